//! Disks that shine to one side. Twin of `emitters/disk.glsl`, which names the source.

use glam::{Vec2, Vec3};

use super::{
    light_sample::{LightSample, sample_of_point, towards},
    rectangle::{flat_pdf, hit_plane},
};
use crate::{layout::AreaLight, reference::turns::sin_cos_of_turns};

/// Distance at which a ray meets the disk's front, in lengths of its direction; infinity if it does not.
pub(super) fn hit_disk(light: &AreaLight, origin: Vec3, direction: Vec3) -> f32 {
    let t = hit_plane(light, origin, direction);
    let from_centre = origin + t * direction - light.position;
    if from_centre.dot(from_centre) <= light.radius * light.radius { t } else { f32::INFINITY }
}

/// A point of the unit disk, uniform on its area.
fn disk_point(u: Vec2) -> Vec2 {
    let at = 2.0 * u - 1.0;
    if at == Vec2::ZERO {
        return at;
    }
    if at.x.abs() > at.y.abs() {
        let (sine, cosine) = sin_cos_of_turns(0.125 * (at.y / at.x));
        at.x * Vec2::new(cosine, sine)
    } else {
        let (sine, cosine) = sin_cos_of_turns(0.125 * (at.x / at.y));
        at.y * Vec2::new(sine, cosine)
    }
}

pub(super) fn sample_disk(light: &AreaLight, point_world: Vec3, u: Vec2) -> LightSample {
    let place = light.radius * disk_point(u);
    let way = towards(point_world, light.position + place.x * light.edge_u + place.y * light.edge_v);
    let pdf = light.probability * flat_pdf(light, way.direction, way.distance);
    sample_of_point(way, light.radiance, pdf)
}
