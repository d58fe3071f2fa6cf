//! Surface layers: the albedos and the normals that each pixel's camera rays hit. Twin of `surface_layers.comp`.

use glam::Vec3;
use rayon::prelude::*;

use super::{
    RAYS_PER_TASK, bsdf::hit_albedo, emitters::seen_light, inputs::KernelInputs, maps::shaded_at,
    sample_sums::sum_of_samples,
};
use crate::layout::{Hit, NO_TRIANGLE, PathRay};

/// Writes the sums of the frame's samples: the albedos to the first half of `pixel_layers`, the normals to the second
/// half. `rays`, `hits`: of the camera, `2^samples_log2` for each pixel of the batch.
pub fn surface_layers(
    inputs: &KernelInputs,
    samples_log2: u32,
    (rays, hits): (&[PathRay], &[Hit]),
    pixel_layers: &mut [[f32; 4]],
) {
    let n_samples = 1 << samples_log2;
    let sums_of = |(rays, hits): (&[PathRay], &[Hit])| {
        let surfaces: Vec<_> = rays.iter().zip(hits).map(|(ray, hit)| surface_at_hit(inputs, ray, hit)).collect();
        let sum = |value: fn(&(Vec3, Vec3)) -> Vec3| {
            sum_of_samples(samples_log2, |sample_ix| value(&surfaces[sample_ix as usize]).extend(1.0))
        };
        (rays[0].pixel_ix as usize, [sum(|surface| surface.0), sum(|surface| surface.1)])
    };
    let pixels = rays.par_chunks(n_samples).zip(hits.par_chunks(n_samples));
    let sums: Vec<_> = pixels.with_min_len((RAYS_PER_TASK / n_samples).max(1)).map(sums_of).collect();
    let (albedos, normals) = pixel_layers.split_at_mut(pixel_layers.len() / 2);
    for (pixel_ix, [albedo, normal]) in sums {
        albedos[pixel_ix] = albedo.to_array();
        normals[pixel_ix] = normal.to_array();
    }
}

/// Returns the albedo and the normal of what a camera ray hits.
fn surface_at_hit(inputs: &KernelInputs, ray: &PathRay, hit: &Hit) -> (Vec3, Vec3) {
    if hit.triangle_ix == NO_TRIANGLE || seen_light(inputs, ray.origin, ray.direction, hit.t).t.is_finite() {
        return (Vec3::ZERO, Vec3::ZERO);
    }
    let (surface, material) = shaded_at(inputs, ray, hit);
    let finite = |value: Vec3| if value.is_finite() { value } else { Vec3::ZERO };
    (finite(hit_albedo(&material)), finite(surface.shading))
}
