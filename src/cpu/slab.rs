//! Whether a ray keeps clear of the slab around a node's surface. Twin of `slab.glsl`; the planes of triangles are in `leaf.rs`,
//! slabs for eight rays in `packet.rs`.

use super::{bindings::Bindings, kdtree::TraversalRay, table::Reads};
use crate::layout::{KD_IN_SLAB, KdNode, Slab};

/// The node's slab, if it has one.
#[inline(always)]
pub fn slab_of<'a>(bindings: &Bindings<'a, impl Reads>, node: KdNode, node_ix: u32) -> Option<&'a Slab> {
    if node.axis_and_child & KD_IN_SLAB == 0 { None } else { bindings.kd_slabs.get(node_ix as usize) }
}

impl TraversalRay {
    /// Whether the ray keeps to one side of the slab on its way from `t_enter` to `t_exit`.
    #[inline(always)]
    pub fn is_clear_of(&self, slab: &Slab, [t_enter, t_exit]: [f32; 2]) -> bool {
        let (t_middle, t_half) = (0.5 * (t_enter + t_exit), 0.5 * (t_exit - t_enter));
        let height = slab.normal.dot(self.origin.into()) - slab.offset;
        let slope = slab.normal.dot(self.direction.into());
        (t_middle * slope + height).abs() > t_half * slope.abs() + 1.0
    }
}
