//! Builds one level of a grid: the pairs of a cell and a triangle, in the order of the cells.

use std::mem::offset_of;

use super::{Cut, Kernels, ONE_GROUP, dispatch, sized_by, spirv, then};
use crate::{
    buffers::{GridBuffers, PairSets},
    gpu::{Commands, ComputePipeline, Constants, GpuError},
    layout::{
        GRID_DIGIT_BITS, GRID_MAX_ATTEMPTS, GRID_SCANS_COLUMNS, GRID_SCANS_DIGITS, GRID_SCANS_PAIRS, GridBuild,
        GridSort, constants,
    },
};

/// The kernels of a level.
pub struct Level {
    columns: ComputePipeline,
    spine_columns: ComputePipeline,
    count: ComputePipeline,
    spine_pairs: ComputePipeline,
    emit: ComputePipeline,
    sort: Sort,
    cells: ComputePipeline,
}

/// The kernels of one pass of the sort.
struct Sort {
    count: ComputePipeline,
    spine: ComputePipeline,
    scatter: ComputePipeline,
}

/// The kernels' names, which are their debug labels and the names of their rows in the timer.
struct Names {
    columns: &'static str,
    spine_columns: &'static str,
    count: &'static str,
    spine_pairs: &'static str,
    emit: &'static str,
    sort_count: &'static str,
    sort_spine: &'static str,
    sort_scatter: &'static str,
    cells: &'static str,
}

const UPPER: Names = Names {
    columns: "grid_columns",
    spine_columns: "grid_spine_columns",
    count: "grid_count",
    spine_pairs: "grid_spine_pairs",
    emit: "grid_emit",
    sort_count: "grid_sort_count",
    sort_spine: "grid_sort_spine",
    sort_scatter: "grid_sort_scatter",
    cells: "grid_cells",
};

const LOWER_LEVEL: Names = Names {
    columns: "grid_lower_columns",
    spine_columns: "grid_lower_spine_columns",
    count: "grid_lower_count",
    spine_pairs: "grid_lower_spine_pairs",
    emit: "grid_lower_emit",
    sort_count: "grid_lower_sort_count",
    sort_spine: "grid_lower_sort_spine",
    sort_scatter: "grid_lower_sort_scatter",
    cells: "grid_lower_cells",
};

impl Level {
    /// Creates the kernels of the upper level, or of the only one.
    ///
    /// # Errors
    /// The driver refuses a shader.
    pub fn upper(kernels: &Kernels) -> Result<Self, GpuError> {
        Self::new(kernels, &UPPER, &Constants::new().set(constants::LOWER_LEVEL, false))
    }

    /// Creates the kernels of the lower level.
    ///
    /// # Errors
    /// The driver refuses a shader.
    pub fn lower(kernels: &Kernels) -> Result<Self, GpuError> {
        Self::new(kernels, &LOWER_LEVEL, &Constants::new().set(constants::LOWER_LEVEL, true))
    }

    fn new(kernels: &Kernels, names: &Names, level: &Constants) -> Result<Self, GpuError> {
        let spine = |name, scans| {
            kernels.of_blocks(name, spirv!("grid_spine.comp"), &level.clone().set(constants::SCANS, scans))
        };
        Ok(Self {
            columns: kernels.of_blocks(names.columns, spirv!("grid_columns.comp"), level)?,
            spine_columns: spine(names.spine_columns, GRID_SCANS_COLUMNS)?,
            count: kernels.of_blocks(names.count, spirv!("grid_count.comp"), level)?,
            spine_pairs: spine(names.spine_pairs, GRID_SCANS_PAIRS)?,
            emit: kernels.of_blocks(names.emit, spirv!("grid_emit.comp"), level)?,
            sort: Sort {
                count: kernels.of_blocks(names.sort_count, spirv!("grid_sort_count.comp"), level)?,
                spine: spine(names.sort_spine, GRID_SCANS_DIGITS)?,
                scatter: kernels.of_blocks(names.sort_scatter, spirv!("grid_sort_scatter.comp"), level)?,
            },
            cells: kernels.of_blocks(names.cells, spirv!("grid_cells.comp"), level)?,
        })
    }

    /// Returns the number of a level's dispatches, without those of a `Cut`.
    pub fn n_stages(sets: &PairSets) -> u32 {
        4 * GRID_MAX_ATTEMPTS + 1 + 3 * sets.n_passes + 1
    }

    /// Records the build of the level. Needs `build`, and for the lower level what the upper level leaves. Leaves the
    /// level's `cells` and its sorted pairs. The descriptor set that remains bound has the pairs as `pairs_from`.
    /// `cut`: for the lower level, the kernels that choose its lattices before each attempt.
    pub fn record(&self, commands: &Commands, buffers: &GridBuffers, sets: &PairSets, cut: Option<&Cut>) {
        commands.bind(sets.writing_unsorted());
        for attempt in 0..GRID_MAX_ATTEMPTS {
            if let Some(cut) = cut {
                cut.record(commands, buffers, attempt);
            }
            self.count(commands, buffers, attempt);
        }
        dispatch(commands, &self.emit, sized_by(buffers, offset_of!(GridBuild, counted_column_groups_x)));
        for pass_ix in 0..sets.n_passes {
            then(commands);
            commands.bind(sets.reading_for(pass_ix));
            self.sort.record(commands, buffers, pass_ix);
        }
        then(commands);
        commands.bind(sets.reading_for(sets.n_passes));
        dispatch(commands, &self.cells, sized_by(buffers, offset_of!(GridBuild, counted_pair_groups_x)));
    }

    /// Records one attempt to count columns and pairs. Needs `build`, and at the lower level `blocks`. Leaves the
    /// index of each item's first column in `first_columns`, and of each column's first pair in `first_pairs`. Both
    /// count from the first entry of their block of the scan, whose own position is left in `scan_blocks`. Leaves the
    /// sizes of the next dispatches in `build`.
    fn count(&self, commands: &Commands, buffers: &GridBuffers, attempt: u32) {
        let none = GridSort::default();
        let items = sized_by(buffers, offset_of!(GridBuild, item_groups_x));
        commands.dispatch(&self.columns, Some(attempt), &none, items);
        then(commands);
        commands.dispatch(&self.spine_columns, Some(attempt), &none, ONE_GROUP);
        then(commands);
        let columns = sized_by(buffers, offset_of!(GridBuild, column_groups_x));
        commands.dispatch(&self.count, Some(attempt), &none, columns);
        then(commands);
        commands.dispatch(&self.spine_pairs, Some(attempt), &none, ONE_GROUP);
        then(commands);
    }
}

impl Sort {
    /// Records one pass. Needs `pairs_from`. Leaves the same pairs in `pairs_to`, in the order of the pass's digit.
    fn record(&self, commands: &Commands, buffers: &GridBuffers, pass_ix: u32) {
        let push = GridSort { first_bit: pass_ix * GRID_DIGIT_BITS };
        let groups = || sized_by(buffers, offset_of!(GridBuild, sort_groups_x));
        commands.dispatch(&self.count, Some(pass_ix), &push, groups());
        then(commands);
        commands.dispatch(&self.spine, Some(pass_ix), &push, ONE_GROUP);
        then(commands);
        commands.dispatch(&self.scatter, Some(pass_ix), &push, groups());
    }
}
