//! Secondary rays, which start at the hits of other rays.

use std::f32::consts::TAU;

use glam::Vec3;
use rayon::prelude::*;

use crate::{
    layout::{Hit, NO_TRIANGLE, PathRay, Triangle},
    reference::surface::{Surface, surface_at},
};

/// Returns one ray for each hit, in the order of the hits, with a pseudorandom direction in the hemisphere above the
/// hit. The pdf of directions is proportional to the cosine. Misses give no ray.
pub fn diffuse_rays(triangle_at: impl Fn(u32) -> Triangle + Sync, rays: &[PathRay], hits: &[Hit]) -> Vec<PathRay> {
    rays_from_hits(triangle_at, rays, hits, |ray, surface| {
        leaving(surface, ray, cosine_distributed(surface.geometric, uniform_pair(ray.pixel_ix)))
    })
}

/// Returns the ray that `next` makes from each hit, in the order of the hits. Misses give no ray.
pub fn rays_from_hits(
    triangle_at: impl Fn(u32) -> Triangle + Sync,
    rays: &[PathRay],
    hits: &[Hit],
    next: impl Fn(&PathRay, &Surface) -> PathRay + Sync,
) -> Vec<PathRay> {
    let of_hit = |(ray, hit): (&PathRay, &Hit)| {
        let is_hit = hit.triangle_ix != NO_TRIANGLE;
        is_hit.then(|| next(ray, &surface_at(ray, hit, &triangle_at(hit.triangle_ix))))
    };
    rays.par_iter().zip(hits).filter_map(of_hit).collect()
}

/// Returns the ray that leaves a surface in a direction, with the whole throughput of its parent.
pub fn leaving(surface: &Surface, parent: &PathRay, direction: Vec3) -> PathRay {
    surface.ray_from(direction, NO_TRIANGLE, parent, Vec3::ONE)
}

/// Maps two uniform numbers from 0 to 1 to a unit vector around a unit normal, with a pdf of cosine / pi.
fn cosine_distributed(normal: Vec3, [u, v]: [f32; 2]) -> Vec3 {
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    let (sin_azimuth, cos_azimuth) = (TAU * v).sin_cos();
    let radius = u.sqrt();
    let on_disc = radius * (cos_azimuth * tangent + sin_azimuth * bitangent);
    (on_disc + (1.0 - u).max(0.0).sqrt() * normal).normalize()
}

/// Returns two numbers from 0 to 1, 1 excluded, from a hash of the pixel (pcg2d; Jarzynski and Olano: Hash Functions
/// for GPU Rendering, JCGT 2020).
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

    #[test]
    fn hashed_numbers_are_spread_evenly() {
        const N: u32 = 1 << 16;
        let mut cells = [0u32; 64];
        for [u, v] in (0..N).map(uniform_pair) {
            assert!((0.0..1.0).contains(&u) && (0.0..1.0).contains(&v));
            cells[(u * 8.0) as usize * 8 + (v * 8.0) as usize] += 1;
        }
        // Each cell has 1024 on average, with a standard deviation of 32.
        assert!(cells.iter().all(|n| n.abs_diff(N / 64) < 160), "{cells:?}");
    }

    /// For a pdf of cosine / pi, the mean cosine is 2/3, the mean squared cosine is 1/2, and no azimuth is
    /// preferred.
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
