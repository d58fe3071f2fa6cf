//! Point, spot and directional lights, as seen from a point of a surface. Twin of `shading/light.glsl`.

use glam::Vec3;

use crate::layout::{LIGHT_DIRECTIONAL, LIGHT_SPOT, Light};

/// What arrives from a light at a point.
#[derive(Clone, Copy, Debug)]
pub struct IncidentLight {
    /// Unit vector to the light.
    pub direction: Vec3,
    /// The light's distance, world units (infinity for a directional light).
    pub distance: f32,
    /// Irradiance on a surface that faces the light.
    pub irradiance: Vec3,
}

/// The share of a spot light's intensity in a direction, whose opposite is `direction`.
fn spot_share(light: &Light, direction: Vec3) -> f32 {
    let cosine = light.axis.dot(-direction);
    let share = ((cosine - light.outer_cos) / (light.inner_cos - light.outer_cos).max(1.0e-3)).clamp(0.0, 1.0);
    share * share
}

/// Returns what arrives from a light at a point.
pub fn incident_light(light: &Light, point_world: Vec3) -> IncidentLight {
    if light.kind == LIGHT_DIRECTIONAL {
        return IncidentLight { direction: light.position, distance: f32::INFINITY, irradiance: light.intensity };
    }
    let to_light = light.position - point_world;
    let squared = to_light.dot(to_light);
    let distance = squared.sqrt();
    let direction = to_light / distance;
    let cone = if light.kind == LIGHT_SPOT { spot_share(light, direction) } else { 1.0 };
    IncidentLight { direction, distance, irradiance: light.intensity * cone / squared }
}
