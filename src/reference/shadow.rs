//! Shadow (the paper's section 2.1): tests which lights each hit sees. Twin of `shadow.comp`.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use super::{
    RAYS_PER_TASK,
    inputs::KernelInputs,
    light::incident_light,
    maps::shaded_at,
    material::can_show,
    search_ray::SearchRay,
    surface::lit_point,
    traverser::{Tracer, Traverser},
};
use crate::{
    accel::kdtree::Traversal,
    layout::{Hit, LIGHT_LIT, LIGHT_SHADOWED, LIGHT_UNTESTED, Light, NO_TRIANGLE, PathRay},
};

/// The shadow ray to the light, or none if the surface faces away from the light or would not show it.
pub(crate) fn shadow_ray_of(inputs: &KernelInputs, ray: &PathRay, hit: &Hit, light: &Light) -> Option<PathRay> {
    let (surface, material) = shaded_at(inputs, ray, hit);
    let to_light = incident_light(light, surface.point_world);
    // Not `<=`: a NaN is unlit.
    if !(surface.interpolated.dot(to_light.direction) > 0.0) {
        return None;
    }
    if !can_show(&material, surface.shading, -ray.direction, to_light.direction) {
        return None;
    }
    let from = lit_point(&surface, hit, &inputs.triangle(hit.triangle_ix), to_light.direction);
    let origin = from + surface.origin_offset * surface.geometric;
    Some(PathRay {
        origin,
        pixel_ix: ray.pixel_ix,
        direction: to_light.direction,
        source_triangle: hit.triangle_ix,
        throughput: Vec3::ZERO,
        // The shadow ray ends where the light is seen from the surface's own point.
        t_max: to_light.distance - (origin - surface.point_world).dot(to_light.direction),
    })
}

/// Writes `light_visibility[light * capacity + ray]`, one of `LIGHT_*`, for some of the queue's rays, those at the
/// indices `places`. `capacity`: the number of rays for which `light_visibility` has room. `rays` and `hits` are those
/// of the whole queue. Returns the number of shadow rays that were tested.
pub fn shadow(
    inputs: &KernelInputs,
    traversal: Traversal,
    places: &Range<usize>,
    (rays, hits): (&[PathRay], &[Hit]),
    light_visibility: &mut [u32],
) -> u32 {
    shadow_by(inputs, || Traverser::new(inputs, traversal), places, (rays, hits), light_visibility)
}

/// Does what [`shadow`] does, by tracers that `new_tracer` makes, at least one for each thread that works.
pub fn shadow_by<T: Tracer>(
    inputs: &KernelInputs,
    new_tracer: impl Fn() -> T + Sync + Send,
    places: &Range<usize>,
    (rays, hits): (&[PathRay], &[Hit]),
    light_visibility: &mut [u32],
) -> u32 {
    let (rays, hits) = (&rays[places.clone()], &hits[places.clone()]);
    let inputs = &inputs.with_blended_tested();
    let of_light = |(light, visibility): (&Light, &mut [u32])| -> u32 {
        let of_task = |tracer: &mut T, ((rays, hits), visibility): ((&[PathRay], &[Hit]), &mut [u32])| {
            let mut n_tested = 0;
            let shadow_rays = rays.iter().zip(hits).zip(visibility).filter_map(|((ray, hit), visible)| {
                *visible = LIGHT_UNTESTED;
                let is_hit = hit.triangle_ix != NO_TRIANGLE;
                let shadow_ray = is_hit.then(|| shadow_ray_of(inputs, ray, hit, light)).flatten()?;
                n_tested += 1;
                Some((visible, SearchRay::from(&shadow_ray)))
            });
            tracer.trace_all::<true, _>(inputs, shadow_rays, |visible, hit| {
                *visible = if hit.triangle_ix == NO_TRIANGLE { LIGHT_LIT } else { LIGHT_SHADOWED };
            });
            n_tested
        };
        rays.par_chunks(RAYS_PER_TASK)
            .zip(hits.par_chunks(RAYS_PER_TASK))
            .zip(visibility[places.clone()].par_chunks_mut(RAYS_PER_TASK))
            .map_init(&new_tracer, of_task)
            .sum()
    };
    let stride = stride(inputs, light_visibility);
    inputs.lights.iter().zip(light_visibility.chunks_mut(stride)).map(of_light).sum()
}

/// Returns the stride from one light to the next in `light_visibility`, in elements, at least 1.
pub(super) fn stride(inputs: &KernelInputs, light_visibility: &[u32]) -> usize {
    (light_visibility.len() / inputs.lights.len().max(1)).max(1)
}
