//! Rectangles that shine to one side. Twin of `emitters/rectangle.glsl`.

use glam::{Vec2, Vec3};

use super::pick::{LightPick, pick_of_point, towards};
use crate::layout::AreaLight;

/// Distance at which a ray meets the front of a plane, in lengths of its direction; infinity if it does not.
pub(super) fn hit_plane(light: &AreaLight, origin: Vec3, direction: Vec3) -> f32 {
    let cosine = light.axis.dot(direction);
    let t = (light.position - origin).dot(light.axis) / cosine;
    if cosine < 0.0 && t > 0.0 { t } else { f32::INFINITY }
}

/// Distance at which a ray meets the rectangle's front, in lengths of its direction; infinity if it does not.
pub(super) fn hit_rectangle(light: &AreaLight, origin: Vec3, direction: Vec3) -> f32 {
    let t = hit_plane(light, origin, direction);
    let from_centre = origin + t * direction - light.position;
    let u = from_centre.dot(light.edge_u) / light.edge_u.dot(light.edge_u);
    let v = from_centre.dot(light.edge_v) / light.edge_v.dot(light.edge_v);
    if u.abs() <= 1.0 && v.abs() <= 1.0 { t } else { f32::INFINITY }
}

/// Density per steradian of a direction in which a flat light is seen at a distance, if its points are picked
/// uniformly.
pub(super) fn flat_density(light: &AreaLight, direction: Vec3, distance: f32) -> f32 {
    let facing = -light.axis.dot(direction) * light.area;
    if facing > 0.0 { distance * distance / facing } else { 0.0 }
}

pub(super) fn pick_rectangle(light: &AreaLight, point_world: Vec3, u: Vec2) -> LightPick {
    let point = light.position + (2.0 * u.x - 1.0) * light.edge_u + (2.0 * u.y - 1.0) * light.edge_v;
    let way = towards(point_world, point);
    let density = light.probability * flat_density(light, way.direction, way.distance);
    pick_of_point(way, light.radiance, density)
}
