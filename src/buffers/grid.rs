//! Buffers of a grid's build, and the descriptor sets over them.

use std::sync::Arc;

use super::binding;
use crate::{
    accel::grid::{GridLevels, GridOptions},
    gpu::{Binding, BindingLayout, BindingSet, Buffer, BufferUse, Context, GpuError},
    layout::{
        BIND_GRID_BLOCKS, BIND_GRID_BUILD, BIND_GRID_CELLS, BIND_GRID_FIRST_COLUMNS, BIND_GRID_FIRST_PAIRS,
        BIND_GRID_LEAF_PLANES, BIND_GRID_LEAF_TRIANGLES, BIND_GRID_PAIRS_FROM, BIND_GRID_PAIRS_TO,
        BIND_GRID_SCAN_BLOCKS, BIND_GRID_TRIANGLES, BIND_GRID_UPPER_PAIRS, GRID_BLOCK_SIZE, GRID_DIGITS,
        GRID_MAX_RESOLUTION, GRID_MAX_SORT_GROUPS, GridBuild, GridCell, GridSort, LeafTriangle, Plane, StructurePlace,
        Triangle,
    },
};

/// The bindings of the descriptor sets of a build.
const BINDINGS: [u32; 12] = [
    BIND_GRID_BUILD,
    BIND_GRID_TRIANGLES,
    BIND_GRID_UPPER_PAIRS,
    BIND_GRID_FIRST_COLUMNS,
    BIND_GRID_FIRST_PAIRS,
    BIND_GRID_SCAN_BLOCKS,
    BIND_GRID_PAIRS_FROM,
    BIND_GRID_PAIRS_TO,
    BIND_GRID_CELLS,
    BIND_GRID_BLOCKS,
    BIND_GRID_LEAF_TRIANGLES,
    BIND_GRID_LEAF_PLANES,
];

/// Capacities of a build: the most entries of each kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GridCapacities {
    pub n_triangles: u32,
    /// Pairs of a cell and a triangle.
    pub n_references: u32,
    /// Columns of cells in the boxes of all items of a level.
    pub n_columns: u32,
    /// Cells of the upper level, or of the only level.
    pub n_upper: u32,
    /// Cells of the lower level.
    pub n_lower: u32,
}

impl GridCapacities {
    /// Returns the capacities for a build over `n_triangles` triangles.
    pub fn new(n_triangles: u32, options: &GridOptions) -> Self {
        let max_references = options.max_references_of(n_triangles as usize);
        let most_cells = GRID_MAX_RESOLUTION.pow(3);
        let n_upper = ((options.levels.upper_density() * n_triangles as f32) as u32).clamp(1, most_cells);
        let n_lower = match options.levels {
            GridLevels::Uniform { .. } => 0,
            GridLevels::Two { .. } => max_references,
        };
        Self {
            n_triangles,
            n_references: max_references,
            n_columns: GridOptions::max_columns_of(max_references),
            n_upper,
            n_lower,
        }
    }
}

/// Buffers of a build: its state, and the arrays that its kernels hand to one another.
pub struct GridBuffers {
    pub capacities: GridCapacities,
    /// The state of the build: one element.
    pub build: Buffer<GridBuild>,
    /// The cells of the upper level, then those of the lower one.
    pub cells: Buffer<GridCell>,
    pub leaf_triangles: Buffer<LeafTriangle>,
    pub leaf_planes: Buffer<Plane>,
    /// The descriptor sets of the upper level and, in a grid of two levels, of the lower one.
    pub levels: Vec<PairSets>,
    initial: GridBuild,
    arrays: Arrays,
}

/// Descriptor sets of a level, over two arrays of pairs. Each pass of the sort reads one array and writes the other;
/// the last pass writes the first array.
pub struct PairSets {
    /// The sets whose kernels read pairs from the first and from the second array.
    sets: [BindingSet; 2],
    /// The number of the sort's passes.
    pub n_passes: u32,
}

impl PairSets {
    /// The set for a pass of the sort or, if `pass_ix` is `n_passes`, for the kernels after the last pass.
    pub fn reading_for(&self, pass_ix: u32) -> &BindingSet {
        &self.sets[((self.n_passes - pass_ix) % 2) as usize]
    }

    /// The set for the kernel that writes the unsorted pairs, from which the first pass of the sort reads.
    pub fn writing_unsorted(&self) -> &BindingSet {
        &self.sets[((self.n_passes + 1) % 2) as usize]
    }
}

/// Returns the number of the sort's passes for `n_cells` cells.
fn n_sort_passes(n_cells: u32) -> u32 {
    let n_bits = u32::BITS - n_cells.saturating_sub(1).leading_zeros();
    n_bits.div_ceil(GRID_DIGITS.ilog2())
}

impl GridBuffers {
    /// Makes the layout of the sets.
    ///
    /// # Errors
    /// Memory runs out.
    pub fn bindings(context: &Arc<Context>) -> Result<Arc<BindingLayout>, GpuError> {
        BindingLayout::new(
            context,
            &BINDINGS.map(binding),
            size_of::<StructurePlace>().max(size_of::<GridSort>()) as u32,
        )
    }

    /// Makes the buffers and sets of a build over the triangles, or over the first ones.
    ///
    /// # Errors
    /// A buffer is beyond the device's limits, or memory runs out.
    pub fn new(
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        triangles: &Buffer<Triangle>,
        options: &GridOptions,
    ) -> Result<Self, GpuError> {
        let capacities = GridCapacities::new(triangles.len() as u32, options);
        let GridCapacities { n_triangles, n_references, n_columns, n_upper, n_lower } = capacities;
        let is_two_level = n_lower > 0;
        let storage = BufferUse::Storage;
        let pairs = |name, n: u32| Buffer::<[u32; 2]>::new(context, name, n as usize, storage);
        let n_items = n_triangles.max(if is_two_level { n_references } else { 0 });
        let regions = ScanRegions::new(n_items, n_columns, if is_two_level { n_upper } else { 0 });
        let arrays = Arrays {
            triangles: triangles.clone(),
            first_columns: Buffer::new(context, "grid_first_columns", n_items as usize, storage)?,
            first_pairs: Buffer::new(context, "grid_first_pairs", n_columns as usize, storage)?,
            scan_blocks: Buffer::new(context, "grid_scan_blocks", regions.len as usize, storage)?,
            blocks: pairs("grid_blocks", if is_two_level { n_upper } else { 0 })?,
            pairs: [
                pairs("grid_upper_pairs", n_references)?,
                pairs("grid_pairs", n_references)?,
                pairs("grid_lower_pairs", if is_two_level { n_references } else { 0 })?,
            ],
        };
        let build = Buffer::new(context, "grid_build", 1, BufferUse::Indirect)?;
        let cells = Buffer::new(context, "grid_build_cells", n_upper as usize + n_lower as usize, storage)?;
        let leaf_triangles = Buffer::new(context, "grid_build_leaf_triangles", n_references as usize, storage)?;
        let leaf_planes = Buffer::new(context, "grid_build_leaf_planes", n_references as usize, storage)?;
        let mut buffers = Self {
            capacities,
            build,
            cells,
            leaf_triangles,
            leaf_planes,
            levels: Vec::new(),
            initial: initial_build(capacities, options, &regions),
            arrays,
        };
        buffers.levels.push(buffers.pair_sets(bindings, [0, 1], n_sort_passes(n_upper))?);
        if is_two_level {
            buffers.levels.push(buffers.pair_sets(bindings, [1, 2], n_sort_passes(n_lower))?);
        }
        Ok(buffers)
    }

    /// Returns the state that the host writes into `build` before a build over the first triangles. `own`: the
    /// capacities of a build over so many triangles.
    pub fn initial(&self, own: &GridCapacities) -> GridBuild {
        GridBuild {
            n_triangles: own.n_triangles,
            max_references: own.n_references,
            max_columns: own.n_columns,
            ..self.initial
        }
    }

    /// Makes the sets over two of the arrays of pairs, which are given by their indices.
    fn pair_sets(
        &self,
        bindings: &Arc<BindingLayout>,
        [a, b]: [usize; 2],
        n_passes: u32,
    ) -> Result<PairSets, GpuError> {
        let arrays = &self.arrays;
        let set = |from: usize, to: usize| {
            let objects = [
                self.build.any(),
                arrays.triangles.any(),
                arrays.pairs[0].any(),
                arrays.first_columns.any(),
                arrays.first_pairs.any(),
                arrays.scan_blocks.any(),
                arrays.pairs[from].any(),
                arrays.pairs[to].any(),
                self.cells.any(),
                arrays.blocks.any(),
                self.leaf_triangles.any(),
                self.leaf_planes.any(),
            ];
            let objects: Vec<_> = BINDINGS.into_iter().zip(objects.map(Binding::Buffer)).collect();
            BindingSet::new(bindings, "grid", &objects)
        };
        Ok(PairSets { sets: [set(a, b)?, set(b, a)?], n_passes })
    }
}

/// Arrays that only kernels access. grid/grid_build.glsl defines the terms: item, column, pair and block.
struct Arrays {
    triangles: Buffer<Triangle>,
    /// The index of each item's first column, counted from the first column of the item's scan block.
    first_columns: Buffer<u32>,
    /// The index of each column's first pair, counted from the first pair of the column's scan block.
    first_pairs: Buffer<u32>,
    /// Sums of blocks of `GRID_BLOCK_SIZE` entries ([`ScanRegions`]).
    scan_blocks: Buffer<u32>,
    /// For each upper cell, its block of lower cells (`BIND_GRID_BLOCKS`). Empty for a uniform grid.
    blocks: Buffer<[u32; 2]>,
    /// Arrays of pairs. The sort of the upper level ends in the first one, that of the lower level in the second one.
    pairs: [Buffer<[u32; 2]>; 3],
}

/// Regions of `scan_blocks`: the index at which the sums of each prefix sum begin. Those of the sort begin at 0.
struct ScanRegions {
    columns_begin: u32,
    pairs_begin: u32,
    cells_begin: u32,
    len: u32,
}

impl ScanRegions {
    fn new(n_items: u32, n_columns: u32, n_upper: u32) -> Self {
        let columns_begin = GRID_DIGITS * GRID_MAX_SORT_GROUPS;
        let pairs_begin = columns_begin + n_items.div_ceil(GRID_BLOCK_SIZE);
        let cells_begin = pairs_begin + n_columns.div_ceil(GRID_BLOCK_SIZE);
        Self { columns_begin, pairs_begin, cells_begin, len: cells_begin + n_upper.div_ceil(GRID_BLOCK_SIZE) }
    }
}

/// Returns the state of a build before it begins.
fn initial_build(capacities: GridCapacities, options: &GridOptions, regions: &ScanRegions) -> GridBuild {
    let lower_density = match options.levels {
        GridLevels::Uniform { .. } => 0.0,
        GridLevels::Two { lower_density, .. } => lower_density,
    };
    GridBuild {
        least_x: u32::MAX,
        least_y: u32::MAX,
        least_z: u32::MAX,
        n_triangles: capacities.n_triangles,
        upper_density: options.levels.upper_density(),
        lower_density,
        max_references: capacities.n_references,
        max_columns: capacities.n_columns,
        columns_begin: regions.columns_begin,
        pairs_begin: regions.pairs_begin,
        cells_begin: regions.cells_begin,
        blocks_per_group: 1,
        cell_groups_z: 1,
        item_groups_z: 1,
        column_groups_z: 1,
        counted_column_groups_z: 1,
        counted_pair_groups_z: 1,
        counted_cell_groups_z: 1,
        sort_groups_z: 1,
        ..GridBuild::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_bit_of_a_cell_is_in_a_pass() {
        assert_eq!([0, 1, 2, 16, 17, 256, 257, 1 << 22, (1 << 22) + 1].map(n_sort_passes), [0, 0, 1, 1, 2, 2, 3, 6, 6]);
    }
}
