//! A subtree by one thread: recursion with the references of the cells on the way in one growing and shrinking array.

use std::ops::Range;

use super::{
    BuildOptions, EMPTY_LEAF, Node,
    bounds::{Bounds, Reference},
    clip::split_bounds,
    sah::{Search, Split},
};
use crate::layout::{KdNode, Triangle};

/// What a build reads.
#[derive(Clone, Copy)]
pub struct Input<'a> {
    pub triangles: &'a [Triangle],
    pub options: &'a BuildOptions,
}

/// A cell to be built, without its references.
#[derive(Clone, Copy)]
pub struct Cell {
    pub bounds: Bounds,
    /// Levels below the root.
    pub level: u32,
    /// References that the leaves in the cell may have.
    pub budget: u64,
    /// Splits on the way that looked worse than a leaf.
    pub bad_splits: u32,
}

impl Cell {
    /// The cells on either side of a plane, with budgets in proportion to their references, so that the tree does not
    /// depend on the order in which cells are built. None where the references exceed the budget.
    pub fn children(&self, split: &Split) -> Option<[Cell; 2]> {
        let bounds = self.bounds.split(split.axis, split.position);
        let n = split.n_references.map(u64::from);
        let child = |side: usize| Cell {
            bounds: bounds[side],
            level: self.level + 1,
            budget: self.budget * n[side] / (n[0] + n[1]),
            ..*self
        };
        (n[0] + n[1] <= self.budget).then(|| [child(0), child(1)])
    }
}

/// The reference's parts below and above a split of its cell.
#[inline]
pub fn sort_out(input: Input, reference: &Reference, cell: &Bounds, split: &Split) -> [Option<Reference>; 2] {
    let (min, max) = (reference.bounds.min[split.axis], reference.bounds.max[split.axis]);
    let is_planar_below = split.planar_below && min == split.position && max == split.position;
    if max < split.position || (max == split.position && min < max) || is_planar_below {
        return [Some(*reference), None];
    }
    if min >= split.position {
        return [None, Some(*reference)];
    }
    let triangle = &input.triangles[reference.triangle_ix as usize];
    let parts = split_bounds(triangle, cell, split.axis, split.position);
    // Bounds only ever shrink: each is rounded outwards by itself.
    let limits = reference.bounds.split(split.axis, split.position);
    [0, 1].map(|side| parts[side].map(|part| Reference { bounds: part.intersection(&limits[side]), ..*reference }))
}

/// A subtree on its own: node 0 is its root and node 1 unused, as in a whole tree.
pub struct Subtree {
    pub nodes: Vec<KdNode>,
    pub leaf_triangles: Vec<u32>,
    /// Levels of the deepest leaf below the whole tree's root.
    pub depth: u32,
}

/// Builds the subtree of a cell.
pub fn build(input: Input, references: Vec<Reference>, cell: Cell) -> Subtree {
    let n = references.len();
    let subtree = Subtree { nodes: vec![EMPTY_LEAF; 2], leaf_triangles: Vec::new(), depth: cell.level };
    let mut builder = Builder { input, references, above: Vec::new(), search: Search::default(), subtree };
    builder.node(0, 0..n, cell);
    builder.subtree
}

struct Builder<'a> {
    input: Input<'a>,
    /// The references of the cells on the way, and of their siblings still to be built; the newest last.
    references: Vec<Reference>,
    /// Of the upper child, while both are sorted out.
    above: Vec<Reference>,
    search: Search,
    subtree: Subtree,
}

impl Builder<'_> {
    /// Builds the node of a cell into a slot, with all below it behind the last node; returns its cost.
    fn node(&mut self, slot: usize, range: Range<usize>, mut cell: Cell) -> f32 {
        let options = self.input.options;
        let leaf_cost = options.intersection_cost * range.len() as f32;
        // A split costs a step at least.
        if leaf_cost <= options.traversal_cost || cell.level >= options.depth_limit() {
            return self.leaf(slot, range, cell.level);
        }
        let split = self.search.best_split(&self.references[range.clone()], &cell.bounds, options);
        let is_bad = options.cost(&split) >= leaf_cost;
        cell.bad_splits += u32::from(is_bad);
        if split.weight == f32::INFINITY || cell.bad_splits > options.bad_splits {
            return self.leaf(slot, range, cell.level);
        }
        let Some(cells) = cell.children(&split) else {
            return self.leaf(slot, range, cell.level);
        };
        let n_references = self.references.len();
        let lengths = (self.subtree.nodes.len(), self.subtree.leaf_triangles.len(), self.subtree.depth);
        let children = self.partition(range.clone(), &cell.bounds, &split);
        let cost = self.children(slot, &split, children, cells);
        self.references.truncate(n_references);
        if is_bad && cost >= leaf_cost {
            self.subtree.nodes.truncate(lengths.0);
            self.subtree.leaf_triangles.truncate(lengths.1);
            self.subtree.depth = lengths.2;
            return self.leaf(slot, range, cell.level);
        }
        cost
    }

    /// Makes a slot a split and builds its children; returns its cost.
    fn children(&mut self, slot: usize, split: &Split, ranges: [Range<usize>; 2], cells: [Cell; 2]) -> f32 {
        let nodes = &mut self.subtree.nodes;
        let child = nodes.len();
        nodes[slot] = Node::Split { axis: split.axis, position: split.position, child: child as u32 }.into();
        nodes.extend([EMPTY_LEAF; 2]);
        let [below, above] = ranges;
        let below = self.node(child, below, cells[0]);
        let above = self.node(child + 1, above, cells[1]);
        self.input.options.traversal_cost + split.shares[0] * below + split.shares[1] * above
    }

    fn leaf(&mut self, slot: usize, range: Range<usize>, level: u32) -> f32 {
        let leaf_triangles = &mut self.subtree.leaf_triangles;
        let (first, count) = (leaf_triangles.len() as u32, range.len() as u32);
        leaf_triangles.extend(self.references[range].iter().map(|reference| reference.triangle_ix));
        self.subtree.nodes[slot] = Node::Leaf { first, count }.into();
        self.subtree.depth = self.subtree.depth.max(level);
        self.input.options.intersection_cost * count as f32
    }

    /// Appends the references of both children, the lower one's first. What lies on one side only stays where it is.
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
            let [below, above] = sort_out(self.input, &self.references[ix], cell, split);
            self.references.extend(below);
            self.above.extend(above);
        }
        let middle = self.references.len();
        self.references.append(&mut self.above);
        [first..middle, middle..self.references.len()]
    }
}
