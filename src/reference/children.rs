//! The child rays that start at a hit: reflected, transmitted, both or none. Twin of `shading/children.glsl`.

use glam::Vec3;

use super::{
    inputs::KernelInputs,
    maps::shaded_at,
    material::{Scattering, scatter, scatters_light, transmittance},
    microfacet::is_microfacet,
    surface::Surface,
};
use crate::layout::{CHILD_REFLECTED, CHILD_TRANSMITTED, Frame, Hit, LEAST_THROUGHPUT, Material, NO_TRIANGLE, PathRay};

/// The weight of a child ray, or 0 if its throughput is negligible in all colours.
fn kept_weight(ray: &PathRay, material: &Material, weight: Vec3) -> Vec3 {
    let least = if is_microfacet(material) { LEAST_THROUGHPUT } else { 0.0 };
    if (ray.throughput * weight).cmpgt(Vec3::splat(least)).any() { weight } else { Vec3::ZERO }
}

/// Whether the ray is at the last depth, and has no children that are deeper. In frames with more bounces than depths,
/// the `t_max` of a ray says the ray's depth: as many floats lie between it and infinity.
fn is_at_last_depth(frame: &Frame, ray: &PathRay) -> bool {
    let n_used = || f32::INFINITY.to_bits() - ray.t_max.to_bits();
    frame.extra_bounces > 0 && n_used() + 1 >= frame.max_depth - frame.extra_bounces
}

fn scattering_at(inputs: &KernelInputs, ray: &PathRay, hit: &Hit) -> (Surface, Scattering) {
    let (surface, material) = shaded_at(inputs, ray, hit);
    let mut next = scatter(&material, &surface, ray.direction);
    let transmitted = transmittance(&material, &surface, hit.t);
    next.reflected_weight = kept_weight(ray, &material, next.reflected_weight * transmitted);
    next.transmitted_weight = kept_weight(ray, &material, next.transmitted_weight * transmitted);
    if is_at_last_depth(inputs.frame(), ray) {
        next.reflected_weight = Vec3::ZERO;
        next.transmitted_weight = if next.passes_straight { next.transmitted_weight } else { Vec3::ZERO };
    }
    (surface, next)
}

/// The ray's children that carry light, as bits `CHILD_*`.
pub fn child_flags_of(inputs: &KernelInputs, ray: &PathRay, hit: &Hit) -> u32 {
    if hit.triangle_ix == NO_TRIANGLE {
        return 0;
    }
    // Textures may change what a material scatters.
    if inputs.textures.is_none() && !scatters_light(inputs.material_at(hit)) {
        return 0;
    }
    let (_, next) = scattering_at(inputs, ray, hit);
    let reflected = if next.reflected_weight != Vec3::ZERO { CHILD_REFLECTED } else { 0 };
    let transmitted = if next.transmitted_weight != Vec3::ZERO { CHILD_TRANSMITTED } else { 0 };
    reflected | transmitted
}

/// The ray's children of these flags (bits `CHILD_*`), the reflected one first.
pub fn children_of(inputs: &KernelInputs, ray: &PathRay, hit: &Hit, flags: u32) -> impl Iterator<Item = PathRay> {
    let scattering = (flags != 0).then(|| scattering_at(inputs, ray, hit));
    let children = scattering.map(|(surface, next)| {
        [
            (CHILD_REFLECTED, next.reflected, next.reflected_weight, true),
            (CHILD_TRANSMITTED, next.transmitted, next.transmitted_weight, !next.passes_straight),
        ]
        .map(|(flag, direction, weight, is_deeper)| {
            (flags & flag != 0).then(|| {
                let child = surface.ray_from(direction, hit.triangle_ix, ray, ray.throughput * weight);
                let is_deeper = is_deeper && inputs.frame().extra_bounces > 0;
                PathRay { t_max: if is_deeper { ray.t_max.next_down() } else { ray.t_max }, ..child }
            })
        })
    });
    children.into_iter().flatten().flatten()
}
