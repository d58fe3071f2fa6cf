//! Cast: each given ray's closest hit through the kd-tree, or any hit. Twin of `cast.comp`.

use glam::Vec3;
use rayon::prelude::*;

use super::{
    RAYS_PER_TASK,
    bindings::Bindings,
    kdtree::{Traverser, min},
};
use crate::{
    cast::Query,
    frame::Traversal,
    layout::{CastRay, Hit, NO_TRIANGLE, Ray},
};

const MISS: Hit = Hit { t: f32::INFINITY, triangle_ix: NO_TRIANGLE, u: 0.0, v: 0.0 };

/// The longest component's exponent as the bits hold it, 1 to 254; 0: all but zero, 255: infinite or NaN.
fn exponent_of(direction: Vec3) -> u32 {
    let [x, y, z] = direction.to_array().map(|d| d.to_bits() & 0x7fff_ffff);
    x.max(y).max(z) >> 23
}

/// False for what can only miss: a NaN anywhere, an infinite origin or direction, a direction of zero (or one so short
/// that it is denormal).
pub fn is_ray(ray: &CastRay) -> bool {
    (1..255).contains(&exponent_of(ray.direction))
        && ray.origin.is_finite()
        && !ray.t_min.is_nan()
        && !ray.t_max.is_nan()
}

/// The traversal wants a direction of about unit length. Scaled by a power of two it keeps its bits, and so does t.
fn cast_ray<const ANY_HIT: bool>(bindings: &Bindings, traverser: &mut Traverser, ray: &CastRay) -> Hit {
    let exponent = exponent_of(ray.direction).min(253);
    let scale = f32::from_bits((254 - exponent) << 23); // 2^(127 - exponent)
    let inv_scale = f32::from_bits(exponent << 23);
    let scaled = Ray {
        origin: ray.origin,
        pixel_ix: 0,
        direction: ray.direction * scale,
        source_triangle: NO_TRIANGLE,
        throughput: Vec3::ZERO,
        t_max: min(ray.t_max, f32::MAX) * inv_scale,
    };
    let hit = traverser.traverse::<ANY_HIT>(bindings, &scaled, ray.t_min * inv_scale);
    if hit.triangle_ix == NO_TRIANGLE { MISS } else { Hit { t: hit.t * scale, ..hit } }
}

/// Writes `hits`, one a ray.
pub fn cast(bindings: &Bindings, traversal: Traversal, query: Query, rays: &[CastRay], hits: &mut [Hit]) {
    rays.par_chunks(RAYS_PER_TASK).zip(hits.par_chunks_mut(RAYS_PER_TASK)).for_each_init(
        || Traverser::new(traversal),
        |traverser, (rays, hits)| {
            for (ray, hit) in rays.iter().zip(hits) {
                *hit = match query {
                    _ if !is_ray(ray) => MISS,
                    Query::Closest => cast_ray::<false>(bindings, traverser, ray),
                    Query::Any => cast_ray::<true>(bindings, traverser, ray),
                };
            }
        },
    );
}
