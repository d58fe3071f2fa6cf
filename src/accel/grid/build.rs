//! Pairs of a cell and a triangle, put in the order of the cells.

use rayon::prelude::*;

use super::{GRID_MAX_BLOCK_RESOLUTION, Grid, GridCell, GridOptions, Lattice, overlap::Columns, planes::plane_of};
use crate::{
    accel::bounds::{Bounds, is_finite},
    layout::Triangle,
};

/// A cell's place and a triangle's index.
type Pair = (u32, u32);

/// What all steps of a build read.
#[derive(Clone, Copy)]
struct Input<'a> {
    triangles: &'a [Triangle],
    options: &'a GridOptions,
    margin: f32,
    max_references: u64,
}

/// The lower level's cells of an upper one.
struct Block {
    lattice: Lattice,
    first_cell: u32,
}

impl Grid {
    /// Builds the grid of `triangles`. Those of a zero area stay in it, those with a corner that is not finite do not.
    ///
    /// The same triangles and options give the same grid on any number of threads.
    pub fn build(triangles: &[Triangle], options: &GridOptions) -> Self {
        let exact_bounds = Bounds::of_all(triangles);
        let margin = exact_bounds.margin();
        let input = Input { triangles, options, margin, max_references: options.max_references(triangles.len()) };
        let (lattice, pairs, n_coarser) = upper_level(input, &exact_bounds.grown(margin));
        let mut cells = cells_of(lattice.n_cubes(), 0, &pairs);
        let mut grid = Self {
            lattice,
            n_levels: options.n_levels,
            cells: Vec::new(),
            leaf_triangles: Vec::new(),
            leaf_planes: Vec::new(),
            n_triangles: triangles.len(),
            n_coarser,
        };
        let entries = match options.n_levels {
            1 => pairs,
            _ => {
                let (lower_pairs, n_coarser) = lower_level(input, &lattice, &mut cells, &pairs);
                grid.n_coarser += n_coarser;
                lower_pairs
            }
        };
        let [least, greatest] = lattice.bounds();
        let largest_coordinate = least.abs().max(greatest.abs()).max_element();
        grid.cells = cells;
        grid.leaf_triangles = entries.par_iter().map(|&(_, triangle_ix)| triangle_ix).collect();
        let plane = |&ix: &u32| plane_of(&triangles[ix as usize], largest_coordinate);
        grid.leaf_planes = grid.leaf_triangles.par_iter().map(plane).collect();
        grid
    }
}

/// The cells and the sorted pairs of a uniform grid, or of the upper level of two. Last: how many times the cells' edges had to
/// be doubled to keep to the limits.
fn upper_level(input: Input, bounds: &Bounds) -> (Lattice, Vec<Pair>, u32) {
    let finite: Vec<u32> = (0..input.triangles.len() as u32)
        .into_par_iter()
        .filter(|&ix| is_finite(&input.triangles[ix as usize]))
        .collect();
    let density = if input.options.n_levels == 1 { input.options.density } else { input.options.upper_density };
    let mut lattice = Lattice::of_density(bounds, density * finite.len() as f32);
    let mut n_coarser = 0;
    loop {
        let columns = |&ix: &u32| Columns::new(&lattice, &input.triangles[ix as usize], input.margin);
        let n_columns: u64 = finite.par_iter().map(|ix| u64::from(columns(ix).n_columns())).sum();
        let is_coarsest = lattice.n_cubes() == 1 || lattice.cell_size == f32::MAX;
        if n_columns <= input.max_references || is_coarsest {
            let pairs_of = |ix: &u32| pairs_of(&columns(ix), |cube| lattice.place_of(cube), *ix);
            let pairs: Vec<Pair> = finite.par_iter().flat_map_iter(pairs_of).collect();
            if pairs.len() as u64 <= input.max_references || is_coarsest {
                return (lattice, in_order(pairs), n_coarser);
            }
        }
        lattice = Lattice::of_size(bounds, (2.0 * lattice.cell_size).min(f32::MAX));
        n_coarser += 1;
    }
}

/// Cuts the upper cells, which have these pairs, into blocks, and gives the blocks' cells their triangles. Returns the sorted pairs
/// of the lower cells, and how many times the blocks' resolutions had to be halved to keep to the limits.
fn lower_level(input: Input, upper: &Lattice, cells: &mut Vec<GridCell>, upper_pairs: &[Pair]) -> (Vec<Pair>, u32) {
    let n_upper = cells.len();
    let counts: Vec<u32> = cells.iter().map(|cell| cell.count).collect();
    for n_coarser in 0.. {
        let mut first_cell = n_upper as u64;
        for (cell, &n_triangles) in cells.iter_mut().zip(&counts) {
            let resolution = resolution_for(input, upper, n_triangles, n_coarser);
            *cell = GridCell { first: first_cell as u32, count: resolution };
            first_cell += u64::from(resolution).pow(3);
        }
        let n_lower = first_cell - n_upper as u64;
        let is_coarsest = cells.iter().all(|cell| cell.count <= 1);
        if n_lower > input.max_references && !is_coarsest {
            continue;
        }
        let blocks = |pair: &Pair| {
            let GridCell { first: first_cell, count: resolution } = cells[pair.0 as usize];
            Block { lattice: upper.within(upper.cube_at(pair.0), resolution), first_cell }
        };
        let columns = |block: &Block, ix: u32| {
            Columns::new(&block.lattice, &input.triangles[ix as usize], input.margin).n_columns()
        };
        let n_columns: u64 = upper_pairs.par_iter().map(|pair| u64::from(columns(&blocks(pair), pair.1))).sum();
        if n_columns > input.max_references && !is_coarsest {
            continue;
        }
        let pairs_of = |pair: &Pair| {
            let Block { lattice, first_cell } = blocks(pair);
            let columns = Columns::new(&lattice, &input.triangles[pair.1 as usize], input.margin);
            pairs_of(&columns, |cube| first_cell + lattice.place_of(cube), pair.1)
        };
        let pairs: Vec<Pair> = upper_pairs.par_iter().flat_map_iter(pairs_of).collect();
        if pairs.len() as u64 <= input.max_references || is_coarsest {
            let pairs = in_order(pairs);
            cells.extend(cells_of(n_lower as usize, n_upper as u32, &pairs));
            return (pairs, n_coarser);
        }
    }
    unreachable!("blocks of one cell keep to the limits")
}

/// Along each axis: the most cells of which no more than `lower_density` for each triangle make a block, and which are not smaller
/// than the margin; then halved so many times.
fn resolution_for(input: Input, upper: &Lattice, n_triangles: u32, n_halvings: u32) -> u32 {
    let max_cells = input.options.lower_density * n_triangles as f32;
    let fits = |r: u32| (r * r * r) as f32 <= max_cells && upper.cell_size_within(r) >= input.margin;
    let finest = (2..=GRID_MAX_BLOCK_RESOLUTION).take_while(|&r| fits(r)).last().unwrap_or(1);
    if n_triangles == 0 { 0 } else { (finest >> n_halvings).max(1) }
}

fn pairs_of(columns: &Columns, place_of: impl Fn([u32; 3]) -> u32, triangle_ix: u32) -> Vec<Pair> {
    let mut pairs = Vec::new();
    (0..columns.n_columns()).for_each(|ix| columns.cubes_of(ix, |cube| pairs.push((place_of(cube), triangle_ix))));
    pairs
}

/// In the order of the cells; within a cell the order stays that of the triangles.
fn in_order(mut pairs: Vec<Pair>) -> Vec<Pair> {
    pairs.par_sort_by_key(|&(cell_ix, _)| cell_ix);
    pairs
}

/// Cells whose entries are the pairs' triangles. `first_cell`: the place of the first of them.
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
