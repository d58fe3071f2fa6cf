//! Arrays of a kd-tree. Anyone can make and change them, but only valid ones become a [`KdTree`].

use glam::Vec3;

use super::{Invalid, KdTree, Node, scales::Scales};
use crate::accel::bounds::Bounds;
use crate::layout::{KdNode, Plane, Slab, Triangle};

/// Arrays of a kd-tree and the cell of its root.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KdArrays {
    /// The nodes. Node 0 is the root, and node 1 is unused (an empty leaf). The two children of a split are
    /// neighbours, the first one at an even index. The order is depth-first: a pair of children, then all nodes below
    /// the first, then all nodes below the second.
    pub nodes: Vec<KdNode>,
    /// The parents, `nodes.len() / 2` entries. Entry `n >> 1` is the split whose children are `n & !1` and `n | 1`.
    /// Entry 0 is 0.
    pub parents: Vec<u32>,
    /// Triangle indices, leaf after leaf in depth-first order, ascending in each leaf.
    pub leaf_triangles: Vec<u32>,
    /// The plane of each triangle in `leaf_triangles`, whose normal has the length 2^i at scale i (scales.rs).
    pub leaf_planes: Vec<Plane>,
    /// A slab for each node, zeros for a node that is not marked with `KD_HAS_SLAB`. The array may be empty if no
    /// node is marked.
    pub slabs: Vec<Slab>,
    /// The least corner of the root's cell, world units. The root's cell is the exact bounds of all triangles (a box
    /// of zeros for none), grown by the rounding margin.
    pub box_min: Vec3,
    /// The greatest corner of the root's cell, world units.
    pub box_max: Vec3,
    /// The number of levels below the root, at most `KD_MAX_DEPTH - 2`.
    pub depth: u32,
}

impl KdArrays {
    /// Returns the node at an index, decoded.
    pub fn node(&self, node_ix: u32) -> Node {
        self.nodes[node_ix as usize].into()
    }
}

impl KdTree {
    /// Makes a tree from arrays of any origin. `triangles`: those that the leaves' entries index.
    ///
    /// # Errors
    /// The first of [`KdTree::validate`]'s invariants that does not hold.
    pub fn from_arrays(arrays: KdArrays, triangles: &[Triangle]) -> Result<Self, Invalid> {
        let scales = Scales::new(triangles, &Bounds::of_all(triangles));
        let tree = Self { arrays, n_triangles: triangles.len(), scales };
        tree.validate(triangles)?;
        Ok(tree)
    }

    /// Returns the tree's arrays. [`KdTree::from_arrays`] makes them a tree again.
    pub fn into_arrays(self) -> KdArrays {
        self.arrays
    }

    /// [`KdArrays::nodes`].
    pub fn nodes(&self) -> &[KdNode] {
        &self.arrays.nodes
    }

    /// [`KdArrays::parents`].
    pub fn parents(&self) -> &[u32] {
        &self.arrays.parents
    }

    /// [`KdArrays::leaf_triangles`].
    pub fn leaf_triangles(&self) -> &[u32] {
        &self.arrays.leaf_triangles
    }

    /// [`KdArrays::leaf_planes`].
    pub fn leaf_planes(&self) -> &[Plane] {
        &self.arrays.leaf_planes
    }

    /// [`KdArrays::slabs`].
    pub fn slabs(&self) -> &[Slab] {
        &self.arrays.slabs
    }

    /// The least corner of the root's cell, world units.
    pub fn box_min(&self) -> Vec3 {
        self.arrays.box_min
    }

    /// The greatest corner of the root's cell, world units.
    pub fn box_max(&self) -> Vec3 {
        self.arrays.box_max
    }

    /// The least and the greatest corner of the root's cell, which holds all triangles, world units.
    pub fn bounds(&self) -> [Vec3; 2] {
        [self.box_min(), self.box_max()]
    }

    /// [`KdArrays::depth`].
    pub fn depth(&self) -> u32 {
        self.arrays.depth
    }

    /// The number of triangles that the tree was built from.
    pub fn n_triangles(&self) -> usize {
        self.n_triangles
    }

    /// Returns the node at an index, decoded.
    pub fn node(&self, node_ix: u32) -> Node {
        self.arrays.node(node_ix)
    }
}
