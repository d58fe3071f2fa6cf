//! Spheres that shine outwards. Twin of `emitters/sphere.glsl`, which names the sources.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::light_sample::{LightSample, Towards, around, sample_of_point, towards};
use crate::{layout::AreaLight, reference::bsdf::local_frame::frame_around};

/// Distance at which a ray meets the sphere from outside, in lengths of its direction, a unit vector; infinity if it
/// does not.
pub(super) fn hit_sphere(light: &AreaLight, origin: Vec3, direction: Vec3) -> f32 {
    let to_centre = light.position - origin;
    let along = to_centre.dot(direction);
    let aside = to_centre - along * direction;
    let squared = light.radius * light.radius - aside.dot(aside);
    let is_outside = to_centre.dot(to_centre) > light.radius * light.radius;
    if is_outside && along > 0.0 && squared >= 0.0 { along - squared.sqrt() } else { f32::INFINITY }
}

/// 1 less the cosine of the angle between the centre of the sphere and its edge, seen from a point; 0 from inside.
fn sphere_versine(light: &AreaLight, to_centre: Vec3) -> f32 {
    let squared_sine = light.radius * light.radius / to_centre.dot(to_centre);
    if squared_sine < 1.0 { squared_sine / (1.0 + (1.0 - squared_sine).sqrt()) } else { 0.0 }
}

/// Pdf per steradian of the directions in which the sphere is seen; 0 from inside.
pub(super) fn sphere_pdf(light: &AreaLight, point_world: Vec3) -> f32 {
    let versine = sphere_versine(light, light.position - point_world);
    if versine > 0.0 { 1.0 / (2.0 * PI * versine) } else { 0.0 }
}

pub(super) fn sample_sphere(light: &AreaLight, point_world: Vec3, u: Vec2) -> LightSample {
    let to_centre = towards(point_world, light.position);
    let versine = u.x * sphere_versine(light, light.position - point_world);
    let sine = (versine * (2.0 - versine)).sqrt();
    let axes = frame_around(to_centre.direction);
    let direction = around([axes.normal, axes.tangent, axes.bitangent], [1.0 - versine, sine, u.y]);
    let aside = to_centre.distance * sine;
    let half_chord = (light.radius * light.radius - aside * aside).max(0.0).sqrt();
    let distance = (to_centre.distance * (1.0 - versine) - half_chord).max(0.0);
    let pdf = light.probability * sphere_pdf(light, point_world);
    sample_of_point(Towards { direction, distance }, light.radiance, pdf)
}
