//! The time line of a scene whose animations play: which moment is shown, and which one is due.

use std::{
    mem::replace,
    path::{Path, PathBuf},
    time::Instant,
};

use tracing::dispatcher::{Dispatch, with_default};

use super::{gpu_session::GpuSession, message::Topic, session::Session};
use crate::{
    engine::{AnimatedWorld, LoadError, LoadRequest},
    gpu::GpuError,
    scene::{AnimationChoice, AnimationInfo, Camera, Scene},
    world::World,
};

/// Least and greatest speed, seconds of the animation per second.
pub const SPEEDS: std::ops::RangeInclusive<f64> = 0.25..=4.0;

/// What the user sets of a time line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Playback {
    /// The moment, seconds.
    pub seconds: f64,
    /// Whether things stand as the file has them at rest, and not as at the moment.
    pub is_at_rest: bool,
    pub is_playing: bool,
    /// Seconds of the animation per second.
    pub speed: f64,
    /// Whether the animation begins again after its end.
    pub loops: bool,
    /// Index of the animation that is shown; none for all together.
    pub animation_ix: Option<usize>,
}

/// A moment of an animation, or of all together: seconds, and the animation's index.
type Moment = (f64, Option<usize>);

/// The worlds of a file.
enum Worlds {
    /// The file, its request, and the scene that was read of it. It is not read again before another moment is due.
    Unread(Box<(PathBuf, LoadRequest, Scene)>),
    Read(Box<AnimatedWorld>),
}

/// The animations of a scene, and the moment of them that is shown.
pub struct Timeline {
    /// None only while they are read.
    worlds: Option<Worlds>,
    animations: Vec<AnimationInfo>,
    playback: Playback,
    /// The moment that the world shows; none if it shows the file at rest.
    shown: Option<Moment>,
    /// When the moment followed the clock last.
    followed_at: Instant,
}

impl Timeline {
    /// Makes the time line of a scene that was read of a file with animations. `request`: that of the reading.
    pub fn new(path: &Path, request: &LoadRequest, scene: Scene) -> Self {
        let animations = scene.animations.clone();
        let animation_ix = request.scene.animation.index_in(&animations);
        let shown = request.scene.moment().map(|moment| (moment.seconds, animation_ix));
        let playback = Playback {
            seconds: 0.0,
            is_at_rest: shown.is_none(),
            is_playing: false,
            speed: 1.0,
            loops: true,
            animation_ix,
        };
        let worlds = Some(Worlds::Unread(Box::new((path.to_owned(), request.clone(), scene))));
        let mut timeline = Self { worlds, animations, playback, shown, followed_at: Instant::now() };
        timeline.playback.seconds = shown.map_or(timeline.range().0, |(seconds, _)| seconds);
        timeline
    }

    pub fn animations(&self) -> &[AnimationInfo] {
        &self.animations
    }

    pub fn playback(&self) -> &Playback {
        &self.playback
    }

    /// Returns the first and the last moment of what is shown, seconds.
    pub fn range(&self) -> (f64, f64) {
        AnimationInfo::range(match self.playback.animation_ix {
            Some(ix) => &self.animations[ix..=ix],
            None => &self.animations,
        })
    }

    /// Takes over what the user has set. Another animation is shown at a moment that it has.
    pub fn set(&mut self, playback: Playback) {
        let before = replace(&mut self.playback, playback);
        if playback.is_playing && !before.is_playing {
            self.play();
        }
        if playback.animation_ix != before.animation_ix {
            let (begin, end) = self.range();
            self.playback.seconds = playback.seconds.clamp(begin, end);
            self.playback.is_at_rest = false;
        }
    }

    /// Plays from the moment on, or pauses.
    pub fn toggle(&mut self) {
        match self.playback.is_playing {
            true => self.playback.is_playing = false,
            false => self.play(),
        }
    }

    fn play(&mut self) {
        let (begin, end) = self.range();
        if self.playback.seconds >= end {
            self.playback.seconds = begin;
        }
        (self.playback.is_playing, self.playback.is_at_rest) = (true, false);
        self.followed_at = Instant::now();
    }

    /// Goes on with what the user has set of the same file before it was read again.
    pub fn go_on(&mut self, before: &Self) {
        if self.animations == before.animations {
            (self.playback, self.followed_at) = (before.playback, before.followed_at);
        }
    }

    /// Returns whether time goes on, or a moment is still to be shown.
    pub fn is_busy(&self) -> bool {
        self.playback.is_playing || self.due().is_some()
    }

    /// Lets the moment follow the clock.
    fn follow(&mut self, now: Instant) {
        let elapsed = now.saturating_duration_since(replace(&mut self.followed_at, now)).as_secs_f64();
        let Playback { seconds, is_playing, speed, loops, .. } = self.playback;
        if !is_playing {
            return;
        }
        let (begin, end) = self.range();
        let next = seconds + elapsed * speed;
        self.playback.seconds = match next < end {
            true => next,
            false if loops && begin < end => begin + (next - begin).rem_euclid(end - begin),
            false => {
                self.playback.is_playing = false;
                end
            }
        };
    }

    /// Returns the moment that the world does not show yet, if there is one.
    fn due(&self) -> Option<Moment> {
        let Playback { seconds, is_at_rest, animation_ix, .. } = self.playback;
        Some((seconds, animation_ix)).filter(|moment| !is_at_rest && Some(*moment) != self.shown)
    }

    /// Returns the world of the moment that is due, and its camera. `first`: the world that was loaded, if no other
    /// moment has been shown.
    fn world(&mut self, (seconds, animation_ix): Moment, first: &World) -> Result<(World, Camera), LoadError> {
        let mut worlds = match self.worlds.take().expect("the worlds of a file") {
            Worlds::Read(worlds) => worlds,
            Worlds::Unread(of_file) => {
                let (path, request, scene) = *of_file;
                Box::new(AnimatedWorld::new(&path, &request, scene, first))
            }
        };
        worlds.set_animation(animation_ix.map_or(AnimationChoice::All, |ix| self.named(ix)));
        // What a moment cannot show would be told again with each moment.
        let world = with_default(&Dispatch::none(), || worlds.at(seconds));
        self.worlds = Some(Worlds::Read(worlds));
        self.shown = Some((seconds, animation_ix));
        world
    }

    /// Returns the choice of an animation: by its name, or by its index if others have the same name or it has none.
    fn named(&self, ix: usize) -> AnimationChoice {
        let name = &self.animations[ix].name;
        let is_only = self.animations.iter().filter(|it| it.name == *name).count() == 1;
        let has_name = is_only && *name != format!("animations[{ix}]");
        AnimationChoice::Named(if has_name { name.clone() } else { ix.to_string() })
    }
}

impl Session {
    /// Uploads the newest moment of the animations if it is not shown yet. Moments in between are left out. The moment
    /// stays while a picture of it is to be saved, or is drawn in parts.
    ///
    /// # Errors
    /// The device is lost. If the moment cannot be shown, a message says so, and the animation pauses.
    pub(super) fn show_moment(&mut self, gpu: &mut GpuSession, now: Instant) -> Result<(), GpuError> {
        if self.is_save_due || self.is_moving && gpu.renderer.is_pending() {
            return Ok(());
        }
        let Some(timeline) = &mut self.loaded.timeline else { return Ok(()) };
        timeline.follow(now);
        let Some(moment) = timeline.due() else { return Ok(()) };
        let made = timeline.world(moment, &self.loaded.built.world);
        let shown = made.and_then(|(world, camera)| {
            gpu.set_world(&world)?;
            Ok((world, camera))
        });
        match shown {
            Ok((world, camera)) => {
                self.loaded.built.world = world;
                self.controller.move_start(camera);
                self.pace.moved(now);
                self.clear_message(Topic::Time);
            }
            Err(LoadError::Device(error)) if error.is_device_lost() => {
                timeline.shown = None;
                return Err(error);
            }
            Err(error) => {
                timeline.playback.is_playing = false;
                self.show_error(Topic::Time, &error.to_string());
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn info(name: &str, begin: f64, end: f64) -> AnimationInfo {
        AnimationInfo { name: name.to_owned(), begin, end, fps: None, n_moved: 1, n_morphed: 0, n_changed: 0 }
    }

    fn timeline(animations: Vec<AnimationInfo>) -> Timeline {
        let path = Path::new("a.glb");
        Timeline::new(path, &LoadRequest::default(), Scene { animations, ..Scene::empty(path) })
    }

    /// Returns the moments of a time line at some times after it began to play, seconds.
    fn moments(timeline: &mut Timeline, after: &[f64]) -> Vec<f64> {
        let begin = timeline.followed_at;
        let mut at = |after: &f64| {
            timeline.follow(begin + Duration::from_secs_f64(*after));
            (timeline.playback.seconds * 1e3).round() / 1e3
        };
        after.iter().map(&mut at).collect()
    }

    #[test]
    fn moments_follow_the_clock_times_the_speed() {
        let mut timeline = timeline(vec![info("a", 0.5, 2.0), info("b", 1.0, 4.0)]);
        assert_eq!((timeline.range(), timeline.is_busy()), ((0.0, 4.0), false));
        timeline.toggle();
        assert!(timeline.is_busy());
        assert_eq!(moments(&mut timeline, &[0.0, 1.5, 3.75, 4.25, 13.0]), [0.0, 1.5, 3.75, 0.25, 1.0]);
        timeline.set(Playback { speed: 0.5, loops: false, ..timeline.playback });
        assert_eq!(moments(&mut timeline, &[1.0, 7.0, 8.0]), [1.5, 4.0, 4.0]);
        assert!(!timeline.playback.is_playing, "it has ended");
        timeline.toggle();
        assert_eq!(moments(&mut timeline, &[1.0]), [0.5], "it begins again");
        timeline.toggle();
        assert_eq!(moments(&mut timeline, &[9.0]), [0.5], "a pause is no time to play");
    }

    #[test]
    fn an_animation_without_length_has_an_end() {
        let mut timeline = timeline(vec![info("a", 0.0, 0.0)]);
        timeline.toggle();
        assert_eq!(moments(&mut timeline, &[1.0]), [0.0]);
        assert!(!timeline.playback.is_playing && timeline.due() == Some((0.0, None)));
    }

    #[test]
    fn another_animation_is_shown_where_it_has_keys() {
        let mut timeline = timeline(vec![info("a", 0.0, 4.0), info("b", 0.0, 1.0), info("b", 0.0, 1.0)]);
        assert_eq!(timeline.due(), None, "the file at rest");
        timeline.set(Playback { seconds: 3.0, is_at_rest: false, ..timeline.playback });
        assert_eq!(timeline.due(), Some((3.0, None)));
        timeline.set(Playback { animation_ix: Some(1), ..timeline.playback });
        assert_eq!(timeline.due(), Some((1.0, Some(1))));
        let name = |ix| timeline.named(ix);
        assert_eq!([name(0), name(2)], ["a", "2"].map(|name| AnimationChoice::Named(name.to_owned())));
    }

    #[test]
    fn the_first_moment_is_that_of_the_request() {
        let path = Path::new("a.glb");
        let of = |at, animation| {
            let mut request = LoadRequest::default();
            (request.scene.at, request.scene.animation) = (at, animation);
            let animations = vec![info("a", 0.0, 4.0), info("b", 0.0, 9.0)];
            Timeline::new(path, &request, Scene { animations, ..Scene::empty(path) })
        };
        let named = || AnimationChoice::Named("b".to_owned());
        assert_eq!(of(Some(2.5), AnimationChoice::All).shown, Some((2.5, None)));
        assert_eq!(of(None, named()).shown, Some((0.0, Some(1))));
        let at = of(Some(7.0), named());
        assert_eq!((at.shown, at.range(), at.due()), (Some((7.0, Some(1))), (0.0, 9.0), None));
    }
}
