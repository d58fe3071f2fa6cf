//! Where a frame's time went.

use std::time::Instant;

use serde::Serialize;

use super::pass::{Pass, Role};

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
    /// The name of a [`Pass`], of its debug label and of its kernel's file.
    pub name: &'static str,
    /// None for passes that run once a frame, or for all bounces of a batch at once: shadow, shade, resolve.
    pub bounce: Option<u32>,
    /// In the order of execution; none for passes that run once a frame.
    pub batch: Option<u32>,
    /// Since the frame's first pass began; none where the device has no timestamps, like `ms`.
    pub start_ms: Option<f64>,
    /// Milliseconds; none if the device has no timestamps.
    pub ms: Option<f64>,
    /// Rays of the bounce, or of all the batch's; none where a pass has pixels.
    pub n_rays_in: Option<u64>,
    /// Of what finds hits: rays that hit; of shadow: segments that were tested; of compaction: rays of the next bounce.
    /// None where a pass makes no rays.
    pub n_rays_out: Option<u64>,
}

impl PassTime {
    /// What is known of the pass beside its time.
    pub fn pass(&self) -> Pass {
        Pass::named(self.name)
    }

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
        self.add_bounces(&frame.bounces);
        self.frame_ms = self.frame_ms.zip(frame.frame_ms).map(|(a, b)| a + b);
        self.n_batches = self.n_batches.max(frame.n_batches);
    }

    /// Puts the frame of another part of the picture behind this one. Its batches are counted on.
    pub fn append(&mut self, part: Profile) {
        let delay = self.begun_at.zip(part.begun_at).map(|(first, later)| later.saturating_duration_since(first));
        let delay_ms = delay.unwrap_or_default().as_secs_f64() * 1e3;
        let n_batches = self.n_batches;
        self.passes.extend(part.passes.into_iter().map(|pass| PassTime {
            batch: pass.batch.map(|batch| batch + n_batches),
            start_ms: pass.start_ms.map(|ms| ms + delay_ms),
            ..pass
        }));
        self.add_bounces(&part.bounces);
        self.frame_ms = self.frame_ms.zip(part.frame_ms).map(|(a, b)| a + b);
        self.n_batches += part.n_batches;
    }

    fn add_bounces(&mut self, bounces: &[BounceStats]) {
        self.bounces.resize(self.bounces.len().max(bounces.len()), BounceStats::default());
        self.bounces.iter_mut().zip(bounces).for_each(|(sum, bounce)| sum.add(bounce));
    }

    /// Milliseconds of all passes of one name, or none where any lacks a timestamp.
    pub fn pass_ms(&self, name: &str) -> Option<f64> {
        self.passes.iter().filter(|pass| pass.name == name).map(|pass| pass.ms).sum()
    }

    /// Milliseconds in which the closest hits of a bounce's rays were found, or none where any pass lacks a timestamp.
    /// Passes that find primary visibility once a frame belong to bounce 0.
    pub fn tracing_ms(&self, bounce: u32) -> Option<f64> {
        let passes = self.passes.iter().filter(|pass| pass.pass().is_tracing());
        passes.filter(|pass| pass.bounce.unwrap_or(0) == bounce).map(|pass| pass.ms).sum()
    }

    /// Milliseconds in which shadow rays were tested, or none where any pass lacks a timestamp.
    pub fn shadow_ms(&self) -> Option<f64> {
        self.passes.iter().filter(|pass| pass.pass().role() == Role::Shadow).map(|pass| pass.ms).sum()
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

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

    #[test]
    fn tracing_takes_all_passes_that_find_closest_hits() {
        let pass = |name, bounce, ms| PassTime { name, bounce, ms: Some(ms), ..PassTime::default() };
        let passes = vec![
            pass("visibility", None, 1.0),
            pass("rasterize_triangles", None, 2.0),
            pass("rasterize_blocks", None, 4.0),
            pass("primary_hit", Some(0), 8.0),
            pass("trace", Some(0), 16.0),
            pass("compact_scatter", Some(0), 100.0),
            pass("trace", Some(1), 3.0),
            pass("shadow", None, 5.0),
            pass("tonemap", None, 100.0),
        ];
        let profile = Profile { passes, ..Profile::default() };
        assert_eq!([0, 1, 2].map(|bounce| profile.tracing_ms(bounce)), [Some(31.0), Some(3.0), Some(0.0)]);
        assert_eq!(profile.shadow_ms(), Some(5.0));
    }

    #[test]
    fn a_part_of_the_picture_goes_behind_those_before() {
        let begin = Instant::now();
        let part = |begun_ms, n_batches| Profile {
            passes: [Some(0), None]
                .map(|batch| PassTime { name: "trace", batch, start_ms: Some(1.5), ..PassTime::default() })
                .to_vec(),
            bounces: vec![BounceStats { n_rays: 10, n_hits: 4, n_shadow_rays: 3 }],
            n_batches,
            frame_ms: Some(4.0),
            begun_at: Some(begin + Duration::from_millis(begun_ms)),
            ..Profile::default()
        };
        let mut all = part(0, 3);
        all.append(part(20, 2));
        let places: Vec<_> = all.passes.iter().map(|pass| (pass.batch, pass.start_ms)).collect();
        assert_eq!(places, [(Some(0), Some(1.5)), (None, Some(1.5)), (Some(3), Some(21.5)), (None, Some(21.5))]);
        assert_eq!((all.n_batches, all.frame_ms, all.begun_at), (5, Some(8.0), Some(begin)));
        assert_eq!(all.bounces, [BounceStats { n_rays: 20, n_hits: 8, n_shadow_rays: 6 }]);
    }
}
