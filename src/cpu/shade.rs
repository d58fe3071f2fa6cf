//! Shade (the paper's section 2.1): light that leaves each hit, and the next level's rays. Twin of `shade.comp`.

use bytemuck::Zeroable;
use glam::Vec3;
use rayon::prelude::*;

use super::{
    RAYS_PER_TASK,
    bindings::Bindings,
    light::sample_light,
    material::{local_weight, phong, scatter},
    surface::{Surface, surface_at},
};
use crate::layout::{Hit, Material, NO_TRIANGLE, Ray};

/// What there is to shade.
#[derive(Clone, Copy)]
pub struct LitRays<'a> {
    pub rays: &'a [Ray],
    /// One a ray.
    pub hits: &'a [Hit],
    /// `[light * queue_capacity + ray]`, 1: lit.
    pub light_visibility: &'a [u32],
}

/// What comes of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shaded {
    /// One a ray, weighted by its throughput.
    pub ray_radiance: Vec<[f32; 4]>,
    /// Two places a ray.
    pub child_rays: Vec<Ray>,
    /// One a ray: how many of its places are filled.
    pub child_counts: Vec<u32>,
}

impl Shaded {
    /// Room for `n_rays`.
    pub fn resize(&mut self, n_rays: usize) {
        self.ray_radiance.resize(n_rays, [0.0; 4]);
        self.child_rays.resize(2 * n_rays, Ray::zeroed());
        self.child_counts.resize(n_rays, 0);
    }
}

fn local_radiance(
    bindings: &Bindings,
    is_lit: impl Fn(usize) -> bool,
    ray: &Ray,
    surface: &Surface,
    material: &Material,
) -> Vec3 {
    let mut radiance = material.ke + material.ka * bindings.frame.ambient;
    for (light_ix, light) in bindings.lights.iter().enumerate() {
        if !is_lit(light_ix) {
            continue;
        }
        let to_light = sample_light(light, surface.point_world);
        radiance += phong(material, surface.shading, -ray.direction, to_light.direction) * to_light.irradiance;
    }
    radiance * local_weight(material)
}

/// One ray: its radiance, and how many rays it adds to `children`.
fn shade_ray(
    bindings: &Bindings,
    has_children: bool,
    (ray, hit): (&Ray, &Hit),
    is_lit: impl Fn(usize) -> bool,
    children: &mut [Ray],
) -> (Vec3, u32) {
    if hit.triangle_ix == NO_TRIANGLE {
        return (ray.throughput * bindings.frame.background, 0);
    }
    let surface = surface_at(ray, hit, &bindings.triangles[hit.triangle_ix as usize]);
    let material_ix = bindings.triangle_materials[hit.triangle_ix as usize];
    let material = &bindings.materials[material_ix as usize];
    let radiance = ray.throughput * local_radiance(bindings, is_lit, ray, &surface, material);
    let mut n_children = 0;
    if has_children {
        let next = scatter(material, &surface, ray.direction);
        for (direction, weight) in
            [(next.reflected, next.reflected_weight), (next.transmitted, next.transmitted_weight)]
        {
            let throughput = ray.throughput * weight;
            if throughput.cmpgt(Vec3::ZERO).any() {
                children[n_children] = surface.ray_from(direction, hit.triangle_ix, ray, throughput);
                n_children += 1;
            }
        }
    }
    (radiance, n_children as u32)
}

/// Shades every ray that `shaded` has room for; `depth`: their level, 0 for primary ones.
pub fn shade(bindings: &Bindings, depth: u32, lit: LitRays, shaded: &mut Shaded) {
    let has_children = depth + 1 < bindings.frame.max_depth;
    let stride = bindings.frame.queue_capacity as usize;
    shaded
        .ray_radiance
        .par_chunks_mut(RAYS_PER_TASK)
        .zip(shaded.child_rays.par_chunks_mut(2 * RAYS_PER_TASK))
        .zip(shaded.child_counts.par_chunks_mut(RAYS_PER_TASK))
        .enumerate()
        .for_each(|(task, ((radiance, children), counts))| {
            let places = radiance.iter_mut().zip(children.chunks_exact_mut(2)).zip(counts);
            for (ray_ix, ((radiance, children), count)) in (task * RAYS_PER_TASK..).zip(places) {
                let is_lit = |light_ix: usize| lit.light_visibility[light_ix * stride + ray_ix] != 0;
                let ray = (&lit.rays[ray_ix], &lit.hits[ray_ix]);
                let (rgb, n_children) = shade_ray(bindings, has_children, ray, is_lit, children);
                *radiance = rgb.extend(0.0).to_array();
                *count = n_children;
            }
        });
}
