//! Cameras.

use glam::Vec3;

use super::mesh::MAX_COORDINATE;

/// Least and greatest vertical field of view, degrees.
pub(crate) const FOV_DEGREES: (f32, f32) = (0.1, 170.0);
/// Least and greatest height of what an orthographic camera shows, world units: from the smallest scene to more than
/// the largest one.
pub(crate) const HEIGHTS: (f32, f32) = (1e-8, 10.0 * MAX_COORDINATE);

/// A camera. `eye`, `target` and `up` span a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Point at which the rays of a perspective camera begin, world space. For an orthographic camera, it is the
    /// middle of the rectangle in which they begin. No camera shows what is behind this point.
    pub eye: Vec3,
    /// Point that the middle of the picture shows, world space.
    pub target: Vec3,
    /// Unit vector that points up in the picture, world space. It is not parallel to the view.
    pub up: Vec3,
    /// How the picture shows the world.
    pub projection: Projection,
}

/// How a picture shows the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// A pinhole's picture: all rays begin at the eye.
    Perspective {
        /// Angle between the picture's lower and upper edge, degrees.
        vertical_fov_degrees: f32,
    },
    /// All rays are parallel to the view, so that the size of things in the picture does not depend on their distance.
    Orthographic {
        /// Distance between the picture's lower and upper edge, world units.
        height: f32,
    },
}

impl Default for Camera {
    /// Looks from the origin along -z; +y points up.
    fn default() -> Self {
        let projection = Projection::Perspective { vertical_fov_degrees: 45.0 };
        Self { eye: Vec3::ZERO, target: Vec3::NEG_Z, up: Vec3::Y, projection }
    }
}

impl Camera {
    /// Returns whether eye and target differ, and up does not point along the view.
    pub(crate) fn spans_picture(&self) -> bool {
        let forward = (self.target.as_dvec3() - self.eye.as_dvec3()).normalize_or_zero();
        forward.cross(self.up.as_dvec3()).length() >= 1e-4
    }

    /// Returns what keeps the camera from showing a picture.
    pub(crate) fn check(&self) -> Result<(), String> {
        let points = [("eye", self.eye), ("target", self.target), ("up", self.up)];
        if let Some((name, point)) = points.into_iter().find(|(_, point)| !point.is_finite()) {
            return Err(format!("{name} is {:?}, which is not finite", point.to_array()));
        }
        let right = (self.target.as_dvec3() - self.eye.as_dvec3()).cross(self.up.as_dvec3());
        if right.length_squared() == 0.0 {
            return Err("up points along the view, or eye and target are one point".to_owned());
        }
        match self.projection {
            Projection::Perspective { vertical_fov_degrees: angle } if !(angle > 0.0 && angle < 180.0) => {
                Err(format!("vertical_fov_degrees is {angle}, not above 0 and below 180"))
            }
            Projection::Orthographic { height } if !(height > 0.0 && height.is_finite()) => {
                Err(format!("height is {height}, not a finite number above 0"))
            }
            _ => Ok(()),
        }
    }

    /// Returns whether the camera is orthographic.
    pub fn is_orthographic(&self) -> bool {
        matches!(self.projection, Projection::Orthographic { .. })
    }

    /// Returns unit vectors to the right of the picture, to its top, and from the eye to the target.
    pub(crate) fn axes(&self) -> [Vec3; 3] {
        let forward = (self.target - self.eye).normalize_or_zero();
        let right = forward.cross(self.up).normalize_or_zero();
        [right, right.cross(forward), forward]
    }

    /// Returns whether a picture of this shape, width by height, can show something of a box. That it shows nothing is
    /// certain if all corners are beyond one of the picture's edges, or behind the eye.
    pub(crate) fn may_see(&self, (min, max): (Vec3, Vec3), aspect: f32) -> bool {
        let [right, up, forward] = self.axes();
        let corners = (0..8).map(|ix| {
            let pick = |axis: usize| if ix >> axis & 1 == 0 { min[axis] } else { max[axis] };
            let from_eye = Vec3::new(pick(0), pick(1), pick(2)) - self.eye;
            let (depth, x, y) = (from_eye.dot(forward), from_eye.dot(right), from_eye.dot(up));
            let half = self.height_at(depth) / 2.0;
            [-depth, x - half * aspect, -x - half * aspect, y - half, -y - half]
        });
        let corners: Vec<[f32; 5]> = corners.collect();
        (0..5).all(|side| corners.iter().any(|beyond| beyond[side] < 0.0))
    }

    /// Returns the height, in world units, of what the picture shows at a distance from the eye along the view.
    pub fn height_at(&self, distance: f32) -> f32 {
        match self.projection {
            Projection::Perspective { vertical_fov_degrees } => {
                2.0 * distance * (vertical_fov_degrees.to_radians() / 2.0).tan()
            }
            Projection::Orthographic { height } => height,
        }
    }
}
