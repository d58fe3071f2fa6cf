//! Point, spot and directional lights without a size. Twin of `emitters/punctual.glsl`.

use std::f32::consts::PI;

use glam::Vec3;

use super::pick::LightPick;
use crate::{layout::Light, reference::light::incident_light};

/// `probability`: with which this light is picked.
pub fn pick_punctual(light: &Light, point_world: Vec3, probability: f32) -> LightPick {
    let arriving = incident_light(light, point_world);
    // Not `<=`: at the light itself, there are NaNs.
    if !(arriving.distance > 0.0) {
        return LightPick::NONE;
    }
    let light = arriving.irradiance * (PI / probability);
    LightPick { direction: arriving.direction, distance: arriving.distance, light, pdf: 0.0 }
}
