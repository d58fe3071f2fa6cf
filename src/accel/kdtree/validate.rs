//! Check of all invariants of a tree. This file checks the structure. `coverage` checks that no leaf lacks a
//! triangle.

use super::{
    EMPTY_LEAF, KdTree, Node, coverage,
    planes::{self, planes_of},
    scales::Scales,
};
use crate::{
    accel::bounds::{Bounds, is_finite},
    layout::{KD_MAX_DEPTH, Triangle},
};

/// The first invariant that was found broken.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the variants mean")]
pub enum Invalid {
    #[error("the tree was built from {built_of} triangles, not from {given}")]
    Triangles { built_of: usize, given: usize },
    #[error("{nodes} nodes, {parents} parents: nodes come in pairs, with a parent each")]
    Length { nodes: usize, parents: usize },
    #[error("the root's cell is not the bounds of all triangles and their margin")]
    RootCell,
    #[error("node 1 or the root's parent is not 0")]
    Unused,
    #[error("node {node} is split along no axis")]
    Axis { node: u32 },
    #[error("node {node}: child {child} is the root or out of range")]
    Child { node: u32, child: u32 },
    #[error("node {node} has two parents")]
    Shared { node: u32 },
    #[error("node {node} has no parent")]
    Orphan { node: u32 },
    #[error("parents[{pair}] is {found}, not {expected}")]
    Parent { pair: u32, found: u32, expected: u32 },
    #[error("node {node}: the split at {position} on axis {axis} lies outside its cell")]
    Position { node: u32, axis: usize, position: f32 },
    #[error("leaf {node}: its triangles do not follow those of the leaf before, or end behind the last")]
    LeafRange { node: u32 },
    #[error("leaf {node}: triangle {triangle} is out of range, or not behind the one before")]
    LeafOrder { node: u32, triangle: u32 },
    #[error("leaf {node}: triangle {triangle} lies outside its cell")]
    Stray { node: u32, triangle: u32 },
    #[error("{n_unused} leaf entries that no leaf has")]
    UnusedEntries { n_unused: usize },
    #[error("recorded depth {recorded}, found {found}, at most {}", KD_MAX_DEPTH - 2)]
    Depth { recorded: u32, found: u32 },
    #[error("leaf {node} lacks triangle {triangle}")]
    Missing { node: u32, triangle: u32 },
    #[error("leaf_planes are too far from leaf_triangles")]
    Planes,
    #[error("node {node} is marked as having a slab, which is not among the {slabs}")]
    NoSlab { node: u32, slabs: usize },
    #[error("node {node}: triangle {triangle} reaches out of its slab")]
    OutsideSlab { node: u32, triangle: u32 },
}

impl KdTree {
    /// Checks the tree against the triangles it was built from.
    ///
    /// Each triangle is cut up along the planes that it meets, down to the leaves. Each leaf within the triangle's
    /// margin of a part must have the triangle. The check takes some microseconds a triangle.
    ///
    /// # Errors
    /// The first invariant that does not hold.
    pub fn validate(&self, triangles: &[Triangle]) -> Result<(), Invalid> {
        let (built_of, given) = (self.n_triangles, triangles.len());
        if built_of != given {
            return Err(Invalid::Triangles { built_of, given });
        }
        let (nodes, parents) = (self.nodes().len(), self.parents().len());
        if nodes < 2 || nodes != 2 * parents {
            return Err(Invalid::Length { nodes, parents });
        }
        let root = Bounds::from(self.bounds());
        let exact_bounds = Bounds::of_all(triangles);
        let scales = Scales::new(triangles, &exact_bounds);
        if root != exact_bounds.grown(exact_bounds.margin()) || scales != self.scales {
            return Err(Invalid::RootCell);
        }
        if self.nodes()[1] != EMPTY_LEAF || self.parents()[0] != 0 {
            return Err(Invalid::Unused);
        }
        Walk::new(self, triangles).run(root)?;
        coverage::check(self, triangles)?;
        let are_the_hosts = self.leaf_planes() == planes_of(&self.arrays, triangles, &scales);
        let are_valid = are_the_hosts || planes::are_valid(&self.arrays, triangles, &scales);
        if are_valid { Ok(()) } else { Err(Invalid::Planes) }
    }
}

/// A walk through all nodes in depth-first order.
struct Walk<'a> {
    tree: &'a KdTree,
    triangles: &'a [Triangle],
    /// Whether each node has been entered.
    seen: Vec<bool>,
    /// The number of entries of the leaves so far.
    n_entries: usize,
    /// The deepest level so far.
    depth: u32,
}

impl<'a> Walk<'a> {
    fn new(tree: &'a KdTree, triangles: &'a [Triangle]) -> Self {
        Self { tree, triangles, seen: vec![false; tree.nodes().len()], n_entries: 0, depth: 0 }
    }

    fn run(mut self, root: Bounds) -> Result<(), Invalid> {
        // Each node is entered once, so the walk ends even if links form a circle.
        let mut stack = vec![(0, 0, root)];
        self.seen[1] = true;
        while let Some((node, level, cell)) = stack.pop() {
            let slabs = self.tree.slabs().len();
            if self.tree.has_slab(node) && node as usize >= slabs {
                return Err(Invalid::NoSlab { node, slabs });
            }
            if std::mem::replace(&mut self.seen[node as usize], true) {
                return Err(Invalid::Shared { node });
            }
            self.depth = self.depth.max(level);
            match self.tree.node(node) {
                Node::Leaf { first, count } => self.leaf(node, first as usize, count as usize, &cell)?,
                Node::Split { axis, position, child } => {
                    self.split(node, (axis, position), child, &cell)?;
                    let [below, above] = cell.split(axis, position);
                    stack.extend([(child + 1, level + 1, above), (child, level + 1, below)]);
                }
            }
        }
        if let Some(node) = self.seen.iter().position(|seen| !seen) {
            return Err(Invalid::Orphan { node: node as u32 });
        }
        let n_unused = self.tree.leaf_triangles().len() - self.n_entries;
        if n_unused > 0 {
            return Err(Invalid::UnusedEntries { n_unused });
        }
        if self.depth != self.tree.depth() || self.depth > KD_MAX_DEPTH - 2 {
            return Err(Invalid::Depth { recorded: self.tree.depth(), found: self.depth });
        }
        Ok(())
    }

    /// Checks a split's axis, child index, parent link and position.
    fn split(&self, node: u32, (axis, position): (usize, f32), child: u32, cell: &Bounds) -> Result<(), Invalid> {
        if axis > 2 {
            return Err(Invalid::Axis { node });
        }
        if child < 2 || child as usize + 1 >= self.tree.nodes().len() {
            return Err(Invalid::Child { node, child });
        }
        let (pair, found) = (child / 2, self.tree.parents()[child as usize / 2]);
        if found != node {
            return Err(Invalid::Parent { pair, found, expected: node });
        }
        // A NaN is not inside.
        let is_inside = position >= cell.min[axis] && position <= cell.max[axis];
        if is_inside { Ok(()) } else { Err(Invalid::Position { node, axis, position }) }
    }

    /// Checks a leaf's range of entries, their order, and that each triangle comes near to the cell.
    fn leaf(&mut self, node: u32, first: usize, count: usize, cell: &Bounds) -> Result<(), Invalid> {
        if first != self.n_entries || count > self.tree.leaf_triangles().len() - first {
            return Err(Invalid::LeafRange { node });
        }
        self.n_entries += count;
        let mut next = 0;
        for &triangle in &self.tree.leaf_triangles()[first..][..count] {
            let Some(corners) = self.triangles.get(triangle as usize).filter(|_| triangle >= next) else {
                return Err(Invalid::LeafOrder { node, triangle });
            };
            let is_near = || Bounds::of(corners).grown(self.tree.scales.margin_of(corners)).touches(cell);
            if !is_finite(corners) || !is_near() {
                return Err(Invalid::Stray { node, triangle });
            }
            next = triangle + 1;
        }
        Ok(())
    }
}
