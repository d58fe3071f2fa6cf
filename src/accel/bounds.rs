//! Axis-aligned boxes and the references of triangles to the cells that they meet.

use rayon::prelude::*;

use crate::layout::Triangle;

/// Times the largest coordinate: a leaf has every triangle that comes so near to its cell.
///
/// So the traversal may take its own arithmetic as exact: the leaf in which it finds itself at a hit's t has the triangle.
/// Proof: let m be the largest coordinate, u = 2^-24, and |o| <= 4 m (`KD_MAX_ORIGIN_DISTANCE`) where the ray starts. With
/// divisions right to 2.5 units in the last place, as Vulkan has them, a plane's crossing at p is off by u (|o| + |p| +
/// 6 |p - o|) <= 35 u m in space. The point at a hit's t is off the triangle by u (11.5 D + 14 L) on each axis, as
/// `reference::triangle` proves. D, from o to the farthest corner, is at most 5 m, and L, between two corners, at most 2 m,
/// so this is 85.5 u m. Together it is 120.5 u m, of 128.
pub const MARGIN: f32 = 1.0 / (1 << 17) as f32;

/// A closed box, world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    pub min: [f32; 3],
    pub max: [f32; 3],
}

impl Bounds {
    /// The exact bounds of a triangle.
    pub fn of(triangle: &Triangle) -> Self {
        let [v0, v1, v2] = [triangle.v0, triangle.v1, triangle.v2];
        Self { min: v0.min(v1).min(v2).to_array(), max: v0.max(v1).max(v2).to_array() }
    }

    /// The bounds of all triangles whose corners are finite; a box of zeros for none.
    pub fn of_all(triangles: &[Triangle]) -> Self {
        let finite = triangles.par_iter().filter(|triangle| is_finite(triangle));
        finite.map(Self::of).reduce_with(|a, b| a.union(&b)).unwrap_or(Self { min: [0.0; 3], max: [0.0; 3] })
    }

    /// The box with all faces moved outwards by a margin; it stays finite.
    pub fn grown(&self, margin: f32) -> Self {
        Self { min: self.min.map(|x| (x - margin).max(f32::MIN)), max: self.max.map(|x| (x + margin).min(f32::MAX)) }
    }

    /// How far from a cell a triangle is still taken as in it, if this box has all triangles (see [`MARGIN`]). Never
    /// zero: no grown box is flat.
    pub fn margin(&self) -> f32 {
        let largest = self.min.iter().chain(&self.max).fold(0.0, |largest: f32, x| largest.max(x.abs()));
        (MARGIN * largest).max(f32::MIN_POSITIVE)
    }

    /// The smallest box around both.
    pub fn union(mut self, other: &Self) -> Self {
        for axis in 0..3 {
            self.min[axis] = self.min[axis].min(other.min[axis]);
            self.max[axis] = self.max[axis].max(other.max[axis]);
        }
        self
    }

    /// What both contain.
    pub fn intersection(mut self, other: &Self) -> Self {
        for axis in 0..3 {
            self.min[axis] = self.min[axis].max(other.min[axis]);
            self.max[axis] = self.max[axis].min(other.max[axis]);
        }
        self
    }

    /// Do the closed boxes have a point in common?
    pub fn touches(&self, other: &Self) -> bool {
        (0..3).all(|axis| self.min[axis] <= other.max[axis] && self.max[axis] >= other.min[axis])
    }

    /// The two parts on either side of a plane: below, above.
    pub fn split(&self, axis: usize, position: f32) -> [Self; 2] {
        let (mut below, mut above) = (*self, *self);
        below.max[axis] = position;
        above.min[axis] = position;
        [below, above]
    }

    /// Side lengths. In f64 no finite box overflows, nor do products of two.
    pub fn extent(&self) -> [f64; 3] {
        [0, 1, 2].map(|axis| f64::from(self.max[axis]) - f64::from(self.min[axis]))
    }
}

/// No NaN and no infinity among a triangle's corners.
pub fn is_finite(triangle: &Triangle) -> bool {
    triangle.v0.is_finite() && triangle.v1.is_finite() && triangle.v2.is_finite()
}

/// A triangle in a cell: 28 bytes.
#[derive(Clone, Copy, Debug)]
pub struct Reference {
    /// Bounds of the part of the triangle that comes within the margin of the cell, grown by the margin.
    pub bounds: Bounds,
    pub triangle_ix: u32,
}
