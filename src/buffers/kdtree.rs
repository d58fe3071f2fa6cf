//! Buffers of a kd-tree's build, and the descriptor sets over them.

use std::sync::Arc;

use super::binding;
use crate::{
    accel::kdtree::BuildOptions,
    gpu::{Binding, BindingLayout, BindingSet, Buffer, BufferUse, Context, GpuError},
    layout::{
        BIND_KD_ABOVE, BIND_KD_BELOW, BIND_KD_BINS, BIND_KD_BUILD, BIND_KD_BUILT_NODES, BIND_KD_BUILT_PARENTS,
        BIND_KD_CELLS_FROM, BIND_KD_CELLS_TO, BIND_KD_LEAF_PLANES, BIND_KD_LEAF_REFERENCES, BIND_KD_LEAF_TRIANGLES,
        BIND_KD_LEVELS, BIND_KD_NODES, BIND_KD_PARENTS, BIND_KD_PLACES, BIND_KD_REFERENCES_FROM, BIND_KD_REFERENCES_TO,
        BIND_KD_SCALE_COUNTS, BIND_KD_SCAN_BLOCKS, BIND_KD_SIDES, BIND_KD_SLAB_TREE, BIND_KD_TRIANGLES, KD_BIN_BLOCK,
        KD_BIN_WORDS, KD_BLOCK_SIZE, KD_LEVEL_RECORDS, KD_MOST_ENTRIES, KD_SCALES, KD_WORD_DEPTH, KdBuild, KdCell,
        KdLevel, KdNode, KdReference, KdSlabPatch, KdSlabTree, LeafTriangle, Plane, SCAN_GROUP_SIZE, StructurePlace,
        Triangle,
    },
};

/// The bindings of the descriptor sets of a build.
const BINDINGS: [u32; 22] = [
    BIND_KD_BUILD,
    BIND_KD_LEVELS,
    BIND_KD_TRIANGLES,
    BIND_KD_SCALE_COUNTS,
    BIND_KD_REFERENCES_FROM,
    BIND_KD_REFERENCES_TO,
    BIND_KD_ABOVE,
    BIND_KD_CELLS_FROM,
    BIND_KD_CELLS_TO,
    BIND_KD_SIDES,
    BIND_KD_SCAN_BLOCKS,
    BIND_KD_BINS,
    BIND_KD_BUILT_NODES,
    BIND_KD_BUILT_PARENTS,
    BIND_KD_BELOW,
    BIND_KD_PLACES,
    BIND_KD_LEAF_REFERENCES,
    BIND_KD_NODES,
    BIND_KD_PARENTS,
    BIND_KD_LEAF_TRIANGLES,
    BIND_KD_LEAF_PLANES,
    BIND_KD_SLAB_TREE,
];

/// Entries by which each capacity may exceed a multiple of the number of triangles.
const SPARE: u64 = 1024;

/// Capacities of a build: the most entries of each kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KdTreeCapacities {
    pub n_triangles: u32,
    /// References of a level, and entries of all leaves. At least the number of triangles.
    pub n_references: u32,
    /// Pairs of nodes, with that of the root.
    pub n_pairs: u32,
    /// Cells of a level that have references.
    pub n_cells: u32,
}

impl KdTreeCapacities {
    /// Returns the capacities for a build over `n_triangles` triangles, as multiples of that number plus 1024, and not
    /// more than a device with storage buffers of `storage_range` bytes can bind.
    pub fn new(n_triangles: u32, per_triangle: KdTreeRoom, storage_range: u64) -> Self {
        let KdTreeRoom { references, pairs, cells } = per_triangle;
        let most = |multiple: u32, bytes: usize| {
            let wanted = u64::from(n_triangles) * u64::from(multiple) + SPARE;
            wanted.min(storage_range / bytes as u64).min(u64::from(KD_MOST_ENTRIES)) as u32
        };
        Self {
            n_triangles,
            n_references: most(references, size_of::<LeafTriangle>()).max(n_triangles),
            n_pairs: most(pairs, 2 * size_of::<KdSlabPatch>()), // the largest element of a node
            n_cells: most(cells, size_of::<KdCell>()),
        }
    }
}

/// Capacities as multiples of the number of triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KdTreeRoom {
    /// References of a level, and entries of all leaves.
    pub references: u32,
    /// Pairs of nodes.
    pub pairs: u32,
    /// Cells of a level.
    pub cells: u32,
}

/// Meshes have some 3 entries, 2.5 pairs and less than one cell of a level per triangle. With these capacities, a build
/// takes 2.6 kB per triangle, and 1.6 kB without slabs.
impl Default for KdTreeRoom {
    fn default() -> Self {
        Self { references: 6, pairs: 5, cells: 2 }
    }
}

/// Buffers of a build: its state, the finished tree, and the arrays that the kernels hand to one another.
pub struct KdTreeBuffers {
    pub capacities: KdTreeCapacities,
    /// The state of the build: one element.
    pub build: Buffer<KdBuild>,
    pub levels: Buffer<KdLevel>,
    pub scale_counts: Buffer<u32>,
    pub bins: Buffer<u32>,
    /// The nodes of the finished tree.
    pub nodes: Buffer<KdNode>,
    /// The parent of each pair of nodes.
    pub parents: Buffer<u32>,
    /// The triangles of the leaves, with their indices.
    pub leaf_triangles: Buffer<LeafTriangle>,
    /// The plane of each of `leaf_triangles`.
    pub leaf_planes: Buffer<Plane>,
    /// What the computation of slabs needs to know of the finished tree: one element.
    pub slab_tree: Buffer<KdSlabTree>,
    /// The sets for even and for odd levels.
    sets: [BindingSet; 2],
    initial: KdBuild,
}

impl KdTreeBuffers {
    /// Makes the layout of the sets.
    ///
    /// # Errors
    /// Memory runs out.
    pub fn bindings(context: &Arc<Context>) -> Result<Arc<BindingLayout>, GpuError> {
        BindingLayout::new(context, &BINDINGS.map(binding), size_of::<StructurePlace>() as u32)
    }

    /// Makes the buffers and sets of a build over the triangles, or over the first ones.
    ///
    /// # Errors
    /// A buffer is beyond the device's limits, or memory runs out.
    pub fn new(
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        triangles: &Buffer<Triangle>,
        room: KdTreeRoom,
        options: &BuildOptions,
    ) -> Result<Self, GpuError> {
        let storage = BufferUse::Storage;
        let n_triangles = triangles.len() as u32;
        let capacities = KdTreeCapacities::new(n_triangles, room, context.limits().storage_range);
        let [n_references, n_pairs, n_cells] =
            [capacities.n_references, capacities.n_pairs, capacities.n_cells].map(|n| n as usize);
        let cell_groups_begin = capacities.n_references.div_ceil(KD_BLOCK_SIZE);
        let n_blocks = cell_groups_begin + capacities.n_cells.div_ceil(SCAN_GROUP_SIZE);
        let words = |name, n: usize| Buffer::<u32>::new(context, name, n, storage);
        let two_words = |name, n: usize| Buffer::<[u32; 2]>::new(context, name, n, storage);
        let references = |name| Buffer::<KdReference>::new(context, name, n_references, storage);
        let cells = |name| Buffer::<KdCell>::new(context, name, n_cells, storage);
        let nodes = |name| Buffer::<KdNode>::new(context, name, 2 * n_pairs, storage);
        let build = Buffer::new(context, "kd_build", 1, BufferUse::Indirect)?;
        let levels = Buffer::new(context, "kd_levels", KD_LEVEL_RECORDS as usize, BufferUse::Indirect)?;
        let scale_counts = words("kd_scale_counts", KD_SCALES as usize)?;
        let n_large = n_references / KD_BIN_BLOCK as usize + 1;
        let bins = words("kd_bins", n_large * KD_BIN_WORDS as usize)?;
        let (from, to) = (references("kd_references_0")?, references("kd_references_1")?);
        let (cells_from, cells_to) = (cells("kd_cells_0")?, cells("kd_cells_1")?);
        let above = references("kd_above")?;
        let sides = words("kd_sides", n_references)?;
        let scan_blocks = Buffer::<[u32; 4]>::new(context, "kd_scan_blocks", n_blocks as usize, storage)?;
        let (built_nodes, built_parents) = (nodes("kd_built_nodes")?, words("kd_built_parents", n_pairs)?);
        let (below, places) = (two_words("kd_below", 2 * n_pairs)?, two_words("kd_places", 2 * n_pairs)?);
        let leaf_references = two_words("kd_leaf_references", n_references)?;
        let (finished, parents) = (nodes("kd_build_nodes")?, words("kd_build_parents", n_pairs)?);
        let leaf_triangles = Buffer::new(context, "kd_build_leaf_triangles", n_references, storage)?;
        let leaf_planes = Buffer::new(context, "kd_build_leaf_planes", n_references, storage)?;
        let slab_tree = Buffer::new(context, "kd_build_slab_tree", 1, storage)?;
        let set = |references: [&Buffer<KdReference>; 2], cells: [&Buffer<KdCell>; 2]| {
            let objects = [
                build.any(),
                levels.any(),
                triangles.any(),
                scale_counts.any(),
                references[0].any(),
                references[1].any(),
                above.any(),
                cells[0].any(),
                cells[1].any(),
                sides.any(),
                scan_blocks.any(),
                bins.any(),
                built_nodes.any(),
                built_parents.any(),
                below.any(),
                places.any(),
                leaf_references.any(),
                finished.any(),
                parents.any(),
                leaf_triangles.any(),
                leaf_planes.any(),
                slab_tree.any(),
            ];
            let objects: Vec<_> = BINDINGS.into_iter().zip(objects.map(Binding::Buffer)).collect();
            BindingSet::new(bindings, "kdtree", &objects)
        };
        let sets = [set([&from, &to], [&cells_from, &cells_to])?, set([&to, &from], [&cells_to, &cells_from])?];
        let initial = initial_build(capacities, options, cell_groups_begin);
        Ok(Self {
            capacities,
            build,
            levels,
            scale_counts,
            bins,
            nodes: finished,
            parents,
            leaf_triangles,
            leaf_planes,
            slab_tree,
            sets,
            initial,
        })
    }

    /// The state that the host writes into `build` before a build over all triangles.
    pub fn initial(&self) -> &KdBuild {
        &self.initial
    }

    /// The set for the kernels of a level.
    pub fn set_of(&self, level_ix: u32) -> &BindingSet {
        &self.sets[(level_ix % 2) as usize]
    }
}

/// Returns the state of a build before it begins.
fn initial_build(capacities: KdTreeCapacities, options: &BuildOptions, cell_groups_begin: u32) -> KdBuild {
    KdBuild {
        least_x: u32::MAX,
        least_y: u32::MAX,
        least_z: u32::MAX,
        n_triangles: capacities.n_triangles,
        traversal_cost: options.traversal_cost,
        intersection_cost: options.intersection_cost,
        empty_factor: 1.0 - options.empty_bonus,
        max_depth: options.depth_limit().min(KD_WORD_DEPTH),
        max_references: capacities.n_references,
        max_pairs: capacities.n_pairs,
        max_cells: capacities.n_cells,
        cell_groups_begin,
        ..KdBuild::default()
    }
}
