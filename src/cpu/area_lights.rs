//! The test of sixteen rays against all rectangles, disks and spheres that shine. It does the operations of the
//! reference's `hit_area_light`.

use fearless_simd::{Simd, f32x16, mask32x16, prelude::*};

use super::vec3x16::Vec3x16;
use crate::layout::{AREA_DISK, AREA_RECTANGLE, AreaLight};

/// The rays whose direction meets the front of a flat light's plane, and the distances at which they do.
#[inline(always)]
fn plane_hits<S: Simd>(
    light: &AreaLight,
    origin: Vec3x16<S>,
    direction: Vec3x16<S>,
) -> (mask32x16<S>, f32x16<S>, Vec3x16<S>) {
    let simd = origin.0[0].simd;
    let (axis, position) = (Vec3x16::splat(simd, light.axis), Vec3x16::splat(simd, light.position));
    let cosine = axis.dot(direction);
    let t = (position - origin).dot(axis) / cosine;
    (cosine.simd_lt(0.0) & t.simd_gt(0.0), t, origin + direction * t - position)
}

#[inline(always)]
fn sphere_hits<S: Simd>(light: &AreaLight, origin: Vec3x16<S>, direction: Vec3x16<S>) -> (mask32x16<S>, f32x16<S>) {
    let to_centre = Vec3x16::splat(origin.0[0].simd, light.position) - origin;
    let along = to_centre.dot(direction);
    let aside = to_centre - direction * along;
    let radius_squared = light.radius * light.radius;
    let squared = radius_squared - aside.dot(aside);
    let is_outside = to_centre.dot(to_centre).simd_gt(radius_squared);
    (is_outside & along.simd_gt(0.0) & squared.simd_ge(0.0), along - squared.sqrt())
}

/// Returns the rays that meet an area light between 0 and `t_max`. `direction`: unit vectors.
#[inline(always)]
pub fn meets_light<S: Simd>(
    lights: &[AreaLight],
    origin: Vec3x16<S>,
    direction: Vec3x16<S>,
    t_max: f32x16<S>,
) -> mask32x16<S> {
    let mut meets = mask32x16::splat(t_max.simd, false);
    for light in lights {
        let (is_hit, t) = match light.kind {
            AREA_RECTANGLE => {
                let (is_front, t, from_centre) = plane_hits(light, origin, direction);
                let (edge_u, edge_v) = (light.edge_u, light.edge_v);
                let u = from_centre.dot(Vec3x16::splat(t.simd, edge_u)) / edge_u.dot(edge_u);
                let v = from_centre.dot(Vec3x16::splat(t.simd, edge_v)) / edge_v.dot(edge_v);
                (is_front & u.abs().simd_le(1.0) & v.abs().simd_le(1.0), t)
            }
            AREA_DISK => {
                let (is_front, t, from_centre) = plane_hits(light, origin, direction);
                (is_front & from_centre.dot(from_centre).simd_le(light.radius * light.radius), t)
            }
            _ => sphere_hits(light, origin, direction),
        };
        meets |= is_hit & t.simd_lt(t_max) & t.simd_lt(f32::INFINITY);
    }
    meets
}
