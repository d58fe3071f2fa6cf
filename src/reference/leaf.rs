//! Tests of a leaf's triangles. A ray is tested only against those whose planes it meets within the leaf. Twin of
//! `search/leaf.glsl`.

use std::ops::Range;

use glam::{Mat4, Vec3A, Vec4};

use super::{
    candidate::intersect, counting::table::ReadCounter, inputs::KernelInputs, slab::Interval,
    traversal_ray::TraversalRay,
};
use crate::layout::{Hit, KD_PAIR_SHIFT, KdNode, Plane};

/// Returns the leaf's entries: indices into `leaf_triangles` and `leaf_planes`.
#[inline(always)]
pub fn entries_of(leaf: KdNode) -> Range<usize> {
    let first = leaf.split_or_first as usize;
    first..first + (leaf.axis_and_child >> KD_PAIR_SHIFT) as usize
}

/// Returns the four planes from `first` on as a structure of arrays: the columns are the normals' x, y and z, and the
/// distances. Planes beyond the last one are zero.
#[inline(always)]
fn four_planes(planes: &[Plane], first: usize) -> Mat4 {
    let columns = |planes: &[Plane; 4]| {
        let [a, b, c, d]: [[f32; 4]; 4] = bytemuck::cast(*planes);
        Mat4::from_cols(a.into(), b.into(), c.into(), d.into()).transpose()
    };
    match planes.get(first..first + 4).and_then(|four| four.try_into().ok()) {
        Some(four) => columns(four),
        None => columns(&std::array::from_fn(|i| planes.get(first + i).copied().unwrap_or_default())),
    }
}

/// Returns a mask of the planes that the ray may meet in `interval`. Bit i is cleared if the ray stays on one side of
/// plane i, at a distance that the rounding of the hit test cannot bridge.
#[inline(always)]
fn near_planes(ray: &TraversalRay, interval: Interval, planes: &Mat4) -> u32 {
    let dot = |v: Vec3A| planes.x_axis * v.x + planes.y_axis * v.y + planes.z_axis * v.z;
    let (height, slope) = (dot(ray.origin) - planes.w_axis, dot(ray.direction));
    let is_clear =
        (interval.middle * slope + height).abs().cmpgt(interval.half * slope.abs() + Vec4::splat(ray.plane_epsilon));
    !is_clear.bitmask()
}

/// Tests the leaf's triangles against the ray, as [`intersect_entries`] does. `interval`: `t_enter` and `t_exit`.
#[inline(always)]
pub fn intersect_leaf(
    inputs: &KernelInputs<impl ReadCounter>,
    ray: &TraversalRay,
    leaf: KdNode,
    interval: [f32; 2],
    best: &mut Hit,
) {
    intersect_entries(inputs, ray, entries_of(leaf), interval, best);
}

/// Tests the triangles of some entries against the ray. Skips each triangle whose plane the ray does not meet from
/// `t_enter` to `t_exit`; without planes, skips none. Keeps the nearest hit in `best`.
#[inline(always)]
pub fn intersect_entries(
    inputs: &KernelInputs<impl ReadCounter>,
    ray: &TraversalRay,
    entries: Range<usize>,
    [t_enter, t_exit]: [f32; 2],
    best: &mut Hit,
) {
    let triangles = &inputs.leaf_triangles[entries.clone()];
    if inputs.leaf_planes.is_empty() {
        return triangles.iter().for_each(|&ix| intersect(inputs, &ray.hit_filter, ix, best));
    }
    let interval = Interval::new(t_enter, t_exit);
    for (four, first) in triangles.chunks(4).zip(entries.step_by(4)) {
        let planes = four_planes(inputs.leaf_planes, first);
        let mut near = near_planes(ray, interval, &planes) & ((1 << four.len()) - 1);
        while near != 0 {
            intersect(inputs, &ray.hit_filter, four[near.trailing_zeros() as usize], best);
            near &= near - 1;
        }
    }
}
