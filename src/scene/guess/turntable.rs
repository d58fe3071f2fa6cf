//! The cameras of a film that goes round a scene.

use glam::{DQuat, DVec3, Vec3};

use super::{
    framing::{FILLED, support},
    near::NearPart,
};
use crate::scene::{
    meshes::ground::Ground,
    model::{Camera, Projection, Scene, Up},
};

impl Scene {
    /// Returns a turn once round the scene in equal steps. The first camera looks from the side of the scene's own
    /// camera and with its projection; the next ones stand to its right. All are equally far away, so that none cuts
    /// the scene. `aspect`: width of the pictures divided by their height.
    ///
    /// If the scene's own camera stands within the scene's box, as in a room, the cameras turn where it stands.
    pub fn turntable(&self, n_frames: u32, aspect: f32) -> Turntable {
        let n_grounds = usize::from(Ground::of(self).is_some());
        let near = NearPart::of(self, &self.instances[..self.instances.len() - n_grounds]);
        let (min, max) = (near.bounds.0.as_dvec3(), near.bounds.1.as_dvec3());
        let own = self.camera;
        let up = if own.up.z.abs() > own.up.y.abs() { Up::Z } else { Up::Y }.vector().as_dvec3();
        let (eye, away) = (own.eye.as_dvec3(), (own.eye - own.target).as_dvec3());
        if eye.cmpge(min).all() && eye.cmple(max).all() {
            return Turntable { n_frames, up, eye, middle: None, away, projection: own.projection, own_up: own.up };
        }
        let centre = (min + max) / 2.0;
        let orbit = Orbit { up, centre, aspect: f64::from(aspect), projection: own.projection };
        let turns = (0..n_frames).map(|frame| turn(up, f64::from(frame), n_frames));
        let needs = turns.map(|turn| orbit.needs(self, &near, turn * away.normalize()));
        let [distance, half_height] =
            needs.fold([0.0; 2], |most, needs| [0, 1].map(|ix| f64::max(most[ix], needs[ix])));
        let projection = match own.projection {
            Projection::Orthographic { .. } => Projection::Orthographic { height: (2.0 * half_height) as f32 },
            perspective @ Projection::Perspective { .. } => perspective,
        };
        let away = distance * away.normalize();
        Turntable { n_frames, up, eye: centre + away, middle: Some(centre), away, projection, own_up: up.as_vec3() }
    }
}

/// The cameras of a turn.
#[derive(Clone, Debug)]
pub struct Turntable {
    n_frames: u32,
    /// The axis of the turn, a unit vector.
    up: DVec3,
    /// The eye of the first camera.
    eye: DVec3,
    /// The target of all cameras, round which they go; none if they turn where they stand.
    middle: Option<DVec3>,
    /// From the first camera's target to its eye.
    away: DVec3,
    projection: Projection,
    /// The `up` of all cameras.
    own_up: Vec3,
}

impl Turntable {
    /// Returns the camera of a frame, which may lie between two whole frames.
    pub fn camera_at(&self, frame: f64) -> Camera {
        let away = turn(self.up, frame, self.n_frames) * self.away;
        let (eye, target) = match self.middle {
            Some(middle) => (middle + away, middle),
            None => (self.eye, self.eye - away),
        };
        Camera { eye: eye.as_vec3(), target: target.as_vec3(), up: self.own_up, projection: self.projection }
    }
}

/// Returns the rotation of a frame.
fn turn(up: DVec3, frame: f64, n_frames: u32) -> DQuat {
    DQuat::from_axis_angle(up, std::f64::consts::TAU * frame / f64::from(n_frames))
}

/// What all cameras of a turn have in common.
struct Orbit {
    up: DVec3,
    centre: DVec3,
    aspect: f64,
    projection: Projection,
}

impl Orbit {
    /// Returns the least distance, and half the least height of an orthographic picture, by which a camera at the
    /// direction `away` from the centre sees all.
    ///
    /// Let x, y and z be the coordinates of a corner to the right, up and forward from the centre, d the distance of
    /// the eye, and t the tangent of half the field of view. The corner is in the picture if |x| <= t (d + z), so d is
    /// at least x / t - z and -x / t - z.
    fn needs(&self, scene: &Scene, near: &NearPart, away: DVec3) -> [f64; 2] {
        let forward = -away;
        let right = forward.cross(self.up).normalize_or(forward.any_orthonormal_vector());
        let up = right.cross(forward);
        match self.projection {
            Projection::Perspective { vertical_fov_degrees } => {
                let tangent = (f64::from(vertical_fov_degrees) / 2.0).to_radians().tan() * FILLED;
                let (x, y) = (right / (tangent * self.aspect), up / tangent);
                let needed = support(scene, near, self.centre, [x - forward, -x - forward, y - forward, -y - forward]);
                [needed.into_iter().fold(0.0, f64::max), 0.0]
            }
            Projection::Orthographic { .. } => {
                let x = right / self.aspect;
                let needed = support(scene, near, self.centre, [x, -x, up, -up]);
                let [behind, ..] = support(scene, near, self.centre, [away; 4]);
                [2.0 * behind.abs(), needed.into_iter().fold(0.0, f64::max) / FILLED]
            }
        }
    }
}
