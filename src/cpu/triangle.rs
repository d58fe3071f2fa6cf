//! Rays against one triangle: the watertight test, and the surface at a hit. Twin of `triangle.glsl`.

use crate::layout::{Hit, Triangle};

/// A ray's shear: maps the ray onto the z axis of a space in which its direction's longest component is z.
#[derive(Clone, Copy, Debug)]
pub struct Shear {
    /// The ray's origin in the order of `axes`.
    origin: [f32; 3],
    x: f32,
    y: f32,
    z: f32,
    /// World axes that become x, y and z; cyclic, so that winding is kept.
    axes: [usize; 3],
}

/// The component of largest magnitude; of equal ones the first. NaN loses against nothing: z.
pub fn longest_axis(v: [f32; 3]) -> usize {
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
        let axes = match longest_axis(direction) {
            0 => [1, 2, 0],
            1 => [2, 0, 1],
            _ => [0, 1, 2],
        };
        let d = axes.map(|axis| direction[axis]);
        Self { origin: axes.map(|axis| origin[axis]), x: d[0] / d[2], y: d[1] / d[2], z: 1.0 / d[2], axes }
    }

    /// A corner seen from the ray: xy across it, z along it in units of the direction's longest component.
    #[inline(always)]
    fn sheared(&self, corner: &[f32; 4]) -> [f32; 3] {
        // `& 3` says to the compiler that a corner has a component of this index.
        let along = |i: usize| corner[self.axes[i] & 3] - self.origin[i];
        let p = [along(0), along(1), along(2)];
        [p[0] - self.x * p[2], p[1] - self.y * p[2], p[2]]
    }

    #[inline(always)]
    fn corners(&self, triangle: &Triangle) -> [[f32; 3]; 3] {
        let [v0, v1, v2]: &[[f32; 4]; 3] = bytemuck::cast_ref(triangle);
        [self.sheared(v0), self.sheared(v1), self.sheared(v2)]
    }

    /// t and barycentric weights from edge functions whose sum is det (not 0).
    #[inline(always)]
    fn weighted_hit(&self, edges: [f32; 3], det: f32, z: [f32; 3], triangle_ix: u32) -> Hit {
        let inv_det = 1.0 / det;
        let t = (edges[0] * z[0] + edges[1] * z[1] + edges[2] * z[2]) * self.z * inv_det;
        Hit { t, triangle_ix, u: edges[1] * inv_det, v: edges[2] * inv_det }
    }

    /// Watertight and two-sided (Woop, Benthin, Wald: Watertight Ray/Triangle Intersection, JCGT 2013), edges
    /// included. None also for a triangle without area and for NaN. t may be negative.
    #[inline(always)]
    pub fn intersect_triangle(&self, triangle: &Triangle, triangle_ix: u32) -> Option<Hit> {
        let [a, b, c] = self.corners(triangle);
        let mut edges = edge_functions(a, b, c);
        if is_outside(edges) {
            return None;
        }
        if edges.contains(&0.0) {
            edges = [exact_edge(c, b, edges[0]), exact_edge(a, c, edges[1]), exact_edge(b, a, edges[2])];
            if is_outside(edges) {
                return None;
            }
        }
        let det = edges[0] + edges[1] + edges[2];
        // Not `<=`: a NaN misses.
        if !(det.abs() > 0.0) {
            return None;
        }
        Some(self.weighted_hit(edges, det, [a[2], b[2], c[2]], triangle_ix))
    }

    /// Where the ray meets the triangle's plane, moved to the triangle's edge where that lies outside.
    pub fn clamp_to_triangle(&self, triangle: &Triangle, triangle_ix: u32) -> Hit {
        let [a, b, c] = self.corners(triangle);
        let z = [a[2], b[2], c[2]];
        let edges = edge_functions(a, b, c);
        let det = edges[0] + edges[1] + edges[2];
        let inside = edges.map(|e| (if det < 0.0 { -e } else { e }).max(0.0));
        let sum = inside[0] + inside[1] + inside[2];
        if sum > 0.0 {
            self.weighted_hit(inside, sum, z, triangle_ix)
        } else {
            self.weighted_hit([1.0; 3], 3.0, z, triangle_ix)
        }
    }
}

/// Twice the signed areas that the ray's axis spans with the edges opposite to v0, v1, v2.
#[inline(always)]
fn edge_functions(a: [f32; 3], b: [f32; 3], c: [f32; 3]) -> [f32; 3] {
    [c[0] * b[1] - c[1] * b[0], a[0] * c[1] - a[1] * c[0], b[0] * a[1] - b[1] * a[0]]
}

/// The edge function a.x * b.y - a.y * b.x where its products round to one value. Two products of `f32` and their
/// difference are exact in `f64`; the kernels have none and add up the products' errors to the same.
#[cold]
fn exact_edge(a: [f32; 3], b: [f32; 3], edge: f32) -> f32 {
    let [ax, ay, bx, by] = [a[0], a[1], b[0], b[1]].map(f64::from);
    if edge == 0.0 { (ax * by - ay * bx) as f32 } else { edge }
}

#[inline(always)]
fn is_outside(edges: [f32; 3]) -> bool {
    (edges[0] < 0.0 || edges[1] < 0.0 || edges[2] < 0.0) && (edges[0] > 0.0 || edges[1] > 0.0 || edges[2] > 0.0)
}
