//! What the traversal reads: triangles and their tree by address, and the constants that hold the addresses.

use std::sync::Arc;

use crate::{
    frame::Traversal,
    gpu::{Binding, Buffer, BufferUse, Context, GpuError},
    kdtree::{Extras, KdTree},
    layout::{BIND_FRAME, BRUTE_MAX_TRIANGLES, Frame, KdBox, KdNode, Plane, Triangle},
};

/// Triangles, their kd-tree, and the constants that hold the root's cell.
pub struct Tree {
    /// One: `constants`, once they are there.
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
    constants: Frame,
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
        let by_address = BufferUse::Address;
        let mut made = Self {
            frame: Buffer::new(context, "frame", 1, BufferUse::Uniform)?,
            triangles: Buffer::with(context, "triangles", triangles, by_address)?,
            kd_nodes: Buffer::with(context, "kd_nodes", &tree.nodes, by_address)?,
            kd_parents: Buffer::with(context, "kd_parents", &tree.parents, by_address)?,
            leaf_triangles: Buffer::with(context, "leaf_triangles", &tree.leaf_triangles, by_address)?,
            leaf_planes: Buffer::with(context, "leaf_planes", &tree.leaf_planes, by_address)?,
            kd_boxes: Buffer::new(context, "kd_boxes", 0, by_address)?,
            kd_ropes: Buffer::new(context, "kd_ropes", 0, by_address)?,
            constants: *constants,
        };
        made.set_constants(constants);
        made.frame.upload(&[made.constants])?;
        Ok(made)
    }

    /// Uploads what the traversal reads beside the tree. Where that fails, all is as before.
    ///
    /// # Errors
    /// Too many triangles for brute force; beyond the device's limits, out of memory.
    pub fn add_extras(&mut self, context: &Arc<Context>, tree: &KdTree, traversal: Traversal) -> Result<(), GpuError> {
        let (value, limit) = (self.triangles.len() as u64, u64::from(BRUTE_MAX_TRIANGLES));
        if traversal == Traversal::Brute && value > limit {
            return Err(GpuError::Limit { what: "triangles without a tree", value, limit });
        }
        let extras = Extras::new(tree, traversal);
        let kd_boxes = Buffer::with(context, "kd_boxes", &extras.boxes, BufferUse::Address)?;
        let kd_ropes = Buffer::with(context, "kd_ropes", &extras.ropes, BufferUse::Address)?;
        let constants = Frame { kd_boxes: kd_boxes.address(), kd_ropes: kd_ropes.address(), ..self.constants };
        self.frame.upload(&[constants])?;
        (self.kd_boxes, self.kd_ropes, self.constants) = (kd_boxes, kd_ropes, constants);
        Ok(())
    }

    /// Other constants, with the addresses of the triangles and the tree; they are not uploaded.
    pub fn set_constants(&mut self, constants: &Frame) {
        self.constants = Frame {
            triangles: self.triangles.address(),
            kd_nodes: self.kd_nodes.address(),
            kd_parents: self.kd_parents.address(),
            leaf_triangles: self.leaf_triangles.address(),
            leaf_planes: self.leaf_planes.address(),
            kd_boxes: self.kd_boxes.address(),
            kd_ropes: self.kd_ropes.address(),
            ..*constants
        };
    }

    /// The constants that the kernels are to read.
    pub fn constants(&self) -> &Frame {
        &self.constants
    }

    /// What a descriptor set has of it.
    pub(super) fn binding(&self) -> (u32, Binding<'_>) {
        (BIND_FRAME, Binding::Buffer(self.frame.any()))
    }
}
