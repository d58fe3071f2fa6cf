//! Builds a kd-tree on a device, in buffers that are allocated once.

use std::sync::Arc;

use super::KdTreePasses;
use crate::{
    accel::{
        self, DeviceBuild,
        kdtree::{BuildOptions, KdArrays, Statistics},
    },
    buffers::{KdTreeBuffers, KdTreeRoom, TreeBuffers},
    gpu::{Buffer, BufferUse, CommandBuffer, Commands, Context, GpuError, Timer, TimerRow},
    layout::{KD_MOST_ENTRIES, KdBuild, LeafTriangle, Slab, StructurePlace, Triangle},
    passes::{
        device_build,
        kd_slabs::SlabBuilder,
        structures::{StructureArrays, StructureKind, Target, submit},
        then,
    },
};

/// The most triangles of which one command buffer builds all levels. An H200 takes some 5 ms for them.
const WHOLE_BUILD: u32 = 1 << 18;
/// The number of levels that a command buffer builds if there are more triangles.
const LEVELS_PER_SUBMIT: u32 = 8;

/// Options of a [`KdTreeBuilder`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KdTreeBuilderOptions {
    /// The costs and the depth of the tree, and whether it has slabs. The tree has no more than 32 levels below the
    /// root. Its capacities are those of `room`, and `exact_planes` has no effect.
    pub tree: BuildOptions,
    /// The capacities of the tree and of its build.
    pub room: KdTreeRoom,
    /// The number of levels that a command buffer builds, at least 1. By default these are 8, or all of up to 2^18
    /// triangles: a driver stops a device that takes too long for one command buffer, and each takes the host time.
    pub levels_per_submit: Option<u32>,
}

/// Kernels and memory that build the kd-tree of an array of triangles. A build can be repeated any number of times,
/// with other triangles in the same buffer, and also with fewer.
pub struct KdTreeBuilder {
    context: Arc<Context>,
    options: KdTreeBuilderOptions,
    passes: KdTreePasses,
    buffers: KdTreeBuffers,
    slabs: Option<SlabStage>,
    /// The finished tree is at the beginning of these arrays.
    arrays: StructureArrays,
}

/// The last stage of a build of a tree with slabs.
struct SlabStage {
    builder: SlabBuilder,
    slabs: Buffer<Slab>,
}

impl SlabStage {
    fn new(context: &Arc<Context>, of: &KdTreeBuffers) -> Result<Self, GpuError> {
        let slabs = Buffer::new(context, "kd_build_slabs", of.nodes.len(), BufferUse::Storage)?;
        let tree = TreeBuffers {
            tree: of.slab_tree.clone(),
            nodes: of.nodes.clone(),
            parents: of.parents.clone(),
            leaf_triangles: of.leaf_triangles.clone(),
            slabs: slabs.clone(),
        };
        Ok(Self { builder: SlabBuilder::new(context, &tree)?, slabs })
    }
}

/// A finished build. The tree is in the builder's buffers until the next build.
#[derive(Clone, Debug)]
pub struct BuiltTree {
    /// Splits and leaves, and the unused node 1.
    pub n_nodes: u32,
    /// Entries of all leaves.
    pub n_entries: u32,
    /// The number of levels below the root.
    pub depth: u32,
    /// Cells that became leaves because their children would have passed a capacity.
    pub n_limited: u32,
    /// The finest scale of a triangle (src/accel/kdtree/scales.rs).
    pub finest_scale: u32,
    /// Times of the build's dispatches; empty without a timer.
    pub stages: Vec<TimerRow>,
    /// Whether slabs have been computed.
    pub has_slabs: bool,
    state: KdBuild,
}

impl BuiltTree {
    /// The numbers of nodes and of entries.
    pub fn sizes(&self) -> (usize, usize) {
        (self.n_nodes as usize, self.n_entries as usize)
    }

    /// The kind of the tree's arrays.
    pub fn kind(&self) -> StructureKind {
        StructureKind::KdTree { has_slabs: self.has_slabs }
    }

    /// Returns what is known of the tree's sizes, and the times of its build, by kernel.
    pub fn report(&self, n_triangles: usize) -> DeviceBuild {
        let sizes = [self.n_nodes, self.n_entries].map(u64::from);
        let statistics = Statistics::of_device(n_triangles, sizes, self.depth, self.has_slabs);
        device_build::report(accel::Statistics::KdTree(statistics), &self.stages)
    }
}

impl KdTreeBuilder {
    /// Creates the kernels and the memory for builds over the triangles.
    ///
    /// # Errors
    /// The build exceeds the device's limits; out of memory; the driver refuses a shader.
    pub fn new(
        context: &Arc<Context>,
        triangles: &Buffer<Triangle>,
        options: &KdTreeBuilderOptions,
    ) -> Result<Self, GpuError> {
        if !Self::has_room(context, triangles.len()) {
            let (object, limit) = (triangles.any().name().to_owned(), context.limits().storage_range);
            return Err(GpuError::TooLarge { object, bytes: triangles.any().bytes(), limit });
        }
        let bindings = KdTreeBuffers::bindings(context)?;
        let buffers = KdTreeBuffers::new(context, &bindings, triangles, options.room, &options.tree)?;
        let slabs = options.tree.slabs.then(|| SlabStage::new(context, &buffers)).transpose()?;
        Ok(Self {
            arrays: StructureArrays {
                nodes: buffers.nodes.clone(),
                parents: buffers.parents.clone(),
                leaf_triangles: buffers.leaf_triangles.clone(),
                leaf_planes: buffers.leaf_planes.clone(),
                slabs: match &slabs {
                    Some(stage) => stage.slabs.clone(),
                    None => Buffer::new(context, "kd_build_slabs", 0, BufferUse::Storage)?,
                },
                cells: Buffer::new(context, "grid_cells", 0, BufferUse::Storage)?,
            },
            slabs,
            buffers,
            passes: KdTreePasses::new(context, &bindings)?,
            context: context.clone(),
            options: options.clone(),
        })
    }

    /// Whether the device can bind the arrays of a tree with an entry for each of `n_triangles` triangles. Free memory
    /// is not considered.
    pub fn has_room(context: &Context, n_triangles: usize) -> bool {
        let bytes = (n_triangles as u64).saturating_mul(size_of::<LeafTriangle>() as u64);
        bytes <= context.limits().storage_range && n_triangles < KD_MOST_ENTRIES as usize
    }

    /// Returns the buffers. Of `nodes`, `parents`, `leaf_triangles` and `leaf_planes`, only as many elements are
    /// defined as the [`BuiltTree`] has.
    pub fn buffers(&self) -> &KdTreeBuffers {
        &self.buffers
    }

    /// Returns the number of a timer's rows that a build needs, one per dispatch.
    pub fn n_stages(&self) -> u32 {
        let of_slabs = if self.slabs.is_some() { SlabBuilder::N_STAGES } else { 0 };
        KdTreePasses::n_stages(self.buffers.initial().max_depth) + of_slabs
    }

    /// The number of triangles for which there is room.
    fn capacity(&self) -> usize {
        self.buffers.initial().n_triangles as usize
    }

    /// Builds the tree and waits for the device. `timer`: takes the times of the dispatches; it must have room for
    /// [`KdTreeBuilder::n_stages`] rows.
    ///
    /// # Errors
    /// Out of memory; a Vulkan call fails.
    pub fn build(&self, timer: Option<&Timer>) -> Result<BuiltTree, GpuError> {
        self.build_first(self.capacity(), timer)
    }

    /// Builds the tree of the first `n_triangles` triangles, as [`KdTreeBuilder::build`] does.
    ///
    /// # Errors
    /// Out of memory; a Vulkan call fails.
    ///
    /// # Panics
    /// There are more than [`KdTreeBuilder::capacity`].
    pub fn build_first(&self, n_triangles: usize, timer: Option<&Timer>) -> Result<BuiltTree, GpuError> {
        assert!(n_triangles <= self.capacity(), "{n_triangles} triangles, room for {}", self.capacity());
        let n_triangles = n_triangles as u32;
        self.context.wait_for(self.context.submit(self.record(n_triangles, timer)?)?)?;
        let state = self.buffers.build.download()?[0];
        Ok(BuiltTree {
            n_nodes: 2 * state.n_pairs,
            n_entries: state.n_entries,
            depth: state.depth,
            n_limited: state.n_limited,
            finest_scale: state.finest,
            stages: timer.map_or(Ok(Vec::new()), Timer::rows)?,
            state,
            has_slabs: self.slabs.is_some(),
        })
    }

    /// Copies the tree of the last build to the host.
    /// [`KdTree::from_arrays`](crate::accel::kdtree::KdTree::from_arrays) validates it.
    ///
    /// # Errors
    /// Out of memory; a Vulkan call fails.
    pub fn read_back(&self, built: &BuiltTree) -> Result<KdArrays, GpuError> {
        let (n_nodes, n_entries) = (built.n_nodes as usize, built.n_entries as usize);
        let entries = self.buffers.leaf_triangles.download_first(n_entries)?;
        Ok(KdArrays {
            nodes: self.buffers.nodes.download_first(n_nodes)?,
            parents: self.buffers.parents.download_first(n_nodes / 2)?,
            leaf_triangles: entries.iter().map(|entry| entry.triangle_ix).collect(),
            leaf_planes: self.buffers.leaf_planes.download_first(n_entries)?,
            slabs: self.slabs.as_ref().map_or(Ok(Vec::new()), |stage| stage.slabs.download_first(n_nodes))?,
            box_min: built.state.box_min,
            box_max: built.state.box_max,
            depth: built.depth,
        })
    }

    /// Copies the tree of the last build to buffers that are created for `usage`, so that the builder can be dropped.
    ///
    /// # Errors
    /// Out of memory; a Vulkan call fails.
    pub fn copy(&self, built: &BuiltTree, usage: BufferUse) -> Result<StructureArrays, GpuError> {
        self.arrays.copied(&self.context, built.kind(), built.sizes(), usage)
    }

    /// Copies the tree of the last build as [`KdTreeBuilder::copy`] does, with the indices that it has in arrays of
    /// several trees. In the builder's buffers, too, the tree has these indices afterwards.
    ///
    /// # Errors
    /// Out of memory; a Vulkan call fails.
    pub fn copy_relocated(
        &self,
        built: &BuiltTree,
        place: &StructurePlace,
        usage: BufferUse,
    ) -> Result<StructureArrays, GpuError> {
        submit(&self.context, "kdtree_relocate", |commands| self.relocate(commands, built, place))?;
        self.copy(built, usage)
    }

    /// Copies the tree of the last build into arrays of several trees. Does not wait for the device: the copies come
    /// after all commands that were submitted before, and before all later ones. The tree in the builder's buffers
    /// cannot be used any more.
    ///
    /// # Errors
    /// Out of memory; a Vulkan call fails. Nothing has been copied then.
    ///
    /// # Panics
    /// The arrays have no room there.
    pub fn place(&self, built: &BuiltTree, target: &Target) -> Result<(), GpuError> {
        let relocate = |commands: &Commands| self.relocate(commands, built, &target.place);
        self.arrays.place(&self.context, built.sizes(), (target, relocate))
    }

    fn relocate(&self, commands: &Commands, built: &BuiltTree, place: &StructurePlace) {
        self.passes.relocate(commands, &self.buffers, built.n_nodes.max(built.n_entries), place);
    }

    /// Records the command buffers of a build: one for what comes before the levels, one or more for the levels, and
    /// one for what comes after them.
    fn record(&self, n_triangles: u32, timer: Option<&Timer>) -> Result<Vec<CommandBuffer>, GpuError> {
        let record = |body: &dyn Fn(&Commands)| CommandBuffer::record(&self.context, "kdtree_build", timer, body);
        let mut command_buffers = vec![record(&|commands| {
            commands.reset_timer();
            self.passes.setup(commands, &self.buffers, n_triangles);
        })?];
        let by_size = if n_triangles <= WHOLE_BUILD { self.n_levels() } else { LEVELS_PER_SUBMIT };
        let n_each = self.options.levels_per_submit.unwrap_or(by_size).max(1);
        for first in (0..self.n_levels()).step_by(n_each as usize) {
            command_buffers.push(record(&|commands| {
                let end = (first + n_each).min(self.n_levels());
                (first..end).for_each(|level_ix| self.passes.level(commands, &self.buffers, level_ix));
            })?);
        }
        command_buffers.push(record(&|commands| {
            commands.bind(self.buffers.set_of(0));
            self.finish(commands);
        })?);
        Ok(command_buffers)
    }

    /// Records what comes after the last level. Needs the built nodes, and the references in leaves. Leaves the tree.
    fn finish(&self, commands: &Commands) {
        self.passes.finish(commands, &self.buffers);
        if let Some(stage) = &self.slabs {
            then(commands);
            stage.builder.record(commands);
        }
    }

    /// The number of levels, that of the root included.
    fn n_levels(&self) -> u32 {
        self.buffers.initial().max_depth + 1
    }
}
