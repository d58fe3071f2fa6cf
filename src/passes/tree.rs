//! What the traversal reads: a part of every descriptor set.

use std::sync::Arc;

use crate::{
    gpu::{Binding, Buffer, BufferUse, Context, GpuError},
    kdtree::KdTree,
    layout::{
        BIND_FRAME, BIND_KD_NODES, BIND_KD_PARENTS, BIND_LEAF_TRIANGLES, BIND_TRIANGLES, Frame, KdNode, Triangle,
    },
};

/// The bindings' numbers.
pub(super) const BINDINGS: [u32; 5] = [BIND_FRAME, BIND_TRIANGLES, BIND_KD_NODES, BIND_KD_PARENTS, BIND_LEAF_TRIANGLES];

/// Triangles, their kd-tree, and the constants that hold the root's cell.
pub struct Tree {
    /// One.
    pub frame: Buffer<Frame>,
    pub triangles: Buffer<Triangle>,
    pub kd_nodes: Buffer<KdNode>,
    /// One a pair of nodes.
    pub kd_parents: Buffer<u32>,
    pub leaf_triangles: Buffer<u32>,
}

impl Tree {
    /// Uploads triangles, tree and constants.
    ///
    /// # Errors
    /// Beyond the device's limits, out of memory.
    pub fn new(
        context: &Arc<Context>,
        triangles: &[Triangle],
        tree: &KdTree,
        constants: &Frame,
    ) -> Result<Self, GpuError> {
        let storage = BufferUse::Storage;
        Ok(Self {
            frame: Buffer::with(context, "frame", &[*constants], BufferUse::Uniform)?,
            triangles: Buffer::with(context, "triangles", triangles, storage)?,
            kd_nodes: Buffer::with(context, "kd_nodes", &tree.nodes, storage)?,
            kd_parents: Buffer::with(context, "kd_parents", &tree.parents, storage)?,
            leaf_triangles: Buffer::with(context, "leaf_triangles", &tree.leaf_triangles, storage)?,
        })
    }

    /// For [`BINDINGS`].
    pub(super) fn objects(&self) -> [(u32, Binding<'_>); BINDINGS.len()] {
        let buffers = [
            self.frame.any(),
            self.triangles.any(),
            self.kd_nodes.any(),
            self.kd_parents.any(),
            self.leaf_triangles.any(),
        ];
        std::array::from_fn(|i| (BINDINGS[i], Binding::Buffer(buffers[i])))
    }
}
