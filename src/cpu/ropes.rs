//! From leaf to leaf by ropes; near edges by the mask. Twin of `ropes.glsl`.

use super::{
    bindings::Bindings,
    kd_boxes::Slabs,
    kdtree::{TraversalRay, axis_of, intersect_leaf, is_done, max, min, search},
    pending_mask::PendingMask,
    table::Reads,
};
use crate::layout::{Hit, KD_LEAF, KdNode};

/// No axis: where the walk begins.
const NO_AXIS: usize = 3;

/// A passage through a leaf from `t_enter` to `t_exit`, by planes on two axes that the ray is in for `width_enter` and
/// `width_exit` (the walk begins without one: no axis, width 0).
struct Passage {
    t_enter: f32,
    t_exit: f32,
    entry_axis: usize,
    exit_axis: usize,
    width_enter: f32,
    width_exit: f32,
}

/// The leaf in `node_ix` where the ray is at t.
#[inline(always)]
fn leaf_at(bindings: &Bindings<impl Reads>, ray: &TraversalRay, t: f32, node_ix: &mut u32) -> KdNode {
    let mut node = bindings.kd_nodes[*node_ix as usize];
    while axis_of(node) != KD_LEAF {
        *node_ix = ray.first_child(node) ^ u32::from(t > ray.crossing(node)[0]);
        node = bindings.kd_nodes[*node_ix as usize];
    }
    node
}

impl Passage {
    /// Is the ray out of all other planes of the leaf from its entry until it has quite left it?
    #[inline(always)]
    fn is_clear(&self, slabs: &Slabs, widths: &[f32; 3]) -> bool {
        let is_within = |i: usize| slabs.near[i] + widths[i] < self.t_enter;
        let is_short = |i: usize| slabs.far[i] > self.t_exit + self.width_exit;
        (0..3).all(|i| i == self.entry_axis || is_within(i))
            && (0..3).all(|i| i == self.exit_axis || is_short(i))
            && self.t_enter + self.width_enter < self.t_exit
    }

    /// The ray between entry and exit.
    #[inline(always)]
    fn part_of(&self, ray: &TraversalRay) -> TraversalRay {
        let mut part = *ray;
        part.t_enter = max(ray.t_enter, self.t_enter);
        part.t_exit = min(ray.t_exit, self.t_exit + self.width_exit);
        part
    }
}

/// The closest hit, or with `ANY_HIT` one that need not be the closest.
#[inline]
pub fn follow_ropes<const ANY_HIT: bool>(
    bindings: &Bindings<impl Reads>,
    ray: &TraversalRay,
    pending: &mut PendingMask,
    best: &mut Hit,
) {
    if !(ray.t_enter <= ray.t_exit) {
        return;
    }
    let widths = ray.widths();
    let mut node_ix = 0;
    let (mut t, mut entry_axis, mut width_enter) = (ray.t_enter, NO_AXIS, 0.0);
    loop {
        let leaf = leaf_at(bindings, ray, t, &mut node_ix);
        let slabs = ray.slabs_of(bindings, node_ix);
        let [x, y, z] = slabs.far;
        let exit_axis = match (x <= y && x <= z, y <= z) {
            (true, _) => 0,
            (_, true) => 1,
            _ => 2,
        };
        let (t_exit, width_exit) = (slabs.far[exit_axis], widths[exit_axis]);
        let passage = Passage { t_enter: t, t_exit, entry_axis, exit_axis, width_enter, width_exit };
        if passage.is_clear(&slabs, &widths) {
            intersect_leaf(bindings, ray, leaf, best);
        } else {
            search::<_, ANY_HIT>(bindings, &passage.part_of(ray), pending, best);
        }
        let is_above = usize::from(!(ray.inv_direction[exit_axis] < 0.0));
        node_ix = bindings.kd_ropes[6 * node_ix as usize + 2 * exit_axis + is_above];
        if is_done::<ANY_HIT>(best) || best.t < t_exit || node_ix == 0 {
            return;
        }
        (t, entry_axis, width_enter) = (t_exit, exit_axis, width_exit);
    }
}
