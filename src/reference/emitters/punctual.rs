//! Point, spot and directional lights without a size. Twin of `emitters/punctual.glsl`.

use std::f32::consts::PI;

use glam::Vec3;

use super::light_sample::LightSample;
use crate::{layout::Light, reference::light::incident_light};

/// `probability`: with which this light is sampled.
pub fn sample_punctual(light: &Light, point_world: Vec3, probability: f32) -> LightSample {
    let arriving = incident_light(light, point_world);
    // Not `<=`: at the light itself, there are NaNs.
    if !(arriving.distance > 0.0) {
        return LightSample::NONE;
    }
    let light = arriving.irradiance * (PI / probability);
    LightSample { direction: arriving.direction, distance: arriving.distance, light, pdf: 0.0 }
}
