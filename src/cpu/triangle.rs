//! Rays against one triangle: the watertight test, and the surface at a hit. Twin of `triangle.glsl`.

use glam::{Mat4, Vec4, Vec4Swizzles};

use crate::layout::{Hit, Triangle};

/// A ray's shear: maps the ray onto the z axis of a space in which its direction's longest component is z.
#[derive(Clone, Copy, Debug)]
pub struct Shear {
    /// Cyclic, so that winding is kept: the axis after the longest one first, the longest one last.
    pub(super) origin: [f32; 3],
    pub(super) x: f32,
    pub(super) y: f32,
    pub(super) z: f32,
    pub(super) axis: usize,
}

/// A triangle's corners seen from a ray, as columns: the test treats all three alike, at once. Fourth lanes are void.
struct Corners {
    x: Vec4,
    y: Vec4,
    /// Along the ray, in units of the direction's longest component.
    z: Vec4,
}

/// v with component `axis` last.
#[inline(always)]
pub(super) fn axis_last<T: Copy>([x, y, z]: [T; 3], axis: usize) -> [T; 3] {
    match axis {
        0 => [y, z, x],
        1 => [z, x, y],
        _ => [x, y, z],
    }
}

/// The component of largest magnitude; of equal ones the first. With a NaN, the last that may be it.
fn longest_axis(v: [f32; 3]) -> usize {
    let [x, y, z] = v.map(f32::abs);
    if x >= y && x >= z {
        0
    } else if y >= z {
        1
    } else {
        2
    }
}

impl Shear {
    /// The shear of a ray. A direction of zero or with a NaN gives NaNs, which no triangle survives.
    #[inline]
    pub fn of(origin: [f32; 3], direction: [f32; 3]) -> Self {
        let axis = longest_axis(direction);
        let [x, y, z] = axis_last(direction, axis);
        Self { origin: axis_last(origin, axis), x: x / z, y: y / z, z: 1.0 / z, axis }
    }

    #[inline(always)]
    fn corners(&self, triangle: &Triangle) -> Corners {
        let [v0, v1, v2]: [[f32; 4]; 3] = bytemuck::cast(*triangle);
        let columns = Mat4::from_cols(v0.into(), v1.into(), v2.into(), Vec4::ZERO).transpose();
        let [x, y, z] = axis_last([columns.x_axis, columns.y_axis, columns.z_axis], self.axis);
        let z = z - self.origin[2];
        Corners { x: (x - self.origin[0]) - self.x * z, y: (y - self.origin[1]) - self.y * z, z }
    }

    /// t and barycentric weights from edge functions whose sum is det (not 0).
    #[inline(always)]
    fn weighted_hit(&self, edges: Vec4, det: f32, z: Vec4, triangle_ix: u32) -> Hit {
        let inv_det = 1.0 / det;
        let t = (edges.x * z.x + edges.y * z.y + edges.z * z.z) * self.z * inv_det;
        Hit { t, triangle_ix, u: edges.y * inv_det, v: edges.z * inv_det }
    }

    /// Watertight and two-sided (Woop, Benthin, Wald: Watertight Ray/Triangle Intersection, JCGT 2013), edges
    /// included. None also for a triangle without area and for NaN. t may be negative.
    #[inline(always)]
    pub fn intersect_triangle(&self, triangle: &Triangle, triangle_ix: u32) -> Option<Hit> {
        let corners = self.corners(triangle);
        let mut edges = corners.edge_functions();
        if is_outside(edges) {
            return None;
        }
        if edges.cmpeq(Vec4::ZERO).bitmask() & 0b111 != 0 {
            edges = corners.exact_edge_functions(edges);
            if is_outside(edges) {
                return None;
            }
        }
        let det = edges.x + edges.y + edges.z;
        // Not `<=`: a NaN misses.
        if !(det.abs() > 0.0) {
            return None;
        }
        Some(self.weighted_hit(edges, det, corners.z, triangle_ix))
    }

    /// Where the ray meets the triangle's plane, moved to the triangle's edge where that lies outside.
    pub fn clamp_to_triangle(&self, triangle: &Triangle, triangle_ix: u32) -> Hit {
        let corners = self.corners(triangle);
        let edges = corners.edge_functions();
        let det = edges.x + edges.y + edges.z;
        let inside = (if det < 0.0 { -edges } else { edges }).max(Vec4::ZERO);
        let sum = inside.x + inside.y + inside.z;
        if sum > 0.0 {
            self.weighted_hit(inside, sum, corners.z, triangle_ix)
        } else {
            self.weighted_hit(Vec4::ONE, 3.0, corners.z, triangle_ix)
        }
    }
}

impl Corners {
    /// Twice the signed areas that the ray's axis spans with the edges opposite to v0, v1, v2.
    #[inline(always)]
    fn edge_functions(&self) -> Vec4 {
        self.x.zxyw() * self.y.yzxw() - self.y.zxyw() * self.x.yzxw()
    }

    /// The edge functions whose products round to one value, by the exact products. Two products of `f32` and their
    /// difference are exact in `f64`; the kernels have none and add up the products' errors to the same.
    #[cold]
    fn exact_edge_functions(&self, rounded: Vec4) -> Vec4 {
        let exact =
            self.x.zxyw().as_dvec4() * self.y.yzxw().as_dvec4() - self.y.zxyw().as_dvec4() * self.x.yzxw().as_dvec4();
        Vec4::select(rounded.cmpeq(Vec4::ZERO), exact.as_vec4(), rounded)
    }
}

#[inline(always)]
fn is_outside(edges: Vec4) -> bool {
    let (below, above) = (edges.cmplt(Vec4::ZERO).bitmask(), edges.cmpgt(Vec4::ZERO).bitmask());
    below & 0b111 != 0 && above & 0b111 != 0
}
