//! Sixteen vectors together, as a column for each axis. The operations are those of [`glam::Vec3`], bit for bit.

use std::{
    array::from_fn,
    ops::{Add, Div, Mul, Neg, Sub},
};

use fearless_simd::{Simd, f32x16, mask32x16, prelude::*};

use super::lanes::LANES;

/// Sixteen vectors in memory.
pub type Vec3sSoa = [[f32; LANES]; 3];

/// Sixteen vectors as columns.
#[derive(Clone, Copy)]
pub struct Vec3x16<S: Simd>(pub [f32x16<S>; 3]);

/// Returns the smaller one of two numbers; `b` if one is NaN.
#[inline(always)]
pub fn lesser<S: Simd>(a: f32x16<S>, b: f32x16<S>) -> f32x16<S> {
    a.simd_lt(b).select(a, b)
}

/// Returns the larger one of two numbers; `b` if one is NaN.
#[inline(always)]
pub fn greater<S: Simd>(a: f32x16<S>, b: f32x16<S>) -> f32x16<S> {
    a.simd_gt(b).select(a, b)
}

impl<S: Simd> Vec3x16<S> {
    #[inline(always)]
    pub fn load(simd: S, [x, y, z]: &Vec3sSoa) -> Self {
        Self([f32x16::load_array_ref(simd, x), f32x16::load_array_ref(simd, y), f32x16::load_array_ref(simd, z)])
    }

    #[inline(always)]
    pub fn splat(simd: S, v: glam::Vec3) -> Self {
        Self([f32x16::splat(simd, v.x), f32x16::splat(simd, v.y), f32x16::splat(simd, v.z)])
    }

    #[inline(always)]
    pub fn to_arrays(self) -> Vec3sSoa {
        let [x, y, z] = self.0;
        [x.to_array(), y.to_array(), z.to_array()]
    }

    #[inline(always)]
    pub fn dot(self, other: Self) -> f32x16<S> {
        let ([ax, ay, az], [bx, by, bz]) = (self.0, other.0);
        ax * bx + ay * by + az * bz
    }

    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        let ([ax, ay, az], [bx, by, bz]) = (self.0, other.0);
        Self([ay * bz - by * az, az * bx - bz * ax, ax * by - bx * ay])
    }

    #[inline(always)]
    pub fn normalize(self) -> Self {
        self * (1.0 / self.dot(self).sqrt())
    }

    #[inline(always)]
    pub fn abs(self) -> Self {
        let [x, y, z] = self.0;
        Self([x.abs(), y.abs(), z.abs()])
    }

    #[inline(always)]
    pub fn min(self, most: f32x16<S>) -> Self {
        let [x, y, z] = self.0;
        Self([lesser(x, most), lesser(y, most), lesser(z, most)])
    }

    #[inline(always)]
    pub fn max(self, least: f32x16<S>) -> Self {
        let [x, y, z] = self.0;
        Self([greater(x, least), greater(y, least), greater(z, least)])
    }

    #[inline(always)]
    pub fn max_element(self) -> f32x16<S> {
        let [x, y, z] = self.0;
        greater(x, greater(y, z))
    }

    /// Returns the components' products.
    #[inline(always)]
    pub fn times(self, other: Self) -> Self {
        let ([ax, ay, az], [bx, by, bz]) = (self.0, other.0);
        Self([ax * bx, ay * by, az * bz])
    }

    /// Tells which vectors have a component above 0.
    #[inline(always)]
    pub fn any_positive(self) -> mask32x16<S> {
        let [x, y, z] = self.0;
        x.simd_gt(0.0) | y.simd_gt(0.0) | z.simd_gt(0.0)
    }

    /// Tells of which vectors all components are below a bound.
    #[inline(always)]
    pub fn all_below(self, bound: f32) -> mask32x16<S> {
        let [x, y, z] = self.0;
        x.simd_lt(bound) & y.simd_lt(bound) & z.simd_lt(bound)
    }

    #[inline(always)]
    pub fn select(mask: mask32x16<S>, a: Self, b: Self) -> Self {
        let ([ax, ay, az], [bx, by, bz]) = (a.0, b.0);
        Self([mask.select(ax, bx), mask.select(ay, by), mask.select(az, bz)])
    }
}

impl<S: Simd> Add for Vec3x16<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let ([ax, ay, az], [bx, by, bz]) = (self.0, other.0);
        Self([ax + bx, ay + by, az + bz])
    }
}

impl<S: Simd> Sub for Vec3x16<S> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        let ([ax, ay, az], [bx, by, bz]) = (self.0, other.0);
        Self([ax - bx, ay - by, az - bz])
    }
}

impl<S: Simd> Mul<f32x16<S>> for Vec3x16<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: f32x16<S>) -> Self {
        let [x, y, z] = self.0;
        Self([x * factor, y * factor, z * factor])
    }
}

impl<S: Simd> Div<f32x16<S>> for Vec3x16<S> {
    type Output = Self;

    #[inline(always)]
    fn div(self, divisor: f32x16<S>) -> Self {
        let [x, y, z] = self.0;
        Self([x / divisor, y / divisor, z / divisor])
    }
}

impl<S: Simd> Neg for Vec3x16<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        let [x, y, z] = self.0;
        Self([-x, -y, -z])
    }
}

/// Stores one vector.
#[inline(always)]
pub fn set(vectors: &mut Vec3sSoa, lane: usize, v: glam::Vec3) {
    let [x, y, z] = vectors;
    (x[lane], y[lane], z[lane]) = (v.x, v.y, v.z);
}

/// Returns one vector.
#[inline(always)]
pub fn get(vectors: &Vec3sSoa, lane: usize) -> glam::Vec3 {
    from_fn(|axis| vectors[axis][lane]).into()
}
