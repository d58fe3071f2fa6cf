//! Build of the upper part of a tree: large cells. All threads count and separate the references of such a cell, and
//! its children are built in parallel. The sums of counts and the order of references do not depend on the threads,
//! so the tree does not either.

use rayon::prelude::*;

use super::{
    BuildOptions, KdTree,
    binned::BinnedSearch,
    flatten::{UpperTree, flatten},
    planes::planes_of,
    sah::Split,
    scales::Scales,
    subtree::{self, BuildCell, Input, split_reference},
};
use crate::{
    accel::bounds::{Bounds, Reference, is_finite},
    layout::Triangle,
    util::progress::{Meter, Progress, Work},
};

/// The most references of a cell that one thread builds, with all cells below it. This takes some 5 ms.
const TASK_REFERENCES: usize = 4096;
/// The number of references that one thread separates at a time.
const CHUNK: usize = 1 << 15;
/// The number of references by which a tree may exceed `max_references_per_triangle` times the number of triangles.
const MIN_BUDGET: u64 = 1024;
/// The most references of a tree, unless it has more triangles. Cutting off empty space makes up to 14 nodes per
/// reference, so a tree of this many references stays below the 2^29 nodes that a split's child index can address.
const MAX_BUDGET: u64 = 1 << 25;

impl KdTree {
    /// Builds the kd-tree of `triangles`. Triangles without area are in it, and those with a corner that is not
    /// finite are not.
    ///
    /// The same triangles and options give the same tree on any number of threads. The build takes O(n log n) time,
    /// and some 200 bytes a triangle while it runs.
    pub fn build(triangles: &[Triangle], options: &BuildOptions) -> KdTree {
        Self::build_observed(triangles, options, &Progress::default())
    }

    /// Does what [`KdTree::build`] does, and reports its progress.
    pub fn build_observed(triangles: &[Triangle], options: &BuildOptions, progress: &Progress) -> KdTree {
        let exact_bounds = Bounds::of_all(triangles);
        let scales = Scales::new(triangles, &exact_bounds);
        let reference = |ix: u32| {
            let triangle = &triangles[ix as usize];
            Reference { bounds: Bounds::of(triangle).grown(scales.margin_of(triangle)), triangle_ix: ix }
        };
        let references: Vec<Reference> = (0..triangles.len() as u32)
            .into_par_iter()
            .filter(|&ix| is_finite(&triangles[ix as usize]))
            .map(reference)
            .collect();
        let bounds = exact_bounds.grown(exact_bounds.margin());
        let n = references.len() as u64;
        let budget = (n * u64::from(options.max_references_per_triangle) + MIN_BUDGET).min(MAX_BUDGET.max(n));
        let cell = BuildCell { bounds, level: 0, budget };
        // The budget of a cell is its share of the triangles.
        let meter = progress.begin(Work::Building, budget);
        let input = Input { triangles, options, scales };
        let mut arrays = flatten(grow((input, &meter), references, cell), bounds);
        arrays.leaf_planes = planes_of(&arrays, triangles, &scales);
        let mut tree = KdTree { arrays, n_triangles: triangles.len(), scales };
        if options.slabs {
            tree.add_slabs(triangles);
        }
        tree
    }
}

/// Builds the node of a cell and all nodes below it.
fn grow((input, meter): (Input, &Meter), references: Vec<Reference>, cell: BuildCell) -> UpperTree {
    let subtree = |references| {
        let subtree = subtree::build(input, references, cell);
        meter.add(cell.budget);
        UpperTree::Subtree(subtree)
    };
    if references.len() <= TASK_REFERENCES {
        return subtree(references);
    }
    // The observer may stop the build, which takes long until the first subtree is done.
    meter.add(0);
    let Some((split, cells)) = cell.split(&references, input.options, &mut BinnedSearch::default()) else {
        // The cell becomes a leaf. This is rare: nearly all of its triangles coincide, or a split exceeds the budget.
        return subtree(references);
    };
    let [below, above] = partition(input, references, &cell.bounds, &split);
    let (below, above) =
        rayon::join(|| grow((input, meter), below, cells[0]), || grow((input, meter), above, cells[1]));
    UpperTree::Split { axis: split.axis, position: split.position, children: Box::new([below, above]) }
}

/// Returns the references of both children, in the order of their parent's references.
fn partition(input: Input, references: Vec<Reference>, cell: &Bounds, split: &Split) -> [Vec<Reference>; 2] {
    match split.n_references {
        [0, _] => return [Vec::new(), references],
        [_, 0] => return [references, Vec::new()],
        _ => (),
    }
    let sorted_out = |chunk: &[Reference]| {
        let (mut below, mut above) = (Vec::with_capacity(chunk.len()), Vec::with_capacity(chunk.len()));
        for reference in chunk {
            let pieces = split_reference(input, reference, cell, split);
            below.extend(pieces[0]);
            above.extend(pieces[1]);
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
