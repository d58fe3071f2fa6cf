//! The arrays of a tree: anybody can make and change them, but only valid ones become a [`KdTree`].

use glam::Vec3;

use super::{Invalid, KdTree, Node};
use crate::layout::{KdNode, Plane, Slab, Triangle};

/// The arrays of a kd-tree and its root's cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Parts {
    /// Root 0; node 1 is unused (an empty leaf); the children of a split are neighbours at an even index. Depth-first:
    /// a pair of children, then all below the first, then all below the second.
    pub nodes: Vec<KdNode>,
    /// `nodes.len() / 2` entries: `parents[n >> 1]` is the split whose children are `n & !1` and `n | 1`; entry 0 is 0.
    pub parents: Vec<u32>,
    /// Triangle indices, leaf after leaf in depth-first order, ascending in each leaf.
    pub leaf_triangles: Vec<u32>,
    /// The plane of each of `leaf_triangles`.
    pub leaf_planes: Vec<Plane>,
    /// One slab a node, zeros where the node is not marked as having one; or no slabs, if no node is marked.
    pub slabs: Vec<Slab>,
    /// The root's cell is the exact bounds of all triangles (a box of zeros for none).
    pub cell_min: Vec3,
    /// The greatest corner of the root's cell, world units.
    pub cell_max: Vec3,
    /// Levels below the root, at most `KD_MAX_DEPTH - 2`.
    pub depth: u32,
}

impl Parts {
    /// The node at an index.
    pub fn node(&self, node_ix: u32) -> Node {
        self.nodes[node_ix as usize].into()
    }
}

impl KdTree {
    /// Makes a tree of its arrays, which may come from anywhere, over the triangles that its leaves name.
    ///
    /// # Errors
    /// The first of [`KdTree::validate`]'s invariants that does not hold.
    pub fn from_parts(parts: Parts, triangles: &[Triangle]) -> Result<Self, Invalid> {
        let tree = Self { parts, n_triangles: triangles.len() };
        tree.validate(triangles)?;
        Ok(tree)
    }

    /// The tree's arrays, to be changed and made a tree again.
    pub fn into_parts(self) -> Parts {
        self.parts
    }

    /// [`Parts::nodes`].
    pub fn nodes(&self) -> &[KdNode] {
        &self.parts.nodes
    }

    /// [`Parts::parents`].
    pub fn parents(&self) -> &[u32] {
        &self.parts.parents
    }

    /// [`Parts::leaf_triangles`].
    pub fn leaf_triangles(&self) -> &[u32] {
        &self.parts.leaf_triangles
    }

    /// [`Parts::leaf_planes`].
    pub fn leaf_planes(&self) -> &[Plane] {
        &self.parts.leaf_planes
    }

    /// [`Parts::slabs`].
    pub fn slabs(&self) -> &[Slab] {
        &self.parts.slabs
    }

    /// The least corner of the root's cell.
    pub fn cell_min(&self) -> Vec3 {
        self.parts.cell_min
    }

    /// The greatest corner of the root's cell.
    pub fn cell_max(&self) -> Vec3 {
        self.parts.cell_max
    }

    /// The least and the greatest corner of the root's cell, which holds all triangles.
    pub fn bounds(&self) -> [Vec3; 2] {
        [self.cell_min(), self.cell_max()]
    }

    /// [`Parts::depth`].
    pub fn depth(&self) -> u32 {
        self.parts.depth
    }

    /// The number of triangles that the tree was built from.
    pub fn n_triangles(&self) -> usize {
        self.n_triangles
    }

    /// The node at an index.
    pub fn node(&self, node_ix: u32) -> Node {
        self.parts.node(node_ix)
    }
}
