//! Builds a grid on a device, in buffers that are allocated once, of the largest possible size.

use std::sync::Arc;

use super::GridPasses;
use crate::{
    accel::grid::{GridOptions, Lattice},
    buffers::{GridBuffers, GridCapacities},
    gpu::{Buffer, BufferUse, CommandBuffer, Commands, Context, GpuError, Timer, TimerRow},
    layout::{GRID_IS_COUNTED, LeafTriangle, StructurePlace, Triangle},
    passes::structures::{StructureArrays, StructureKind, Target, submit},
};

/// Kernels and memory that build the grid of an array of triangles. A build can be repeated any number of times, with
/// other triangles in the same buffer, and also with fewer.
pub struct GridBuilder {
    context: Arc<Context>,
    options: GridOptions,
    passes: GridPasses,
    buffers: GridBuffers,
    /// The finished grid is at the beginning of these arrays.
    arrays: StructureArrays,
}

/// A finished build. The grid is in the builder's buffers until the next build: the same as the host's
/// [`Grid`](crate::accel::grid::Grid), bit for bit.
#[derive(Clone, Debug)]
pub struct BuiltGrid {
    /// The lattice of the upper level.
    pub lattice: Lattice,
    /// The number of levels, 1 or 2.
    pub n_levels: u32,
    /// The number of times that cells were made larger because a count exceeded its limit: doublings of the upper
    /// cells' edges and halvings of the blocks' resolutions.
    pub n_coarser: u32,
    /// Cells of all levels.
    pub n_cells: u32,
    /// Entries of all cells.
    pub n_references: u32,
    /// The number of cells with triangles, of the upper level and of the lower one.
    pub n_filled: [u32; 2],
    /// Times of the build's dispatches; empty without a timer.
    pub stages: Vec<TimerRow>,
}

impl GridBuilder {
    /// Creates the kernels and the memory for builds over the triangles.
    ///
    /// # Errors
    /// The build exceeds the device's limits; out of memory; the driver refuses a shader.
    pub fn new(context: &Arc<Context>, triangles: &Buffer<Triangle>, options: &GridOptions) -> Result<Self, GpuError> {
        if !Self::has_room(context, triangles.len()) {
            let (object, limit) = (triangles.any().name().to_owned(), context.limits().storage_range);
            return Err(GpuError::TooLarge { object, bytes: triangles.any().bytes(), limit });
        }
        let options = Self::options_for(context, options);
        let bindings = GridBuffers::bindings(context)?;
        let buffers = GridBuffers::new(context, &bindings, triangles, &options)?;
        let arrays = StructureArrays {
            cells: buffers.cells.clone(),
            leaf_triangles: buffers.leaf_triangles.clone(),
            leaf_planes: buffers.leaf_planes.clone(),
            nodes: Buffer::new(context, "kd_nodes", 0, BufferUse::Storage)?,
            parents: Buffer::new(context, "kd_parents", 0, BufferUse::Storage)?,
            slabs: Buffer::new(context, "kd_slabs", 0, BufferUse::Storage)?,
        };
        Ok(Self {
            arrays,
            buffers,
            passes: GridPasses::new(context, &bindings, options.levels.n_levels())?,
            context: context.clone(),
            options,
        })
    }

    /// Whether the device can bind an array of `n_triangles` triangles as a storage buffer. Free memory is
    /// not considered.
    pub fn has_room(context: &Context, n_triangles: usize) -> bool {
        (n_triangles as u64).saturating_mul(size_of::<Triangle>() as u64) <= context.limits().storage_range
    }

    /// Returns the options with the limit of references lowered to what the device can bind. With the returned
    /// options, the host builds the same grid as the device.
    pub fn options_for(context: &Context, options: &GridOptions) -> GridOptions {
        let most = context.limits().storage_range / size_of::<LeafTriangle>() as u64;
        let max_references = options.max_references.min(u32::try_from(most).unwrap_or(u32::MAX));
        GridOptions { max_references, ..options.clone() }
    }

    /// Returns the options of the builds, as [`GridBuilder::options_for`] has made them.
    pub fn options(&self) -> &GridOptions {
        &self.options
    }

    /// Returns the number of a timer's rows that a build needs, one per dispatch.
    pub fn n_stages(&self) -> u32 {
        self.passes.n_stages(&self.buffers)
    }

    /// Builds the grid and waits for the device. `timer`: takes the times of the dispatches; it must have room for
    /// [`GridBuilder::n_stages`] rows.
    ///
    /// # Errors
    /// Out of memory; a Vulkan call fails.
    pub fn build(&self, timer: Option<&Timer>) -> Result<BuiltGrid, GpuError> {
        self.build_first(self.buffers.capacities.n_triangles as usize, timer)
    }

    /// Builds the grid of the first `n_triangles` triangles, as [`GridBuilder::build`] does.
    ///
    /// # Errors
    /// Out of memory; a Vulkan call fails.
    ///
    /// # Panics
    /// The builder was made for fewer.
    pub fn build_first(&self, n_triangles: usize, timer: Option<&Timer>) -> Result<BuiltGrid, GpuError> {
        let capacity = self.buffers.capacities.n_triangles as usize;
        assert!(n_triangles <= capacity, "{n_triangles} triangles, room for {capacity}");
        let own = GridCapacities::new(n_triangles as u32, &self.options);
        let commands = CommandBuffer::record(&self.context, "grid_build", timer, |commands| {
            commands.reset_timer();
            self.passes.record(commands, &self.buffers, &own);
        })?;
        self.context.wait_for(self.context.submit(vec![commands])?)?;
        let build = self.buffers.build.download()?[0];
        assert_eq!(build.counts, GRID_IS_COUNTED, "the last attempt keeps to the limit");
        Ok(BuiltGrid {
            lattice: Lattice {
                min: build.box_min.to_array(),
                max: build.box_max.to_array(),
                cell_size: build.cell_size,
                n_cells: [build.n_cells_x, build.n_cells_y, build.n_cells_z],
            },
            n_levels: self.options.levels.n_levels(),
            n_coarser: build.n_coarser + build.n_halvings,
            n_cells: build.n_upper + build.n_lower,
            n_references: build.n_pairs,
            n_filled: [build.n_filled_upper, build.n_filled_lower],
            stages: timer.map_or(Ok(Vec::new()), Timer::rows)?,
        })
    }

    /// Copies the grid of the last build to buffers that are created for `usage`, so that the builder can be dropped.
    ///
    /// # Errors
    /// Out of memory; a Vulkan call fails.
    pub fn copy(&self, built: &BuiltGrid, usage: BufferUse) -> Result<StructureArrays, GpuError> {
        self.arrays.copied(&self.context, StructureKind::Grid, built.sizes(), usage)
    }

    /// Copies the grid of the last build as [`GridBuilder::copy`] does, with the indices that it has in arrays of
    /// several grids. In the builder's buffers, too, the grid has these indices afterwards.
    ///
    /// # Errors
    /// Out of memory; a Vulkan call fails.
    pub fn copy_relocated(
        &self,
        built: &BuiltGrid,
        place: &StructurePlace,
        usage: BufferUse,
    ) -> Result<StructureArrays, GpuError> {
        submit(&self.context, "grid_relocate", |commands| self.relocate(commands, built, place))?;
        self.copy(built, usage)
    }

    /// Copies the grid of the last build into arrays of several grids, as
    /// [`KdTreeBuilder::place`](crate::passes::kdtree::KdTreeBuilder::place) does with a tree.
    ///
    /// # Errors
    /// Out of memory; a Vulkan call fails. Nothing has been copied then.
    ///
    /// # Panics
    /// The arrays have no room there.
    pub fn place(&self, built: &BuiltGrid, target: &Target) -> Result<(), GpuError> {
        let relocate = |commands: &Commands| self.relocate(commands, built, &target.place);
        self.arrays.place(&self.context, built.sizes(), (target, relocate))
    }

    fn relocate(&self, commands: &Commands, built: &BuiltGrid, place: &StructurePlace) {
        self.passes.relocate(commands, &self.buffers, built.n_cells.max(built.n_references), place);
    }
}
