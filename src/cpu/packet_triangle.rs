//! A triangle against sixteen rays: the operations of `triangle.rs` on columns, so that each ray finds the same, bit for
//! bit.

use fearless_simd::{Simd, f32x16, mask32x16, prelude::*, u32x16};

use super::{
    packet::{LANES, Lanes},
    triangle::{Shear, axis_last},
};
use crate::layout::{Hit, NO_TRIANGLE, Triangle};

/// The shears of sixteen rays.
pub struct Shears<S: Simd> {
    /// As `Shear` has it: each ray's longest axis last.
    origin: [f32x16<S>; 3],
    x: f32x16<S>,
    y: f32x16<S>,
    z: f32x16<S>,
    /// The rays whose longest axis it is.
    pub lanes_of_axis: [Lanes; 3],
}

/// Sixteen hits.
#[derive(Clone, Copy)]
pub struct Found<S: Simd> {
    pub t: f32x16<S>,
    pub triangle_ix: u32x16<S>,
    pub u: f32x16<S>,
    pub v: f32x16<S>,
}

impl<S: Simd> Found<S> {
    /// Misses.
    #[inline(always)]
    pub fn nothing(t_max: f32x16<S>) -> Self {
        let zero = f32x16::splat(t_max.simd, 0.0);
        Self { t: t_max, triangle_ix: u32x16::splat(t_max.simd, NO_TRIANGLE), u: zero, v: zero }
    }

    /// These where `mask` is set, others elsewhere.
    #[inline(always)]
    pub fn or(self, other: Self, mask: mask32x16<S>) -> Self {
        Self {
            t: mask.select(self.t, other.t),
            triangle_ix: mask.select(self.triangle_ix, other.triangle_ix),
            u: mask.select(self.u, other.u),
            v: mask.select(self.v, other.v),
        }
    }

    #[inline(always)]
    pub fn is_hit(&self) -> mask32x16<S> {
        self.triangle_ix.simd_ne(NO_TRIANGLE)
    }

    #[inline(always)]
    pub fn of_lane(&self, lane: usize) -> Hit {
        Hit {
            t: self.t.as_array()[lane],
            triangle_ix: self.triangle_ix.as_array()[lane],
            u: self.u.as_array()[lane],
            v: self.v.as_array()[lane],
        }
    }

    #[inline(always)]
    pub fn set_lane(&mut self, lane: usize, hit: &Hit) {
        self.t.as_mut_array()[lane] = hit.t;
        self.triangle_ix.as_mut_array()[lane] = hit.triangle_ix;
        self.u.as_mut_array()[lane] = hit.u;
        self.v.as_mut_array()[lane] = hit.v;
    }
}

impl<S: Simd> Shears<S> {
    /// As `Shear::of`.
    #[inline(always)]
    pub fn of(origin: &[f32x16<S>; 3], direction: &[f32x16<S>; 3]) -> Self {
        let [x, y, z] = [direction[0].abs(), direction[1].abs(), direction[2].abs()];
        let is_x = x.simd_ge(y) & x.simd_ge(z);
        let is_y = !is_x & y.simd_ge(z);
        let [x, y, z] = axes_last(direction, is_x, is_y);
        let (lanes_of_x, lanes_of_y) = (is_x.to_bitmask() as Lanes, is_y.to_bitmask() as Lanes);
        Self {
            origin: axes_last(origin, is_x, is_y),
            x: x / z,
            y: y / z,
            z: 1.0 / z,
            lanes_of_axis: [lanes_of_x, lanes_of_y, !(lanes_of_x | lanes_of_y)],
        }
    }

    #[inline(always)]
    pub fn of_lane(&self, lane: usize) -> Shear {
        let (x, y, z) = (self.x.as_array()[lane], self.y.as_array()[lane], self.z.as_array()[lane]);
        let axis = (0..3).position(|axis| self.lanes_of_axis[axis] >> lane & 1 == 1).unwrap_or(2);
        let origin =
            [self.origin[0].as_array()[lane], self.origin[1].as_array()[lane], self.origin[2].as_array()[lane]];
        Shear { origin, x, y, z, axis }
    }

    /// A corner, the rays' longest axis last, as each ray sees it.
    #[inline(always)]
    fn corner(&self, [x, y, z]: [f32; 3]) -> [f32x16<S>; 3] {
        let z = z - self.origin[2];
        [(x - self.origin[0]) - self.x * z, (y - self.origin[1]) - self.y * z, z]
    }

    /// As `Shear::intersect_triangle`, of `lanes`, whose longest axis is `axis`: hits, and which of them are hits; none where no
    /// ray comes near.
    #[inline(always)]
    pub fn intersect_triangle(
        &self,
        triangle: &Triangle,
        triangle_ix: u32,
        axis: usize,
        lanes: Lanes,
    ) -> Option<(Found<S>, mask32x16<S>)> {
        let simd = self.x.simd;
        let [x0, y0, z0] = self.corner(axis_last(triangle.v0.to_array(), axis));
        let [x1, y1, z1] = self.corner(axis_last(triangle.v1.to_array(), axis));
        let [x2, y2, z2] = self.corner(axis_last(triangle.v2.to_array(), axis));
        let edges = [x2 * y1 - y2 * x1, x0 * y2 - y0 * x2, x1 * y0 - y1 * x0];
        let inside = !is_outside(edges) & mask32x16::from_bitmask(simd, lanes.into());
        if inside.all_false() {
            return None;
        }
        let det = edges[0] + edges[1] + edges[2];
        // Not `<=`: a NaN misses.
        let mut hit = inside & det.abs().simd_gt(0.0);
        let inv_det = 1.0 / det;
        let t = (edges[0] * z0 + edges[1] * z1 + edges[2] * z2) * self.z * inv_det;
        let mut found =
            Found { t, triangle_ix: u32x16::splat(simd, triangle_ix), u: edges[1] * inv_det, v: edges[2] * inv_det };
        let touches = edges[0].simd_eq(0.0) | edges[1].simd_eq(0.0) | edges[2].simd_eq(0.0);
        let at_edge = (inside & touches).to_bitmask() as Lanes;
        if at_edge != 0 {
            self.intersect_exactly(triangle, triangle_ix, at_edge, &mut found, &mut hit);
        }
        Some((found, hit))
    }

    /// The rays at an edge, one by one.
    #[cold]
    fn intersect_exactly(
        &self,
        triangle: &Triangle,
        triangle_ix: u32,
        lanes: Lanes,
        found: &mut Found<S>,
        hit: &mut mask32x16<S>,
    ) {
        for lane in (0..LANES).filter(|lane| lanes >> lane & 1 == 1) {
            let exact = self.of_lane(lane).intersect_triangle(triangle, triangle_ix);
            hit.set(lane, exact.is_some());
            if let Some(exact) = exact {
                found.set_lane(lane, &exact);
            }
        }
    }
}

#[inline(always)]
fn is_outside<S: Simd>(edges: [f32x16<S>; 3]) -> mask32x16<S> {
    let below = edges[0].simd_lt(0.0) | edges[1].simd_lt(0.0) | edges[2].simd_lt(0.0);
    let above = edges[0].simd_gt(0.0) | edges[1].simd_gt(0.0) | edges[2].simd_gt(0.0);
    below & above
}

/// Vectors with a component last: x, y or else z.
#[inline(always)]
fn axes_last<S: Simd>([x, y, z]: &[f32x16<S>; 3], is_x: mask32x16<S>, is_y: mask32x16<S>) -> [f32x16<S>; 3] {
    [is_x.select(*y, is_y.select(*z, *x)), is_x.select(*z, is_y.select(*x, *y)), is_x.select(*x, is_y.select(*y, *z))]
}
