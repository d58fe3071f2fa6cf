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

/// A passage through a leaf: from `t_enter`, through a face on `entry_axis` that was widened by `slack_enter` (none and
/// 0 where the walk begins), to `t_exit`.
struct Passage {
    t_enter: f32,
    t_exit: f32,
    entry_axis: usize,
    exit_axis: usize,
    slack_enter: f32,
    slack_exit: f32,
}

/// The leaf in `node_ix` where the ray is at t, by planes as they are, not widened.
#[inline(always)]
fn leaf_at(bindings: &Bindings<impl Reads>, ray: &TraversalRay, t: f32, node_ix: &mut u32) -> KdNode {
    let mut node = bindings.kd_nodes[*node_ix as usize];
    while axis_of(node) != KD_LEAF {
        *node_ix = ray.first_child(node) ^ u32::from(t > ray.at_plane(node));
        node = bindings.kd_nodes[*node_ix as usize];
    }
    node
}

impl Passage {
    /// Does the ray, with the slack around it, cross the leaf from one face to another and meet no third? Then what it
    /// touches there is the leaf, the one before and the next, if these are clear too; if not, their search finds it.
    #[inline(always)]
    fn is_clear(&self, ray: &TraversalRay, slabs: &Slabs) -> bool {
        let is_within = |i: usize| slabs.enter[i] + ray.slack[i] < self.t_enter - self.slack_enter;
        let is_short = |i: usize| slabs.exit[i] - ray.slack[i] > self.t_exit + self.slack_exit;
        (0..3).all(|i| i == self.entry_axis || is_within(i))
            && (0..3).all(|i| i == self.exit_axis || is_short(i))
            && self.t_enter + self.slack_enter + self.slack_exit < self.t_exit
    }

    /// The ray between entry and exit.
    #[inline(always)]
    fn part_of(&self, ray: &TraversalRay) -> TraversalRay {
        let mut part = *ray;
        part.t_enter = max(ray.t_enter, self.t_enter - self.slack_enter);
        part.t_exit = min(ray.t_exit, self.t_exit + self.slack_exit);
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
    let mut node_ix = 0;
    let (mut t, mut entry_axis, mut slack_enter) = (ray.t_enter, NO_AXIS, 0.0);
    loop {
        let leaf = leaf_at(bindings, ray, t, &mut node_ix);
        let slabs = ray.slabs_of(bindings, node_ix);
        let [x, y, z] = slabs.exit;
        let exit_axis = match (x <= y && x <= z, y <= z) {
            (true, _) => 0,
            (_, true) => 1,
            _ => 2,
        };
        let (t_exit, slack_exit) = (slabs.exit[exit_axis], ray.slack[exit_axis]);
        let passage = Passage { t_enter: t, t_exit, entry_axis, exit_axis, slack_enter, slack_exit };
        if passage.is_clear(ray, &slabs) {
            intersect_leaf(bindings, ray, leaf, best);
        } else {
            search::<_, ANY_HIT>(bindings, &passage.part_of(ray), pending, best);
        }
        let is_above = usize::from(!(ray.inv_direction[exit_axis] < 0.0));
        node_ix = bindings.kd_ropes[6 * node_ix as usize + 2 * exit_axis + is_above];
        if is_done::<ANY_HIT>(best) || best.t < t_exit - slack_exit || node_ix == 0 {
            return;
        }
        (t, entry_axis, slack_enter) = (t_exit, exit_axis, slack_exit);
    }
}
