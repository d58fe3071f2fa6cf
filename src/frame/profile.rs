//! Where a frame's time went.

use std::time::Instant;

use serde::Serialize;

/// Where a frame's time went; nothing where nobody asked.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Profile {
    /// The device's own name.
    pub device: String,
    /// In the order of execution.
    pub passes: Vec<PassTime>,
    /// One row a bounce, 0 = primary rays; batches added up.
    pub bounces: Vec<BounceStats>,
    /// Ray batches that the frame was split into; the most of any, where several frames are added up.
    pub n_batches: u32,
    /// From the first pass's start to the last one's end; none where the device has no timestamps.
    pub frame_ms: Option<f64>,
    /// When the device was given its first command, or the CPU began.
    #[serde(skip)]
    pub begun_at: Option<Instant>,
}

/// One pass, of one bounce of one batch as a rule.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PassTime {
    /// Also the debug label and the kernel's file name.
    pub name: &'static str,
    /// None for passes that run once a frame, or for all bounces of a batch at once: shadow, shade, resolve.
    pub bounce: Option<u32>,
    /// In the order of execution; none for passes that run once a frame.
    pub batch: Option<u32>,
    /// Since the frame's first pass began; none where the device has no timestamps, like `ms`.
    pub start_ms: Option<f64>,
    pub ms: Option<f64>,
    /// Rays of the bounce, or of all the batch's; none where a pass has pixels.
    pub n_rays_in: Option<u64>,
    /// Of what finds hits: rays that hit; of shadow: segments that were tested; of compaction: rays of the next bounce.
    /// None where a pass makes no rays.
    pub n_rays_out: Option<u64>,
}

impl PassTime {
    /// Adds the same pass of another frame.
    fn add(&mut self, other: &Self) {
        let sum = |a: Option<u64>, b: Option<u64>| a.zip(b).map(|(a, b)| a + b);
        self.ms = self.ms.zip(other.ms).map(|(a, b)| a + b);
        self.n_rays_in = sum(self.n_rays_in, other.n_rays_in);
        self.n_rays_out = sum(self.n_rays_out, other.n_rays_out);
    }
}

/// Rays of one bounce.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct BounceStats {
    /// Rays whose closest hit was found.
    pub n_rays: u64,
    /// Those that hit something.
    pub n_hits: u64,
    /// Shadow segments that were tested.
    pub n_shadow_rays: u64,
}

impl BounceStats {
    /// Adds another batch's.
    pub fn add(&mut self, other: &Self) {
        self.n_rays += other.n_rays;
        self.n_hits += other.n_hits;
        self.n_shadow_rays += other.n_shadow_rays;
    }
}

impl Profile {
    /// Adds a frame's times and counts to those of others of the same options; passes begin when they first began.
    pub fn add(&mut self, frame: &Profile) {
        let mut next = 0;
        let place = |pass: &PassTime| (pass.name, pass.bounce, pass.batch);
        for pass in &frame.passes {
            let known = self.passes.iter().position(|sum| place(sum) == place(pass));
            match known.map(|i| (i, &mut self.passes[i])) {
                Some((i, sum)) => {
                    sum.add(pass);
                    next = i + 1;
                }
                None => {
                    self.passes.insert(next, pass.clone());
                    next += 1;
                }
            }
        }
        self.bounces.resize(self.bounces.len().max(frame.bounces.len()), BounceStats::default());
        self.bounces.iter_mut().zip(&frame.bounces).for_each(|(sum, bounce)| sum.add(bounce));
        self.frame_ms = self.frame_ms.zip(frame.frame_ms).map(|(a, b)| a + b);
        self.n_batches = self.n_batches.max(frame.n_batches);
    }

    /// Milliseconds of all passes of one name, or none where any lacks a timestamp.
    pub fn pass_ms(&self, name: &str) -> Option<f64> {
        self.passes.iter().filter(|pass| pass.name == name).map(|pass| pass.ms).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn profiles_add_up() {
        let pass = |name, bounce, ms| PassTime {
            name,
            bounce,
            batch: bounce.map(|_| 0),
            ms: Some(ms),
            n_rays_in: bounce.map(|_| 7),
            ..PassTime::default()
        };
        let stats = |n_rays| BounceStats { n_rays, n_hits: 1, n_shadow_rays: 2 };
        let frame = |passes, n_batches| Profile {
            device: "d".to_owned(),
            passes,
            bounces: vec![stats(10), stats(5)],
            n_batches,
            frame_ms: Some(4.0),
            begun_at: None,
        };
        let mut sum = frame(vec![pass("trace", Some(0), 1.0), pass("tonemap", None, 2.0)], 3);
        let later =
            frame(vec![pass("trace", Some(0), 1.5), pass("accumulate", None, 0.5), pass("tonemap", None, 2.0)], 2);
        sum.add(&later);
        let traced = PassTime { n_rays_in: Some(14), ..pass("trace", Some(0), 2.5) };
        let expected = [traced, pass("accumulate", None, 0.5), pass("tonemap", None, 4.0)];
        assert_eq!((&sum.passes[..], sum.n_batches, sum.frame_ms), (&expected[..], 3, Some(8.0)));
        assert_eq!(sum.bounces[0], BounceStats { n_rays: 20, n_hits: 2, n_shadow_rays: 4 });
        sum.add(&Profile { frame_ms: None, ..later });
        assert_eq!(sum.frame_ms, None);
    }
}
