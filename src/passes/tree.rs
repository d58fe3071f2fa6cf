//! What the traversal reads: the buffers with which every descriptor set begins.

use std::sync::Arc;

use crate::{
    gpu::{Binding, BindingKind, Buffer, BufferUse, Context, GpuError},
    kdtree::KdTree,
    layout::{Frame, KdNode, Triangle},
};

/// In the order of the first `BIND_` numbers in layout.glsl.
pub(super) const KINDS: [BindingKind; 5] =
    [BindingKind::Uniform, BindingKind::Storage, BindingKind::Storage, BindingKind::Storage, BindingKind::Storage];

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

    /// Of the kinds `KINDS`.
    pub(super) fn objects(&self) -> [Binding<'_>; KINDS.len()] {
        [
            Binding::Buffer(self.frame.any()),
            Binding::Buffer(self.triangles.any()),
            Binding::Buffer(self.kd_nodes.any()),
            Binding::Buffer(self.kd_parents.any()),
            Binding::Buffer(self.leaf_triangles.any()),
        ]
    }
}
