//! Rays of a packet and their hits as structures of arrays, the layout that SIMD instructions load and store.

use glam::Vec3;

use super::lanes::LANES;
use crate::{layout::Hit, reference::search_ray::SearchRay};

/// The rays of a packet.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub struct RaysSoa {
    pub origin: [[f32; LANES]; 3],
    pub direction: [[f32; LANES]; 3],
    pub t_min: [f32; LANES],
    pub t_max: [f32; LANES],
    pub source_triangle: [u32; LANES],
    pub alpha_seed: [u32; LANES],
}

/// The hits of a packet.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub struct HitsSoa {
    pub t: [f32; LANES],
    pub triangle_ix: [u32; LANES],
    pub u: [f32; LANES],
    pub v: [f32; LANES],
}

impl RaysSoa {
    #[inline(always)]
    pub fn set(&mut self, lane: usize, search_ray: &SearchRay) {
        for axis in 0..3 {
            self.origin[axis][lane] = search_ray.origin[axis];
            self.direction[axis][lane] = search_ray.direction[axis];
        }
        self.t_min[lane] = search_ray.t_min;
        self.t_max[lane] = search_ray.t_max;
        self.source_triangle[lane] = search_ray.source_triangle;
        self.alpha_seed[lane] = search_ray.alpha_seed;
    }

    #[inline(always)]
    pub fn direction(&self, lane: usize) -> Vec3 {
        let [x, y, z] = &self.direction;
        Vec3::new(x[lane], y[lane], z[lane])
    }

    #[inline(always)]
    pub fn get(&self, lane: usize) -> SearchRay {
        let [x, y, z] = &self.origin;
        SearchRay {
            origin: Vec3::new(x[lane], y[lane], z[lane]),
            t_min: self.t_min[lane],
            direction: self.direction(lane),
            t_max: self.t_max[lane],
            source_triangle: self.source_triangle[lane],
            alpha_seed: self.alpha_seed[lane],
        }
    }
}

impl HitsSoa {
    #[inline(always)]
    pub fn get(&self, lane: usize) -> Hit {
        Hit { t: self.t[lane], triangle_ix: self.triangle_ix[lane], u: self.u[lane], v: self.v[lane] }
    }
}
