//! The watertight test of a ray against one triangle. Twin of `search/triangle.glsl`.
//!
//! # Bounds of a hit's error
//!
//! u is 2^-24, o the ray's origin and d its direction. D is the greatest magnitude of a coordinate of any v_i - o,
//! and L that of any v_i - v_j, where v_i are the triangle's corners. Products, sums and differences are rounded to
//! nearest. Divisions are right to 2.5 units in the last place, which is what Vulkan guarantees; the CPU's are
//! better. Terms of u² are left out.
//!
//! **Result.** The triangle has a point Q whose every coordinate is within u (11.5 D + 14 L) of o + t d. The weights
//! that are returned with t are those of Q, except for factors within 8 u of 1. Let c be the cosine between d and the
//! triangle's normal, and t_plane the t at which the ray meets the plane. Then
//! |d| |t - t_plane| <= u ((7 D + 5 L) / c + 13 D + 20 L).
//!
//! The first bound holds for every triangle that is hit, however narrow it is and however flat the ray meets it,
//! since it does not depend on the normal.
//!
//! **Proof.** Let the coordinates be named so that d.z is the longest component. Then the shear S = d.x / d.z is at
//! most 1.
//!
//! 1. *Corners.* A rounded corner has z = v.z - o.z, off by u D, and x = (v.x - o.x) - S z. Of x, the first
//!    difference is off by u D, S z by 2.5 u D for S and by u D for the product, and the last difference by u |x|.
//!    The same is true of y.
//! 2. *Edge functions.* Those of the rounded corners are known to factors within 2 u of 1 (`exact_edges`), with right
//!    signs. Let w_i be their quotients by their sum, without rounding, so w_i >= 0. Let Q be the mean of the corners
//!    with these weights. With exact edge functions the mean of the rounded x would be 0, which is the ray's x. Each
//!    w_i is off by 2 u of itself, so the mean of x is at most 2 u times the mean of |x|. As the rounded x lie on
//!    both sides of 0, no more than 2 L apart, the mean of |x| is at most L. So these weights add 2 u L, and the last
//!    difference of step 1 adds u L in the mean.
//! 3. *Depth.* Let Z be the mean of the rounded z with the weights w_i. The returned weights are off by 8 u of
//!    themselves: 2 for the sum of the edge functions, 5 for its inverse, 1 for the product. Their products with
//!    differences of z, which are at most L, round three times more, so they are off by 11 u L. The sum with the
//!    first z is off by u D, 1 / d.z by 5 u D and the last product by u D. So t d.z differs from Z by
//!    e <= u (7 D + 11 L).
//! 4. *Sum.* Along z, o + t d differs from Q by e and by the u D of step 1. Along x, it differs by S e, by the
//!    4.5 u D of step 1 and by the 3 u L of step 2: by u (11.5 D + 14 L) in all. The terms without e are a vector of
//!    at most u (7 D + 5 L). It leads from Q, in the plane, to a point of the ray whose distance from the plane is c
//!    times its distance along the ray from t_plane. The terms with e move that point along the ray, by at most
//!    e |d| / |d.z|, and |d| / |d.z| is at most the root of 3.
//!
//! **Underflow.** Edge functions whose sum is below 2^-90 are used as rounded. They belong to triangles that seem
//! less than 3e-14 wide. Then t is between the corners' depths, but anywhere along a needle. In larger sums,
//! underflow is below 2^-32 of the sum.

use std::hint::select_unpredictable;

use glam::{Mat4, Vec4, Vec4Swizzles};

use crate::layout::{Hit, Triangle};

/// A ray's shear, which maps the ray onto the z axis of a space in which its direction's longest component is z.
#[derive(Clone, Copy, Debug)]
pub struct Shear {
    /// The ray's origin with its components permuted cyclically, so that winding is kept. The component on `axis` is
    /// last.
    pub(crate) origin: [f32; 3],
    /// The direction's x in the permuted order, divided by the longest component.
    pub(crate) x: f32,
    /// The direction's y in the permuted order, divided by the longest component.
    pub(crate) y: f32,
    /// The inverse of the longest component.
    pub(crate) z: f32,
    /// The axis of the direction's longest component.
    pub(crate) axis: usize,
}

/// A triangle's corners as seen from a ray, as a structure of arrays: the test treats all three at once. The fourth
/// lanes are unused.
struct Corners {
    x: Vec4,
    y: Vec4,
    /// Offsets from the ray's origin along `Shear::axis` (world units). Times `Shear::z`, they are t.
    z: Vec4,
}

/// Returns v with component `axis` last. The components are permuted cyclically.
#[inline(always)]
pub(crate) fn axis_last<T: Copy>([x, y, z]: [T; 3], axis: usize) -> [T; 3] {
    match axis {
        0 => [y, z, x],
        1 => [z, x, y],
        _ => [x, y, z],
    }
}

/// Does what [`axis_last`] does, for an axis that branches would mispredict.
#[inline(always)]
fn any_axis_last([x, y, z]: [f32; 3], axis: usize) -> [f32; 3] {
    let last = |of_x, of_y, of_z| select_unpredictable(axis == 0, of_x, select_unpredictable(axis == 1, of_y, of_z));
    [last(y, z, x), last(z, x, y), last(x, y, z)]
}

/// Returns the axis of the component of largest magnitude, the first one of equals. Comparisons with a NaN fail, so
/// with a NaN it can be a later axis.
pub fn longest_axis(v: [f32; 3]) -> usize {
    let [x, y, z] = v.map(f32::abs);
    // Nothing predicts the axes of scattered rays, so there are no branches.
    select_unpredictable((x >= y) & (x >= z), 0, select_unpredictable(y >= z, 1, 2))
}

impl Shear {
    /// The shear of a ray. A direction that is zero or has a NaN gives NaNs, with which every triangle is missed.
    #[inline]
    pub fn of(origin: [f32; 3], direction: [f32; 3]) -> Self {
        let axis = longest_axis(direction);
        let [x, y, z] = any_axis_last(direction, axis);
        Self { origin: any_axis_last(origin, axis), x: x / z, y: y / z, z: 1.0 / z, axis }
    }

    /// Returns the triangle's corners as seen from the ray.
    #[inline(always)]
    fn corners(&self, triangle: &Triangle) -> Corners {
        let [v0, v1, v2]: [[f32; 4]; 3] = bytemuck::cast(*triangle);
        let columns = Mat4::from_cols(v0.into(), v1.into(), v2.into(), Vec4::ZERO).transpose();
        let [x, y, z] = axis_last([columns.x_axis, columns.y_axis, columns.z_axis], self.axis);
        let z = z - self.origin[2];
        Corners { x: (x - self.origin[0]) - self.x * z, y: (y - self.origin[1]) - self.y * z, z }
    }

    /// Returns t and barycentric weights from edge functions whose sum is not 0. The module's documentation proves
    /// bounds of their errors.
    #[inline(always)]
    fn weighted_hit(&self, edges: Vec4, z: Vec4, triangle_ix: u32) -> Hit {
        let inv_det = 1.0 / sum_of(edges);
        let (u, v) = (edges.y * inv_det, edges.z * inv_det);
        let t = (z.x + (u * (z.y - z.x) + v * (z.z - z.x))) * self.z;
        Hit { t, triangle_ix, u, v }
    }

    /// Tests a triangle. The test is watertight, two-sided and includes edges (Woop, Benthin, Wald: Watertight
    /// Ray/Triangle Intersection, JCGT 2013). Returns `None` also for a triangle without area and for NaN. The hit's
    /// t may be negative.
    #[inline(always)]
    pub fn intersect_triangle(&self, triangle: &Triangle, triangle_ix: u32) -> Option<Hit> {
        let corners = self.corners(triangle);
        let edges = corners.edge_functions();
        if is_outside(edges) {
            return None;
        }
        let errors = corners.edge_errors();
        is_inside(with_exact_signs(edges, errors))
            .then(|| self.weighted_hit(exact_edges(edges, errors), corners.z, triangle_ix))
    }

    /// Returns whether a ray that hits a triangle comes from behind it: from the side from which its corners turn
    /// clockwise. The edge functions have exact signs, so the answer is right for needles, too.
    pub fn is_back_face(&self, triangle: &Triangle) -> bool {
        let corners = self.corners(triangle);
        (sum_of(with_exact_signs(corners.edge_functions(), corners.edge_errors())) < 0.0) == (self.z > 0.0)
    }

    /// Returns the point at which the ray meets the triangle's plane, moved to the triangle's edge if it is outside.
    pub fn clamp_to_triangle(&self, triangle: &Triangle, triangle_ix: u32) -> Hit {
        let corners = self.corners(triangle);
        let edges = exact_edges(corners.edge_functions(), corners.edge_errors());
        let inside = (if sum_of(edges) < 0.0 { -edges } else { edges }).max(Vec4::ZERO);
        let inside = if sum_of(inside) > 0.0 { inside } else { Vec4::ONE };
        self.weighted_hit(inside, corners.z, triangle_ix)
    }
}

impl Corners {
    /// Returns the edge functions: in the xy plane, twice the signed areas of the triangles between the ray, which is
    /// at (0, 0), and the edges opposite to v0, v1, v2.
    #[inline(always)]
    fn edge_functions(&self) -> Vec4 {
        self.x.zxyw() * self.y.yzxw() - self.y.zxyw() * self.x.yzxw()
    }

    /// Returns the rounding errors of the products in the edge functions.
    #[inline(always)]
    fn edge_errors(&self) -> Vec4 {
        product_errors(self.x.zxyw(), self.y.yzxw()) - product_errors(self.y.zxyw(), self.x.yzxw())
    }
}

/// Returns the rounding errors of products. A product of two `f32` is exact in `f64`. The kernels have no `f64`, and
/// compute the same errors by Dekker's method or a fused `fma`.
#[inline(always)]
fn product_errors(a: Vec4, b: Vec4) -> Vec4 {
    (a.as_dvec4() * b.as_dvec4() - (a * b).as_dvec4()).as_vec4()
}

/// If the sum of the edge functions is smaller than this, 2^-90, the errors of their products may underflow.
pub(crate) const LEAST_EXACT_SUM: f32 = f32::from_bits((127 - 90) << 23);

/// Returns the edge functions, each right to 2^-23 of itself.
#[inline(always)]
fn exact_edges(edges: Vec4, errors: Vec4) -> Vec4 {
    let exact = edges + errors;
    if sum_of(exact).abs() < LEAST_EXACT_SUM { with_exact_signs(edges, errors) } else { exact }
}

/// Returns the edge functions with right signs. If the two products round to the same value, the edge function is
/// the difference of their errors.
#[inline(always)]
fn with_exact_signs(edges: Vec4, errors: Vec4) -> Vec4 {
    Vec4::select(edges.cmpeq(Vec4::ZERO), errors, edges)
}

#[inline(always)]
fn sum_of(edges: Vec4) -> f32 {
    edges.x + edges.y + edges.z
}

/// Returns whether edge functions of both signs occur: the ray passes outside of the triangle.
#[inline(always)]
fn is_outside(edges: Vec4) -> bool {
    let (below, above) = (edges.cmplt(Vec4::ZERO).bitmask(), edges.cmpgt(Vec4::ZERO).bitmask());
    below & 0b111 != 0 && above & 0b111 != 0
}

/// Returns whether the ray goes through the triangle or its edges, by edge functions with exact signs. Returns false
/// also for a triangle without area and for NaN.
#[inline(always)]
fn is_inside(edges: Vec4) -> bool {
    !is_outside(edges) && sum_of(edges).abs() > 0.0
}
