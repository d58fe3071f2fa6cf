//! Camera tours, which need no user: for tests, measurements and films.

use glam::Quat;

use crate::scene::{Camera, CameraPath};

/// Cameras of a fixed sequence of frames.
#[derive(Clone, Debug, PartialEq)]
pub struct Tour {
    /// One camera per frame, at least one.
    cameras: Vec<Camera>,
}

impl Tour {
    /// Returns a tour of `n_frames` frames once around the target. The last frame's camera is exactly `start`.
    ///
    /// # Panics
    /// `n_frames` is 0.
    pub fn around(start: Camera, n_frames: u32) -> Self {
        assert!(n_frames > 0, "a tour has frames");
        let turned = |n_turned: u32| {
            let angle = std::f32::consts::TAU * n_turned as f32 / n_frames as f32;
            let eye = start.target + Quat::from_axis_angle(start.up, angle) * (start.eye - start.target);
            Camera { eye, ..start }
        };
        Self { cameras: (1..n_frames).map(turned).chain([start]).collect() }
    }

    /// Returns a tour of `n_frames` frames along a path, from its first keyframe to its last. A single frame is the
    /// last keyframe. Returns none if eye, target and up vector of a frame span no picture.
    ///
    /// # Panics
    /// `n_frames` is 0.
    pub fn along(path: &CameraPath, n_frames: u32) -> Option<Self> {
        assert!(n_frames > 0, "a tour has frames");
        let step = (path.end() - path.begin()) / f64::from(n_frames.max(2) - 1);
        let at = |frame_ix: u32| path.camera_at(path.end() - f64::from(n_frames - 1 - frame_ix) * step);
        Some(Self { cameras: (0..n_frames).map(at).collect::<Option<_>>()? })
    }

    /// Returns the number of frames.
    pub fn n_frames(&self) -> u32 {
        self.cameras.len() as u32
    }

    /// Returns the camera of frame `frame_ix`.
    pub fn camera(&self, frame_ix: u32) -> Camera {
        self.cameras[frame_ix as usize]
    }
}

#[cfg(test)]
mod tests {
    use glam::{Vec3, vec3};

    use super::*;
    use crate::scene::Projection;

    #[test]
    fn it_goes_round_and_ends_where_it_began() {
        let start = Camera {
            eye: vec3(0.0, 1.0, 4.0),
            target: Vec3::Y,
            up: Vec3::Y,
            projection: Projection::Perspective { vertical_fov_degrees: 40.0 },
        };
        let tour = Tour::around(start, 4);
        let eyes: Vec<_> = (0..4).map(|frame_ix| tour.camera(frame_ix).eye).collect();
        let expected = [vec3(4.0, 1.0, 0.0), vec3(0.0, 1.0, -4.0), vec3(-4.0, 1.0, 0.0), start.eye];
        assert!(eyes.iter().zip(expected).all(|(a, b)| (*a - b).length() < 1e-5), "{eyes:?}");
        assert_eq!(tour.camera(3), start);
        assert_eq!(Tour::around(start, 1).camera(0), start);
    }

    #[test]
    fn it_follows_a_path_from_end_to_end() {
        let directory = tempfile::TempDir::new().unwrap();
        let file = directory.path().join("path.toml");
        let key = |frame: u32, x: f32| {
            format!("[[keyframe]]\nframe = {frame}\neye = [{x:?}, 0.0, 5.0]\ntarget = [{x:?}, 0.0, 0.0]\n")
        };
        std::fs::write(&file, key(10, 1.0) + &key(20, 3.0)).unwrap();
        let path = CameraPath::load(&file).unwrap();
        let tour = Tour::along(&path, 3).unwrap();
        let eyes: Vec<_> = (0..tour.n_frames()).map(|frame_ix| tour.camera(frame_ix).eye.x).collect();
        assert_eq!(eyes, [1.0, 2.0, 3.0]);
        assert_eq!(Tour::along(&path, 1).unwrap().camera(0).eye.x, 3.0);
    }
}
