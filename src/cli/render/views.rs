//! The views that `kdray render` draws: the scene's own, or one for each frame of a film.

use std::path::Path;

use glam::DVec3;
use kdray::scene::{Camera, CameraPath, animations_of};

use super::{
    draw::FrameJob,
    files::{Files, STDOUT, is_one_film, numbered},
};
use crate::cli::{
    args::{FrameChoice, Frames, RenderArgs},
    error::CliError,
    file_roles::FileRoles,
    progress::Progress,
};

/// Number of frames by which the time of a key may miss a frame: times in single precision are rounded.
const ROUNDING: f64 = 1e-3;
/// Largest number of a frame of `--frames all`.
const MOST_FRAMES: f64 = 1e6;

/// Returns the scene's own view or, of a film, one view per frame. Leaves out views whose files exist, if the user
/// wants that. Refuses views whose files cannot be written or have another role.
pub fn views(
    args: &RenderArgs,
    (scene, output): (&Path, &Path),
    path: Option<&NamedPath>,
    mut roles: FileRoles,
    progress: &Progress,
) -> Result<Vec<FrameJob>, CliError> {
    let mut views = if args.is_film() {
        let views = views_of_film(path, args, (scene, output))?;
        let n_files = if is_one_film(output) { 1 } else { views.len() };
        views[..n_files].iter().try_for_each(|view| view.files.note(&mut roles))?;
        views
    } else {
        vec![FrameJob {
            camera: None,
            frame: 0,
            ix: 0,
            shares_file: false,
            files: Files::of(output.to_owned(), &args.aov),
        }]
    };
    if args.skip_existing {
        let n_all = views.len();
        views.retain(|view| !view.files.exist());
        match n_all - views.len() {
            0 => (),
            1 => progress.note("1 picture exists already"),
            n => progress.note(&format!("{n} pictures exist already")),
        }
    }
    if output != Path::new(STDOUT) {
        views.iter().try_for_each(|view| view.files.check())?;
    }
    Ok(views)
}

/// Returns one view per frame. Cameras of a path are set when the scene's origin is known, but a path without a camera
/// at one of these frames is refused here, before the scene is loaded.
fn views_of_film(
    path: Option<&NamedPath>,
    args: &RenderArgs,
    (scene, output): (&Path, &Path),
) -> Result<Vec<FrameJob>, CliError> {
    let Frames { first, last, step } = match (args.frames, path) {
        (Some(FrameChoice::Some(frames)), None) if args.turntable.is_some_and(|n| frames.last >= n) => {
            let (last, n) = (frames.last, args.turntable.unwrap_or_default());
            return CliError::refuse(format!("--frames: a turn of {n} frames has no frame {last}"));
        }
        (Some(FrameChoice::Some(frames)), _) => frames,
        (_, Some(path)) => path.frames()?,
        (_, None) if args.turntable.is_some() => Frames { first: 0, last: args.turntable.unwrap_or(1) - 1, step: 1 },
        (_, None) => frames_of_animations(args, scene)?,
    };
    let shares_file = is_one_film(output);
    let view = |(ix, frame): (usize, u32)| {
        path.map_or(Ok(()), |path| path.camera_at(frame.into()).map(drop))?;
        let picture = if shares_file { output.to_owned() } else { numbered(output, frame)? };
        Ok(FrameJob { camera: None, frame, ix, shares_file, files: Files::of(picture, &args.aov) })
    };
    (first..=last).step_by(step as usize).enumerate().map(view).collect()
}

/// Returns all whole frames from the first key of the animations that are shown to the last one.
///
/// # Errors
/// The file cannot be read, has no such animation, or no frame lies between its keys.
fn frames_of_animations(args: &RenderArgs, scene: &Path) -> Result<Frames, CliError> {
    let animations = animations_of(scene, &args.load.options())?;
    if animations.is_empty() {
        args.refuse_to_move(scene)?;
    }
    let begin = animations.iter().map(|it| it.begin).fold(f64::INFINITY, f64::min);
    let end = animations.iter().map(|it| it.end).fold(f64::NEG_INFINITY, f64::max);
    let fps = args.load.frames_a_second();
    let (first, last) = ((begin * fps - ROUNDING).ceil().max(0.0), (end * fps + ROUNDING).floor());
    if !(first <= last && last <= MOST_FRAMES) {
        let scene = scene.display();
        let what = format!("{scene}: no frames from 0 to {MOST_FRAMES} lie from {begin} s, its first key, to {end} s");
        return CliError::refuse(what);
    }
    Ok(Frames { first: first as u32, last: last as u32, step: 1 })
}

/// A camera path and the file that it was read from.
pub struct NamedPath<'a> {
    file: &'a Path,
    path: CameraPath,
}

impl<'a> NamedPath<'a> {
    pub fn load(file: &'a Path) -> Result<Self, CliError> {
        Ok(Self { file, path: CameraPath::load(file)? })
    }

    /// Returns the path for a scene that was moved to the origin, as [`CameraPath::from_origin`] does.
    pub fn relative_to(self, origin: DVec3) -> Self {
        Self { path: self.path.from_origin(origin), ..self }
    }

    /// Returns all whole frames of the path.
    ///
    /// # Errors
    /// There are none.
    fn frames(&self) -> Result<Frames, CliError> {
        let [first, last] = [self.path.begin().ceil() as u32, self.path.end().floor() as u32];
        let none = || self.refused("no whole frame number lies between its first and last keyframe".to_owned());
        (first <= last).then_some(Frames { first, last, step: 1 }).ok_or_else(none)
    }

    /// # Errors
    /// The curve leads through a camera that sees nothing at this frame.
    pub fn camera_at(&self, frame: f64) -> Result<Camera, CliError> {
        let refused =
            || self.refused(format!("at frame {frame}, eye and target coincide, or up points along the view"));
        self.path.camera_at(frame).ok_or_else(refused)
    }

    fn refused(&self, what: String) -> CliError {
        CliError::Usage(format!("{}: {what}", self.file.display()))
    }
}
