//! The test of one triangle against sixteen rays, and of sixteen triangles against one ray. It does the operations of
//! `reference/triangle.rs` on columns, so that each ray finds the same hit, bit for bit.

use fearless_simd::{Simd, f32x16, mask32x16, prelude::*, u32x16};

use super::lanes::{LANES, LaneMask};
use crate::{
    layout::{Hit, NO_TRIANGLE, Triangle},
    reference::triangle::{LEAST_EXACT_SUM, Shear, axis_last},
};

/// The shears of sixteen rays as columns: see [`Shear`].
pub struct Shears<S: Simd> {
    /// The axes are permuted as in [`Shear`]: each ray's longest axis is last.
    origin: [f32x16<S>; 3],
    x: f32x16<S>,
    y: f32x16<S>,
    z: f32x16<S>,
    /// For each axis, the rays whose directions are longest along it.
    pub lanes_of_axis: [LaneMask; 3],
}

/// Sixteen hits as columns.
#[derive(Clone, Copy)]
pub struct HitColumns<S: Simd> {
    pub t: f32x16<S>,
    pub triangle_ix: u32x16<S>,
    pub u: f32x16<S>,
    pub v: f32x16<S>,
}

impl<S: Simd> HitColumns<S> {
    /// Returns a miss for each ray, with its t set to `t_max`.
    #[inline(always)]
    pub fn nothing(t_max: f32x16<S>) -> Self {
        let zero = f32x16::splat(t_max.simd, 0.0);
        Self { t: t_max, triangle_ix: u32x16::splat(t_max.simd, NO_TRIANGLE), u: zero, v: zero }
    }

    /// Returns these hits where `mask` is set, and those of `other` elsewhere.
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
    /// Computes the shears, as [`Shear::of`] does for one ray.
    #[inline(always)]
    pub fn of(origin: &[f32x16<S>; 3], direction: &[f32x16<S>; 3]) -> Self {
        let [x, y, z] = [direction[0].abs(), direction[1].abs(), direction[2].abs()];
        let is_x = x.simd_ge(y) & x.simd_ge(z);
        let is_y = !is_x & y.simd_ge(z);
        let [x, y, z] = axes_last(direction, is_x, is_y);
        let (lanes_of_x, lanes_of_y) = (is_x.to_bitmask() as LaneMask, is_y.to_bitmask() as LaneMask);
        Self {
            origin: axes_last(origin, is_x, is_y),
            x: x / z,
            y: y / z,
            z: 1.0 / z,
            lanes_of_axis: [lanes_of_x, lanes_of_y, !(lanes_of_x | lanes_of_y)],
        }
    }

    /// Returns the shear of one ray in all lanes.
    #[inline(always)]
    pub fn splat(simd: S, shear: &Shear) -> Self {
        let [x, y, z] = shear.origin;
        Self {
            origin: [f32x16::splat(simd, x), f32x16::splat(simd, y), f32x16::splat(simd, z)],
            x: f32x16::splat(simd, shear.x),
            y: f32x16::splat(simd, shear.y),
            z: f32x16::splat(simd, shear.z),
            lanes_of_axis: [0, 1, 2].map(|axis| if axis == shear.axis { LaneMask::MAX } else { 0 }),
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

    /// Maps a triangle's corner to the sheared space of each ray. The corner's components `[x, y, z]` are permuted so
    /// that the rays' longest axis is last.
    #[inline(always)]
    fn corner<T: std::ops::Sub<f32x16<S>, Output = f32x16<S>>>(&self, [x, y, z]: [T; 3]) -> [f32x16<S>; 3] {
        let z = z - self.origin[2];
        [(x - self.origin[0]) - self.x * z, (y - self.origin[1]) - self.y * z, z]
    }

    /// Maps one corner of each of sixteen triangles to the sheared space of the ray in the triangle's lane. `corner`:
    /// the corners' coordinates on each axis.
    #[inline(always)]
    fn corners(&self, corner: &[[f32; LANES]; 3], axis: usize) -> [f32x16<S>; 3] {
        // By arithmetic, since the axis of a single ray cannot be predicted.
        let (simd, [x, y, z]) = (self.x.simd, [(axis + 1) % 3, (axis + 2) % 3, axis]);
        self.corner([
            f32x16::load_array_ref(simd, &corner[x]),
            f32x16::load_array_ref(simd, &corner[y]),
            f32x16::load_array_ref(simd, &corner[z]),
        ])
    }

    /// Finds what [`Shear::intersect_triangle`] finds for each ray of `lanes`, whose longest axis is `axis`. Returns
    /// the hits, the lanes in which they are valid, and those of them whose rays come from behind the triangle; or none
    /// if the rounded edge functions already exclude all rays.
    #[inline(always)]
    pub fn intersect_triangle(
        &self,
        triangle: &Triangle,
        triangle_ix: u32,
        axis: usize,
        lanes: LaneMask,
    ) -> Option<(HitColumns<S>, mask32x16<S>, mask32x16<S>)> {
        let corners = [
            self.corner(axis_last(triangle.v0.to_array(), axis)),
            self.corner(axis_last(triangle.v1.to_array(), axis)),
            self.corner(axis_last(triangle.v2.to_array(), axis)),
        ];
        let (simd, lanes) = (self.x.simd, lanes.into());
        self.hits(corners, u32x16::splat(simd, triangle_ix), mask32x16::from_bitmask(simd, lanes))
    }

    /// Finds what [`Shear::intersect_triangle`] finds for the triangle and the ray in each lane. The rays' longest axis
    /// is `axis`. `corners`: the coordinates of each corner on each axis. Returns what
    /// [`Self::intersect_triangle`] returns.
    #[inline(always)]
    pub fn intersect_triangles(
        &self,
        corners: &[[[f32; LANES]; 3]; 3],
        triangle_ixs: u32x16<S>,
        axis: usize,
    ) -> Option<(HitColumns<S>, mask32x16<S>, mask32x16<S>)> {
        let [v0, v1, v2] = corners;
        let corners = [self.corners(v0, axis), self.corners(v1, axis), self.corners(v2, axis)];
        self.hits(corners, triangle_ixs, mask32x16::splat(self.x.simd, true))
    }

    /// Returns the hits of triangles by their sheared corners, those of `lanes` in which they are valid, and those in
    /// which [`Shear::is_back_face`]. Returns none if the rounded edge functions already exclude all hits.
    #[inline(always)]
    fn hits(
        &self,
        [[x0, y0, z0], [x1, y1, z1], [x2, y2, z2]]: [[f32x16<S>; 3]; 3],
        triangle_ix: u32x16<S>,
        lanes: mask32x16<S>,
    ) -> Option<(HitColumns<S>, mask32x16<S>, mask32x16<S>)> {
        let edges = [x2 * y1 - y2 * x1, x0 * y2 - y0 * x2, x1 * y0 - y1 * x0];
        let near = !is_outside(edges) & lanes;
        if near.all_false() {
            return None;
        }
        let errors = [edge_error([x2, y2], [x1, y1]), edge_error([x0, y0], [x2, y2]), edge_error([x1, y1], [x0, y0])];
        let signed = with_exact_signs(edges, errors);
        let hit = near & is_inside(signed);
        let is_back = !(sum_of(signed).simd_lt(0.0) ^ self.z.simd_gt(0.0));
        let edges = exact_edges(edges, errors);
        let inv_det = 1.0 / sum_of(edges);
        let (u, v) = (edges[1] * inv_det, edges[2] * inv_det);
        let t = (z0 + (u * (z1 - z0) + v * (z2 - z0))) * self.z;
        Some((HitColumns { t, triangle_ix, u, v }, hit, is_back))
    }
}

/// Returns the error of the edge function `a.x * b.y - a.y * b.x` that the rounding of its products causes: the value
/// with exact products less the value with rounded products.
#[inline(always)]
fn edge_error<S: Simd>(a: [f32x16<S>; 2], b: [f32x16<S>; 2]) -> f32x16<S> {
    product_error(a[0], b[1]) - product_error(a[1], b[0])
}

/// Returns the exact product less the rounded one.
#[inline(always)]
fn product_error<S: Simd>(a: f32x16<S>, b: f32x16<S>) -> f32x16<S> {
    a.mul_sub_precise(b, a * b)
}

/// Returns the edge functions, each with a relative error of at most 2^-23: see the proof in
/// `reference/triangle.rs`. If their sum is so small that the errors of the products may have underflowed, takes the
/// edge functions of `with_exact_signs` instead.
#[inline(always)]
fn exact_edges<S: Simd>(edges: [f32x16<S>; 3], errors: [f32x16<S>; 3]) -> [f32x16<S>; 3] {
    let exact = [edges[0] + errors[0], edges[1] + errors[1], edges[2] + errors[2]];
    let underflows = sum_of(exact).abs().simd_lt(LEAST_EXACT_SUM);
    if underflows.all_false() {
        return exact;
    }
    let signed = with_exact_signs(edges, errors);
    [
        underflows.select(signed[0], exact[0]),
        underflows.select(signed[1], exact[1]),
        underflows.select(signed[2], exact[2]),
    ]
}

/// Returns the edge functions with exact signs. Where the two products round to the same value, the edge function is
/// the error of the products.
#[inline(always)]
fn with_exact_signs<S: Simd>(edges: [f32x16<S>; 3], errors: [f32x16<S>; 3]) -> [f32x16<S>; 3] {
    [
        edges[0].simd_eq(0.0).select(errors[0], edges[0]),
        edges[1].simd_eq(0.0).select(errors[1], edges[1]),
        edges[2].simd_eq(0.0).select(errors[2], edges[2]),
    ]
}

#[inline(always)]
fn sum_of<S: Simd>(edges: [f32x16<S>; 3]) -> f32x16<S> {
    edges[0] + edges[1] + edges[2]
}

/// Tells from edge functions with exact signs whether the rays go through the triangle or its edges. The result is
/// false also for a triangle without area and for NaN.
#[inline(always)]
fn is_inside<S: Simd>(edges: [f32x16<S>; 3]) -> mask32x16<S> {
    !is_outside(edges) & sum_of(edges).abs().simd_gt(0.0)
}

#[inline(always)]
fn is_outside<S: Simd>(edges: [f32x16<S>; 3]) -> mask32x16<S> {
    let below = edges[0].simd_lt(0.0) | edges[1].simd_lt(0.0) | edges[2].simd_lt(0.0);
    let above = edges[0].simd_gt(0.0) | edges[1].simd_gt(0.0) | edges[2].simd_gt(0.0);
    below & above
}

/// Returns vectors with their components permuted cyclically. The last component is x where `is_x` is set, y where
/// `is_y` is set, and z elsewhere.
#[inline(always)]
fn axes_last<S: Simd>([x, y, z]: &[f32x16<S>; 3], is_x: mask32x16<S>, is_y: mask32x16<S>) -> [f32x16<S>; 3] {
    [is_x.select(*y, is_y.select(*z, *x)), is_x.select(*z, is_y.select(*x, *y)), is_x.select(*x, is_y.select(*y, *z))]
}
