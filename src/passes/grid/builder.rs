//! Builds a grid on a device: runs the kernels over the triangles, and copies the grid from arrays of the largest
//! possible size to arrays of exactly the grid's size.

use std::sync::Arc;

use super::GridPasses;
use crate::{
    accel::grid::{GridOptions, Lattice},
    buffers::GridBuffers,
    gpu::{Buffer, BufferUse, CommandBuffer, Context, GpuError, Timer, TimerRow},
    layout::{GRID_IS_COUNTED, GridBuild, GridCell, LeafTriangle, Plane, Triangle},
    passes::device_build,
};

/// Kernels and memory that build the grid of an array of triangles. A build can be repeated any number of times.
pub struct GridBuilder {
    context: Arc<Context>,
    options: GridOptions,
    passes: GridPasses,
    buffers: GridBuffers,
}

/// A grid in a device's memory, the same as the host's [`Grid`](crate::accel::grid::Grid), bit for bit.
pub struct DeviceGrid {
    /// The lattice of the upper level.
    pub lattice: Lattice,
    /// The number of levels, 1 or 2.
    pub n_levels: u32,
    /// The number of times that cells were made larger because a count exceeded its limit: doublings of the upper
    /// cells' edges and halvings of the blocks' resolutions.
    pub n_coarser: u32,
    /// The cells of the upper level, then those of the lower one.
    pub cells: Buffer<GridCell>,
    /// The triangles of each cell, one cell after the other.
    pub leaf_triangles: Buffer<LeafTriangle>,
    /// The plane of each of `leaf_triangles`.
    pub leaf_planes: Buffer<Plane>,
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
        Ok(Self {
            buffers: GridBuffers::new(context, &bindings, triangles, &options)?,
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

    /// Builds the grid and waits for the device. The grid's buffers are created for `usage`. `timer`: takes the times
    /// of the dispatches; it must have room for [`GridBuilder::n_stages`] rows.
    ///
    /// # Errors
    /// Out of memory; a Vulkan call fails.
    pub fn build(&self, timer: Option<&Timer>, usage: BufferUse) -> Result<DeviceGrid, GpuError> {
        let commands = CommandBuffer::record(&self.context, "grid_build", timer, |commands| {
            commands.reset_timer();
            self.passes.record(commands, &self.buffers);
        })?;
        self.context.wait_for(self.context.submit(vec![commands])?)?;
        let build = self.buffers.build.download()?[0];
        assert_eq!(build.counts, GRID_IS_COUNTED, "the last attempt keeps to the limit");
        let mut grid = self.with_room(&build, usage)?;
        self.copy_to(&grid)?;
        grid.stages = timer.map_or(Ok(Vec::new()), Timer::rows)?;
        Ok(grid)
    }

    /// Creates the grid of a finished build, with arrays whose contents are undefined.
    fn with_room(&self, build: &GridBuild, usage: BufferUse) -> Result<DeviceGrid, GpuError> {
        let lattice = Lattice {
            min: build.box_min.to_array(),
            max: build.box_max.to_array(),
            cell_size: build.cell_size,
            n_cells: [build.n_cells_x, build.n_cells_y, build.n_cells_z],
        };
        let n_cells = build.n_upper as usize + build.n_lower as usize;
        let n_references = build.n_pairs as usize;
        Ok(DeviceGrid {
            lattice,
            n_levels: self.options.levels.n_levels(),
            n_coarser: build.n_coarser + build.n_halvings,
            cells: Buffer::new(&self.context, "grid_cells", n_cells, usage)?,
            leaf_triangles: Buffer::new(&self.context, "leaf_triangles", n_references, usage)?,
            leaf_planes: Buffer::new(&self.context, "leaf_planes", n_references, usage)?,
            n_filled: [build.n_filled_upper, build.n_filled_lower],
            stages: Vec::new(),
        })
    }

    fn copy_to(&self, grid: &DeviceGrid) -> Result<(), GpuError> {
        let copies = [
            (self.buffers.cells.any(), grid.cells.any(), grid.cells.len() * size_of::<GridCell>()),
            (
                self.buffers.leaf_triangles.any(),
                grid.leaf_triangles.any(),
                grid.leaf_triangles.len() * size_of::<LeafTriangle>(),
            ),
            (self.buffers.leaf_planes.any(), grid.leaf_planes.any(), grid.leaf_planes.len() * size_of::<Plane>()),
        ];
        device_build::copy(&self.context, "grid_copy", &copies)
    }
}
