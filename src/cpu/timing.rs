//! Wall-clock times of passes.

use std::time::Instant;

use crate::frame::{
    BounceStats, Pass, PassTime,
    counts::{count_rays, is_in_batch},
};

/// Measures the wall-clock times of passes by name, bounce and batch.
pub struct Clock {
    begin: Instant,
    passes: Vec<PassTime>,
    /// Number of entries of `passes` that have their ray counts. These are the passes of ended batches.
    n_counted: usize,
    batch_ix: u32,
}

impl Clock {
    pub fn start() -> Self {
        Self { begin: Instant::now(), passes: Vec::new(), n_counted: 0, batch_ix: 0 }
    }

    /// Records a pass that has run since `start_ms`. Two consecutive runs of the same pass, bounce and batch count as
    /// one.
    pub fn record(&mut self, pass: Pass, bounce: Option<u32>, start_ms: f64) {
        let ms = self.elapsed_ms() - start_ms;
        let mut pass =
            PassTime { name: pass.name(), bounce, start_ms: Some(start_ms), ms: Some(ms), ..PassTime::default() };
        pass.batch = is_in_batch(&pass).then_some(self.batch_ix);
        let place = |pass: &PassTime| (pass.name, pass.bounce, pass.batch);
        match self.passes.last_mut().filter(|last| place(last) == place(&pass)) {
            Some(last) => last.ms = last.ms.map(|sum| sum + ms),
            None => self.passes.push(pass),
        }
    }

    /// Ends a batch that is complete, or that was abandoned to be halved. `bounces` holds the batch's ray counts.
    pub fn end_batch(&mut self, bounces: &[BounceStats]) {
        self.passes[self.n_counted..].iter_mut().for_each(|pass| count_rays(pass, bounces));
        self.n_counted = self.passes.len();
        self.batch_ix += 1;
    }

    /// Returns the passes in the order of execution.
    pub fn passes(&self) -> &[PassTime] {
        &self.passes
    }

    pub fn begun_at(&self) -> Instant {
        self.begin
    }

    pub fn elapsed_ms(&self) -> f64 {
        self.begin.elapsed().as_secs_f64() * 1e3
    }
}
