//! Pixel AOVs: the first-hit AOVs of each pixel (position, normal, albedo, depth and the indices of the triangle and
//! its material). Twin of `pixel_aovs.comp`.

use super::{inputs::KernelInputs, maps::shaded_at};
use crate::layout::{Hit, NO_TRIANGLE, PathRay, PixelAovs};

/// Writes `pixel_aovs` of the primary rays' pixels, except the counts `n_rays` and `n_steps`.
pub fn pixel_aovs<'a>(
    inputs: &KernelInputs,
    first_hits: impl Iterator<Item = (&'a PathRay, &'a Hit)>,
    pixel_aovs: &mut [PixelAovs],
) {
    for (ray, hit) in first_hits {
        let aovs = &mut pixel_aovs[ray.pixel_ix as usize];
        let PixelAovs { n_rays, n_steps, .. } = *aovs;
        *aovs = PixelAovs { n_rays, n_steps, ..aovs_of(inputs, ray, hit) };
    }
}

fn aovs_of(inputs: &KernelInputs, ray: &PathRay, hit: &Hit) -> PixelAovs {
    if hit.triangle_ix == NO_TRIANGLE {
        let depth = f32::INFINITY;
        return PixelAovs { triangle_ix: NO_TRIANGLE, material_ix: NO_TRIANGLE, depth, ..PixelAovs::default() };
    }
    let (surface, material) = shaded_at(inputs, ray, hit);
    PixelAovs {
        position_world: surface.point_world,
        triangle_ix: hit.triangle_ix,
        normal_world: surface.shading,
        material_ix: inputs.material_ix_of(hit.triangle_ix),
        albedo: material.kd,
        depth: (surface.point_world - inputs.frame().eye).dot(inputs.frame().forward),
        ..PixelAovs::default()
    }
}
