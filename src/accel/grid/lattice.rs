//! Lattices: cubes of one size that fill a box. The cubes are the cells of a grid, or of a block.

use glam::Vec3;

use crate::{
    accel::bounds::Bounds,
    layout::{AccelConstants, GRID_MAX_RESOLUTION, KD_PLANE_EPSILON},
};

/// Cubes side by side that fill a box, beginning at its least corner. At its greatest corner the box may cut some of
/// the cubes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// The box's least corner, world units.
    pub min: [f32; 3],
    /// The box's greatest corner, world units.
    pub max: [f32; 3],
    /// The length of a cube's edge, world units.
    pub cell_size: f32,
    /// The number of cubes along each axis, 1 to `GRID_MAX_RESOLUTION`.
    pub n_cells: [u32; 3],
}

impl Lattice {
    /// Returns the lattice of the smallest cubes with which the box has no more than `max_cells` cubes, and no more
    /// than `GRID_MAX_RESOLUTION` along an axis. The cubes are no smaller than the margin of the box.
    pub fn finest(bounds: &Bounds, max_cells: u32) -> Self {
        let margin = bounds.margin();
        // The bits of positive floats, as integers, have the same order as the floats. The search finds the bits of
        // the largest size that is too small, the highest bit first. At every step, `bits` are those of such a size.
        let mut bits = 0;
        for bit in (0..31).rev() {
            let next = f32::from_bits(bits | (1 << bit));
            if next.is_finite() && (next < margin || !Self::fits(bounds, next, max_cells)) {
                bits |= 1 << bit;
            }
        }
        Self::of_size(bounds, f32::from_bits(bits + 1).min(f32::MAX))
    }

    /// Returns the lattice of cubes of a size that [`Lattice::finest`] has found, or of a larger one. One cube
    /// of the size `f32::MAX` counts as filling any box.
    fn of_size(bounds: &Bounds, cell_size: f32) -> Self {
        let mut lattice = Self { min: bounds.min, max: bounds.max, cell_size, n_cells: [1; 3] };
        if cell_size < f32::MAX {
            lattice.n_cells = [0, 1, 2].map(|axis| Self::n_cubes_along(bounds, axis, cell_size));
        }
        lattice
    }

    /// Returns the lattice after doubling the edges of the cubes n times, and n. The doubling ends early if one cube
    /// fills the box. Otherwise n is `n_doublings`.
    pub fn coarser(&self, n_doublings: u32) -> (Self, u32) {
        let bounds = Bounds { min: self.min, max: self.max };
        let mut lattice = *self;
        for n in 0..n_doublings {
            if lattice.n_cubes() == 1 {
                return (lattice, n);
            }
            lattice = Self::of_size(&bounds, (2.0 * lattice.cell_size).min(f32::MAX));
        }
        (lattice, n_doublings)
    }

    /// Whether cubes of a size fill the box within the limits: at most `GRID_MAX_RESOLUTION` on each axis,
    /// `max_cells` in all.
    fn fits(bounds: &Bounds, cell_size: f32, max_cells: u32) -> bool {
        let [n_x, n_y, n_z] = [0, 1, 2].map(|axis| Self::n_cubes_along(bounds, axis, cell_size));
        n_x.max(n_y).max(n_z) <= GRID_MAX_RESOLUTION && n_x * n_y * n_z <= max_cells.max(1)
    }

    /// Returns the least number of cubes that reach from one side of the box to the other. If this is more than
    /// `GRID_MAX_RESOLUTION`, the result is some number above that.
    fn n_cubes_along(bounds: &Bounds, axis: usize, cell_size: f32) -> u32 {
        let mut n_too_few = 0;
        for bit in (0..=GRID_MAX_RESOLUTION.ilog2()).rev() {
            let n = n_too_few + (1 << bit);
            if bounds.min[axis] + n as f32 * cell_size < bounds.max[axis] {
                n_too_few = n;
            }
        }
        n_too_few + 1
    }

    /// Returns the coordinate at which the cubes of index `i` on an axis begin and those before them end, world
    /// units.
    #[inline(always)]
    pub fn plane(&self, axis: usize, i: u32) -> f32 {
        let at = self.min[axis] + i as f32 * self.cell_size;
        if self.max[axis] < at { self.max[axis] } else { at }
    }

    /// Estimates the index on an axis of the cubes in which a coordinate is. The estimate may be off, since devices
    /// round quotients differently. A coordinate outside the box gets the first or the last index.
    #[inline(always)]
    pub fn index_near(&self, axis: usize, at: f32) -> u32 {
        // A negative number and a NaN are cast to 0.
        (((at - self.min[axis]) / self.cell_size) as u32).min(self.n_cells[axis] - 1)
    }

    /// Returns the first and the last index of the closed cubes that meet an interval on an axis. For an interval
    /// outside the box, both are the index of the cubes on that side of the box.
    pub fn indices_in(&self, axis: usize, least: f32, greatest: f32) -> [u32; 2] {
        let last_ix = self.n_cells[axis] - 1;
        let mut first = self.index_near(axis, least);
        while first > 0 && self.plane(axis, first) >= least {
            first -= 1;
        }
        while first < last_ix && self.plane(axis, first + 1) < least {
            first += 1;
        }
        let mut last = self.index_near(axis, greatest);
        while last < last_ix && self.plane(axis, last + 1) <= greatest {
            last += 1;
        }
        while last > 0 && self.plane(axis, last) > greatest {
            last -= 1;
        }
        [first, last]
    }

    /// Returns the index of a cube in the order of all cubes: x fastest, then y.
    #[inline(always)]
    pub fn cell_ix_of(&self, [x, y, z]: [u32; 3]) -> u32 {
        x + self.n_cells[0] * (y + self.n_cells[1] * z)
    }

    /// The number of all cubes.
    pub fn n_cubes(&self) -> usize {
        self.n_cells.iter().map(|&n| n as usize).product()
    }

    /// Returns the lattice that cuts a cube into `resolution` cubes along each axis.
    pub fn within(&self, cell: [u32; 3], resolution: u32) -> Self {
        Self {
            min: [0, 1, 2].map(|axis| self.plane(axis, cell[axis])),
            max: [0, 1, 2].map(|axis| self.plane(axis, cell[axis] + 1)),
            cell_size: self.cell_size_within(resolution),
            n_cells: [resolution; 3],
        }
    }

    /// Returns the edge length of the smaller cubes into which `within` cuts a cube, world units.
    ///
    /// 1 / resolution is rounded up to a multiple of 2^-16 by integer arithmetic, since the last bit of a quotient of
    /// floats is not the same on every device. So the last cube along each axis is up to 2 % smaller than the others.
    pub fn cell_size_within(&self, resolution: u32) -> f32 {
        self.cell_size * ((1_u32 << 16).div_ceil(resolution) as f32 * (1.0 / 65_536.0))
    }

    /// Returns a cube's indices on the axes from its index in the order of all cubes.
    pub fn cube_at(&self, cell_ix: u32) -> [u32; 3] {
        let [n_x, n_y, _] = self.n_cells;
        [cell_ix % n_x, cell_ix / n_x % n_y, cell_ix / n_x / n_y]
    }

    /// Returns the uniform constants that kernels need of a grid with these cells on its upper level. `origin_reach`:
    /// that of the grid's triangles (kdtree/scales.rs), world units.
    pub fn constants(&self, origin_reach: f32) -> AccelConstants {
        let [box_min, box_max] = self.bounds();
        let [n_cells_x, n_cells_y, n_cells_z] = self.n_cells;
        AccelConstants {
            box_min,
            plane_epsilon: KD_PLANE_EPSILON * self.largest_coordinate(),
            origin_reach,
            box_max,
            n_cells_x,
            n_cells_y,
            n_cells_z,
            cell_size: self.cell_size,
            ..AccelConstants::default()
        }
    }

    /// The least and the greatest corner of the box, world units.
    pub fn bounds(&self) -> [Vec3; 2] {
        [self.min.into(), self.max.into()]
    }

    /// The largest magnitude of the box's coordinates, world units.
    pub fn largest_coordinate(&self) -> f32 {
        self.min.iter().chain(&self.max).fold(0.0, |largest: f32, x| largest.max(x.abs()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit_box(height: f32) -> Bounds {
        Bounds { min: [0.0; 3], max: [1.0, height, 1.0] }
    }

    #[test]
    fn cubes_are_as_small_as_their_number_allows() {
        for (height, max_cells, expected) in [(1.0, 8, [2, 2, 2]), (0.5, 5, [2, 1, 2]), (1e-3, 99, [9, 1, 9])] {
            let lattice = Lattice::finest(&unit_box(height), max_cells);
            assert_eq!(lattice.n_cells, expected, "{height} {max_cells}");
        }
    }

    #[test]
    fn a_box_of_any_size_is_filled() {
        for scale in [1e-30, 1e-6, 1.0, 1e6, 1e30, f32::MAX] {
            let bounds = Bounds { min: [-scale, 0.0, 0.3 * scale], max: [scale, 0.1 * scale, 0.4 * scale] };
            let lattice = Lattice::finest(&bounds, 100_000);
            assert!(lattice.n_cubes() <= 100_000 && lattice.n_cubes() > 50_000, "{scale}: {:?}", lattice.n_cells);
            (0..3).for_each(|axis| assert_eq!(lattice.plane(axis, lattice.n_cells[axis]), bounds.max[axis]));
        }
    }

    #[test]
    fn doubled_cubes_end_as_one() {
        for scale in [1e-6, 1.0, 1e30, f32::MAX] {
            let bounds = Bounds { min: [-scale, 0.0, 0.3 * scale], max: [scale, 0.1 * scale, 0.4 * scale] };
            let lattice = Lattice::finest(&bounds, 100_000);
            let (twice, n) = lattice.coarser(1);
            assert_eq!((n, twice.cell_size), (1, 2.0 * lattice.cell_size));
            assert_eq!(twice.n_cells, lattice.n_cells.map(|n| n.div_ceil(2)), "{scale}");
            let (one, n) = lattice.coarser(32);
            assert!(one.n_cubes() == 1 && n <= 11, "{scale}: {n}");
        }
    }

    #[test]
    fn cubes_are_never_smaller_than_the_margin() {
        let bounds = Bounds { min: [1e5; 3], max: [100_000.5; 3] };
        let lattice = Lattice::finest(&bounds, 1_000_000);
        assert!(lattice.cell_size >= bounds.margin());
    }

    #[test]
    fn an_interval_meets_the_cubes_that_it_touches() {
        let lattice = Lattice::of_size(&unit_box(1.0), 0.25);
        assert_eq!(lattice.indices_in(0, 0.3, 0.4), [1, 1]);
        assert_eq!(lattice.indices_in(0, 0.25, 0.5), [0, 2]);
        assert_eq!(lattice.indices_in(0, -5.0, -4.0), [0, 0]);
        assert_eq!(lattice.indices_in(0, 4.0, 5.0), [3, 3]);
    }
}
