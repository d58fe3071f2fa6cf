//! Build of grids: makes the pairs of a cell and a triangle in it, and puts them in the order of the cells.

use rayon::prelude::*;

use super::{Grid, GridLevels, GridOptions, Lattice, overlap::Columns, planes::plane_of};
use crate::{
    accel::{
        bounds::{Bounds, is_finite},
        kdtree::scales::Scales,
    },
    layout::{GRID_MAX_ATTEMPTS, GRID_MAX_BLOCK_RESOLUTION, GRID_MAX_COUNT, GRID_MAX_HALVINGS, GridCell, Triangle},
};

/// The index of a cell and the index of a triangle.
type Pair = (u32, u32);

/// Inputs of all steps of a build.
struct Input<'a> {
    triangles: &'a [Triangle],
    /// Distance from a cell within which a triangle counts as inside the cell, world units ([`Bounds::margin`]).
    margin: f32,
    max_references: u32,
}

/// A number of columns, pairs or cells that is above its limit.
struct TooMany {
    count: u64,
    limit: u32,
}

/// A triangle and the lattice whose cells it is sorted into.
struct Item {
    triangle_ix: u32,
    lattice: Lattice,
    /// The index of the lattice's first cell in [`Grid::cells`].
    first_cell: u32,
}

/// State of a build after a level: the cells of all levels so far, and the pairs of the lowest of these levels in the
/// order of its cells.
struct Level {
    cells: Vec<GridCell>,
    pairs: Vec<Pair>,
    /// The number of times that the cells' edges were doubled to keep to the limits.
    n_coarser: u32,
}

impl Grid {
    /// Builds the grid of `triangles`. Triangles without area are in it, and those with a corner that is not finite
    /// are not.
    ///
    /// The same triangles and options give the same grid on any number of threads.
    pub fn build(triangles: &[Triangle], options: &GridOptions) -> Self {
        let exact_bounds = Bounds::of_all(triangles);
        let margin = exact_bounds.margin();
        let input = Input { triangles, margin, max_references: options.max_references_of(triangles.len()) };
        let (lattice, upper) = upper_level(&input, &exact_bounds.grown(margin), options.levels.upper_density());
        let lowest = match options.levels {
            GridLevels::Uniform { .. } => upper,
            GridLevels::Two { lower_density, .. } => lower_level(&input, &lattice, upper, lower_density),
        };
        let largest_coordinate = lattice.largest_coordinate();
        let leaf_triangles: Vec<u32> = lowest.pairs.into_par_iter().map(|(_, triangle_ix)| triangle_ix).collect();
        let plane = |&ix: &u32| plane_of(&triangles[ix as usize], largest_coordinate);
        Self {
            lattice,
            n_levels: options.levels.n_levels(),
            cells: lowest.cells,
            leaf_planes: leaf_triangles.par_iter().map(plane).collect(),
            leaf_triangles,
            n_triangles: triangles.len(),
            n_coarser: lowest.n_coarser,
            origin_reach: Scales::new(triangles, &exact_bounds).origin_reach(largest_coordinate),
        }
    }
}

/// Returns the lattice, the cells and the pairs of a uniform grid, or of the upper level of a two-level grid.
fn upper_level(input: &Input, bounds: &Bounds, density: f32) -> (Lattice, Level) {
    let n_finite = input.triangles.par_iter().filter(|triangle| is_finite(triangle)).count();
    let mut lattice = Lattice::finest(bounds, (density * n_finite as f32) as u32);
    let mut n_coarser = 0;
    for n_attempts in 1.. {
        let item = |triangle_ix: usize| {
            let item = Item { triangle_ix: triangle_ix as u32, lattice, first_cell: 0 };
            is_finite(&input.triangles[triangle_ix]).then_some(item)
        };
        match pairs_of(input, input.triangles.len(), item) {
            Ok(pairs) => {
                let pairs = in_order(pairs);
                return (lattice, Level { cells: cells_of(lattice.n_cubes(), 0, &pairs), pairs, n_coarser });
            }
            Err(too_many) => {
                let n_doublings;
                (lattice, n_doublings) = lattice.coarser(too_many.n_doublings(n_attempts));
                n_coarser += n_doublings;
            }
        }
    }
    unreachable!("a grid of one cell keeps to the limits")
}

/// Cuts the cells of the upper level into blocks of cells and sorts the triangles of each upper cell into its block.
fn lower_level(input: &Input, lattice: &Lattice, upper: Level, density: f32) -> Level {
    let n_upper = upper.cells.len() as u32;
    let finest: Vec<u32> =
        upper.cells.iter().map(|cell| finest_resolution(input, lattice, density * cell.count as f32)).collect();
    let mut n_halvings = 0;
    for n_attempts in 1.. {
        let resolution = |ix: usize| if upper.cells[ix].count == 0 { 0 } else { (finest[ix] >> n_halvings).max(1) };
        let (blocks, n_lower) = blocks_of(n_upper, resolution);
        let item = |pair_ix: usize| {
            let (cell_ix, triangle_ix) = upper.pairs[pair_ix];
            let GridCell { first: first_cell, count: resolution } = blocks[cell_ix as usize];
            Some(Item { triangle_ix, lattice: lattice.within(lattice.cube_at(cell_ix), resolution), first_cell })
        };
        let pairs = check(n_lower, input.max_references).and_then(|()| pairs_of(input, upper.pairs.len(), item));
        match pairs {
            Ok(pairs) => {
                let pairs = in_order(pairs);
                let lower_cells = cells_of(n_lower as usize, n_upper, &pairs);
                return Level { cells: [blocks, lower_cells].concat(), pairs, n_coarser: upper.n_coarser + n_halvings };
            }
            Err(too_many) => {
                n_halvings = (n_halvings + too_many.n_doublings(n_attempts)).min(GRID_MAX_HALVINGS);
            }
        }
    }
    unreachable!("blocks of one cell keep to the limits")
}

/// Returns the upper cells of a grid of two levels, and the number of all lower cells. In an upper cell, `first` is
/// the index of the first cell of its block, and `count` is the block's resolution. `resolution`: the number of a
/// block's cells along each axis.
fn blocks_of(n_upper: u32, resolution: impl Fn(usize) -> u32) -> (Vec<GridCell>, u64) {
    let mut n_lower = 0;
    let block = |ix: usize| {
        let block = GridCell { first: (u64::from(n_upper) + n_lower) as u32, count: resolution(ix) };
        n_lower += u64::from(block.count).pow(3);
        block
    };
    ((0..n_upper as usize).map(block).collect(), n_lower)
}

/// Returns the largest number of cells along each axis, 1 to `GRID_MAX_BLOCK_RESOLUTION`, with which a block has no
/// more than `max_cells` cells, and none smaller than the margin. Returns 1 if every larger number is too large.
fn finest_resolution(input: &Input, upper: &Lattice, max_cells: f32) -> u32 {
    let fits = |r: u32| (r * r * r) as f32 <= max_cells && upper.cell_size_within(r) >= input.margin;
    (2..=GRID_MAX_BLOCK_RESOLUTION).take_while(|&r| fits(r)).last().unwrap_or(1)
}

/// Returns the pairs of all items, ordered by item, then by column, then by the cell's place in the column.
///
/// # Errors
/// There are too many columns or pairs.
fn pairs_of(input: &Input, n_items: usize, item: impl Fn(usize) -> Option<Item> + Sync) -> Result<Vec<Pair>, TooMany> {
    let items = || (0..n_items).into_par_iter().filter_map(&item);
    let columns = |item: &Item| Columns::new(item.lattice, &input.triangles[item.triangle_ix as usize], input.margin);
    let n_columns = items().map(|item| u64::from(columns(&item).n_columns())).sum();
    check(n_columns, GridOptions::max_columns_of(input.max_references))?;
    let pairs_of_item = |item: Item| {
        let (columns, mut pairs) = (columns(&item), Vec::new());
        for column_ix in 0..columns.n_columns() {
            let found = |cube| pairs.push((item.first_cell + item.lattice.cell_ix_of(cube), item.triangle_ix));
            columns.cubes_of(column_ix, found);
        }
        pairs
    };
    let pairs: Vec<Pair> = items().flat_map_iter(pairs_of_item).collect();
    check(pairs.len() as u64, input.max_references)?;
    Ok(pairs)
}

/// Checks a count against its limit.
fn check(count: u64, limit: u32) -> Result<(), TooMany> {
    if count <= u64::from(limit) { Ok(()) } else { Err(TooMany { count, limit }) }
}

impl TooMany {
    /// Returns how many times the cells' edges are doubled for the next attempt. At each doubling, the number of
    /// cells that a surface meets falls to about a quarter. The more attempts have failed, the more doublings there
    /// are. The last attempt has the largest possible cells.
    ///
    /// `n_attempts`: the number of failed attempts.
    fn n_doublings(&self, n_attempts: u32) -> u32 {
        if n_attempts + 1 >= GRID_MAX_ATTEMPTS {
            return 32;
        }
        let count = if self.count > u64::from(GRID_MAX_COUNT) { u32::MAX } else { self.count as u32 };
        let expected = (1..15).find(|n| count >> (2 * n) <= self.limit).unwrap_or(15);
        expected + n_attempts - 1
    }
}

/// Puts pairs in the order of their cells. Within a cell the order stays that of the triangles.
fn in_order(mut pairs: Vec<Pair>) -> Vec<Pair> {
    pairs.par_sort_by_key(|&(cell_ix, _)| cell_ix);
    pairs
}

/// Returns cells whose entries are the pairs' triangles. `first_cell`: the index of the first cell.
fn cells_of(n_cells: usize, first_cell: u32, pairs: &[Pair]) -> Vec<GridCell> {
    let mut cells = vec![GridCell::default(); n_cells];
    for (entry_ix, &(cell_ix, _)) in pairs.iter().enumerate() {
        let cell = &mut cells[(cell_ix - first_cell) as usize];
        if cell.count == 0 {
            cell.first = entry_ix as u32;
        }
        cell.count += 1;
    }
    cells
}
