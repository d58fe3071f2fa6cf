//! What a frame of a changing scene takes: all triangles have moved, so a structure is built, and then rays are traced.

use serde::Serialize;

use super::{
    GPU_TREE,
    builds::Builds,
    report::{SetResult, Timing},
};
use crate::{accel::AccelKind, bench::rays::RaySetKind};

/// Numbers of rays of a frame, millions.
pub const MRAYS: [u32; 4] = [1, 5, 20, 50];

/// Times of frames with one structure and rays of one kind: medians of the build and of the rate, computed, not
/// measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChangingFrames {
    pub rays: RaySetKind,
    /// The structure.
    pub by: String,
    /// Time of the build, or of the refit, on the GPU, milliseconds.
    pub build_ms: f64,
    /// Time of the build and of each number of [`MRAYS`], milliseconds.
    pub ms: [f64; 4],
    /// When this structure takes less time than the driver's that is rebuilt; none for that one.
    pub ahead: Option<Ahead>,
}

/// When a structure takes less time than another one, by the number of rays a frame, millions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ahead {
    Always,
    Never,
    /// It is built later, but its rays are faster.
    From(f64),
    /// It is built earlier, but its rays are slower.
    UpTo(f64),
}

/// A structure: the time of its build, and the time of a million rays, milliseconds.
struct Costs {
    by: String,
    build_ms: f64,
    ms_per_mray: f64,
}

impl Costs {
    /// Returns the costs of a structure; none without timestamps.
    fn new(by: impl Into<String>, build_ms: Option<f64>, timing: &Timing) -> Option<Self> {
        let rate = timing.mrays_per_s?.median;
        Some(Self { by: by.into(), build_ms: build_ms?, ms_per_mray: 1e3 / rate })
    }

    fn ahead_of(&self, other: &Self) -> Ahead {
        let (later, gain) = (self.build_ms - other.build_ms, other.ms_per_mray - self.ms_per_mray);
        match (later < 0.0, gain >= 0.0) {
            (true, true) => Ahead::Always,
            (true, false) => Ahead::UpTo(later / gain),
            (false, true) if gain > 0.0 => Ahead::From(later / gain),
            (false, _) => Ahead::Never,
        }
    }
}

/// Returns the frames of all sets, for the driver's structure and for kdray's that the GPU builds.
pub fn changing_frames(builds: &Builds, sets: &[SetResult]) -> Vec<ChangingFrames> {
    sets.iter().flat_map(|set| frames_of(builds, set)).collect()
}

fn frames_of(builds: &Builds, set: &SetResult) -> Vec<ChangingFrames> {
    let Some(rebuilt) = Costs::new("driver, rebuilt", builds.bvh_ms.map(|ms| ms.median), &set.driver) else {
        return Vec::new();
    };
    let refitted = Costs::new("driver, refitted", builds.refit_ms.map(|ms| ms.median), &set.driver);
    let of_kdray = builds.on_device.iter().filter_map(|built| {
        let search = if built.accel == AccelKind::KdTree.to_string() { GPU_TREE } else { &built.accel };
        let result = set.kdray.iter().find(|result| result.traversal == search)?;
        Costs::new(&built.accel, built.ms.map(|ms| ms.median), &result.timing)
    });
    let frames = |costs: &Costs| ChangingFrames {
        rays: set.rays,
        by: costs.by.clone(),
        build_ms: costs.build_ms,
        ms: MRAYS.map(|mrays| costs.build_ms + costs.ms_per_mray * f64::from(mrays)),
        ahead: (costs.by != rebuilt.by).then(|| costs.ahead_of(&rebuilt)),
    };
    let others: Vec<_> = refitted.into_iter().chain(of_kdray).collect();
    std::iter::once(&rebuilt).chain(&others).map(frames).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn costs(build_ms: f64, ms_per_mray: f64) -> Costs {
        Costs { by: String::new(), build_ms, ms_per_mray }
    }

    #[test]
    fn a_slower_build_pays_off_after_some_rays() {
        let driver = costs(2.0, 1.0);
        assert_eq!(costs(12.0, 0.5).ahead_of(&driver), Ahead::From(20.0));
        assert_eq!(costs(1.0, 1.5).ahead_of(&driver), Ahead::UpTo(2.0));
        assert_eq!(costs(1.0, 1.0).ahead_of(&driver), Ahead::Always);
        assert_eq!(costs(3.0, 1.0).ahead_of(&driver), Ahead::Never);
        assert_eq!(costs(3.0, 2.0).ahead_of(&driver), Ahead::Never);
    }
}
