//! Arrays that hold the structures of several geometries, one after the other, and copies into them.

use std::{iter, sync::Arc};

use bytemuck::Pod;

use crate::{
    gpu::{Access, AnyBuffer, Buffer, BufferUse, CommandBuffer, Commands, Context, GpuError},
    layout::{GridCell, KdNode, LeafTriangle, Plane, Slab, StructurePlace},
};

/// The kind of the structures in arrays. All are of one kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StructureKind {
    /// Kd-trees, whose elements are nodes.
    KdTree {
        /// Whether the nodes have slabs.
        has_slabs: bool,
    },
    /// Grids, whose elements are cells.
    Grid,
}

/// Arrays that hold a structure, or several. Those of the other kind are empty.
#[derive(Clone)]
pub struct StructureArrays {
    /// The nodes of kd-trees.
    pub nodes: Buffer<KdNode>,
    /// The parent of each pair of nodes.
    pub parents: Buffer<u32>,
    /// A slab for each node; empty for trees without slabs.
    pub slabs: Buffer<Slab>,
    /// The cells of grids.
    pub cells: Buffer<GridCell>,
    /// The triangles of the leaves or cells, with their indices.
    pub leaf_triangles: Buffer<LeafTriangle>,
    /// The plane of each of `leaf_triangles`.
    pub leaf_planes: Buffer<Plane>,
}

impl StructureArrays {
    /// Makes arrays for so many elements and entries, of which none is defined.
    ///
    /// # Errors
    /// An array exceeds the device's limits, or memory runs out.
    pub fn new(
        context: &Arc<Context>,
        kind: StructureKind,
        (n_elements, n_entries): (usize, usize),
        usage: BufferUse,
    ) -> Result<Self, GpuError> {
        let [n_nodes, n_slabs, n_cells] = match kind {
            StructureKind::KdTree { has_slabs: true } => [n_elements, n_elements, 0],
            StructureKind::KdTree { has_slabs: false } => [n_elements, 0, 0],
            StructureKind::Grid => [0, 0, n_elements],
        };
        Ok(Self {
            nodes: Buffer::new(context, "kd_nodes", n_nodes, usage)?,
            parents: Buffer::new(context, "kd_parents", n_nodes / 2, usage)?,
            slabs: Buffer::new(context, "kd_slabs", n_slabs, usage)?,
            cells: Buffer::new(context, "grid_cells", n_cells, usage)?,
            leaf_triangles: Buffer::new(context, "leaf_triangles", n_entries, usage)?,
            leaf_planes: Buffer::new(context, "leaf_planes", n_entries, usage)?,
        })
    }

    /// Copies a structure at the beginning of these arrays to new ones of its size, and waits for the device.
    ///
    /// # Errors
    /// An array exceeds the device's limits, memory runs out, or a call fails.
    pub fn copied(
        &self,
        context: &Arc<Context>,
        kind: StructureKind,
        sizes: (usize, usize),
        usage: BufferUse,
    ) -> Result<Self, GpuError> {
        let to = Self::new(context, kind, sizes, usage)?;
        context.run("structure_copy", |commands| {
            commands.barrier(Access::ComputeWrite, Access::TransferRead); // the build's arrays
            let target = Target { arrays: &to, place: StructurePlace::default(), more: &[] };
            target.record(commands, self, sizes);
            commands.barrier(Access::TransferWrite, Access::AnyUse); // the copies
        })?;
        Ok(to)
    }

    /// Copies a structure at the beginning of these arrays to its place in the target. Its indices are already those of
    /// that place. Does not wait for the device: the copies come after all commands that were submitted before, and
    /// before all later ones.
    ///
    /// # Errors
    /// Out of memory; a Vulkan call fails. Nothing has been copied then.
    ///
    /// # Panics
    /// The arrays have no room there.
    pub fn copy_to(&self, context: &Arc<Context>, sizes: (usize, usize), target: &Target) -> Result<(), GpuError> {
        submit(context, "structure_copy", |commands| target.record(commands, self, sizes))
    }

    /// Copies a structure as [`StructureArrays::copy_to`] does, after kernels have given it the indices of its place.
    /// `relocate` records these kernels.
    ///
    /// # Errors
    /// Fails as [`StructureArrays::copy_to`].
    ///
    /// # Panics
    /// The arrays have no room there.
    pub(super) fn place(
        &self,
        context: &Arc<Context>,
        sizes: (usize, usize),
        (target, relocate): (&Target, impl FnOnce(&Commands)),
    ) -> Result<(), GpuError> {
        submit(context, "structure_place", |commands| {
            relocate(commands);
            commands.barrier(Access::ComputeWrite, Access::TransferRead); // the relocated arrays
            target.record(commands, self, sizes);
        })
    }

    fn buffers(&self) -> [&Arc<AnyBuffer>; 6] {
        [
            self.nodes.any(),
            self.parents.any(),
            self.slabs.any(),
            self.cells.any(),
            self.leaf_triangles.any(),
            self.leaf_planes.any(),
        ]
    }

    /// Returns how many bytes so many elements and entries take in each of the buffers.
    fn bytes_of(&self, (n_elements, n_entries): (usize, usize)) -> [usize; 6] {
        fn bytes<T: Pod>(buffer: &Buffer<T>, n: usize) -> usize {
            if buffer.is_empty() { 0 } else { n * size_of::<T>() }
        }
        [
            bytes(&self.nodes, n_elements),
            bytes(&self.parents, n_elements / 2),
            bytes(&self.slabs, n_elements),
            bytes(&self.cells, n_elements),
            bytes(&self.leaf_triangles, n_entries),
            bytes(&self.leaf_planes, n_entries),
        ]
    }
}

/// Submits commands and does not wait for them. They run after all commands that were submitted before, and before all
/// later ones.
///
/// # Errors
/// Out of memory; a Vulkan call fails.
pub fn submit(context: &Arc<Context>, name: &str, record: impl FnOnce(&Commands)) -> Result<(), GpuError> {
    let commands = CommandBuffer::record(context, name, None, |commands| {
        commands.barrier(Access::AnyUse, Access::AnyUse); // arrays of builds and frames before
        record(commands);
        commands.barrier(Access::AnyUse, Access::AnyUse); // the same arrays in builds and frames that follow
    })?;
    context.submit(vec![commands]).map(drop)
}

/// Arrays that hold the structures of several geometries, one after the other, and the place of one of them.
pub struct Target<'a> {
    /// The arrays of structures.
    pub arrays: &'a StructureArrays,
    /// Where the geometry's parts of the arrays begin.
    pub place: StructurePlace,
    /// What is copied together with the structure.
    pub more: &'a [BufferCopy],
}

/// A copy to a buffer.
pub struct BufferCopy {
    /// The source.
    pub from: Source,
    /// The destination, and the byte at which the copy begins.
    pub to: (Arc<AnyBuffer>, usize),
}

/// What a copy takes its bytes from.
pub enum Source {
    /// The first bytes of a buffer.
    Buffer(Arc<AnyBuffer>, usize),
    /// Words that the host has.
    Words(Vec<u32>),
}

impl BufferCopy {
    fn record(&self, commands: &Commands) {
        let to = (&self.to.0, self.to.1 as u64);
        match &self.from {
            Source::Buffer(_, 0) => {}
            Source::Buffer(from, bytes) => commands.copy_buffer_range((from, 0), to, *bytes as u64),
            Source::Words(words) => commands.update_buffer_at(to, words),
        }
    }
}

impl Target<'_> {
    /// Records the copies of the arrays of a structure of so many elements and entries.
    fn record(&self, commands: &Commands, from: &StructureArrays, sizes: (usize, usize)) {
        let begins = self.arrays.bytes_of((self.place.first_element as usize, self.place.first_entry as usize));
        let n_bytes = self.arrays.bytes_of(sizes);
        let buffers = iter::zip(from.buffers(), self.arrays.buffers());
        for ((from, to), (begin, n_bytes)) in buffers.zip(iter::zip(begins, n_bytes)) {
            if n_bytes > 0 {
                commands.copy_buffer_range((from, 0), (to, begin as u64), n_bytes as u64);
            }
        }
        self.more.iter().for_each(|copy| copy.record(commands));
    }
}
