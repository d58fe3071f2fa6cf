//! Tests whether a ray keeps clear of the slab around a node's surface. Twin of `kdtree/slab.glsl`. `leaf.rs` has the
//! test for the planes of triangles, and `src/cpu/packet.rs` the test of slabs for sixteen rays.

use super::{counting::table::ReadCounter, inputs::KernelInputs, traversal_ray::TraversalRay};
use crate::layout::{KD_HAS_SLAB, KdNode, Slab};

/// Returns the node's slab, if it has one.
#[inline(always)]
pub fn slab_of<'a>(inputs: &KernelInputs<'a, impl ReadCounter>, node: KdNode, node_ix: u32) -> Option<&'a Slab> {
    if node.axis_and_child & KD_HAS_SLAB == 0 { None } else { inputs.kd_slabs.get(node_ix as usize) }
}

/// A segment of a ray, such as the one within a cell: the middle and half the length, in t.
#[derive(Clone, Copy)]
pub struct Interval {
    pub middle: f32,
    pub half: f32,
}

impl Interval {
    /// The segment from `t_enter` to `t_exit`.
    #[inline(always)]
    pub fn new(t_enter: f32, t_exit: f32) -> Self {
        Self { middle: 0.5 * (t_enter + t_exit), half: 0.5 * (t_exit - t_enter) }
    }
}

impl TraversalRay {
    /// Returns whether the ray stays on one side of the slab, outside of it, from `t_enter` to `t_exit`.
    #[inline(always)]
    pub fn is_clear_of(&self, slab: &Slab, [t_enter, t_exit]: [f32; 2]) -> bool {
        let interval = Interval::new(t_enter, t_exit);
        let height = slab.normal.dot(self.origin.into()) - slab.offset;
        let slope = slab.normal.dot(self.direction.into());
        (interval.middle * slope + height).abs() > interval.half * slope.abs() + 1.0
    }
}
