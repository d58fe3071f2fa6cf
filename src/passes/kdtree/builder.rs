//! Builds a kd-tree on a device, in buffers that are allocated once.

use std::sync::Arc;

use super::KdTreePasses;
use crate::{
    accel::{
        self, DeviceBuild,
        kdtree::{BuildOptions, Parts, Statistics},
    },
    buffers::{KdTreeBuffers, KdTreeRoom, TreeBuffers},
    gpu::{Buffer, BufferUse, CommandBuffer, Commands, Context, GpuError, Timer, TimerRow},
    layout::{KD_MOST_ENTRIES, KdBuild, KdNode, LeafTriangle, Plane, Slab, Triangle},
    passes::{device_build, kd_slabs::SlabBuilder, then},
};

/// Options of a [`KdTreeBuilder`].
#[derive(Clone, Debug, PartialEq)]
pub struct KdTreeBuilderOptions {
    /// The costs and the depth of the tree, and whether it has slabs. The tree has no more than 32 levels below the
    /// root. Its capacities are those of `room`, and `exact_planes` has no effect.
    pub tree: BuildOptions,
    /// The capacities of the tree and of its build.
    pub room: KdTreeRoom,
    /// The number of levels that a command buffer builds, at least 1. A build of n levels has a command buffer for
    /// every so many, since a driver stops a device that takes too long for one.
    pub levels_per_submit: u32,
}

impl Default for KdTreeBuilderOptions {
    fn default() -> Self {
        Self { tree: BuildOptions::default(), room: KdTreeRoom::default(), levels_per_submit: 8 }
    }
}

/// Kernels and memory that build the kd-tree of an array of triangles. A build can be repeated any number of times,
/// with other triangles in the same buffer.
pub struct KdTreeBuilder {
    context: Arc<Context>,
    options: KdTreeBuilderOptions,
    passes: KdTreePasses,
    buffers: KdTreeBuffers,
    slabs: Option<SlabStage>,
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

/// Copies of a tree's arrays, of exactly its size.
pub struct DeviceTree {
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

impl BuiltTree {
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
        Ok(Self {
            slabs: options.tree.slabs.then(|| SlabStage::new(context, &buffers)).transpose()?,
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

    /// Builds the tree and waits for the device. `timer`: takes the times of the dispatches, which are then all in one
    /// command buffer; it must have room for [`KdTreeBuilder::n_stages`] rows.
    ///
    /// # Errors
    /// Out of memory; a Vulkan call fails.
    pub fn build(&self, timer: Option<&Timer>) -> Result<BuiltTree, GpuError> {
        let commands = match timer {
            Some(_) => vec![self.record_all(timer)?],
            None => self.record_parts()?,
        };
        self.context.wait_for(self.context.submit(commands)?)?;
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

    /// Copies the tree of the last build to the host. [`KdTree::from_parts`](crate::accel::kdtree::KdTree::from_parts)
    /// validates it.
    ///
    /// # Errors
    /// Out of memory; a Vulkan call fails.
    pub fn read_back(&self, built: &BuiltTree) -> Result<Parts, GpuError> {
        let (n_nodes, n_entries) = (built.n_nodes as usize, built.n_entries as usize);
        let entries = self.buffers.leaf_triangles.download_first(n_entries)?;
        Ok(Parts {
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
    pub fn copy(&self, built: &BuiltTree, usage: BufferUse) -> Result<DeviceTree, GpuError> {
        let (n_nodes, n_entries) = (built.n_nodes as usize, built.n_entries as usize);
        let (context, from) = (&self.context, &self.buffers);
        let to = DeviceTree {
            nodes: Buffer::new(context, "kd_nodes", n_nodes, usage)?,
            parents: Buffer::new(context, "kd_parents", n_nodes / 2, usage)?,
            leaf_triangles: Buffer::new(context, "leaf_triangles", n_entries, usage)?,
            leaf_planes: Buffer::new(context, "leaf_planes", n_entries, usage)?,
            slabs: Buffer::new(context, "kd_slabs", if built.has_slabs { n_nodes } else { 0 }, usage)?,
        };
        let mut arrays = vec![
            (from.nodes.any(), to.nodes.any(), n_nodes * size_of::<KdNode>()),
            (from.parents.any(), to.parents.any(), n_nodes / 2 * size_of::<u32>()),
            (from.leaf_triangles.any(), to.leaf_triangles.any(), n_entries * size_of::<LeafTriangle>()),
            (from.leaf_planes.any(), to.leaf_planes.any(), n_entries * size_of::<Plane>()),
        ];
        arrays.extend(self.slabs.iter().map(|it| (it.slabs.any(), to.slabs.any(), n_nodes * size_of::<Slab>())));
        device_build::copy(context, "kdtree_copy", &arrays)?;
        Ok(to)
    }

    fn record_all(&self, timer: Option<&Timer>) -> Result<CommandBuffer, GpuError> {
        CommandBuffer::record(&self.context, "kdtree_build", timer, |commands| {
            commands.reset_timer();
            self.passes.setup(commands, &self.buffers);
            (0..self.n_levels()).for_each(|level_ix| self.passes.level(commands, &self.buffers, level_ix));
            self.finish(commands);
        })
    }

    /// Records a command buffer for every `levels_per_submit` levels.
    fn record_parts(&self) -> Result<Vec<CommandBuffer>, GpuError> {
        let record = |body: &dyn Fn(&Commands)| CommandBuffer::record(&self.context, "kdtree_build", None, body);
        let mut parts = vec![record(&|commands| self.passes.setup(commands, &self.buffers))?];
        let n_each = self.options.levels_per_submit.max(1);
        for first in (0..self.n_levels()).step_by(n_each as usize) {
            parts.push(record(&|commands| {
                then(commands);
                let end = (first + n_each).min(self.n_levels());
                (first..end).for_each(|level_ix| self.passes.level(commands, &self.buffers, level_ix));
            })?);
        }
        parts.push(record(&|commands| {
            then(commands);
            commands.bind(self.buffers.set_of(0));
            self.finish(commands);
        })?);
        Ok(parts)
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
