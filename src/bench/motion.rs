//! The benchmark of motion: the frames of an animation as the window and films make them, without a window and without
//! files. What moves is posed, what rays search is built, the difference is uploaded, and a picture is drawn.

use std::time::Instant;

use serde::Serialize;

use super::{
    Spread,
    chart::{BarChart, Scale, Series},
    warm_up,
};
use crate::{
    engine::{AnimatedWorld, Engine, LoadError, MomentWork, Renderer},
    frame::{Goal, Profile, RenderOptions},
    scene::{AnimationChoice, AnimationInfo, Camera},
    world::World,
};

/// Returns the moments of the frames of animations that are shown, which begin again after their end. `fps`: frames per
/// second. `first`: the first moment; none for the begin of the animations.
pub fn moments(
    choice: &AnimationChoice,
    animations: &[AnimationInfo],
    (n_frames, fps): (u32, f64),
    first: Option<f64>,
) -> Vec<f64> {
    let shown = choice.index_in(animations).map_or(animations, |ix| &animations[ix..=ix]);
    let (begin, end) = AnimationInfo::range(shown);
    let in_range = |seconds: f64| {
        if begin < end { begin + (seconds - begin).rem_euclid(end - begin) } else { seconds }
    };
    (0..n_frames).map(|frame| in_range(first.unwrap_or(begin) + f64::from(frame) / fps)).collect()
}

/// Times of a frame, milliseconds.
#[derive(Clone, Debug)]
pub struct FrameTimes {
    pub world: MomentWork,
    /// Time of giving the renderer the new world.
    pub upload_ms: f64,
    /// What the passes have taken.
    pub profile: Profile,
    /// Wall-clock time of all.
    pub wall_ms: f64,
}

/// Draws a frame of one sample a pixel for each moment, after others that are not timed.
///
/// # Errors
/// A moment cannot be shown, or a call fails.
pub fn measure(
    engine: &Engine,
    (animated, world): (&mut AnimatedWorld, &World),
    options: &RenderOptions,
    moments: &[f64],
) -> Result<Vec<FrameTimes>, LoadError> {
    let mut renderer = engine.renderer(world, options)?;
    let mut untimed = moments.iter().cycle();
    warm_up(|| untimed.next().map_or(Ok(()), |moment| frame(&mut renderer, animated, *moment).map(drop)))?;
    moments.iter().map(|moment| frame(&mut renderer, animated, *moment)).collect()
}

fn frame(renderer: &mut Renderer, animated: &mut AnimatedWorld, moment: f64) -> Result<FrameTimes, LoadError> {
    let begin = Instant::now();
    let (world, camera): (World, Camera) = animated.at(moment)?;
    let uploading = Instant::now();
    renderer.set_world(&world)?;
    let upload_ms = uploading.elapsed().as_secs_f64() * 1e3;
    let profile = renderer.draw(&camera, Goal::Samples(1), || ())?.profile;
    let wall_ms = begin.elapsed().as_secs_f64() * 1e3;
    Ok(FrameTimes { world: animated.work(), upload_ms, profile, wall_ms })
}

/// A phase of a frame, and its times.
#[derive(Debug, Serialize)]
pub struct Phase {
    pub name: &'static str,
    /// None if the device has no timestamps.
    pub ms: Option<Spread>,
}

/// The benchmark's report.
#[derive(Debug, Serialize)]
pub struct Report {
    pub suite: &'static str,
    pub device: String,
    pub driver: Option<String>,
    pub scene: String,
    pub n_triangles: usize,
    /// Whether meshes are kept apart, so that only what moves is built and uploaded.
    pub keeps_instances: bool,
    /// The most instances that move in a frame, and the most meshes that are deformed in one.
    pub n_moved: usize,
    pub n_deformed: usize,
    pub integrator: String,
    pub width: u32,
    pub height: u32,
    /// Frames per second of the animation.
    pub fps: f64,
    pub n_frames: usize,
    /// What a frame consists of: pose, build and upload by the host's clock, and all passes by the device's.
    pub parts: Vec<Phase>,
    /// The passes, each over all bounces.
    pub passes: Vec<Phase>,
    pub wall_ms: Option<Spread>,
    /// Frames per second of the wall clock.
    pub frames_per_s: f64,
}

impl Report {
    /// Sets what the times of the frames say.
    #[must_use]
    pub fn with_times(self, times: &[FrameTimes]) -> Self {
        let of = |part: fn(&FrameTimes) -> f64| Spread::of(times.iter().map(part));
        let of_profiles = |ms: &dyn Fn(&Profile) -> Option<f64>| {
            times.iter().map(|it| ms(&it.profile)).collect::<Option<Vec<_>>>().and_then(Spread::of)
        };
        let mut names = Vec::new();
        for pass in times.iter().flat_map(|it| &it.profile.passes) {
            if !names.contains(&pass.name) {
                names.push(pass.name);
            }
        }
        let pass = |name| Phase { name, ms: of_profiles(&|profile| profile.pass_ms(name)) };
        let parts = vec![
            Phase { name: "pose", ms: of(|it| it.world.pose_ms) },
            Phase { name: "build", ms: of(|it| it.world.build_ms) },
            Phase { name: "upload", ms: of(|it| it.upload_ms) },
            Phase { name: "passes", ms: of_profiles(&|profile| profile.frame_ms) },
        ];
        let total_ms: f64 = times.iter().map(|it| it.wall_ms).sum();
        let passes = names.into_iter().map(pass).collect();
        let frames_per_s = times.len() as f64 / total_ms * 1e3;
        let most = |count: fn(&MomentWork) -> usize| times.iter().map(|it| count(&it.world)).max().unwrap_or(0);
        let (n_moved, n_deformed) = (most(|it| it.n_moved), most(|it| it.n_deformed));
        Self {
            n_moved,
            n_deformed,
            n_frames: times.len(),
            parts,
            passes,
            wall_ms: of(|it| it.wall_ms),
            frames_per_s,
            ..self
        }
    }

    /// Returns a chart of the phases of a frame.
    pub fn chart(&self) -> BarChart {
        let value = |part: &Phase| part.ms.map(|ms| ms.median).filter(|ms| *ms > 0.0);
        BarChart {
            title: format!("A frame of {} on {}", self.scene, self.device),
            unit: "ms".to_owned(),
            scale: Scale::Linear,
            groups: self.parts.iter().map(|part| part.name.to_owned()).collect(),
            series: vec![Series { name: "median".to_owned(), values: self.parts.iter().map(value).collect() }],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_begin_again_after_the_end() {
        let info = |name: &str, begin: f64, end: f64| AnimationInfo {
            name: name.to_owned(),
            begin,
            end,
            fps: None,
            n_moved: 1,
            n_morphed: 0,
            n_changed: 0,
        };
        let animations = [info("a", 0.5, 1.0), info("b", -0.5, 0.25), info("c", 0.0, 0.0)];
        let of = |choice: AnimationChoice| moments(&choice, &animations, (5, 2.0), None);
        assert_eq!(of(AnimationChoice::All), [-0.5, 0.0, 0.5, -0.5, 0.0]);
        assert_eq!(of(AnimationChoice::Named("a".to_owned())), [0.0, 0.5, 0.0, 0.5, 0.0]);
        assert_eq!(moments(&AnimationChoice::All, &animations, (3, 4.0), Some(0.5)), [0.5, 0.75, -0.5]);
        assert_eq!(of(AnimationChoice::Named("2".to_owned())), [0.0, 0.5, 1.0, 1.5, 2.0]);
    }
}
