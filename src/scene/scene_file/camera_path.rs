//! A camera that moves: a TOML file of keyframes, and the smooth curve between them.

use std::path::Path;

use glam::DVec3;
use serde::Deserialize;
use toml::Spanned;

use super::{
    assemble::{File, camera},
    description::CameraSpec,
};
use crate::scene::{
    files::SourceFile,
    model::{
        Camera, LoadOptions, Projection, SceneError,
        camera::{FOV_DEGREES, HEIGHTS},
        error::Checked,
        keys::Place,
    },
};

/// Frames per second if the file has no `fps`.
const DEFAULT_FPS: f64 = 25.0;
/// Largest frame number of a keyframe.
const MAX_FRAMES: f64 = 1e6;

/// A path file, as serde reads it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PathSpec {
    fps: Option<Spanned<f64>>,
    #[serde(default)]
    keyframe: Vec<Spanned<KeyframeSpec>>,
}

/// A camera as in a scene file, and its frame or time.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct KeyframeSpec {
    /// Frame number, counted from 0.
    frame: Option<f64>,
    /// Time in seconds, in place of a frame.
    time: Option<f64>,
    eye: [f64; 3],
    target: [f64; 3],
    up: Option<[f32; 3]>,
    vertical_fov: Option<f32>,
    orthographic_height: Option<f32>,
}

/// The path of a moving camera: one or more keyframes in the order of their frames.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraPath {
    /// Frames per second.
    pub fps: f64,
    /// The point of the file that is the origin of the cameras.
    origin: DVec3,
    /// Whether the camera is orthographic, in all frames.
    is_orthographic: bool,
    keyframes: Vec<Keyframe>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Keyframe {
    frame: f64,
    pose: Pose,
}

/// A camera as ten numbers that are interpolated one by one: eye, target, up, and the vertical field of view in degrees
/// or, for an orthographic camera, the logarithm of its height. So equal times change the scale of an orthographic
/// picture by equal factors.
type Pose = [f64; 10];

impl CameraPath {
    /// Loads a path file.
    ///
    /// # Errors
    /// The file cannot be read or understood, has no keyframes or has them out of order, or a keyframe's camera sees
    /// nothing.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        let source = SourceFile::new(path, &LoadOptions::default());
        let file = File { source: &source, text: &source.text()? };
        let spec: PathSpec = file.parse()?;
        let fps = match &spec.fps {
            Some(fps) => file.check("fps", fps, |&fps| rate(fps))?,
            None => DEFAULT_FPS,
        };
        let is_orthographic = |spec: &KeyframeSpec| spec.orthographic_height.is_some();
        let first_is = spec.keyframe.first().is_some_and(|first| is_orthographic(first.get_ref()));
        let mut keyframes: Vec<Keyframe> = Vec::new();
        for (ix, spec) in spec.keyframe.iter().enumerate() {
            let before = keyframes.last().map(|keyframe| keyframe.frame);
            let check = |spec: &KeyframeSpec| match is_orthographic(spec) == first_is {
                true => keyframe(spec, fps, before),
                false => Err("orthographic_height: either all keyframes have it or none".to_owned()),
            };
            keyframes.push(file.check(&format!("keyframe {}", ix + 1), spec, check)?);
        }
        if keyframes.is_empty() {
            return Err(source.error("has no [[keyframe]]"));
        }
        Ok(Self { fps, origin: DVec3::ZERO, is_orthographic: first_is, keyframes })
    }

    /// Returns the path for a scene that was moved to the origin: one whose
    /// [`Scene::origin`](crate::scene::Scene::origin) is this point of the file.
    pub fn from_origin(self, origin: DVec3) -> Self {
        Self { origin, ..self }
    }

    /// Returns the frame of the first keyframe.
    pub fn begin(&self) -> f64 {
        self.keyframes[0].frame
    }

    /// Returns the frame of the last keyframe.
    pub fn end(&self) -> f64 {
        self.keyframes[self.keyframes.len() - 1].frame
    }

    /// Returns the camera at a frame, which may be a fraction. Before the first keyframe and after the last one the
    /// camera rests. Returns `None` where the curve leads through a camera that sees nothing: eye and target meet, or
    /// up points along the view.
    ///
    /// Each number of the camera is a cubic Hermite spline over frames with Catmull-Rom tangents (E. Catmull, R. Rom:
    /// A Class of Local Interpolating Splines, 1974). The curve passes through all keyframes, its speed has no jumps,
    /// and uniform motion stays uniform.
    pub fn camera_at(&self, frame: f64) -> Option<Camera> {
        let place = Place::among(&self.keyframes, |keyframe| keyframe.frame, frame);
        let from = place.from;
        if place.share == 0.0 {
            return self.camera_of(&self.keyframes[from].pose);
        }
        let [a, b] = [from, from + 1].map(|ix| (self.keyframes[ix].pose, self.tangent(ix)));
        self.camera_of(&std::array::from_fn(|i| place.spline([a.0[i], b.0[i]], [a.1[i], b.1[i]])))
    }

    /// Returns the change per frame at a keyframe: the slope from the keyframe before it to the one after it. At an
    /// end of the path, the keyframe itself takes the place of the missing one.
    fn tangent(&self, ix: usize) -> Pose {
        let before = &self.keyframes[ix.saturating_sub(1)];
        let after = &self.keyframes[(ix + 1).min(self.keyframes.len() - 1)];
        std::array::from_fn(|i| (after.pose[i] - before.pose[i]) / (after.frame - before.frame))
    }

    fn camera_of(&self, pose: &Pose) -> Option<Camera> {
        let point = |i: usize| DVec3::from_slice(&pose[i..]).to_array();
        let up = DVec3::from_slice(&pose[6..]).as_vec3().to_array();
        // A spline may overshoot its keyframes.
        let (vertical_fov, orthographic_height) = match self.is_orthographic {
            true => (None, Some((pose[9].exp() as f32).clamp(HEIGHTS.0, HEIGHTS.1))),
            false => (Some((pose[9] as f32).clamp(FOV_DEGREES.0, FOV_DEGREES.1)), None),
        };
        let (eye, target, up) = (point(0), point(3), Some(up));
        camera(&CameraSpec { eye, target, up, vertical_fov, orthographic_height }, self.origin).ok()
    }
}

fn rate(fps: f64) -> Checked<f64> {
    if fps > 0.0 && fps <= 1000.0 { Ok(fps) } else { Err(format!("{fps} is outside 0 to 1000")) }
}

fn keyframe(spec: &KeyframeSpec, fps: f64, before: Option<f64>) -> Checked<Keyframe> {
    let frame = match (spec.frame, spec.time) {
        (Some(frame), None) => frame,
        (None, Some(time)) => time * fps,
        (Some(_), Some(_)) => return Err("has both `frame` and `time`".to_owned()),
        (None, None) => return Err("has neither `frame` nor `time`".to_owned()),
    };
    if !(0.0..=MAX_FRAMES).contains(&frame) {
        return Err(format!("its frame is outside 0 to {MAX_FRAMES}"));
    }
    if before.is_some_and(|before| frame <= before) {
        return Err(format!("frame {frame} does not come after the keyframe before it"));
    }
    let KeyframeSpec { eye, target, up, vertical_fov, orthographic_height, .. } = *spec;
    let spec = CameraSpec { eye, target, up, vertical_fov, orthographic_height };
    let Camera { up, projection, .. } = camera(&spec, DVec3::ZERO)?;
    let mut pose = [0.0; 10];
    for (numbers, vector) in pose.chunks_exact_mut(3).zip([eye, target, up.as_dvec3().to_array()]) {
        numbers.copy_from_slice(&vector);
    }
    pose[9] = match projection {
        Projection::Perspective { vertical_fov_degrees } => f64::from(vertical_fov_degrees),
        Projection::Orthographic { height } => f64::from(height).ln(),
    };
    Ok(Keyframe { frame, pose })
}
