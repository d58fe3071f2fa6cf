//! Depth-first traversal of the kd-tree (the paper's section 2.3, Algorithm 2). Twin of `kdtree.glsl`.

use glam::Vec3A;

use super::{
    bindings::Bindings, brute, pending_backtrack::PendingBacktrack, pending_mask::Climb,
    pending_mask_boxes::PendingMaskBoxes, pending_restart::Retrace, pending_short_stack::PendingMarked,
    pending_stack::PendingStack, ropes::follow_ropes, table::Reads, triangle::Shear,
};
use crate::{
    frame::Traversal,
    layout::{
        Hit, KD_AXIS_MASK, KD_CHILD_SHIFT, KD_LEAF, KD_ORIGIN_REACH, KD_PLANE_REACH, KdNode, NO_TRIANGLE, Plane, Ray,
    },
};

/// A node and the interval that the ray spends in it.
#[derive(Clone, Copy, Debug)]
pub struct Cell {
    pub node_ix: u32,
    pub depth: u32,
    pub t_enter: f32,
    pub t_exit: f32,
}

/// What the traversal needs of a ray. Arrays by axis have a fourth entry so that two bits index them without a check.
#[derive(Clone, Copy, Debug)]
pub struct TraversalRay {
    shear: Shear,
    origin: Vec3A,
    direction: Vec3A,
    /// How far a segment has to keep from a plane to be clear of it.
    plane_reach: f32,
    pub(super) inv_direction: [f32; 4],
    /// Where the ray meets the plane at 0 on each axis, in t.
    pub(super) bias: [f32; 4],
    t_min: f32,
    pub t_enter: f32,
    pub t_exit: f32,
    source_triangle: u32,
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

impl TraversalRay {
    #[inline]
    pub fn new(bindings: &Bindings<impl Reads>, ray: &Ray, t_min: f32) -> Self {
        let origin = ray.origin.to_array();
        let cell_min = bindings.frame.cell_min.to_array();
        let cell_max = bindings.frame.cell_max.to_array();
        // A direction in the plane is taken as all but in it: finite everywhere, and one rule for all ties.
        let direction = ray.direction.to_array().map(|d| if d.abs() < 1e-12 { 1e-12 } else { d });
        let inv_direction = direction.map(|d| 1.0 / d);
        let bias = [0, 1, 2].map(|i| -origin[i] * inv_direction[i]);
        let t0 = [0, 1, 2].map(|i| cell_min[i] * inv_direction[i] + bias[i]);
        let t1 = [0, 1, 2].map(|i| cell_max[i] * inv_direction[i] + bias[i]);
        let near = [0, 1, 2].map(|i| min(t0[i], t1[i]));
        let far = [0, 1, 2].map(|i| max(t0[i], t1[i]));
        Self {
            shear: Shear::of(origin, ray.direction.to_array()),
            origin: ray.origin.into(),
            direction: ray.direction.into(),
            plane_reach: KD_PLANE_REACH * largest_coordinate(bindings),
            inv_direction: by_axis(inv_direction),
            bias: by_axis(bias),
            t_min,
            t_enter: max(max(near[0], near[1]), max(near[2], t_min)),
            t_exit: min(min(far[0], far[1]), min(far[2], ray.t_max)),
            source_triangle: ray.source_triangle,
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
        (node.axis_and_child >> KD_CHILD_SHIFT) + first_is_above
    }
}

#[inline(always)]
fn largest_coordinate(bindings: &Bindings<impl Reads>) -> f32 {
    bindings.frame.cell_min.abs().max(bindings.frame.cell_max.abs()).max_element()
}

/// The ray with its origin moved along it to lie within `KD_ORIGIN_REACH`, and how far: 0 for all but cameras far away.
#[inline(always)]
pub fn near_scene(bindings: &Bindings<impl Reads>, ray: &Ray) -> (Ray, f32) {
    if ray.origin.abs().max_element() <= KD_ORIGIN_REACH * largest_coordinate(bindings) {
        return (*ray, 0.0);
    }
    let t_start = max(TraversalRay::new(bindings, ray, 0.0).t_enter, 0.0);
    (Ray { origin: ray.origin + t_start * ray.direction, t_max: ray.t_max - t_start, ..*ray }, t_start)
}

fn by_axis([x, y, z]: [f32; 3]) -> [f32; 4] {
    [x, y, z, 0.0]
}

/// Split axis, or `KD_LEAF`.
#[inline(always)]
pub fn axis_of(node: KdNode) -> u32 {
    node.axis_and_child & KD_AXIS_MASK
}

/// How subtrees that are left for later are kept.
pub trait Pending {
    fn new() -> Self;
    fn clear(&mut self);
    fn push(&mut self, second_ix: u32, cell: &Cell);
    /// The next pending cell that may hold a hit nearer than `t_best`, or false.
    fn pop(&mut self, bindings: &Bindings<impl Reads>, ray: &TraversalRay, t_best: f32, cell: &mut Cell) -> bool;
}

/// Down to the leaf where the ray enters the cell. A NaN fails both tests and goes to the first child: it ends.
#[inline(always)]
fn descend<P: Pending>(
    bindings: &Bindings<impl Reads>,
    ray: &TraversalRay,
    pending: &mut P,
    cell: &mut Cell,
) -> KdNode {
    let mut node = bindings.kd_nodes[cell.node_ix as usize];
    while axis_of(node) != KD_LEAF {
        let t_cross = ray.crossing(node);
        let first_ix = ray.first_child(node);
        let in_first = t_cross >= cell.t_enter;
        let in_second = t_cross <= cell.t_exit;
        cell.depth += 1;
        cell.node_ix = if in_second && !in_first { first_ix ^ 1 } else { first_ix };
        if in_first && in_second {
            pending.push(first_ix ^ 1, cell);
            cell.t_exit = t_cross;
        }
        node = bindings.kd_nodes[cell.node_ix as usize];
    }
    node
}

/// A triangle against the ray; of two hits at one t the lower index wins, whatever the order of triangles.
#[inline(always)]
fn intersect(bindings: &Bindings<impl Reads>, ray: &TraversalRay, triangle_ix: u32, best: &mut Hit) {
    let triangle = &bindings.triangles[triangle_ix as usize];
    let Some(hit) = ray.shear.intersect_triangle(triangle, triangle_ix) else { return };
    let nearer = hit.t < best.t || (hit.t == best.t && triangle_ix < best.triangle_ix);
    if hit.t > ray.t_min && nearer && triangle_ix != ray.source_triangle {
        *best = hit;
    }
}

/// Whether a segment keeps to one side of a plane, so far from it that no rounding of the hit test reaches across.
#[inline(always)]
fn is_clear(plane: &Plane, from: Vec3A, to: Vec3A, reach: f32) -> bool {
    let normal = Vec3A::from(plane.normal);
    let (height_from, height_to) = (normal.dot(from) - plane.distance, normal.dot(to) - plane.distance);
    height_from * height_to > 0.0 && height_from.abs().min(height_to.abs()) > reach
}

/// The leaf's triangles, but those whose planes the ray does not meet within the cell.
#[inline(always)]
pub(super) fn intersect_leaf(
    bindings: &Bindings<impl Reads>,
    ray: &TraversalRay,
    leaf: KdNode,
    [t_enter, t_exit]: [f32; 2],
    best: &mut Hit,
) {
    let (from, to) = (ray.origin + t_enter * ray.direction, ray.origin + t_exit * ray.direction);
    let first = leaf.split_or_first as usize;
    let entries = first..first + (leaf.axis_and_child >> KD_CHILD_SHIFT) as usize;
    let planes = &bindings.leaf_planes[entries.clone()];
    for (plane, &triangle_ix) in planes.iter().zip(&bindings.leaf_triangles[entries]) {
        if !is_clear(plane, from, to, ray.plane_reach) {
            intersect(bindings, ray, triangle_ix, best);
        }
    }
}

#[inline(always)]
pub(super) fn is_done<const ANY_HIT: bool>(best: &Hit) -> bool {
    ANY_HIT && best.triangle_ix != NO_TRIANGLE
}

/// All leaves that the ray meets in [t_enter, t_exit], until nothing nearer can follow.
#[inline]
pub(super) fn search<P: Pending, const ANY_HIT: bool>(
    bindings: &Bindings<impl Reads>,
    ray: &TraversalRay,
    pending: &mut P,
    best: &mut Hit,
) {
    // Not `>`: a NaN misses.
    if !(ray.t_enter <= ray.t_exit) {
        return;
    }
    let mut cell = Cell { node_ix: 0, depth: 0, t_enter: ray.t_enter, t_exit: ray.t_exit };
    pending.clear();
    loop {
        let leaf = descend(bindings, ray, pending, &mut cell);
        intersect_leaf(bindings, ray, leaf, [cell.t_enter, min(cell.t_exit, best.t)], best);
        if is_done::<ANY_HIT>(best) || !pending.pop(bindings, ray, best.t, &mut cell) {
            return;
        }
    }
}

/// A traversal that remembers its working memory from ray to ray; one for each thread.
#[expect(clippy::large_enum_variant, reason = "one a thread, on its stack")]
pub enum Traverser {
    Mask(PendingMarked<Climb, 8>),
    MaskBoxes(PendingMaskBoxes),
    Restart(PendingMarked<Retrace, 0>),
    Backtrack(PendingBacktrack),
    ShortStack(PendingMarked<Retrace, 8>),
    Ropes,
    Stack(PendingStack),
    Brute,
}

impl Traverser {
    pub fn new(traversal: Traversal) -> Self {
        match traversal {
            Traversal::Mask => Self::Mask(Pending::new()),
            Traversal::MaskBoxes => Self::MaskBoxes(Pending::new()),
            Traversal::Restart => Self::Restart(Pending::new()),
            Traversal::Backtrack => Self::Backtrack(Pending::new()),
            Traversal::ShortStack => Self::ShortStack(Pending::new()),
            Traversal::Ropes => Self::Ropes,
            Traversal::Stack => Self::Stack(Pending::new()),
            Traversal::Brute => Self::Brute,
        }
    }

    /// The closest hit in (0, t_max]. A miss keeps t = t_max.
    #[inline]
    pub fn closest_hit(&mut self, bindings: &Bindings<impl Reads>, ray: &Ray) -> Hit {
        self.traverse::<false>(bindings, ray, 0.0)
    }

    /// Whether anything lies in (0, t_max].
    #[inline]
    pub fn any_hit(&mut self, bindings: &Bindings<impl Reads>, ray: &Ray) -> bool {
        self.traverse::<true>(bindings, ray, 0.0).triangle_ix != NO_TRIANGLE
    }

    /// The closest hit in (t_min, t_max], or with `ANY_HIT` one that need not be the closest. A miss keeps t = t_max.
    #[inline]
    pub fn traverse<const ANY_HIT: bool>(&mut self, bindings: &Bindings<impl Reads>, ray_in: &Ray, t_min: f32) -> Hit {
        let (near, t_start) = near_scene(bindings, ray_in);
        let mut best = Hit { t: near.t_max, triangle_ix: NO_TRIANGLE, u: 0.0, v: 0.0 };
        let ray = &TraversalRay::new(bindings, &near, t_min - t_start);
        match self {
            Self::Mask(pending) => search::<_, ANY_HIT>(bindings, ray, pending, &mut best),
            Self::MaskBoxes(pending) => search::<_, ANY_HIT>(bindings, ray, pending, &mut best),
            Self::Restart(pending) => search::<_, ANY_HIT>(bindings, ray, pending, &mut best),
            Self::Backtrack(pending) => search::<_, ANY_HIT>(bindings, ray, pending, &mut best),
            Self::ShortStack(pending) => search::<_, ANY_HIT>(bindings, ray, pending, &mut best),
            Self::Ropes => follow_ropes::<ANY_HIT>(bindings, ray, &mut best),
            Self::Stack(pending) => search::<_, ANY_HIT>(bindings, ray, pending, &mut best),
            Self::Brute => best = brute::closest_hit_beyond(bindings.triangles, &near, t_min - t_start),
        }
        best.t = if best.triangle_ix == NO_TRIANGLE { ray_in.t_max } else { best.t + t_start };
        best
    }
}
