//! Wall-clock times of passes.

use std::time::Instant;

use crate::frame::PassTime;

/// Times passes by name and bounce; those of several batches are added up.
pub struct Clock {
    begin: Instant,
    passes: Vec<PassTime>,
}

impl Clock {
    pub fn start() -> Self {
        Self { begin: Instant::now(), passes: Vec::new() }
    }

    pub fn time<R>(&mut self, name: &'static str, bounce: Option<u32>, pass: impl FnOnce() -> R) -> R {
        let begin = Instant::now();
        let result = pass();
        let ms = milliseconds_since(begin);
        let is_same = |row: &&mut PassTime| row.name == name && row.bounce == bounce;
        match self.passes.iter_mut().find(is_same) {
            Some(row) => row.ms = row.ms.map(|sum| sum + ms),
            None => self.passes.push(PassTime { name, bounce, ms: Some(ms) }),
        }
        result
    }

    pub fn elapsed_ms(&self) -> f64 {
        milliseconds_since(self.begin)
    }

    /// In the order in which they were first timed.
    pub fn passes(&self) -> &[PassTime] {
        &self.passes
    }
}

fn milliseconds_since(begin: Instant) -> f64 {
    begin.elapsed().as_secs_f64() * 1e3
}
