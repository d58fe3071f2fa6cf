//! Auxiliary buffers: what the noise filter `edge` knows of each pixel beside its colour. Twin of `auxiliary.comp`.

use glam::{UVec2, Vec3};

use super::{
    bsdf::{surface_albedo, surface_gloss},
    camera::pixel_ix_of,
    emitters::seen_light,
    inputs::KernelInputs,
    maps::shaded_at,
    material::is_unlit,
    noise::squared_luminance,
    path_camera::path_camera_ray,
    paths::{key_of_path, path_of, pixel_at},
    sampler::random_pair,
    surface::Surface,
};
use crate::layout::{Auxiliary, Batch, Hit, NO_TRIANGLE, PathState};

/// Adds the first hits of the batch's paths to the auxiliary buffers of their pixels. `states`: after bounce 0.
pub fn auxiliary(
    inputs: &KernelInputs,
    batch: &Batch,
    hits: &[Hit],
    states: &[PathState],
    pixel_aux: &mut [Auxiliary],
) {
    let frame = inputs.frame();
    let n_of_frame = 1 << frame.samples_log2;
    let n_earlier = frame.n_samples - n_of_frame;
    for place in 0..batch.n_pixels {
        let pixel = pixel_at(frame, batch, place);
        let aux = &mut pixel_aux[pixel_ix_of(frame, pixel) as usize];
        if n_earlier == 0 {
            *aux = Auxiliary::default();
        }
        for sample_ix in aux.n_samples.saturating_sub(n_earlier).min(n_of_frame)..n_of_frame {
            let path_ix = path_of(frame, place, sample_ix);
            let (hit, seen) = (&hits[path_ix as usize], states[path_ix as usize].radiance);
            let surface = first_surface(inputs, pixel, path_ix, hit);
            add_path(aux, surface, seen);
        }
    }
}

/// What a camera ray hits.
struct FirstSurface {
    surface: Surface,
    albedo: Vec3,
    gloss: f32,
}

/// Returns the surface that a camera ray hits. A lamp in front of the hit ends the path.
fn first_surface(inputs: &KernelInputs, pixel: UVec2, path_ix: u32, hit: &Hit) -> Option<FirstSurface> {
    let key = key_of_path(inputs, path_ix, pixel);
    let ray = path_camera_ray(inputs, pixel, random_pair(key, 0), random_pair(key, 1));
    if hit.triangle_ix == NO_TRIANGLE || seen_light(inputs, ray.origin, ray.direction, hit.t).t.is_finite() {
        return None;
    }
    let (surface, material) = shaded_at(inputs, &ray, hit);
    let albedo = if is_unlit(&material) { Vec3::ZERO } else { surface_albedo(&material) };
    Some(FirstSurface { surface, albedo, gloss: surface_gloss(&material) })
}

/// Adds a path.
fn add_path(aux: &mut Auxiliary, first: Option<FirstSurface>, seen: Vec3) {
    if let Some(FirstSurface { surface, gloss, .. }) = &first {
        aux.n_hits += 1;
        let weight = 1.0 / aux.n_hits as f32;
        aux.position_world += weight * (surface.point_world - aux.position_world);
        aux.normal_world += weight * (surface.shading - aux.normal_world);
        aux.gloss += weight * (gloss - aux.gloss);
    }
    aux.n_samples += 1;
    let weight = 1.0 / aux.n_samples as f32;
    let albedo = first.map_or(Vec3::ZERO, |first| first.albedo);
    aux.albedo += weight * (albedo - aux.albedo);
    aux.seen += weight * (seen - aux.seen);
    aux.seen_squared += weight * (squared_luminance(seen) - aux.seen_squared);
}
