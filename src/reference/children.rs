//! The child rays that start at a hit: reflected, transmitted, both or none. Twin of `shading/children.glsl`.

use glam::Vec3;

use super::{
    inputs::KernelInputs,
    maps::shaded_at,
    material::{Scattering, scatter, scatters_light, transmittance},
    microfacet::is_microfacet,
    surface::Surface,
};
use crate::layout::{CHILD_REFLECTED, CHILD_TRANSMITTED, Hit, LEAST_THROUGHPUT, Material, NO_TRIANGLE, PathRay};

/// The weight of a child ray, or 0 if its throughput is negligible in all colours.
fn kept_weight(ray: &PathRay, material: &Material, weight: Vec3) -> Vec3 {
    let least = if is_microfacet(material) { LEAST_THROUGHPUT } else { 0.0 };
    if (ray.throughput * weight).cmpgt(Vec3::splat(least)).any() { weight } else { Vec3::ZERO }
}

fn scattering_at(inputs: &KernelInputs, ray: &PathRay, hit: &Hit) -> (Surface, Scattering) {
    let (surface, material) = shaded_at(inputs, ray, hit);
    let mut next = scatter(&material, &surface, ray.direction);
    let transmitted = transmittance(&material, &surface, hit.t);
    next.reflected_weight = kept_weight(ray, &material, next.reflected_weight * transmitted);
    next.transmitted_weight = kept_weight(ray, &material, next.transmitted_weight * transmitted);
    (surface, next)
}

/// The ray's children that carry light, as bits `CHILD_*`.
pub fn child_kinds_of(inputs: &KernelInputs, ray: &PathRay, hit: &Hit) -> u32 {
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

/// The ray's children of these kinds (bits `CHILD_*`), the reflected one first.
pub fn children_of(inputs: &KernelInputs, ray: &PathRay, hit: &Hit, kinds: u32) -> impl Iterator<Item = PathRay> {
    let scattering = (kinds != 0).then(|| scattering_at(inputs, ray, hit));
    let children = scattering.map(|(surface, next)| {
        [
            (CHILD_REFLECTED, next.reflected, next.reflected_weight),
            (CHILD_TRANSMITTED, next.transmitted, next.transmitted_weight),
        ]
        .map(|(kind, direction, weight)| {
            let throughput = ray.throughput * weight;
            (kinds & kind != 0).then(|| surface.ray_from(direction, hit.triangle_ix, ray, throughput))
        })
    });
    children.into_iter().flatten().flatten()
}
