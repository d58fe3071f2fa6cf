//! Sets of rays from a scene's own hits: what a renderer asks of a tree, from coherent to scattered.

use std::f32::consts::TAU;

use bytemuck::Zeroable;
use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;

use super::stage::Stage;
use crate::{
    accel::kdtree::Traversal,
    cpu::{
        light::sample_light,
        primary_hit::primary_rays,
        surface::{Surface, surface_at},
        trace::trace,
    },
    layout::{Hit, NO_TRIANGLE, Ray, Triangle},
};

/// What the rays of a set are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum RayKind {
    /// The camera's, through pixel centres.
    Primary,
    /// From each primary hit to the light, any hit.
    Shadow,
    /// Reflected at each primary hit.
    Mirror,
    /// From each primary hit into the hemisphere above it, by the cosine.
    Diffuse,
}

impl RayKind {
    /// In the order of falling coherence.
    pub const ALL: [Self; 4] = [Self::Primary, Self::Shadow, Self::Mirror, Self::Diffuse];

    pub fn name(self) -> &'static str {
        match self {
            Self::Primary => "primary",
            Self::Shadow => "shadow",
            Self::Mirror => "mirror",
            Self::Diffuse => "diffuse",
        }
    }

    /// Whether any hit answers such a ray, not the closest alone.
    pub fn is_any_hit(self) -> bool {
        self == Self::Shadow
    }
}

/// Rays of one kind, in the order of the renderer's queue: tile by tile, without gaps. None has a source triangle:
/// those that leave a surface start clear of it.
#[derive(Clone, Debug, PartialEq)]
pub struct RaySet {
    pub kind: RayKind,
    pub rays: Vec<Ray>,
}

/// The four sets, in the order of [`RayKind::ALL`]: `width * height` primary rays, and one ray of each other kind for
/// each of their hits. The same stage gives the same rays.
pub fn ray_sets(stage: &Stage) -> [RaySet; 4] {
    let bindings = stage.bindings();
    let mut primary = vec![Ray::zeroed(); (stage.frame.width * stage.frame.height) as usize];
    primary_rays(&stage.frame, 0, &mut primary);
    let mut hits = vec![Hit::zeroed(); primary.len()];
    trace(&bindings, Traversal::Mask, &primary, &mut hits);

    let triangles = bindings.triangles;
    let shadow = rays_from_hits(triangles, &primary, &hits, |ray, surface| {
        let to_light = sample_light(&stage.light, surface.point_world);
        Ray { t_max: to_light.distance, ..leaving(surface, ray, to_light.direction) }
    });
    let mirror = rays_from_hits(triangles, &primary, &hits, |ray, surface| {
        leaving(surface, ray, mirrored(ray.direction, surface))
    });
    let diffuse = diffuse_rays(triangles, &primary, &hits);
    let mut sets = RayKind::ALL.into_iter().zip([primary, shadow, mirror, diffuse]);
    std::array::from_fn(|_| sets.next().map(|(kind, rays)| RaySet { kind, rays }).expect("as many sets as kinds"))
}

/// One ray for each hit, in their order, into the hemisphere above it, by the cosine.
pub(crate) fn diffuse_rays(triangles: &[Triangle], rays: &[Ray], hits: &[Hit]) -> Vec<Ray> {
    rays_from_hits(triangles, rays, hits, |ray, surface| {
        leaving(surface, ray, cosine_distributed(surface.geometric, uniform_pair(ray.pixel_ix)))
    })
}

/// One ray for each hit, in their order.
fn rays_from_hits(
    triangles: &[Triangle],
    rays: &[Ray],
    hits: &[Hit],
    next: impl Fn(&Ray, &Surface) -> Ray + Sync,
) -> Vec<Ray> {
    let of_hit = |(ray, hit): (&Ray, &Hit)| {
        let triangle = triangles.get(hit.triangle_ix as usize)?;
        Some(next(ray, &surface_at(ray, hit, triangle)))
    };
    rays.par_iter().zip(hits).filter_map(of_hit).collect()
}

fn leaving(surface: &Surface, parent: &Ray, direction: Vec3) -> Ray {
    surface.ray_from(direction, NO_TRIANGLE, parent, Vec3::ONE)
}

/// Reflected at the shading normal, or where that leads into the surface, at the geometric one.
fn mirrored(direction: Vec3, surface: &Surface) -> Vec3 {
    let at = |normal: Vec3| (direction - 2.0 * direction.dot(normal) * normal).normalize();
    let smooth = at(surface.shading);
    if smooth.dot(surface.geometric) > 0.0 { smooth } else { at(surface.geometric) }
}

/// A unit vector about a unit normal with a density of cosine / pi, of two numbers from 0 to 1.
fn cosine_distributed(normal: Vec3, [u, v]: [f32; 2]) -> Vec3 {
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    let (sin_azimuth, cos_azimuth) = (TAU * v).sin_cos();
    let radius = u.sqrt();
    let on_disc = radius * (cos_azimuth * tangent + sin_azimuth * bitangent);
    (on_disc + (1.0 - u).max(0.0).sqrt() * normal).normalize()
}

/// Two numbers from 0 to 1, without 1, by a hash of the pixel (pcg2d; Jarzynski and Olano: Hash Functions for GPU
/// Rendering, JCGT 2020).
fn uniform_pair(pixel_ix: u32) -> [f32; 2] {
    let step = |x: u32| x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    let (mut x, mut y) = (step(pixel_ix), step(0));
    for _ in 0..2 {
        x = x.wrapping_add(y.wrapping_mul(1_664_525));
        y = y.wrapping_add(x.wrapping_mul(1_664_525));
        x ^= x >> 16;
        y ^= y >> 16;
    }
    [x, y].map(|bits| (bits >> 8) as f32 / (1 << 24) as f32)
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::*;

    fn surface(geometric: Vec3, shading: Vec3) -> Surface {
        Surface { point_world: Vec3::ZERO, geometric, shading, clearance: 0.0, from_inside: false }
    }

    #[test]
    fn mirrored_rays_leave_at_the_angle_at_which_they_came() {
        let normal = vec3(0.0, 1.0, 0.0);
        let came = vec3(0.6, -0.8, 0.0);
        assert!((mirrored(came, &surface(normal, normal)) - vec3(0.6, 0.8, 0.0)).length() < 1e-6);
    }

    #[test]
    fn no_mirrored_ray_enters_the_surface() {
        let (geometric, shading) = (Vec3::Y, vec3(0.8, 0.6, 0.0));
        let came = vec3(0.995, -0.0999, 0.0).normalize();
        let at_shading = came - 2.0 * came.dot(shading) * shading;
        assert!(at_shading.y < 0.0, "the example must lead into the surface");
        let found = mirrored(came, &surface(geometric, shading));
        assert!((found - vec3(came.x, -came.y, 0.0)).length() < 1e-6);
    }

    #[test]
    fn hashed_numbers_are_spread_evenly() {
        const N: u32 = 1 << 16;
        let mut cells = [0u32; 64];
        for [u, v] in (0..N).map(uniform_pair) {
            assert!((0.0..1.0).contains(&u) && (0.0..1.0).contains(&v));
            cells[(u * 8.0) as usize * 8 + (v * 8.0) as usize] += 1;
        }
        // 1024 a cell, standard deviation 32.
        assert!(cells.iter().all(|n| n.abs_diff(N / 64) < 160), "{cells:?}");
    }

    /// Of a density of cosine / pi: mean cosine 2/3, mean squared cosine 1/2, no preferred azimuth.
    #[test]
    fn diffuse_directions_have_the_moments_of_the_cosine() {
        const N: u32 = 1 << 16;
        for normal in [Vec3::Z, vec3(0.6, 0.0, -0.8), vec3(-0.48, 0.6, 0.64)] {
            let (mut mean, mut cosine_squared) = (Vec3::ZERO, 0.0);
            for direction in (0..N).map(|pixel| cosine_distributed(normal, uniform_pair(pixel))) {
                let cosine = direction.dot(normal);
                assert!((direction.length() - 1.0).abs() < 1e-6 && cosine > -1e-6);
                mean += direction / N as f32;
                cosine_squared += cosine * cosine / N as f32;
            }
            assert!((mean - 2.0 / 3.0 * normal).length() < 0.01, "{mean}");
            assert!((cosine_squared - 0.5).abs() < 0.01, "{cosine_squared}");
        }
    }
}
