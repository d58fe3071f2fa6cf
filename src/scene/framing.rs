//! A camera and a light for meshes without either.

use glam::Vec3;

use super::{Camera, Light, Projection, Scene};

/// Direction from the middle of the scene towards the eye: to the front, the right and above. Not of unit length.
const TOWARDS_EYE: Vec3 = Vec3::new(0.45, 0.35, 1.0);
const VERTICAL_FOV_DEGREES: f32 = 40.0;
/// Factor on the eye's distance, which leaves a margin around the bounding sphere.
const MARGIN: f32 = 1.05;

/// Returns a camera that sees the whole bounding sphere of a bounding box, in any picture whose height is at most its
/// width.
pub(super) fn camera((min, max): (Vec3, Vec3)) -> Camera {
    let centre = (min + max) / 2.0;
    // For a small scene far from the origin, the eye's distance must exceed the rounding of its coordinates.
    let radius = ((max - min).length() / 2.0).max(centre.abs().max_element() * 1e-3);
    let distance = MARGIN * radius / (VERTICAL_FOV_DEGREES / 2.0).to_radians().sin();
    Camera {
        eye: centre + TOWARDS_EYE.normalize() * distance,
        target: centre,
        up: Vec3::Y,
        projection: Projection::Perspective { vertical_fov_degrees: VERTICAL_FOV_DEGREES },
    }
}

/// Lights a scene that describes no light: by one light, ambient light, and a background.
pub(super) fn light_up(scene: &mut Scene) {
    scene.lights = vec![light()];
    scene.ambient = Vec3::splat(0.25);
    scene.background = Vec3::new(0.32, 0.36, 0.42);
}

/// Returns a directional light from above the camera's left shoulder.
fn light() -> Light {
    Light::Directional { towards: Vec3::new(-0.4, 0.8, 0.7).normalize(), irradiance: Vec3::splat(0.8) }
}
