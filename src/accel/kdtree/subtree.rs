//! Build of a subtree by one thread, recursively. The references of the current cell and of all cells above it are in
//! one array, which grows and shrinks like a stack.

use std::ops::Range;

use super::{BuildOptions, EMPTY_LEAF, Node, binned::BinnedSearch, clip::split_bounds, sah::Split, scales::Scales};
use crate::{
    accel::bounds::{Bounds, Reference},
    layout::{KD_WORD_DEPTH, KdNode, Triangle},
};

/// Inputs of a build.
#[derive(Clone, Copy)]
pub struct Input<'a> {
    pub triangles: &'a [Triangle],
    pub options: &'a BuildOptions,
    pub scales: Scales,
}

/// A cell that is to be built, without its references.
#[derive(Clone, Copy)]
pub struct BuildCell {
    pub bounds: Bounds,
    /// The cell's level, 0 for the root of the whole tree.
    pub level: u32,
    /// The most references that all leaves in the cell may have together.
    pub budget: u64,
}

/// At level `KD_WORD_DEPTH` and deeper, a cell with this number of references or fewer always becomes a leaf. A split
/// there would need a second word of the traversal's bit mask, which slows all rays down. So few references do not
/// justify that. In meshes of a million triangles, hardly any leaf at these levels has this many references
/// (docs/experiments.md).
const FEW_REFERENCES: usize = 64;

impl BuildCell {
    /// Returns the best split and its children's cells, or none where a leaf is cheaper or a limit is reached.
    pub fn split(
        self,
        references: &[Reference],
        options: &BuildOptions,
        search: &mut BinnedSearch,
    ) -> Option<(Split, [BuildCell; 2])> {
        let leaf_cost = options.intersection_cost * references.len() as f32;
        // A split costs at least one step.
        if leaf_cost <= options.traversal_cost || self.level >= options.depth_limit() {
            return None;
        }
        if self.level >= KD_WORD_DEPTH && references.len() <= FEW_REFERENCES {
            return None;
        }
        let split = search.best_split(references, &self.bounds, options);
        let pays = options.traversal_cost + options.intersection_cost * split.weight < leaf_cost;
        let n = split.n_references.map(u64::from);
        let n_both = n[0] + n[1];
        if !pays || n_both > self.budget {
            return None;
        }
        let bounds = self.bounds.split(split.axis, split.position);
        // The budget is divided in proportion to the references, so a cell's share does not depend on what is built
        // before it.
        let budget = n.map(|n| self.budget * n / n_both);
        let child = |side: usize| BuildCell { bounds: bounds[side], level: self.level + 1, budget: budget[side] };
        Some((split, [child(0), child(1)]))
    }
}

/// Returns the reference's pieces below and above a split of its cell.
#[inline]
pub fn split_reference(input: Input, reference: &Reference, cell: &Bounds, split: &Split) -> [Option<Reference>; 2] {
    if reference.bounds.max[split.axis] <= split.position {
        return [Some(*reference), None];
    }
    if reference.bounds.min[split.axis] >= split.position {
        return [None, Some(*reference)];
    }
    let triangle = &input.triangles[reference.triangle_ix as usize];
    let pieces = split_bounds(triangle, cell, (split.axis, split.position), input.scales.margin_of(triangle));
    // The bounds of each piece are rounded outwards. The intersection keeps them within the reference's own bounds, so
    // bounds never grow from a cell to its children.
    let limits = reference.bounds.split(split.axis, split.position);
    [0, 1].map(|side| pieces[side].map(|piece| Reference { bounds: piece.intersection(&limits[side]), ..*reference }))
}

/// A subtree on its own. Node 0 is its root and node 1 is unused, as in a whole tree.
pub struct Subtree {
    pub nodes: Vec<KdNode>,
    pub leaf_triangles: Vec<u32>,
    /// Level of the deepest leaf, counted from the root of the whole tree.
    pub depth: u32,
}

/// Builds the subtree of a cell.
pub fn build(input: Input, references: Vec<Reference>, cell: BuildCell) -> Subtree {
    let n = references.len();
    let subtree = Subtree { nodes: vec![EMPTY_LEAF; 2], leaf_triangles: Vec::new(), depth: cell.level };
    let mut builder = Builder { input, references, above: Vec::new(), search: BinnedSearch::default(), subtree };
    builder.node(0, 0..n, cell);
    builder.subtree
}

/// State of a build.
struct Builder<'a> {
    input: Input<'a>,
    /// The references of the current cell, of all cells above it, and of siblings that are not built yet; the newest
    /// references are last.
    references: Vec<Reference>,
    /// The references of the upper child while those of both children are separated.
    above: Vec<Reference>,
    search: BinnedSearch,
    subtree: Subtree,
}

impl Builder<'_> {
    /// Builds the node of a cell at the index `slot`, and appends all nodes below it.
    fn node(&mut self, slot: usize, range: Range<usize>, cell: BuildCell) {
        let references = &self.references[range.clone()];
        let Some((split, cells)) = cell.split(references, self.input.options, &mut self.search) else {
            return self.leaf(slot, range, cell.level);
        };
        let nodes = &mut self.subtree.nodes;
        let child = nodes.len();
        nodes[slot] = Node::Split { axis: split.axis, position: split.position, child: child as u32 }.into();
        nodes.extend([EMPTY_LEAF; 2]);
        let n_references = self.references.len();
        let [below, above] = self.partition(range, &cell.bounds, &split);
        self.node(child, below, cells[0]);
        self.node(child + 1, above, cells[1]);
        self.references.truncate(n_references);
    }

    /// Writes a leaf with the references of a range at the index `slot`.
    fn leaf(&mut self, slot: usize, range: Range<usize>, level: u32) {
        let leaf_triangles = &mut self.subtree.leaf_triangles;
        let (first, count) = (leaf_triangles.len() as u32, range.len() as u32);
        leaf_triangles.extend(self.references[range].iter().map(|reference| reference.triangle_ix));
        self.subtree.nodes[slot] = Node::Leaf { first, count }.into();
        self.subtree.depth = self.subtree.depth.max(level);
    }

    /// Appends the references of both children, those of the lower one first, and returns their ranges. If one child
    /// gets all references, they stay where they are.
    fn partition(&mut self, range: Range<usize>, cell: &Bounds, split: &Split) -> [Range<usize>; 2] {
        let none = range.end..range.end;
        match split.n_references {
            [0, _] => return [none, range],
            [_, 0] => return [range, none],
            _ => (),
        }
        let first = self.references.len();
        self.above.clear();
        for ix in range {
            let [below, above] = split_reference(self.input, &self.references[ix], cell, split);
            self.references.extend(below);
            self.above.extend(above);
        }
        let middle = self.references.len();
        self.references.append(&mut self.above);
        [first..middle, middle..self.references.len()]
    }
}
