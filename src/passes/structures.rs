//! Arrays that hold the structures of several geometries, one after the other, and copies into them.

use std::{iter, sync::Arc};

use crate::{
    gpu::{Access, AnyBuffer, Buffer, BufferUse, CommandBuffer, Commands, Context, GpuError},
    layout::{KdNode, LeafTriangle, Plane, Slab, StructurePlace},
};

/// Arrays that hold a tree, or several.
#[derive(Clone)]
pub struct StructureArrays {
    /// The nodes.
    pub nodes: Buffer<KdNode>,
    /// The parent of each pair of nodes.
    pub parents: Buffer<u32>,
    /// The triangles of the leaves, with their indices.
    pub leaf_triangles: Buffer<LeafTriangle>,
    /// The plane of each of `leaf_triangles`.
    pub leaf_planes: Buffer<Plane>,
    /// A slab for each node; empty for a tree without slabs.
    pub slabs: Buffer<Slab>,
}

impl StructureArrays {
    /// Makes arrays for so many nodes and entries, of which none is defined.
    ///
    /// # Errors
    /// An array exceeds the device's limits, or memory runs out.
    pub fn new(
        context: &Arc<Context>,
        (n_nodes, n_entries): (usize, usize),
        has_slabs: bool,
        usage: BufferUse,
    ) -> Result<Self, GpuError> {
        Ok(Self {
            nodes: Buffer::new(context, "kd_nodes", n_nodes, usage)?,
            parents: Buffer::new(context, "kd_parents", n_nodes / 2, usage)?,
            leaf_triangles: Buffer::new(context, "leaf_triangles", n_entries, usage)?,
            leaf_planes: Buffer::new(context, "leaf_planes", n_entries, usage)?,
            slabs: Buffer::new(context, "kd_slabs", if has_slabs { n_nodes } else { 0 }, usage)?,
        })
    }

    /// Copies trees of so many nodes and entries, which have the indices of the target already, to their place there.
    /// Does not wait for the device, as [`KdTreeBuilder::place`](super::kdtree::KdTreeBuilder::place).
    ///
    /// # Errors
    /// Out of memory; a Vulkan call fails. Nothing has been copied then.
    ///
    /// # Panics
    /// The arrays have no room there.
    pub fn copy_to(&self, context: &Arc<Context>, sizes: (usize, usize), target: &Target) -> Result<(), GpuError> {
        let from = self.sizes(0, 0).map(|(buffer, _)| buffer);
        submit(context, "kdtree_copy", |commands| target.record(commands, from, sizes))
    }

    /// Returns the arrays, each with the number of bytes of a tree of so many nodes and entries.
    pub(super) fn sizes(&self, n_nodes: usize, n_entries: usize) -> [(&Arc<AnyBuffer>, usize); 5] {
        let n_slabs = if self.slabs.is_empty() { 0 } else { n_nodes };
        [
            (self.nodes.any(), n_nodes * size_of::<KdNode>()),
            (self.parents.any(), n_nodes / 2 * size_of::<u32>()),
            (self.leaf_triangles.any(), n_entries * size_of::<LeafTriangle>()),
            (self.leaf_planes.any(), n_entries * size_of::<Plane>()),
            (self.slabs.any(), n_slabs * size_of::<Slab>()),
        ]
    }
}

/// Submits commands between whatever else uses their buffers, without a wait.
pub fn submit(context: &Arc<Context>, name: &str, record: impl FnOnce(&Commands)) -> Result<(), GpuError> {
    let commands = CommandBuffer::record(context, name, None, |commands| {
        commands.barrier(Access::AnyUse, Access::AnyUse); // arrays of builds and frames before
        record(commands);
        commands.barrier(Access::AnyUse, Access::AnyUse); // the same arrays in builds and frames that follow
    })?;
    context.submit(vec![commands]).map(drop)
}

/// Arrays that hold the trees of several geometries, one after the other, and the place of one of them.
pub struct Target<'a> {
    /// The arrays of trees.
    pub trees: &'a StructureArrays,
    /// Where the geometry's parts of the arrays begin.
    pub place: StructurePlace,
    /// What is copied together with the tree.
    pub more: &'a [BufferCopy],
}

/// A copy of the first bytes of a buffer to another one, from the byte `begin` of that one on.
pub struct BufferCopy {
    /// The source.
    pub from: Arc<AnyBuffer>,
    /// The destination, and the byte at which the copy begins.
    pub to: (Arc<AnyBuffer>, usize),
    /// The number of bytes.
    pub bytes: usize,
}

impl Target<'_> {
    /// Records the copies of the arrays of a tree of so many nodes and entries.
    pub(super) fn record(&self, commands: &Commands, from: [&Arc<AnyBuffer>; 5], (n_nodes, n_entries): (usize, usize)) {
        let sizes = self.trees.sizes(n_nodes, n_entries);
        let begins = self.trees.sizes(self.place.first_element as usize, self.place.first_entry as usize);
        let arrays =
            iter::zip(from, sizes).zip(begins).map(|((from, (to, bytes)), (_, begin))| (from, to, begin, bytes));
        let more = self.more.iter().map(|it| (&it.from, &it.to.0, it.to.1, it.bytes));
        for (from, to, begin, bytes) in arrays.chain(more).filter(|(.., bytes)| *bytes > 0) {
            commands.copy_buffer_range((from, 0), (to, begin as u64), bytes as u64);
        }
    }
}
