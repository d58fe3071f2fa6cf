//! Axis-aligned boxes, and references, which are the entries in a cell's list of triangles.

use glam::Vec3;
use rayon::prelude::*;

use crate::layout::Triangle;

/// Rounding margin of a cell, as a multiple of the largest coordinate: 128 units of 2^-24. A leaf has every triangle
/// that comes nearer to its cell than this.
///
/// Thanks to the margin, the traversal may treat its own arithmetic as exact: the leaf that the traversal visits at a
/// hit's t has the hit triangle. Proof: let m be the largest coordinate, u = 2^-24, and o the ray's origin. |o| is at
/// most 4 m (`KD_MAX_ORIGIN_DISTANCE`). Divisions are right to 2.5 units in the last place, as Vulkan guarantees.
/// Then the point where a ray crosses the split plane of coordinate p is off by u (|o| + |p| + 6 |p - o|) <= 35 u m
/// on the plane's axis. Since t is `fma(p, inv_direction, bias)` with `bias = -o * inv_direction`, |o| comes from the
/// product in `bias`, |p| from the product in `fma`, which some devices round, and of the 6, 1 comes from the sum in
/// `fma` and 5 from the division, as 2.5 units in the last place are up to 5 u of a quotient. The point at a hit's t
/// is off the triangle by u (11.5 D + 14 L) on each axis, as `reference::triangle` proves. D, the greatest coordinate
/// difference between o and a corner, is at most 5 m. L, that between two corners, is at most 2 m. So the point is
/// off by at most 85.5 u m. The sum is 120.5 u m, of the margin's 128 u m.
///
/// In a kd-tree, each triangle has its own margin, with a length in place of m that may be less (kdtree/scales.rs).
pub const MARGIN: f32 = 1.0 / (1 << 17) as f32;

/// Closed axis-aligned box, world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    pub min: [f32; 3],
    pub max: [f32; 3],
}

impl From<[Vec3; 2]> for Bounds {
    fn from([min, max]: [Vec3; 2]) -> Self {
        Self { min: min.to_array(), max: max.to_array() }
    }
}

impl Bounds {
    /// Returns the exact bounds of a triangle.
    pub fn of(triangle: &Triangle) -> Self {
        let [v0, v1, v2] = [triangle.v0, triangle.v1, triangle.v2];
        Self { min: v0.min(v1).min(v2).to_array(), max: v0.max(v1).max(v2).to_array() }
    }

    /// Returns the bounds of all triangles whose corners are finite, or a box of zeros if there are none.
    pub fn of_all(triangles: &[Triangle]) -> Self {
        Self::of_each(triangles.len(), |ix| triangles[ix])
    }

    /// Does what [`Bounds::of_all`] does, for `n` triangles that a function returns.
    pub fn of_each(n: usize, triangle: impl Fn(usize) -> Triangle + Sync + Send) -> Self {
        let finite = (0..n).into_par_iter().map(triangle).filter(is_finite);
        finite
            .map(|triangle| Self::of(&triangle))
            .reduce_with(|a, b| a.union(&b))
            .unwrap_or(Self { min: [0.0; 3], max: [0.0; 3] })
    }

    /// Returns the box with all faces moved outwards by a margin, world units. It stays finite.
    pub fn grown(&self, margin: f32) -> Self {
        Self { min: self.min.map(|x| (x - margin).max(f32::MIN)), max: self.max.map(|x| (x + margin).min(f32::MAX)) }
    }

    /// Returns the rounding margin of a scene with these bounds, world units (see [`MARGIN`]). A triangle that comes
    /// nearer to a cell than the margin counts as inside the cell. The margin is never zero, so no grown box is flat.
    pub fn margin(&self) -> f32 {
        (MARGIN * self.largest_coordinate()).max(f32::MIN_POSITIVE)
    }

    /// Returns the greatest magnitude of a coordinate of the box, world units.
    pub fn largest_coordinate(&self) -> f32 {
        self.min.iter().chain(&self.max).fold(0.0, |largest: f32, x| largest.max(x.abs()))
    }

    /// Returns the smallest box that contains both.
    pub fn union(mut self, other: &Self) -> Self {
        for axis in 0..3 {
            self.min[axis] = self.min[axis].min(other.min[axis]);
            self.max[axis] = self.max[axis].max(other.max[axis]);
        }
        self
    }

    /// Returns the part that both boxes contain. If there is none, `min` exceeds `max` on some axis.
    pub fn intersection(mut self, other: &Self) -> Self {
        for axis in 0..3 {
            self.min[axis] = self.min[axis].max(other.min[axis]);
            self.max[axis] = self.max[axis].min(other.max[axis]);
        }
        self
    }

    /// Whether the closed boxes have a point in common.
    pub fn touches(&self, other: &Self) -> bool {
        (0..3).all(|axis| self.min[axis] <= other.max[axis] && self.max[axis] >= other.min[axis])
    }

    /// Returns the two parts on either side of a plane: below, above.
    pub fn split(&self, axis: usize, position: f32) -> [Self; 2] {
        let (mut below, mut above) = (*self, *self);
        below.max[axis] = position;
        above.min[axis] = position;
        [below, above]
    }

    /// Returns the side lengths. In f64 no finite box overflows, nor does a product of two side lengths.
    pub fn extent(&self) -> [f64; 3] {
        [0, 1, 2].map(|axis| f64::from(self.max[axis]) - f64::from(self.min[axis]))
    }

    /// Returns half the area of the surface.
    pub fn half_area(&self) -> f64 {
        let [x, y, z] = self.extent();
        x * y + y * z + z * x
    }
}

/// Whether no corner of a triangle has a coordinate that is NaN or infinite.
pub fn is_finite(triangle: &Triangle) -> bool {
    triangle.v0.is_finite() && triangle.v1.is_finite() && triangle.v2.is_finite()
}

/// Reference: an entry in a cell's list of the triangles that come near to the cell, while a kd-tree is built. 28
/// bytes.
#[derive(Clone, Copy, Debug)]
pub struct Reference {
    /// Bounds of the part of the triangle that comes within its margin of the cell, grown by the margin, and then cut
    /// off at the cell's faces. So they never reach beyond the cell.
    pub bounds: Bounds,
    pub triangle_ix: u32,
}
