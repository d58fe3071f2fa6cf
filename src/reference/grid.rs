//! The search through a grid, from cell to cell along the ray (a 3D-DDA: Amanatides and Woo, "A fast voxel traversal
//! algorithm for ray tracing", 1987). Twin of `grid/grid.glsl`.
//!
//! The t at which the ray meets a plane between cells is computed from the plane itself, by the operations of the
//! kd-tree's traversal, not summed up from cell to cell. So the ray visits the cells that it would visit in a kd-tree
//! that is split at all of these planes. Rounding misplaces the ray by no more than in that kd-tree, whose margin
//! covers the error (accel/bounds.rs).
//!
//! "Cube" means a cell as one of a lattice's cubes; `cube` is its three indices there.

use super::{
    counting::table::ReadCounter,
    inputs::KernelInputs,
    kdtree::is_done,
    leaf::intersect_entries,
    traversal_ray::{TraversalRay, min},
};
use crate::{
    accel::grid::Lattice,
    layout::{GridCell, Hit},
};

/// A ray's position on its way through the cubes of a lattice: the cube that it is in, and the t at which it leaves
/// the cube on each axis.
struct Walk<'a> {
    lattice: &'a Lattice,
    cube: [u32; 3],
    t_next: [f32; 3],
}

impl<'a> Walk<'a> {
    /// The position in the first cube that the ray meets at `t` or later.
    #[inline(always)]
    fn new(lattice: &'a Lattice, ray: &TraversalRay, t: f32) -> Self {
        let mut walk = Self { lattice, cube: [0; 3], t_next: [0.0; 3] };
        for axis in 0..3 {
            walk.cube[axis] = walk.index_at(ray, axis, t);
            walk.t_next[axis] = walk.exit_at(ray, axis, walk.cube[axis]);
        }
        walk
    }

    /// Whether the ray goes towards greater coordinates on an axis.
    #[inline(always)]
    fn goes_up(ray: &TraversalRay, axis: usize) -> bool {
        !(ray.inv_direction[axis] < 0.0)
    }

    /// The t at which the ray leaves the cubes of index `i` on an axis. It is infinity for those at the border, where
    /// the search ends.
    #[inline(always)]
    fn exit_at(&self, ray: &TraversalRay, axis: usize, i: u32) -> f32 {
        let goes_up = Self::goes_up(ray, axis);
        let is_last = if goes_up { i + 1 == self.lattice.n_cells[axis] } else { i == 0 };
        if is_last {
            return f32::INFINITY;
        }
        self.lattice.plane(axis, i + u32::from(goes_up)) * ray.inv_direction[axis] + ray.bias[axis]
    }

    /// The first index on an axis, in the ray's order, whose cubes the ray leaves at `t` or later.
    #[inline(always)]
    fn index_at(&self, ray: &TraversalRay, axis: usize, t: f32) -> u32 {
        let last_ix = self.lattice.n_cells[axis] - 1;
        let mut i = self.lattice.index_near(axis, ray.origin[axis] + t * ray.direction[axis]);
        // This first index is off by at most about 1: only rounding makes it wrong, and rounding errors are smaller
        // than the margin, which is no wider than a cube.
        if Self::goes_up(ray, axis) {
            while i > 0 && self.exit_at(ray, axis, i - 1) >= t {
                i -= 1;
            }
            while self.exit_at(ray, axis, i) < t {
                i += 1;
            }
        } else {
            while i < last_ix && self.exit_at(ray, axis, i + 1) >= t {
                i += 1;
            }
            while self.exit_at(ray, axis, i) < t {
                i -= 1;
            }
        }
        i
    }

    /// The axis on which the ray leaves the cube first.
    #[inline(always)]
    fn exit_axis(&self) -> usize {
        let [x, y, z] = self.t_next;
        if y < x {
            if z < y { 2 } else { 1 }
        } else if z < x {
            2
        } else {
            0
        }
    }

    /// Goes to the next cube.
    #[inline(always)]
    fn step(&mut self, ray: &TraversalRay, axis: usize) {
        if Self::goes_up(ray, axis) {
            self.cube[axis] += 1;
        } else {
            self.cube[axis] -= 1;
        }
        self.t_next[axis] = self.exit_at(ray, axis, self.cube[axis]);
    }
}

/// Calls `visit` for the cubes that the ray meets from `t_enter` to `t_exit`, with the place of each
/// ([`Lattice::cell_ix_of`]) and the ray's interval of t in it, until `visit` returns true. Returns whether it did.
#[inline(always)]
fn walk(
    lattice: &Lattice,
    ray: &TraversalRay,
    [mut t_enter, t_exit]: [f32; 2],
    mut visit: impl FnMut(u32, [f32; 2]) -> bool,
) -> bool {
    let mut walk = Walk::new(lattice, ray, t_enter);
    loop {
        let axis = walk.exit_axis();
        let t = walk.t_next[axis];
        let goes_on = t < t_exit;
        let t_leave = if goes_on { t } else { t_exit };
        if visit(lattice.cell_ix_of(walk.cube), [t_enter, t_leave]) {
            return true;
        }
        if !goes_on {
            return false;
        }
        t_enter = t;
        walk.step(ray, axis);
    }
}

/// Searches all cells that the ray meets in `[t_enter, t_exit]`, until nothing nearer can follow.
///
/// # Panics
/// The acceleration structure is not a grid.
#[inline]
pub fn search_grid<const ANY_HIT: bool>(inputs: &KernelInputs<impl ReadCounter>, ray: &TraversalRay, best: &mut Hit) {
    // Not `>`: a NaN misses.
    if !(ray.t_enter <= ray.t_exit) {
        return;
    }
    let lattice = inputs.lattice.expect("a grid");
    let mut visit_leaf = |cell: GridCell, [t_enter, t_leave]: [f32; 2]| {
        if cell.count > 0 {
            let entries = cell.first as usize..(cell.first + cell.count) as usize;
            intersect_entries(inputs, ray, entries, [t_enter, min(t_leave, best.t)], best);
        }
        is_done::<ANY_HIT>(best) || best.t < t_leave
    };
    // If the box's corners are near the largest number, the t at which the ray leaves the box may be infinite. It is
    // clamped to the largest finite number, so that the exits at the border, which are infinite, come later.
    let way = [ray.t_enter, min(ray.t_exit, f32::MAX)];
    walk(lattice, ray, way, |place, way| {
        let cell = inputs.grid_cells[place as usize];
        if inputs.n_grid_levels == 1 || cell.count == 0 {
            return visit_leaf(cell, way);
        }
        let block = lattice.within(lattice.cube_at(place), cell.count);
        walk(&block, ray, way, |place, way| visit_leaf(inputs.grid_cells[(cell.first + place) as usize], way))
    });
}
