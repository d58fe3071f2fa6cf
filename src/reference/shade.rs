//! Shade (the paper's section 2.1): the light that leaves each hit towards the viewer. Twin of `shade.comp`.

use glam::Vec3;
use rayon::prelude::*;

use super::{
    RAYS_PER_TASK,
    inputs::KernelInputs,
    light::incident_light,
    maps::{bump_shadowing, shaded_at},
    material::{ambient_share, emitted, local_weight, reflectance_of, transmittance},
    shadow::stride,
    studio::studio_radiance,
    surface::Surface,
};
use crate::layout::{Frame, Hit, LIGHT_LIT, Material, NO_TRIANGLE, PathRay};

/// The rays to shade, with the lights that their hits see.
#[derive(Clone, Copy)]
pub struct LitRays<'a> {
    pub rays: &'a [PathRay],
    /// One for each ray.
    pub hits: &'a [Hit],
    /// The number of the camera's rays, which come first.
    pub n_of_camera: usize,
    /// The visibility of each light at each ray, in the layout that [`shadow`](super::shadow::shadow) writes.
    pub light_visibility: &'a [u32],
}

/// The irradiance of the ambient light on a surface. Between facing up and facing down it is blended by the normal's
/// coordinate along the up axis.
fn ambient_at(frame: &Frame, normal: Vec3) -> Vec3 {
    let height = normal[frame.up_axis as usize];
    // A triangle of a shape that has no normal counts as upright.
    frame.ambient + frame.ambient_tilt * if height.abs() <= 1.0 { height } else { 0.0 }
}

/// The radiance that the surface itself emits and reflects towards the viewer, from the ambient light and all lights
/// that it sees.
fn local_radiance(
    inputs: &KernelInputs,
    is_lit: impl Fn(usize) -> bool,
    ray: &PathRay,
    surface: &Surface,
    material: &Material,
) -> Vec3 {
    let mut radiance = emitted(material);
    radiance += ambient_share(material, surface.shading, -ray.direction) * ambient_at(inputs.frame(), surface.shading);
    for (light_ix, light) in inputs.lights.iter().enumerate() {
        if !is_lit(light_ix) {
            continue;
        }
        let to_light = incident_light(light, surface.point_world);
        let reflectance = reflectance_of(material, surface.shading, -ray.direction, to_light.direction);
        radiance += reflectance * bump_shadowing(surface, to_light.direction) * to_light.irradiance;
    }
    radiance * local_weight(material)
}

/// The radiance that a ray adds to its pixel, its throughput included.
fn radiance_of(
    inputs: &KernelInputs,
    (ray, hit, is_of_camera): (&PathRay, &Hit, bool),
    is_lit: impl Fn(usize) -> bool,
) -> Vec3 {
    if hit.triangle_ix == NO_TRIANGLE {
        let background = inputs.frame().background;
        if is_of_camera {
            return ray.throughput * background;
        }
        return ray.throughput * (background + studio_radiance(inputs.frame(), ray.direction));
    }
    let (surface, material) = shaded_at(inputs, ray, hit);
    let throughput = ray.throughput * transmittance(&material, &surface, hit.t);
    throughput * local_radiance(inputs, is_lit, ray, &surface, &material)
}

/// Writes `ray_radiance`, one for each ray, weighted by the ray's throughput.
pub fn shade(inputs: &KernelInputs, lit: LitRays, ray_radiance: &mut [[f32; 4]]) {
    let stride = stride(inputs, lit.light_visibility);
    ray_radiance.par_chunks_mut(RAYS_PER_TASK).enumerate().for_each(|(task, radiance)| {
        for (ray_ix, radiance) in (task * RAYS_PER_TASK..).zip(radiance) {
            let is_lit = |light_ix: usize| lit.light_visibility[light_ix * stride + ray_ix] == LIGHT_LIT;
            let ray = (&lit.rays[ray_ix], &lit.hits[ray_ix], ray_ix < lit.n_of_camera);
            *radiance = radiance_of(inputs, ray, is_lit).extend(0.0).to_array();
        }
    });
}
