//! Cast: the closest hit, or any hit, of each given ray. Twin of `cast.comp`.

use glam::Vec3;
use rayon::prelude::*;

use super::{
    RAYS_PER_TASK,
    inputs::KernelInputs,
    search_ray::SearchRay,
    traversal_ray::min,
    traverser::{Tracer, Traverser},
};
use crate::{
    accel::{Query, kdtree::Traversal},
    layout::{Hit, NO_TRIANGLE, Ray},
};

/// The result of a ray that hits nothing.
pub(super) const MISS: Hit = Hit { t: f32::INFINITY, triangle_ix: NO_TRIANGLE, u: 0.0, v: 0.0 };

/// The biased exponent of the longest component, 1 to 254; 0 if it is zero or denormal, 255 if it is infinite or NaN.
#[inline(always)]
pub(super) fn exponent_of(v: Vec3) -> u32 {
    let [x, y, z] = v.to_array().map(|x| x.to_bits() & 0x7fff_ffff);
    x.max(y).max(z) >> 23
}

/// Whether a ray can hit anything. False for a NaN anywhere, an infinite origin or direction, and a direction that is
/// zero (or so short that it is denormal).
#[inline(always)]
pub fn is_ray(ray: &Ray) -> bool {
    // All conditions are evaluated; a branch for each takes longer.
    (1..255).contains(&exponent_of(ray.direction))
        & (exponent_of(ray.origin) < 255)
        & !ray.t_min.is_nan()
        & !ray.t_max.is_nan()
}

/// The factor that scales a direction to about unit length, which the traversal needs, and the factor's inverse. Both
/// are powers of two, so scaling rounds neither the direction nor t.
#[inline(always)]
pub(super) fn scales_of(direction: Vec3) -> [f32; 2] {
    let exponent = exponent_of(direction).min(253);
    [254 - exponent, exponent].map(|exponent| f32::from_bits(exponent << 23))
}

/// The ray with a direction of about unit length. A ray that can only miss gets an empty interval of t, so it is in
/// no cell.
#[inline(always)]
pub(super) fn scaled(ray: &Ray) -> SearchRay {
    let [scale, inv_scale] = scales_of(ray.direction);
    let nowhere = SearchRay {
        origin: Vec3::ZERO,
        t_min: 1.0,
        direction: Vec3::X,
        t_max: 0.0,
        source_triangle: NO_TRIANGLE,
        alpha_seed: 0,
    };
    let scaled = SearchRay {
        origin: ray.origin,
        t_min: ray.t_min * inv_scale,
        direction: ray.direction * scale,
        t_max: min(ray.t_max, f32::MAX) * inv_scale,
        source_triangle: NO_TRIANGLE,
        alpha_seed: 0,
    };
    if is_ray(ray) { scaled } else { nowhere }
}

/// Writes the hits of one task's rays.
fn cast_all<const ANY_HIT: bool>(inputs: &KernelInputs, tracer: &mut impl Tracer, rays: &[Ray], hits: &mut [Hit]) {
    let search_rays = rays.iter().zip(hits).map(|(ray, hit)| ((ray, hit), scaled(ray)));
    tracer.trace_all::<ANY_HIT, _>(inputs, search_rays, |(ray, hit), found| {
        let [scale, _] = scales_of(ray.direction);
        *hit = if found.triangle_ix == NO_TRIANGLE { MISS } else { Hit { t: found.t * scale, ..found } };
    });
}

/// Casts `rays` and writes `hits`, one for each ray. A miss has an infinite t.
pub fn cast(inputs: &KernelInputs, traversal: Traversal, query: Query, rays: &[Ray], hits: &mut [Hit]) {
    cast_by(inputs, || Traverser::new(inputs, traversal), query, rays, hits);
}

/// Does what [`cast`] does, by tracers that `new_tracer` makes, at least one for each thread that works.
pub fn cast_by<T: Tracer>(
    inputs: &KernelInputs,
    new_tracer: impl Fn() -> T + Sync + Send,
    query: Query,
    rays: &[Ray],
    hits: &mut [Hit],
) {
    rays.par_chunks(RAYS_PER_TASK).zip(hits.par_chunks_mut(RAYS_PER_TASK)).for_each_init(
        new_tracer,
        |tracer, (rays, hits)| match query {
            Query::Closest => cast_all::<false>(inputs, tracer, rays, hits),
            Query::Any => cast_all::<true>(inputs, tracer, rays, hits),
        },
    );
}
