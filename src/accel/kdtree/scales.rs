//! Scales: a triangle's margin depends on its own largest coordinate, not on the scene's. A mesh of 1 m beside a ground
//! of 10 km needs leaves that are far smaller than the rounding of the ground's hits.
//!
//! Scale i stands for the length m / 2^i, where m is the largest coordinate of all triangles. A triangle has the
//! finest scale whose length is not below its own largest coordinate. `Scales::finest` limits the scales of a tree. In
//! most scenes it is 0, so that all lengths are m. The margin of a triangle (bounds.rs) and the epsilon of its plane
//! (planes.rs) are multiples of its length.
//!
//! # Why no ray misses a triangle
//!
//! The proofs in bounds.rs and planes.rs hold for each triangle with its own length M in place of m, because they use
//! m in four places:
//!
//! - *Corners.* No coordinate of the triangle exceeds M. So L is at most 2 M there, and D at most M plus the origin's
//!   largest coordinate.
//! - *Split planes.* A rounded t can put a hit on the wrong side of a plane only if the plane is between the true
//!   point and the computed one. Both are next to the triangle, so |p| is at most M, up to a rounding.
//! - *The ray's origin.* No coordinate of the origin exceeds 4 M. `near_scene` (traversal_ray.rs) provides this. Within
//!   `origin_reach`, which is 4 times the least length, no origin is moved. Another origin is moved to the point q of
//!   the ray that is nearest to 0, if that at least halves its largest coordinate. Each point p that the ray can hit
//!   is no nearer to 0 than q, so the distance of q from 0 is at most the root of 3 times the largest coordinate of p.
//!   That coordinate is at most M. So the largest coordinate of a moved origin is at most 1.74 M, and that of an origin
//!   which is not moved is at most 3.5 M. Rounding moves q by at most 13 units of 2^-24 of the origin's distance from
//!   0: 11 for t, and 2 for the point. That is at most 1.5 M, since no length is below m / 2^18, and the distance is at
//!   most 7 m.
//! - *The interval of t in a cell.* Its ends are points in the cell. The proof of planes.rs needs them, and that of
//!   bounds.rs does not. So the epsilons in a cell are multiples of the cell's length too, if that is greater.
//!
//! A moved ray is tested against all triangles from its new origin, so an edge has no gap between its triangles.
//!
//! Grids treat all places alike, by the length m. Yet they move origins as the tree of the same triangles does, since a
//! moved origin is rounded, and all structures are to find the same hits. The proof in bounds.rs holds for a moved
//! origin, too, as it is nearer to 0.

use rayon::prelude::*;

use crate::{
    accel::bounds::{Bounds, MARGIN, is_finite},
    layout::{KD_MAX_ORIGIN_DISTANCE, KdSlabTree, Triangle},
};

/// The finest scale of any tree. It bounds the rounding of moved origins: see the module's documentation.
const MAX_SCALE: u32 = 18;
/// The size of a triangle as a multiple of its margin, below which the triangle needs a finer scale. With margins of
/// a quarter of the size, a tree has a tenth more references. With margins as large as the triangles, rays are slow.
const SIZE_IN_MARGINS: f32 = 8.0;
/// A tree's finest scale is the finest that at least one in this number of triangles needs. Finer scales have a price:
/// rays are moved from nearer origins.
const TRIANGLES_PER_NEEDY: usize = 16;
/// The least and the greatest largest coordinate of scenes with several scales, world units. In between, no product
/// of coordinates and no scaled plane overflows or is denormal.
const LIMITS: [f32; 2] = [f32::from_bits((127 - 80) << 23), f32::from_bits((127 + 60) << 23)];

/// The scales of a tree.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scales {
    /// The largest coordinate of all triangles, world units.
    largest: f32,
    /// The margin of a triangle of scale 0, world units.
    margin: f32,
    /// The finest scale.
    finest: u32,
}

impl Scales {
    /// Chooses the scales for triangles with these bounds. They do not depend on the number of threads.
    pub fn new(triangles: &[Triangle], bounds: &Bounds) -> Self {
        Self::of_each(triangles.len(), |ix| triangles[ix], bounds)
    }

    /// Does what [`Scales::new`] does, for `n` triangles that a function returns.
    pub fn of_each(n: usize, triangle: impl Fn(usize) -> Triangle + Sync + Send, bounds: &Bounds) -> Self {
        let (largest, margin) = (bounds.largest_coordinate(), bounds.margin());
        let all = Self { largest, margin, finest: MAX_SCALE };
        let is_in_range = (LIMITS[0]..=LIMITS[1]).contains(&largest);
        let finest = if is_in_range { all.finest_needed(n, triangle) } else { 0 };
        Self { finest, ..all }
    }

    /// Returns the scales as kernels need them. All other members are 0.
    pub(super) fn slab_tree(&self) -> KdSlabTree {
        let Self { largest, margin, finest: finest_scale } = *self;
        KdSlabTree { largest, margin, finest_scale, ..KdSlabTree::default() }
    }

    /// Returns the finest scale that at least one in `TRIANGLES_PER_NEEDY` triangles needs.
    fn finest_needed(&self, n: usize, triangle: impl Fn(usize) -> Triangle + Sync + Send) -> u32 {
        type Counts = [usize; MAX_SCALE as usize + 1];
        let counted = (0..n).into_par_iter().fold(
            || -> Counts { [0; _] },
            |mut counts, ix| {
                counts[self.needed_by(&triangle(ix)) as usize] += 1;
                counts
            },
        );
        let sum = |mut a: Counts, b: Counts| {
            a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
            a
        };
        let counts = counted.reduce(|| [0; _], sum);
        let mut n_needy = 0;
        for scale in (1..=MAX_SCALE).rev() {
            n_needy += counts[scale as usize];
            if n_needy * TRIANGLES_PER_NEEDY >= n {
                return scale;
            }
        }
        0
    }

    /// Returns the scale at which the triangle's margin is small beside the triangle, or the triangle's own scale if
    /// that is coarser. A triangle without extent, or with a corner that is not finite, needs none.
    fn needed_by(&self, triangle: &Triangle) -> u32 {
        let Bounds { min, max } = Bounds::of(triangle);
        let size = [0, 1, 2].map(|axis| max[axis] - min[axis]).into_iter().fold(0.0, f32::max);
        if size == 0.0 || !is_finite(triangle) {
            return 0;
        }
        self.of_length(size / (SIZE_IN_MARGINS * MARGIN)).min(self.of_triangle(triangle))
    }

    /// Returns the finest scale whose length is not below `length`, up to a rounding.
    fn of_length(&self, length: f32) -> u32 {
        // The exponent of a quotient of at least 1. It is 128 for an infinite one.
        let exponent = ((self.largest / length).to_bits() >> 23).saturating_sub(127);
        exponent.min(self.finest)
    }

    /// The largest coordinate of all triangles, world units.
    pub fn largest(&self) -> f32 {
        self.largest
    }

    /// Whether all triangles and cells have scale 0.
    pub fn has_one(&self) -> bool {
        self.finest == 0
    }

    /// Returns the scale of a triangle, whose corners are finite.
    pub fn of_triangle(&self, triangle: &Triangle) -> u32 {
        if self.has_one() { 0 } else { self.of_length(Bounds::of(triangle).largest_coordinate()) }
    }

    /// Returns the finest scale whose length is not below any coordinate of the cell.
    pub fn of_cell(&self, cell: &Bounds) -> u32 {
        if self.has_one() { 0 } else { self.of_length(cell.largest_coordinate()) }
    }

    /// Returns the distance from a cell within which a triangle counts as inside the cell, world units.
    pub fn margin_of(&self, triangle: &Triangle) -> f32 {
        self.margin * length_of(self.of_triangle(triangle))
    }

    /// Returns the magnitude of an origin's coordinates up to which the origin is not moved, world units. `largest`:
    /// the largest coordinate of the root's cell, world units.
    pub fn origin_reach(&self, largest: f32) -> f32 {
        KD_MAX_ORIGIN_DISTANCE * largest * length_of(self.finest)
    }
}

/// Returns a scale's length as a multiple of that of scale 0: 2^-scale.
pub fn length_of(scale: u32) -> f32 {
    f32::from_bits((127 - scale) << 23)
}
