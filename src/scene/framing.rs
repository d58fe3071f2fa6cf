//! A camera and a light for meshes that come without.

use glam::Vec3;

use super::{Camera, Light};

/// From the middle of the picture towards the eye: from the front, the right and above.
const TOWARDS_EYE: Vec3 = Vec3::new(0.45, 0.35, 1.0);
const VERTICAL_FOV_DEGREES: f32 = 40.0;
/// Room around the bounding sphere.
const MARGIN: f32 = 1.05;

/// Sees the whole bounding sphere of the bounding box, in any picture that is not higher than wide.
pub(super) fn camera((min, max): (Vec3, Vec3)) -> Camera {
    let centre = (min + max) / 2.0;
    // A small scene far from the origin: the eye must be farther away than rounding of its coordinates is.
    let radius = ((max - min).length() / 2.0).max(centre.abs().max_element() * 1e-3);
    let distance = MARGIN * radius / (VERTICAL_FOV_DEGREES / 2.0).to_radians().sin();
    Camera {
        eye: centre + TOWARDS_EYE.normalize() * distance,
        target: centre,
        up: Vec3::Y,
        vertical_fov_degrees: VERTICAL_FOV_DEGREES,
    }
}

/// From over the camera's left shoulder.
pub(super) fn light() -> Light {
    Light::Directional { towards: Vec3::new(-0.4, 0.8, 0.7).normalize(), irradiance: Vec3::splat(0.8) }
}
