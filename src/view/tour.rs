//! Camera moves that need no user: for tests, measurements and films.

use glam::Quat;

use crate::scene::Camera;

/// Frames along a fixed way: once around the target, back to the camera that it started from.
#[derive(Clone, Debug, PartialEq)]
pub struct Tour {
    start: Camera,
    n_frames: u32,
}

impl Tour {
    /// At least one frame.
    pub fn around(start: Camera, n_frames: u32) -> Self {
        assert!(n_frames > 0, "a tour has frames");
        Self { start, n_frames }
    }

    pub fn n_frames(&self) -> u32 {
        self.n_frames
    }

    /// Where frame `frame_ix` is seen from; the last one from the very start.
    pub fn camera(&self, frame_ix: u32) -> Camera {
        let turned = (frame_ix + 1) % self.n_frames;
        if turned == 0 {
            return self.start;
        }
        let angle = std::f32::consts::TAU * turned as f32 / self.n_frames as f32;
        let around = Quat::from_axis_angle(self.start.up, angle);
        let eye = self.start.target + around * (self.start.eye - self.start.target);
        Camera { eye, ..self.start }
    }
}

#[cfg(test)]
mod tests {
    use glam::{Vec3, vec3};

    use super::*;

    #[test]
    fn it_goes_round_and_ends_where_it_began() {
        let start = Camera { eye: vec3(0.0, 1.0, 4.0), target: Vec3::Y, up: Vec3::Y, vertical_fov_degrees: 40.0 };
        let tour = Tour::around(start, 4);
        let eyes: Vec<_> = (0..4).map(|frame_ix| tour.camera(frame_ix).eye).collect();
        let expected = [vec3(4.0, 1.0, 0.0), vec3(0.0, 1.0, -4.0), vec3(-4.0, 1.0, 0.0), start.eye];
        assert!(eyes.iter().zip(expected).all(|(a, b)| (*a - b).length() < 1e-5), "{eyes:?}");
        assert_eq!(tour.camera(3), start);
        assert_eq!(Tour::around(start, 1).camera(0), start);
    }
}
