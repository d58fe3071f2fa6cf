//! Features: the first-hit AOVs of each pixel (position, normal, albedo, depth and the indices of the triangle and
//! its material). Twin of `features.comp`.

use super::{inputs::KernelInputs, maps::shaded_at};
use crate::layout::{Feature, Hit, NO_TRIANGLE, PathRay};

/// Writes `pixel_features` of the primary rays' pixels, except the counts `n_rays` and `n_steps`.
pub fn features<'a>(
    inputs: &KernelInputs,
    first_hits: impl Iterator<Item = (&'a PathRay, &'a Hit)>,
    pixel_features: &mut [Feature],
) {
    for (ray, hit) in first_hits {
        let feature = &mut pixel_features[ray.pixel_ix as usize];
        let Feature { n_rays, n_steps, .. } = *feature;
        *feature = Feature { n_rays, n_steps, ..feature_of(inputs, ray, hit) };
    }
}

fn feature_of(inputs: &KernelInputs, ray: &PathRay, hit: &Hit) -> Feature {
    if hit.triangle_ix == NO_TRIANGLE {
        let depth = f32::INFINITY;
        return Feature { triangle_ix: NO_TRIANGLE, material_ix: NO_TRIANGLE, depth, ..Feature::default() };
    }
    let (surface, material) = shaded_at(inputs, ray, hit);
    Feature {
        position_world: surface.point_world,
        triangle_ix: hit.triangle_ix,
        normal_world: surface.shading,
        material_ix: inputs.triangle_materials[hit.triangle_ix as usize],
        albedo: material.kd,
        depth: (surface.point_world - inputs.frame().eye).dot(inputs.frame().forward),
        ..Feature::default()
    }
}
