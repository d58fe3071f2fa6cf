//! The point of each of sixteen triangles that is closest to the origin. It does the operations of
//! `reference/point_triangle.rs` on columns, so that the points are the same, bit for bit.

use fearless_simd::{Simd, f32x16, mask32x16, prelude::*};

use super::vec3x16::Vec3x16;

/// The corners of sixteen triangles.
type Corners<S> = [Vec3x16<S>; 3];

/// A point of each triangle: see [`PointOnTriangle`](crate::reference::point_triangle::PointOnTriangle).
#[derive(Clone, Copy)]
pub struct PointColumns<S: Simd> {
    pub squared: f32x16<S>,
    pub u: f32x16<S>,
    pub v: f32x16<S>,
}

impl<S: Simd> PointColumns<S> {
    /// Replaces points by the ones with these weights, where those are closer and in `allowed`.
    #[inline(always)]
    fn take_closer(&mut self, [a, b, c]: Corners<S>, [u, v]: [f32x16<S>; 2], allowed: mask32x16<S>) {
        let point = a * (1.0 - u - v) + b * u + c * v;
        let squared = point.dot(point);
        let is_closer = squared.simd_lt(self.squared) & allowed;
        self.squared = is_closer.select(squared, self.squared);
        self.u = is_closer.select(u, self.u);
        self.v = is_closer.select(v, self.v);
    }
}

/// The place of the origin's foot on the line from `a` along an edge, as a share of the edge. 0 if the edge has no
/// length.
#[inline(always)]
fn share_along<S: Simd>(a: Vec3x16<S>, edge: Vec3x16<S>) -> f32x16<S> {
    let squared = edge.dot(edge);
    squared.simd_gt(0.0).select(-a.dot(edge) / squared, f32x16::splat(squared.simd, 0.0))
}

/// The edge's point that is closest to the origin, as a share of the edge: 0 at `a`, 1 at the other end. NaN stays.
#[inline(always)]
fn share_on<S: Simd>(a: Vec3x16<S>, edge: Vec3x16<S>) -> f32x16<S> {
    let (along, squared) = (-a.dot(edge), edge.dot(edge));
    let [zero, one] = [0.0, 1.0].map(|end| f32x16::splat(along.simd, end));
    along.simd_le(zero).select(zero, along.simd_ge(squared).select(one, along / squared))
}

/// [`closest_on_triangles`] if the edge from `a` to `b` is each triangle's longest one.
#[inline(always)]
fn closest_beside_longest<S: Simd>(corners @ [a, b, c]: Corners<S>) -> PointColumns<S> {
    let (ab, ac) = (b - a, c - a);
    let simd = ab.0[0].simd;
    let (zero, all) = (f32x16::splat(simd, 0.0), mask32x16::splat(simd, true));
    let along_ab = share_along(a, ab);
    let along_bc = share_on(b, c - b);
    let mut best = PointColumns { squared: a.dot(a), u: zero, v: zero };
    best.take_closer(corners, [share_on(a, ab), zero], all);
    best.take_closer(corners, [zero, share_on(a, ac)], all);
    best.take_closer(corners, [1.0 - along_bc, along_bc], all);
    let height_along_ab = -share_along(ac, ab);
    let height = ac - ab * height_along_ab;
    let v = share_along(a + ab * along_ab, height);
    let u = along_ab - v * height_along_ab;
    best.take_closer(corners, [u, v], u.simd_gt(0.0) & v.simd_gt(0.0) & (1.0 - u - v).simd_gt(0.0));
    best
}

/// Returns the point of each triangle that is closest to the origin. The corners' coordinates are below 2^60, or NaN:
/// then the point is nowhere.
#[inline(always)]
pub fn closest_on_triangles<S: Simd>([a, b, c]: Corners<S>) -> PointColumns<S> {
    let [ab, bc, ca] = [b - a, c - b, a - c].map(|edge| edge.dot(edge));
    let from_b = bc.simd_gt(ab) & bc.simd_ge(ca);
    let from_c = !from_b & ca.simd_gt(ab);
    let turned = |[a, b, c]: Corners<S>| Vec3x16::select(from_b, b, Vec3x16::select(from_c, c, a));
    let found = closest_beside_longest([turned([a, b, c]), turned([b, c, a]), turned([c, a, b])]);
    let PointColumns { squared, u, v } = found;
    let rest = 1.0 - u - v;
    let rest = rest.simd_gt(0.0).select(rest, f32x16::splat(rest.simd, 0.0));
    PointColumns { squared, u: from_b.select(rest, from_c.select(v, u)), v: from_b.select(u, from_c.select(rest, v)) }
}
