//! The cells of nodes as boxes, for traversals that ask for them. Twin of `kd_boxes.glsl`.

use super::{
    bindings::Bindings,
    kdtree::{TraversalRay, max, min},
    table::Reads,
};

/// Where a ray enters the widened planes of a node's cell on each axis: those it comes to first, and the far ones.
pub struct Slabs {
    pub near: [f32; 3],
    pub far: [f32; 3],
}

impl TraversalRay {
    #[inline(always)]
    pub fn slabs_of(&self, bindings: &Bindings<impl Reads>, node_ix: u32) -> Slabs {
        let cell = &bindings.kd_boxes[node_ix as usize];
        let (low, high) = ([cell.min_x, cell.min_y, cell.min_z], [cell.max_x, cell.max_y, cell.max_z]);
        let t0 = [0, 1, 2].map(|i| low[i] * self.inv_direction[i] + self.bias[i]);
        let t1 = [0, 1, 2].map(|i| high[i] * self.inv_direction[i] + self.bias[i]);
        Slabs { near: [0, 1, 2].map(|i| min(t0[i], t1[i])), far: [0, 1, 2].map(|i| max(t0[i], t1[i])) }
    }

    /// In t, how long the ray is in a widened plane on each axis.
    #[inline(always)]
    pub fn widths(&self) -> [f32; 3] {
        [0, 1, 2].map(|i| self.width * self.inv_direction[i].abs())
    }

    /// The ray's interval in a node's cell between widened planes: the planes that `descend` meets on the way there.
    #[inline(always)]
    pub fn interval_in(&self, bindings: &Bindings<impl Reads>, node_ix: u32) -> [f32; 2] {
        let (Slabs { near, far }, widths) = (self.slabs_of(bindings, node_ix), self.widths());
        let exit = [0, 1, 2].map(|i| far[i] + widths[i]);
        [max(max(near[0], near[1]), max(near[2], self.t_enter)), min(min(exit[0], exit[1]), min(exit[2], self.t_exit))]
    }
}
