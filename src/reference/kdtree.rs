//! Depth-first traversal of the kd-tree (the paper's section 2.3, Algorithm 2). Twin of `kdtree.glsl`.

use glam::{Vec3, Vec3A};

use super::{
    counting::table::ReadCounter,
    inputs::KernelInputs,
    leaf::{Target, intersect_leaf},
    search_ray::SearchRay,
    slab::slab_of,
};
use crate::{
    accel::kdtree::EMPTY_LEAF,
    layout::{
        Hit, KD_AXIS_MASK, KD_LEAF, KD_LEAST_COMPONENT, KD_MAX_ORIGIN_DISTANCE, KD_PAIR_SHIFT, KD_PLANE_EPSILON,
        KdNode, NO_TRIANGLE,
    },
};

/// A node and the interval that the ray spends in it.
#[derive(Clone, Copy, Debug)]
pub struct Cell {
    pub node_ix: u32,
    pub t_enter: f32,
    pub t_exit: f32,
}

/// What the traversal needs of a ray. Arrays by axis have a fourth entry so that two bits index them without a check.
#[derive(Clone, Copy, Debug)]
pub struct TraversalRay {
    pub target: Target,
    pub origin: Vec3A,
    pub direction: Vec3A,
    /// How far a segment has to keep from a plane to be clear of it.
    pub plane_epsilon: f32,
    pub inv_direction: [f32; 4],
    /// Where the ray meets the plane at 0 on each axis, in t.
    pub bias: [f32; 4],
    pub t_enter: f32,
    pub t_exit: f32,
}

/// GLSL's `min`: the first operand where either is NaN.
#[inline(always)]
pub fn min(x: f32, y: f32) -> f32 {
    if y < x { y } else { x }
}

/// GLSL's `max`: the first operand where either is NaN.
#[inline(always)]
pub fn max(x: f32, y: f32) -> f32 {
    if x < y { y } else { x }
}

/// Bit i: on axis i, the ray comes to the upper child first.
#[inline(always)]
pub fn signs_of(direction: Vec3) -> u32 {
    let is_below = |d: f32| u32::from(d <= -KD_LEAST_COMPONENT);
    is_below(direction.x) | is_below(direction.y) << 1 | is_below(direction.z) << 2
}

impl TraversalRay {
    #[inline]
    pub fn new(inputs: &KernelInputs<impl ReadCounter>, ray: &SearchRay) -> Self {
        let origin = ray.origin.to_array();
        let cell_min = inputs.cell_min.to_array();
        let cell_max = inputs.cell_max.to_array();
        let direction =
            ray.direction.to_array().map(|d| if d.abs() < KD_LEAST_COMPONENT { KD_LEAST_COMPONENT } else { d });
        let inv_direction = direction.map(|d| 1.0 / d);
        let bias = [0, 1, 2].map(|i| -origin[i] * inv_direction[i]);
        let t0 = [0, 1, 2].map(|i| cell_min[i] * inv_direction[i] + bias[i]);
        let t1 = [0, 1, 2].map(|i| cell_max[i] * inv_direction[i] + bias[i]);
        let near = [0, 1, 2].map(|i| min(t0[i], t1[i]));
        let far = [0, 1, 2].map(|i| max(t0[i], t1[i]));
        Self {
            target: Target::of(ray),
            origin: ray.origin.into(),
            direction: ray.direction.into(),
            plane_epsilon: KD_PLANE_EPSILON * largest_coordinate(inputs),
            inv_direction: by_axis(inv_direction),
            bias: by_axis(bias),
            t_enter: max(max(near[0], near[1]), max(near[2], ray.t_min)),
            t_exit: min(min(far[0], far[1]), min(far[2], ray.t_max)),
        }
    }

    /// Where the ray meets the split plane.
    #[inline(always)]
    pub fn crossing(&self, node: KdNode) -> f32 {
        let axis = axis_of(node) as usize;
        f32::from_bits(node.split_or_first) * self.inv_direction[axis] + self.bias[axis]
    }

    /// The child on the side that the ray comes from; the other is `^ 1`.
    #[inline(always)]
    pub fn first_child(&self, node: KdNode) -> u32 {
        let first_is_above = u32::from(self.inv_direction[axis_of(node) as usize] < 0.0);
        2 * (node.axis_and_child >> KD_PAIR_SHIFT) + first_is_above
    }
}

#[inline(always)]
pub fn largest_coordinate(inputs: &KernelInputs<impl ReadCounter>) -> f32 {
    inputs.cell_min.abs().max(inputs.cell_max.abs()).max_element()
}

/// How far from 0, by its largest coordinate, a ray may start for the margins of the leaves to cover its rounding.
#[inline(always)]
pub fn origin_reach(inputs: &KernelInputs<impl ReadCounter>) -> f32 {
    KD_MAX_ORIGIN_DISTANCE * largest_coordinate(inputs)
}

/// Whether the ray starts within reach.
#[inline(always)]
fn is_within_reach(inputs: &KernelInputs<impl ReadCounter>, ray: &SearchRay) -> bool {
    ray.origin.abs().max_element() <= origin_reach(inputs)
}

/// The ray with its origin moved along it to lie within `KD_MAX_ORIGIN_DISTANCE`, and how far: 0 for all but cameras far away.
#[inline(always)]
pub fn near_scene(inputs: &KernelInputs<impl ReadCounter>, ray: &SearchRay) -> (SearchRay, f32) {
    if is_within_reach(inputs, ray) {
        return (*ray, 0.0);
    }
    let t_start = max(TraversalRay::new(inputs, &SearchRay { t_min: 0.0, ..*ray }).t_enter, 0.0);
    let origin = ray.origin + t_start * ray.direction;
    (SearchRay { origin, t_min: ray.t_min - t_start, t_max: ray.t_max - t_start, ..*ray }, t_start)
}

/// What `search` finds from near the scene, as seen from where the ray starts. A miss keeps t = t_max.
#[inline(always)]
pub fn hit_from_near(
    inputs: &KernelInputs<impl ReadCounter>,
    probe: &SearchRay,
    search: impl FnOnce(&SearchRay, &mut Hit),
) -> Hit {
    let (near, t_start) = near_scene(inputs, probe);
    let mut best = near.miss();
    search(&near, &mut best);
    best.t = if best.triangle_ix == NO_TRIANGLE { probe.t_max } else { best.t + t_start };
    best
}

fn by_axis([x, y, z]: [f32; 3]) -> [f32; 4] {
    [x, y, z, 0.0]
}

/// Of a split.
#[inline(always)]
pub fn axis_of(node: KdNode) -> u32 {
    node.axis_and_child & KD_AXIS_MASK
}

#[inline(always)]
pub fn is_leaf(node: KdNode) -> bool {
    node.axis_and_child & KD_LEAF != 0
}

/// How subtrees that are left for later are kept.
pub trait Pending {
    fn new() -> Self;
    fn clear(&mut self);
    /// A level down, where a bit is kept for each.
    fn go_down(&mut self) {}
    fn push(&mut self, second_ix: u32, cell: &Cell);
    /// The next pending cell that may hold a hit nearer than `t_best`, or false.
    fn pop(
        &mut self,
        inputs: &KernelInputs<impl ReadCounter>,
        ray: &TraversalRay,
        t_best: f32,
        cell: &mut Cell,
    ) -> bool;
}

/// Down to the leaf where the ray enters the cell, or to a slab that it keeps clear of, as if that were an empty leaf. A NaN
/// fails both tests and goes to the first child: it ends.
#[inline(always)]
fn descend<P: Pending>(
    inputs: &KernelInputs<impl ReadCounter>,
    ray: &TraversalRay,
    t_best: f32,
    pending: &mut P,
    cell: &mut Cell,
) -> KdNode {
    let mut node = inputs.kd_nodes[cell.node_ix as usize];
    loop {
        if let Some(slab) = slab_of(inputs, node, cell.node_ix)
            && ray.is_clear_of(slab, [cell.t_enter, min(cell.t_exit, t_best)])
        {
            return EMPTY_LEAF;
        }
        if is_leaf(node) {
            return node;
        }
        let t_cross = ray.crossing(node);
        let first_ix = ray.first_child(node);
        let in_first = t_cross >= cell.t_enter;
        let in_second = t_cross <= cell.t_exit;
        pending.go_down();
        cell.node_ix = if in_second && !in_first { first_ix ^ 1 } else { first_ix };
        if in_first && in_second {
            pending.push(first_ix ^ 1, cell);
            cell.t_exit = t_cross;
        }
        node = inputs.kd_nodes[cell.node_ix as usize];
    }
}

#[inline(always)]
pub(crate) fn is_done<const ANY_HIT: bool>(best: &Hit) -> bool {
    ANY_HIT && best.triangle_ix != NO_TRIANGLE
}

/// All leaves that the ray meets in [t_enter, t_exit], until nothing nearer can follow.
#[inline(always)]
pub(crate) fn search<P: Pending, const ANY_HIT: bool>(
    inputs: &KernelInputs<impl ReadCounter>,
    ray: &TraversalRay,
    pending: &mut P,
    best: &mut Hit,
) {
    // Not `>`: a NaN misses.
    if ray.t_enter <= ray.t_exit {
        let root = Cell { node_ix: 0, t_enter: ray.t_enter, t_exit: ray.t_exit };
        search_cell::<_, ANY_HIT>(inputs, ray, pending, root, best);
    }
}

/// As [`search`], in a cell that the ray is in.
#[inline(always)]
pub(crate) fn search_cell<P: Pending, const ANY_HIT: bool>(
    inputs: &KernelInputs<impl ReadCounter>,
    ray: &TraversalRay,
    pending: &mut P,
    mut cell: Cell,
    best: &mut Hit,
) {
    pending.clear();
    loop {
        let leaf = descend(inputs, ray, best.t, pending, &mut cell);
        intersect_leaf(inputs, ray, leaf, [cell.t_enter, min(cell.t_exit, best.t)], best);
        if is_done::<ANY_HIT>(best) || !pending.pop(inputs, ray, best.t, &mut cell) {
            return;
        }
    }
}
