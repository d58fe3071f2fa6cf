//! What the traversal reads: a part of every descriptor set.

use std::sync::Arc;

use crate::{
    frame::Traversal,
    gpu::{Binding, Buffer, BufferUse, Context, GpuError},
    kdtree::{Extras, KdTree},
    layout::{
        BIND_FRAME, BIND_KD_BOXES, BIND_KD_NODES, BIND_KD_PARENTS, BIND_KD_ROPES, BIND_LEAF_PLANES,
        BIND_LEAF_TRIANGLES, BIND_TRIANGLES, BRUTE_MAX_TRIANGLES, Frame, KdBox, KdNode, Plane, Triangle,
    },
};

/// The bindings' numbers.
pub(super) const BINDINGS: [u32; 8] = [
    BIND_FRAME,
    BIND_TRIANGLES,
    BIND_KD_NODES,
    BIND_KD_PARENTS,
    BIND_LEAF_TRIANGLES,
    BIND_LEAF_PLANES,
    BIND_KD_BOXES,
    BIND_KD_ROPES,
];

/// Triangles, their kd-tree, and the constants that hold the root's cell.
pub struct Tree {
    /// One.
    pub frame: Buffer<Frame>,
    pub triangles: Buffer<Triangle>,
    pub kd_nodes: Buffer<KdNode>,
    /// One a pair of nodes.
    pub kd_parents: Buffer<u32>,
    pub leaf_triangles: Buffer<u32>,
    /// One an entry of `leaf_triangles`.
    pub leaf_planes: Buffer<Plane>,
    /// One a node, after `add_extras`.
    pub kd_boxes: Buffer<KdBox>,
    /// Six a node, after `add_extras`.
    pub kd_ropes: Buffer<u32>,
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
            leaf_planes: Buffer::with(context, "leaf_planes", &tree.leaf_planes, storage)?,
            kd_boxes: Buffer::new(context, "kd_boxes", 0, storage)?,
            kd_ropes: Buffer::new(context, "kd_ropes", 0, storage)?,
        })
    }

    /// Uploads what the traversal reads beside the tree. Descriptor sets are to be made anew.
    ///
    /// # Errors
    /// Too many triangles for brute force; beyond the device's limits, out of memory.
    pub fn add_extras(&mut self, context: &Arc<Context>, tree: &KdTree, traversal: Traversal) -> Result<(), GpuError> {
        let (value, limit) = (self.triangles.len() as u64, u64::from(BRUTE_MAX_TRIANGLES));
        if traversal == Traversal::Brute && value > limit {
            return Err(GpuError::Limit { what: "triangles without a tree", value, limit });
        }
        let extras = Extras::new(tree, traversal);
        self.kd_boxes = Buffer::with(context, "kd_boxes", &extras.boxes, BufferUse::Storage)?;
        self.kd_ropes = Buffer::with(context, "kd_ropes", &extras.ropes, BufferUse::Storage)?;
        Ok(())
    }

    /// For [`BINDINGS`].
    pub(super) fn objects(&self) -> [(u32, Binding<'_>); BINDINGS.len()] {
        let buffers = [
            self.frame.any(),
            self.triangles.any(),
            self.kd_nodes.any(),
            self.kd_parents.any(),
            self.leaf_triangles.any(),
            self.leaf_planes.any(),
            self.kd_boxes.any(),
            self.kd_ropes.any(),
        ];
        std::array::from_fn(|i| (BINDINGS[i], Binding::Buffer(buffers[i])))
    }
}
