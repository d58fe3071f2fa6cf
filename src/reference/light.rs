//! Point and directional lights, as seen from a point of a surface. Twin of `light.glsl`.

use glam::Vec3;

use crate::layout::{LIGHT_DIRECTIONAL, Light};

/// What arrives from a light at a point.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Unit vector to the light.
    pub direction: Vec3,
    /// The light's distance, world units (infinity for a directional light).
    pub distance: f32,
    /// Irradiance on a surface that faces the light.
    pub irradiance: Vec3,
}

/// Returns what arrives from a light at a point.
pub fn sample_light(light: &Light, point_world: Vec3) -> LightSample {
    if light.kind == LIGHT_DIRECTIONAL {
        return LightSample { direction: light.position, distance: f32::INFINITY, irradiance: light.intensity };
    }
    let to_light = light.position - point_world;
    let squared = to_light.dot(to_light);
    let distance = squared.sqrt();
    LightSample { direction: to_light / distance, distance, irradiance: light.intensity / squared }
}
