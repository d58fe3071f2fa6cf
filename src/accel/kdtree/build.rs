//! The upper part of a tree: large cells, whose references are counted and sorted out by all threads, and whose children
//! are built side by side. Sums of counts and the order of references do not depend on the threads, so neither does the
//! tree.

use rayon::prelude::*;

use super::{
    BuildOptions, KdTree,
    flatten::{Top, flatten},
    planes::planes_of,
    sah::Split,
    search::Search,
    subtree::{self, Cell, Input, sort_out},
};
use crate::{
    accel::bounds::{Bounds, Reference, is_finite},
    layout::Triangle,
};

/// A cell with at most this many references is built by one thread: some 5 ms.
const TASK_REFERENCES: usize = 4096;
/// References that one thread sorts out at a time.
const CHUNK: usize = 1 << 15;
/// References that the budget allows in any case.
const MIN_BUDGET: u64 = 1024;
/// Cutting off empty space makes up to 14 nodes a reference; so many references stay below the 2^29 nodes of a link.
const MAX_BUDGET: u64 = 1 << 25;

impl KdTree {
    /// Builds the tree of `triangles`. Those of a zero area stay in it, those with a corner that is not finite do not.
    ///
    /// The same triangles and options give the same tree on any number of threads. O(n log n) time; some 200 bytes a
    /// triangle while it runs.
    pub fn build(triangles: &[Triangle], options: &BuildOptions) -> KdTree {
        let exact_bounds = Bounds::of_all(triangles);
        let margin = exact_bounds.margin();
        let references: Vec<Reference> = (0..triangles.len() as u32)
            .into_par_iter()
            .filter(|&ix| is_finite(&triangles[ix as usize]))
            .map(|ix| Reference { bounds: Bounds::of(&triangles[ix as usize]).grown(margin), triangle_ix: ix })
            .collect();
        let bounds = exact_bounds.grown(margin);
        let n = references.len() as u64;
        let budget = (n * u64::from(options.max_references_per_triangle) + MIN_BUDGET).min(MAX_BUDGET.max(n));
        let cell = Cell { bounds, level: 0, budget };
        let mut parts = flatten(grow(Input { triangles, options, margin }, references, cell), bounds);
        parts.leaf_planes = planes_of(triangles, &parts.leaf_triangles);
        let mut tree = KdTree { parts, n_triangles: triangles.len() };
        if options.slabs {
            tree.add_slabs(triangles);
        }
        tree
    }
}

fn grow(input: Input, references: Vec<Reference>, cell: Cell) -> Top {
    if references.len() <= TASK_REFERENCES {
        return Top::Subtree(subtree::build(input, references, cell));
    }
    let Some((split, cells)) = cell.split(&references, input.options, &mut Search::default()) else {
        // Rare: nearly all of them coincide, or are too many for the budget. A leaf.
        return Top::Subtree(subtree::build(input, references, cell));
    };
    let [below, above] = partition(input, references, &cell.bounds, &split);
    let (below, above) = rayon::join(|| grow(input, below, cells[0]), || grow(input, above, cells[1]));
    Top::Split { axis: split.axis, position: split.position, children: Box::new([below, above]) }
}

/// The references of both children, in the order of their parent's.
fn partition(input: Input, references: Vec<Reference>, cell: &Bounds, split: &Split) -> [Vec<Reference>; 2] {
    match split.n_references {
        [0, _] => return [Vec::new(), references],
        [_, 0] => return [references, Vec::new()],
        _ => (),
    }
    let sorted_out = |chunk: &[Reference]| {
        let (mut below, mut above) = (Vec::with_capacity(chunk.len()), Vec::with_capacity(chunk.len()));
        for reference in chunk {
            let parts = sort_out(input, reference, cell, split);
            below.extend(parts[0]);
            above.extend(parts[1]);
        }
        (below, above)
    };
    if references.len() <= CHUNK {
        let (below, above) = sorted_out(&references);
        return [below, above];
    }
    let (below, above): (Vec<_>, Vec<_>) = references.par_chunks(CHUNK).map(sorted_out).unzip();
    let (below, above) = rayon::join(|| below.concat(), || above.concat());
    [below, above]
}
