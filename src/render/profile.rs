//! What a frame says of itself.

use super::Renderer;
use crate::{
    frame::{BounceStats, PassTime, Profile},
    gpu::GpuError,
    layout::Bounce,
};

impl Renderer {
    /// Adds up the batches' times and counts.
    pub(super) fn profile(&self, bounces: &[Bounce]) -> Result<Profile, GpuError> {
        let rows = self.schedule.timer.rows()?;
        let counters = self.resources.counters.download()?;
        let mut profile = Profile {
            device: self.context.info().name.clone(),
            n_batches: self.schedule.batches.len() as u32,
            bounces: vec![BounceStats::default(); self.options.max_depth as usize],
            frame_ms: rows
                .iter()
                .map(|row| row.span_ms.map(|(_, end)| end))
                .max_by(|a, b| a.partial_cmp(b).expect("no NaN"))
                .flatten(),
            passes: Vec::new(),
        };
        for row in rows {
            let ms = row.span_ms.map(|(begin, end)| end - begin);
            let known = profile.passes.iter_mut().find(|pass| pass.name == row.name && pass.bounce == row.bounce);
            match known {
                Some(pass) => pass.ms = pass.ms.zip(ms).map(|(a, b)| a + b),
                None => profile.passes.push(PassTime { name: row.name, bounce: row.bounce, ms }),
            }
        }
        for (row_ix, (bounce, counters)) in bounces.iter().zip(&counters).enumerate() {
            let stats = &mut profile.bounces[row_ix % self.options.max_depth as usize];
            stats.n_rays += u64::from(bounce.n_rays);
            stats.n_hits += u64::from(counters.n_hits);
            stats.n_shadow_rays += u64::from(counters.n_shadow_rays);
        }
        Ok(profile)
    }
}
