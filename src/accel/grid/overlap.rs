//! Overlap of triangles and lattices: finds the cubes that a triangle comes near to.
//!
//! The triangle's box is cut into columns of cubes along the axis on which the triangle's normal is longest. A column
//! is skipped if the triangle is beside it, as seen along that axis. Within a column, the triangle's plane meets few
//! cubes. Each of these is tested against the plane, and against the triangle as seen along the other two axes
//! (Schwarz and Seidel, "Fast parallel surface and solid voxelization on GPUs", 2010).

use super::Lattice;
use crate::{accel::bounds::Bounds, layout::Triangle};

/// Factor on the margin of the triangles' box. A triangle that comes nearer to a cube than the product counts as
/// inside the cube. The traversal needs the margin itself (bounds.rs). The additional sixteenth is 8 units of 2^-24
/// times the largest coordinate. The rounding of the cubes' middles and half edges takes 4 of these.
const MARGIN_FACTOR: f32 = 1.0625;
/// Bound of the rounding error of a cross product, and of the dot product of a cross product and a third vector. It
/// is a multiple of the product of all factors' sums of magnitudes: 16 units of 2^-24. The cross product of two edges
/// is off by 4 units: the rounding of each edge takes 1 unit, that of a product of two components 1, and that of the
/// difference of two products 1. The dot product adds 4.
const PRODUCT_ERROR: f32 = 1.0 / (1 << 20) as f32;

/// A triangle and the columns of its box. The axes are permuted so that columns extend along the last one.
pub struct Columns {
    lattice: Lattice,
    corners: [[f32; 3]; 3],
    /// The cross product of two edges, which is not of unit length.
    normal: [f32; 3],
    /// A bound of the error of the normal's components.
    normal_error: f32,
    /// The sum of half of a cube's edge and the margin, world units.
    half: f32,
    /// The first and the last index of the box's cubes on each axis.
    range: [[u32; 2]; 3],
    /// The axis of the lattice that is the last one here.
    axis: usize,
}

impl Columns {
    /// Finds the columns of a triangle. `margin` is that of the box of all triangles.
    pub fn new(lattice: Lattice, triangle: &Triangle, margin: f32) -> Self {
        let corners = [triangle.v0, triangle.v1, triangle.v2].map(|corner| corner.to_array());
        let margin = MARGIN_FACTOR * margin;
        let bounds = Bounds::of(triangle).grown(margin);
        let (a, b) = (difference(corners[1], corners[0]), difference(corners[2], corners[0]));
        let normal = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        let [x, y, z] = normal.map(f32::abs);
        let axis = if z >= x && z >= y { 2 } else { usize::from(y >= x) };
        let range = [0, 1, 2].map(|axis| lattice.indices_in(axis, bounds.min[axis], bounds.max[axis]));
        Self {
            lattice: Lattice {
                min: axis_last(lattice.min, axis),
                max: axis_last(lattice.max, axis),
                n_cells: axis_last(lattice.n_cells, axis),
                ..lattice
            },
            corners: corners.map(|corner| axis_last(corner, axis)),
            normal: axis_last(normal, axis),
            normal_error: PRODUCT_ERROR * (sum_of_magnitudes(a) * sum_of_magnitudes(b)),
            half: 0.5 * lattice.cell_size + margin,
            range: axis_last(range, axis),
            axis,
        }
    }

    /// The number of columns.
    pub fn n_columns(&self) -> u32 {
        let n_on = |[first, last]: [u32; 2]| last - first + 1;
        n_on(self.range[0]) * n_on(self.range[1])
    }

    /// Calls `found` with the indices of each cube of a column that the triangle comes near to. Columns are numbered
    /// along the first axis, then the second.
    pub fn cubes_of(&self, column_ix: u32, mut found: impl FnMut([u32; 3])) {
        let [[first_x, last_x], [first_y, _], _] = self.range;
        let n_in_row = last_x - first_x + 1;
        let [x, y] = [first_x + column_ix % n_in_row, first_y + column_ix / n_in_row];
        let mut middle = [self.middle(0, x), self.middle(1, y), 0.0];
        if self.is_beside(2, middle) {
            return;
        }
        let [first, last] = self.near_plane(middle);
        for z in first..=last {
            middle[2] = self.middle(2, z);
            if self.meets_plane(middle) && !self.is_beside(0, middle) && !self.is_beside(1, middle) {
                found(axis_back([x, y, z], self.axis));
            }
        }
    }

    /// Returns the middle of the cubes of index `i` on an axis.
    fn middle(&self, axis: usize, i: u32) -> f32 {
        0.5 * self.lattice.plane(axis, i) + 0.5 * self.lattice.plane(axis, i + 1)
    }

    /// Whether the triangle is certainly beside the cube with this middle, as seen along an axis.
    ///
    /// A point of the triangle is either on the left of all edges or on the right of all. So the cube is beside the
    /// triangle if it is on the right of one edge and on the left of another. This test does not need the winding,
    /// which rounding may hide in a needle.
    fn is_beside(&self, axis: usize, middle: [f32; 3]) -> bool {
        let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        let (mut is_right, mut is_left) = (false, false);
        for [from, to] in [[0, 1], [1, 2], [2, 0]] {
            let (from, to) = (self.corners[from], self.corners[to]);
            let along = [to[u] - from[u], to[v] - from[v]];
            let way = [middle[u] - from[u], middle[v] - from[v]];
            let span = along[0].abs() + along[1].abs();
            let height = along[0] * way[1] - along[1] * way[0];
            let reach = span * self.half + PRODUCT_ERROR * (span * (way[0].abs() + way[1].abs()));
            is_right |= height < -reach;
            is_left |= height > reach;
        }
        is_right && is_left
    }

    /// Returns the first and the last index of the cubes of a column that may meet the triangle's plane. The interval
    /// is up to a cube wider on each side than `meets_plane` needs, so it may be computed by divisions that are not
    /// exact.
    fn near_plane(&self, middle: [f32; 3]) -> [u32; 2] {
        let ([x, y, z], [first, last]) = (self.normal, self.range[2]);
        let slope = 1.0 / z.abs();
        let way = [middle[0] - self.corners[0][0], middle[1] - self.corners[0][1]];
        let extent = self.lattice.plane(2, last + 1) - self.lattice.plane(2, first);
        let error = self.normal_error * (way[0].abs() + way[1].abs() + extent + self.half) * slope;
        // If the error is too large or NaN, the whole column is returned.
        if !(error < 0.25 * self.lattice.cell_size) {
            return [first, last];
        }
        let height = x * way[0] + y * way[1];
        let at = self.corners[0][2] - if z < 0.0 { -height } else { height } * slope;
        let reach = ((x.abs() + y.abs()) * slope + 1.0) * self.half + self.lattice.cell_size;
        let [near_first, near_last] = [at - reach, at + reach].map(|at| self.lattice.index_near(2, at));
        [first.max(near_first), last.min(near_last)]
    }

    /// Whether the triangle's plane may come near to the cube with this middle.
    fn meets_plane(&self, middle: [f32; 3]) -> bool {
        let way = difference(middle, self.corners[0]);
        let [x, y, z] = self.normal;
        let height = x * way[0] + y * way[1] + z * way[2];
        let error = self.normal_error * (sum_of_magnitudes(way) + 3.0 * self.half);
        let reach = sum_of_magnitudes(self.normal) * self.half + error;
        !(height.abs() > reach)
    }
}

/// Permutes the axes cyclically so that `axis` is the last one.
fn axis_last<T: Copy>(v: [T; 3], axis: usize) -> [T; 3] {
    [v[(axis + 1) % 3], v[(axis + 2) % 3], v[axis]]
}

/// Undoes the permutation of `axis_last`.
fn axis_back<T: Copy>(v: [T; 3], axis: usize) -> [T; 3] {
    // A permutation by one axis undoes one by two.
    axis_last(v, [1, 0, 2][axis])
}

fn difference(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Returns the sum of the magnitudes of a vector's components, which is no less than the vector's length.
fn sum_of_magnitudes([x, y, z]: [f32; 3]) -> f32 {
    x.abs() + y.abs() + z.abs()
}

#[cfg(test)]
mod tests {
    use glam::{Vec3, vec3};

    use super::*;

    fn cubes_of(lattice: &Lattice, triangle: &Triangle, margin: f32) -> Vec<[u32; 3]> {
        let columns = Columns::new(*lattice, triangle, margin);
        let mut cubes = Vec::new();
        (0..columns.n_columns()).for_each(|column_ix| columns.cubes_of(column_ix, |cube| cubes.push(cube)));
        cubes
    }

    fn lattice(n: u32) -> Lattice {
        Lattice { min: [-1.0; 3], max: [1.0; 3], cell_size: 2.0 / n as f32, n_cells: [n; 3] }
    }

    /// Returns points of a triangle, some of them on its edges.
    fn points_of(triangle: &Triangle, n: u32) -> impl Iterator<Item = Vec3> {
        let Triangle { v0, v1, v2, .. } = *triangle;
        let shares = (0..=n).flat_map(move |i| (0..=n - i).map(move |j| [i, j].map(|i| i as f32 / n as f32)));
        shares.map(move |[i, j]| v0 + i * (v1 - v0) + j * (v2 - v0))
    }

    fn triangles() -> Vec<Triangle> {
        let at = |i: u32| {
            let unit = |j: u32| ((i * 3 + j).wrapping_mul(2_654_435_761) >> 8) as f32 / (1 << 23) as f32 - 1.0;
            0.9 * vec3(unit(0), unit(1), unit(2))
        };
        let any = (0..200).map(|i| [at(3 * i), at(3 * i + 1), at(3 * i + 2)]);
        let small = (0..200).map(|i| [at(i), at(i) + 0.05 * at(i + 77), at(i) + 0.05 * at(i + 99)]);
        let needles = (0..50).map(|i| [at(i), at(i + 7), at(i).lerp(at(i + 7), 0.3) + 1e-5 * at(i + 3)]);
        let flat = (0..3).map(|axis| {
            let mut corners = [at(1), at(2), at(3)];
            corners.iter_mut().for_each(|corner| corner[axis] = 0.25);
            corners
        });
        let points = (0..9).map(|i| [at(i); 3]);
        let corners = any.chain(small).chain(needles).chain(flat).chain(points);
        corners.map(|[v0, v1, v2]| Triangle { v0, v1, v2, ..Triangle::default() }).collect()
    }

    #[test]
    fn every_point_is_in_a_cube_of_its_triangle() {
        for n in [1, 3, 16, 50] {
            let lattice = lattice(n);
            for triangle in triangles() {
                let cubes = cubes_of(&lattice, &triangle, 1e-6);
                for point in points_of(&triangle, 64) {
                    let is_in = |cube: &[u32; 3]| {
                        (0..3).all(|axis| {
                            let [least, greatest] = [0, 1].map(|side| lattice.plane(axis, cube[axis] + side));
                            (least..=greatest).contains(&point[axis])
                        })
                    };
                    assert!(cubes.iter().any(is_in), "{point} of {triangle:?} in {n} cubes");
                }
            }
        }
    }

    #[test]
    fn no_cube_is_found_twice_and_few_in_vain() {
        let lattice = lattice(20);
        let (mut n_found, mut n_needed) = (0, 0);
        for triangle in triangles() {
            let mut cubes = cubes_of(&lattice, &triangle, 1e-6);
            cubes.sort();
            let n = cubes.len();
            cubes.dedup();
            assert_eq!(cubes.len(), n, "{triangle:?}");
            let mut needed: Vec<_> = points_of(&triangle, 400)
                .map(|point| [0, 1, 2].map(|axis| lattice.index_near(axis, point[axis])))
                .collect();
            needed.sort();
            needed.dedup();
            n_found += n;
            n_needed += needed.len();
        }
        assert!(n_found < n_needed * 13 / 10, "{n_found} cubes where {n_needed} would do");
    }
}
