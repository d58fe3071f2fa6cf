//! The profile of a frame: times and counts of rays.

use std::time::Instant;

use serde::Serialize;

use super::pass::{Pass, Role};

/// The profile of a frame. It is empty if the options do not ask for one.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Profile {
    /// The name that the device reports.
    pub device: String,
    /// The passes in the order of execution.
    pub passes: Vec<PassTime>,
    /// Counts of rays, the sums of all batches. One row a bounce; row 0: primary rays.
    pub bounces: Vec<BounceStats>,
    /// Number of batches that the frame was split into. In a sum of frames, the largest of their numbers; in a
    /// picture of several bands, the sum of theirs.
    pub n_batches: u32,
    /// Milliseconds from the first pass's start to the last one's end, summed over frames and bands if there are
    /// several; None if the device has no timestamps.
    pub frame_ms: Option<f64>,
    /// When the first commands were submitted to the device, or the CPU began.
    #[serde(skip)]
    pub begun_at: Option<Instant>,
}

/// Times and counts of one run of a pass: for one bounce of a batch, for a whole batch, or for the frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PassTime {
    /// The name of a [`Pass`], of its debug label and of its kernel's file.
    pub name: &'static str,
    /// The bounce. None for passes that run once a frame, and for those that run for all bounces of a batch at once:
    /// shadow, shade, resolve.
    pub bounce: Option<u32>,
    /// Index of the batch, counted in the order of execution. None for passes that run once a frame.
    pub batch: Option<u32>,
    /// Milliseconds from the start of the frame's first pass to that of this one; None if the device has no
    /// timestamps.
    pub start_ms: Option<f64>,
    /// Duration in milliseconds; None if the device has no timestamps.
    pub ms: Option<f64>,
    /// Number of rays of the bounce, or of all bounces of the batch. None for passes that run once a frame.
    pub n_rays_in: Option<u64>,
    /// Number of rays that come out of the pass. For passes that find closest hits: rays that hit. For shadow:
    /// shadow rays that were tested. For compaction: rays of the next bounce. None for all other passes.
    pub n_rays_out: Option<u64>,
}

impl PassTime {
    /// Returns the pass itself, with its properties.
    pub fn pass(&self) -> Pass {
        Pass::named(self.name)
    }

    /// Adds the time and the counts that the same pass has in another frame.
    fn add(&mut self, other: &Self) {
        let sum = |a: Option<u64>, b: Option<u64>| a.zip(b).map(|(a, b)| a + b);
        self.ms = self.ms.zip(other.ms).map(|(a, b)| a + b);
        self.n_rays_in = sum(self.n_rays_in, other.n_rays_in);
        self.n_rays_out = sum(self.n_rays_out, other.n_rays_out);
    }
}

/// Counts of one bounce's rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct BounceStats {
    /// Rays whose closest hit was searched, those that hit nothing included.
    pub n_rays: u64,
    /// Rays that hit something.
    pub n_hits: u64,
    /// Shadow rays that were tested.
    pub n_shadow_rays: u64,
}

impl BounceStats {
    /// Adds the counts of another batch.
    pub fn add(&mut self, other: &Self) {
        self.n_rays += other.n_rays;
        self.n_hits += other.n_hits;
        self.n_shadow_rays += other.n_shadow_rays;
    }
}

impl Profile {
    /// Adds the times and counts of another frame with the same options. The `start_ms` of a pass remains the one
    /// from the first frame that has the pass. If this profile is empty, the sum is the other one.
    pub fn add(&mut self, frame: &Profile) {
        if *self == Self::default() {
            self.clone_from(frame);
            return;
        }
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

    /// Appends the profile of another band of the picture. Its batches are numbered on from those of this profile,
    /// and its passes start later by the time between the beginnings of both bands. If this profile is empty, the
    /// other one replaces it.
    pub fn append(&mut self, part: Profile) {
        if *self == Self::default() {
            *self = part;
            return;
        }
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

    /// Returns the milliseconds of all passes of one name together, or None if one of the passes lacks a timestamp.
    pub fn pass_ms(&self, name: &str) -> Option<f64> {
        self.passes.iter().filter(|pass| pass.name == name).map(|pass| pass.ms).sum()
    }

    /// Returns the milliseconds of the passes that find the closest hits of a bounce's rays, or None if one of the
    /// passes lacks a timestamp. Passes of primary visibility, which run once a frame, count for bounce 0.
    pub fn tracing_ms(&self, bounce: u32) -> Option<f64> {
        let passes = self.passes.iter().filter(|pass| pass.pass().finds_hits());
        passes.filter(|pass| pass.bounce.unwrap_or(0) == bounce).map(|pass| pass.ms).sum()
    }

    /// Returns the milliseconds of the passes that test shadow rays, or None if one of the passes lacks a timestamp.
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
        let first = frame(vec![pass("trace", Some(0), 1.0), pass("tonemap", None, 2.0)], 3);
        let mut sum = Profile::default();
        sum.add(&first);
        assert_eq!(sum, first, "an empty profile has no time of its own");
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
        let mut all = Profile::default();
        all.append(part(0, 3));
        all.append(part(20, 2));
        let places: Vec<_> = all.passes.iter().map(|pass| (pass.batch, pass.start_ms)).collect();
        assert_eq!(places, [(Some(0), Some(1.5)), (None, Some(1.5)), (Some(3), Some(21.5)), (None, Some(21.5))]);
        assert_eq!((all.n_batches, all.frame_ms, all.begun_at), (5, Some(8.0), Some(begin)));
        assert_eq!(all.bounces, [BounceStats { n_rays: 20, n_hits: 8, n_shadow_rays: 6 }]);
    }
}
