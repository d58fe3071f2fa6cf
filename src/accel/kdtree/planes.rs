//! Planes of the leaves' triangles. Where a ray keeps clear of a triangle's plane, the triangle need not be tested.
//!
//! A ray is clear of a plane if its distance from the plane is more than `plane_epsilon` all along its t interval in
//! the leaf. At scale 0 (scales.rs), this epsilon is `KD_PLANE_EPSILON` times the largest coordinate, which is twice
//! the margin: 256 units of 2^-24 times the largest coordinate. The table lists the errors in these units, with origins
//! as far away as `KD_MAX_ORIGIN_DISTANCE` allows. At scale i, errors and epsilon are 2^i times smaller. There, the
//! plane's normal and distance are multiplied by 2^i, so that kernels need no other epsilon. This loses no bits.
//!
//! ```text
//! error of                                                   units
//! the height of the point at a hit's t above the plane         149   (86 on each axis, times sqrt(3): bounds.rs)
//! the plane: 4 if the host computes it, on devices               25
//! the height of the origin above the plane                      30
//! the slope (the change of height per t), times t               26
//! the middle of the t interval                                   9
//! half of the t interval                                         9
//! middle * slope + height, and half * |slope|                4 + 4   (`is_clear` in glsl/shared/kdtree/slab.glsl)
//! sum                                                          256   of 256
//! ```
//!
//! A device computes planes in f32 (`kdtree_leaves.comp`). There, the rounding of the normal's products may put the
//! plane up to 16 units off, or else the plane is 0. The scaling of the normal to length 1 rounds each component, which
//! makes 3.5 more; the three products of the distance and their sum make 5.2.

use rayon::prelude::*;

use super::{
    KdArrays, Node,
    scales::{Scales, length_of},
};
use crate::{
    accel::bounds::Bounds,
    layout::{Plane, Triangle},
};

/// The most that a plane may be off its triangle, in units of 2^-24 times the length of its scale.
const MAX_ERROR: f64 = 25.0 / (1 << 24) as f64;

/// Whether the planes of a tree let no ray miss a triangle: each is 0, or near its triangle (see the module's
/// documentation), and its normal is no longer than that of [`planes_of`], but for a rounding.
pub fn are_valid(arrays: &KdArrays, triangles: &[Triangle], scales: &Scales) -> bool {
    let is_near = |((&ix, plane), cell_scale): ((&u32, &Plane), u32)| {
        let triangle = &triangles[ix as usize];
        let length = f64::from(length_of(cell_scale.min(scales.of_triangle(triangle))));
        let (normal, distance) = (length * plane.normal.as_dvec3(), length * f64::from(plane.distance));
        let most = length * MAX_ERROR * f64::from(scales.largest());
        let height = |corner: glam::Vec3| (normal.dot(corner.as_dvec3()) - distance).abs();
        let corners = [triangle.v0, triangle.v1, triangle.v2];
        normal.length() <= 1.0 + 1e-6 && corners.into_iter().all(|corner| height(corner) <= most)
    };
    let planes = arrays.leaf_triangles.par_iter().zip(&arrays.leaf_planes).zip(cell_scales(arrays, scales));
    arrays.leaf_planes.len() == arrays.leaf_triangles.len() && planes.all(is_near)
}

/// Returns the plane of each entry's triangle. It has the coarser one of the scales of the triangle and of the leaf's
/// cell.
pub fn planes_of(arrays: &KdArrays, triangles: &[Triangle], scales: &Scales) -> Vec<Plane> {
    let in_cell = |(&ix, cell_scale): (&u32, u32)| {
        let triangle = &triangles[ix as usize];
        let Plane { normal, distance } = plane_of(triangle);
        let length = length_of(cell_scale.min(scales.of_triangle(triangle)));
        Plane { normal: normal / length, distance: distance / length }
    };
    arrays.leaf_triangles.par_iter().zip(cell_scales(arrays, scales)).map(in_cell).collect()
}

/// Returns the scale of each entry's cell.
fn cell_scales(arrays: &KdArrays, scales: &Scales) -> Vec<u32> {
    let mut of_entries = vec![0; arrays.leaf_triangles.len()];
    if scales.has_one() {
        return of_entries;
    }
    let mut stack = vec![(0, Bounds::from([arrays.box_min, arrays.box_max]))];
    while let Some((node_ix, cell)) = stack.pop() {
        match arrays.node(node_ix) {
            Node::Leaf { first, count } => {
                of_entries[first as usize..][..count as usize].fill(scales.of_cell(&cell));
            }
            Node::Split { axis, position, child } => {
                let [below, above] = cell.split(axis, position);
                stack.extend([(child, below), (child + 1, above)]);
            }
        }
    }
    of_entries
}

/// Returns a triangle's plane: the rounded normal, and the distance at which a plane with that normal passes through
/// the triangle's centroid. The normal is 0 if the triangle has no area.
pub fn plane_of(triangle: &Triangle) -> Plane {
    let [v0, v1, v2] = [triangle.v0, triangle.v1, triangle.v2].map(|v| v.as_dvec3());
    let normal = (v1 - v0).cross(v2 - v0).normalize_or_zero().as_vec3();
    let middle = (v0 + v1 + v2) / 3.0;
    Plane { normal, distance: normal.as_dvec3().dot(middle) as f32 }
}

#[cfg(test)]
mod tests {
    use glam::{Vec3, vec3};

    use super::*;
    use crate::accel::kdtree::{BuildOptions, KdTree, tests::staircase};

    #[test]
    fn all_corners_lie_in_the_plane() {
        for triangle in staircase(100) {
            let plane = plane_of(&triangle);
            assert!((plane.normal.length() - 1.0).abs() < 1e-6);
            for corner in [triangle.v0, triangle.v1, triangle.v2] {
                assert!((plane.normal.dot(corner) - plane.distance).abs() < 1e-5, "{plane:?}");
            }
        }
    }

    #[test]
    fn planes_that_are_off_by_more_than_roundings_are_not_valid() {
        let triangles = staircase(100);
        let tree = KdTree::build(&triangles, &BuildOptions { slabs: false, ..BuildOptions::default() });
        let scales = tree.scales;
        let arrays = tree.into_arrays();
        let is_valid = |change: fn(&mut Plane, f32)| {
            let mut changed = arrays.clone();
            change(&mut changed.leaf_planes[5], scales.largest() / (1 << 24) as f32);
            are_valid(&changed, &triangles, &scales)
        };
        assert!(is_valid(|_, _| ()));
        assert!(is_valid(|plane, _| *plane = Plane::default()));
        assert!(is_valid(|plane, unit| plane.distance += 20.0 * unit));
        assert!(!is_valid(|plane, unit| plane.distance += 31.0 * unit));
        assert!(!is_valid(|plane, _| *plane = Plane { normal: 1.01 * plane.normal, distance: 1.01 * plane.distance }));
    }

    #[test]
    fn a_triangle_without_area_has_a_plane_that_no_point_is_clear_of() {
        let corner = vec3(1.0, 2.0, 3.0);
        let segment = Triangle { v0: corner, v1: corner, v2: 2.0 * corner, ..Triangle::default() };
        assert_eq!(plane_of(&segment), Plane { normal: Vec3::ZERO, distance: 0.0 });
    }
}
