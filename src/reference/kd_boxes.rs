//! The cells of nodes as boxes, for traversals that use them. Twin of `kdtree/kd_boxes.glsl`.

use super::{
    counting::table::ReadCounter,
    inputs::KernelInputs,
    traversal_ray::{TraversalRay, max, min},
};

/// The t at which a ray meets the planes of a node's cell on each axis.
pub struct BoxPlanes {
    /// The t of the planes that the ray meets first.
    pub near: [f32; 3],
    /// The t of the opposite planes.
    pub far: [f32; 3],
}

impl TraversalRay {
    /// Returns the t of the planes of a node's cell.
    #[inline(always)]
    pub fn box_planes_of(&self, inputs: &KernelInputs<impl ReadCounter>, node_ix: u32) -> BoxPlanes {
        let cell = &inputs.kd_boxes[node_ix as usize];
        let (low, high) = ([cell.min_x, cell.min_y, cell.min_z], [cell.max_x, cell.max_y, cell.max_z]);
        let t0 = [0, 1, 2].map(|i| low[i] * self.inv_direction[i] + self.bias[i]);
        let t1 = [0, 1, 2].map(|i| high[i] * self.inv_direction[i] + self.bias[i]);
        BoxPlanes { near: [0, 1, 2].map(|i| min(t0[i], t1[i])), far: [0, 1, 2].map(|i| max(t0[i], t1[i])) }
    }

    /// Returns `[t_enter, t_exit]` of the ray in a node's cell. The planes of the cell are those of the root's box
    /// and of the splits above the node. Their t are computed as on the way down, so they have the same bits.
    #[inline(always)]
    pub fn interval_in(&self, inputs: &KernelInputs<impl ReadCounter>, node_ix: u32) -> [f32; 2] {
        let BoxPlanes { near, far } = self.box_planes_of(inputs, node_ix);
        [max(max(near[0], near[1]), max(near[2], self.t_enter)), min(min(far[0], far[1]), min(far[2], self.t_exit))]
    }
}
