//! Buffers of a kd-tree on a device whose slabs are computed there, and the descriptor set over them.

use std::sync::Arc;

use super::{accel::leaf_triangles, binding};
use crate::{
    accel::kdtree::KdTree,
    gpu::{Binding, BindingLayout, BindingSet, Buffer, BufferUse, Context, GpuError},
    layout::{
        BIND_KD_SLAB_AREAS, BIND_KD_SLAB_BUILD, BIND_KD_SLAB_ENTRY_LEAVES, BIND_KD_SLAB_EXTENTS, BIND_KD_SLAB_LARGE,
        BIND_KD_SLAB_LEAF_TRIANGLES, BIND_KD_SLAB_NODES, BIND_KD_SLAB_PARENTS, BIND_KD_SLAB_PATCHES,
        BIND_KD_SLAB_RANGES, BIND_KD_SLAB_SLABS, BIND_KD_SLAB_TREE, KdNode, KdSlabBuild, KdSlabExtent, KdSlabPatch,
        KdSlabTree, LeafTriangle, Slab, Triangle,
    },
};

/// The bindings of the descriptor set.
const BINDINGS: [u32; 12] = [
    BIND_KD_SLAB_TREE,
    BIND_KD_SLAB_BUILD,
    BIND_KD_SLAB_NODES,
    BIND_KD_SLAB_PARENTS,
    BIND_KD_SLAB_LEAF_TRIANGLES,
    BIND_KD_SLAB_RANGES,
    BIND_KD_SLAB_ENTRY_LEAVES,
    BIND_KD_SLAB_PATCHES,
    BIND_KD_SLAB_EXTENTS,
    BIND_KD_SLAB_AREAS,
    BIND_KD_SLAB_LARGE,
    BIND_KD_SLAB_SLABS,
];

/// Buffers of a kd-tree, as kernels read it, and of its slabs. Their lengths are the most nodes and entries that the
/// tree may have.
#[derive(Clone)]
pub struct TreeBuffers {
    /// What the kernels need to know of the tree: one element.
    pub tree: Buffer<KdSlabTree>,
    /// The nodes, without slabs. [`KdArrays::nodes`](crate::accel::kdtree::KdArrays::nodes) states their order.
    pub nodes: Buffer<KdNode>,
    /// The parent of each pair of nodes.
    pub parents: Buffer<u32>,
    /// The entries of the leaves in depth-first order. Each leaf, even an empty one, has the index of its first entry.
    pub leaf_triangles: Buffer<LeafTriangle>,
    /// A slab for each node.
    pub slabs: Buffer<Slab>,
}

impl TreeBuffers {
    /// Uploads a tree, with room for slabs.
    ///
    /// # Errors
    /// A buffer exceeds the device's limits; out of memory.
    pub fn of_host(context: &Arc<Context>, tree: &KdTree, triangles: &[Triangle]) -> Result<Self, GpuError> {
        let storage = BufferUse::Storage;
        let mut entries = vec![LeafTriangle::default(); tree.leaf_triangles().len()];
        leaf_triangles(triangles, tree.leaf_triangles(), 0, &mut entries);
        Ok(Self {
            tree: Buffer::with(context, "kd_slab_tree", &[tree.slab_tree()], storage)?,
            nodes: Buffer::with(context, "kd_nodes", tree.nodes(), storage)?,
            parents: Buffer::with(context, "kd_parents", tree.parents(), storage)?,
            leaf_triangles: Buffer::with(context, "leaf_triangles", &entries, storage)?,
            slabs: Buffer::new(context, "kd_slabs", tree.nodes().len(), storage)?,
        })
    }
}

/// Buffers of the computation of slabs.
pub struct KdSlabBuffers {
    pub tree: TreeBuffers,
    /// Sizes of the dispatches: one element.
    pub build: Buffer<KdSlabBuild>,
    /// The leaf of each entry.
    pub entry_leaves: Buffer<u32>,
    pub set: BindingSet,
}

impl KdSlabBuffers {
    /// Creates the layout of the set. The kernels have no push constants, but a layout has room for some.
    ///
    /// # Errors
    /// Out of memory.
    pub fn bindings(context: &Arc<Context>) -> Result<Arc<BindingLayout>, GpuError> {
        BindingLayout::new(context, &BINDINGS.map(binding), size_of::<u32>() as u32)
    }

    /// Creates the buffers and the set for a tree.
    ///
    /// # Errors
    /// A buffer exceeds the device's limits; out of memory.
    pub fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>, tree: &TreeBuffers) -> Result<Self, GpuError> {
        let (n_nodes, n_entries, storage) = (tree.nodes.len(), tree.leaf_triangles.len(), BufferUse::Storage);
        let build = Buffer::new(context, "kd_slab_build", 1, BufferUse::Indirect)?;
        let entry_leaves = Buffer::new(context, "kd_slab_entry_leaves", n_entries, storage)?;
        let ranges = Buffer::<[u32; 2]>::new(context, "kd_slab_ranges", n_nodes, storage)?;
        let patches = Buffer::<KdSlabPatch>::new(context, "kd_slab_patches", n_nodes, storage)?;
        let extents = Buffer::<KdSlabExtent>::new(context, "kd_slab_extents", n_nodes, storage)?;
        let areas = Buffer::<[f32; 4]>::new(context, "kd_slab_areas", n_entries, storage)?;
        let large = Buffer::<u32>::new(context, "kd_slab_large", n_nodes, storage)?;
        let objects = [
            tree.tree.any(),
            build.any(),
            tree.nodes.any(),
            tree.parents.any(),
            tree.leaf_triangles.any(),
            ranges.any(),
            entry_leaves.any(),
            patches.any(),
            extents.any(),
            areas.any(),
            large.any(),
            tree.slabs.any(),
        ];
        let objects: Vec<_> = BINDINGS.into_iter().zip(objects.map(Binding::Buffer)).collect();
        let set = BindingSet::new(bindings, "kd_slabs", &objects)?;
        Ok(Self { tree: tree.clone(), build, entry_leaves, set })
    }
}
