//! Cast: each given ray's closest hit through the kd-tree, or any hit. Twin of `cast.comp`.

use glam::Vec3;
use rayon::prelude::*;

use super::{RAYS_PER_TASK, bindings::Bindings, kdtree::min, probe::Probe, traverser::Traverser};
use crate::{
    cast::Query,
    frame::Traversal,
    layout::{CastRay, Hit, NO_TRIANGLE},
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

/// A direction's scale to about unit length, which the traversal wants: a power of two, so that it keeps its bits, and t.
fn scale_of(direction: Vec3) -> f32 {
    let exponent = exponent_of(direction).min(253);
    f32::from_bits((254 - exponent) << 23) // 2^(127 - exponent)
}

fn scaled(ray: &CastRay) -> Probe {
    let scale = scale_of(ray.direction);
    let inv_scale = 1.0 / scale;
    Probe {
        origin: ray.origin,
        t_min: ray.t_min * inv_scale,
        direction: ray.direction * scale,
        t_max: min(ray.t_max, f32::MAX) * inv_scale,
        source_triangle: NO_TRIANGLE,
    }
}

fn cast_all<const ANY_HIT: bool>(bindings: &Bindings, traverser: &mut Traverser, rays: &[CastRay], hits: &mut [Hit]) {
    let probes = rays.iter().zip(hits).filter_map(|(ray, hit)| {
        *hit = MISS;
        is_ray(ray).then(|| ((ray, hit), scaled(ray)))
    });
    traverser.traverse_all::<ANY_HIT, _>(bindings, probes, |(ray, hit), found| {
        if found.triangle_ix != NO_TRIANGLE {
            *hit = Hit { t: found.t * scale_of(ray.direction), ..found };
        }
    });
}

/// Writes `hits`, one a ray.
pub fn cast(bindings: &Bindings, traversal: Traversal, query: Query, rays: &[CastRay], hits: &mut [Hit]) {
    rays.par_chunks(RAYS_PER_TASK).zip(hits.par_chunks_mut(RAYS_PER_TASK)).for_each_init(
        || Traverser::new(traversal),
        |traverser, (rays, hits)| match query {
            Query::Closest => cast_all::<false>(bindings, traverser, rays, hits),
            Query::Any => cast_all::<true>(bindings, traverser, rays, hits),
        },
    );
}
