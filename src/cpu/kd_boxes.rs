//! The cells of nodes as boxes, for traversals that ask for them. Twin of `kd_boxes.glsl`.

use super::{
    bindings::Bindings,
    kdtree::{TraversalRay, max, min},
    table::Reads,
};

/// Where a ray enters and leaves a node's cell on each axis.
pub struct Slabs {
    pub enter: [f32; 3],
    pub exit: [f32; 3],
}

impl TraversalRay {
    #[inline(always)]
    pub fn slabs_of(&self, bindings: &Bindings<impl Reads>, node_ix: u32) -> Slabs {
        let cell = &bindings.kd_boxes[node_ix as usize];
        let (low, high) = ([cell.min_x, cell.min_y, cell.min_z], [cell.max_x, cell.max_y, cell.max_z]);
        let t0 = [0, 1, 2].map(|i| (low[i] - self.origin[i]) * self.inv_direction[i]);
        let t1 = [0, 1, 2].map(|i| (high[i] - self.origin[i]) * self.inv_direction[i]);
        Slabs { enter: [0, 1, 2].map(|i| min(t0[i], t1[i])), exit: [0, 1, 2].map(|i| max(t0[i], t1[i])) }
    }

    /// The ray's interval in a node's cell, widened by the slack: the planes that `descend` meets on the way there.
    #[inline(always)]
    pub fn interval_in(&self, bindings: &Bindings<impl Reads>, node_ix: u32) -> [f32; 2] {
        let slabs = self.slabs_of(bindings, node_ix);
        let enter = [0, 1, 2].map(|i| slabs.enter[i] - self.slack[i]);
        let exit = [0, 1, 2].map(|i| slabs.exit[i] + self.slack[i]);
        [
            max(max(enter[0], enter[1]), max(enter[2], self.t_enter)),
            min(min(exit[0], exit[1]), min(exit[2], self.t_exit)),
        ]
    }
}
