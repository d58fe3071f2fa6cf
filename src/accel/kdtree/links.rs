//! Arrays that some traversals read beside the tree: the cells of nodes, and ropes from their faces to their
//! neighbours.

use super::KdTree;
use crate::{
    accel::{Accel, kdtree::Traversal},
    layout::{KdBox, KdRope, Triangle},
};

/// Arrays of a tree that only some traversals read. An array that the traversal does not read is empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TraversalLinks {
    /// The cell of each node.
    pub boxes: Vec<KdBox>,
    /// Six ropes for each node: below and above on x, y, z.
    pub ropes: Vec<KdRope>,
}

impl TraversalLinks {
    /// Returns the arrays that the traversal reads in addition to the scene's structure. For a grid, all are empty.
    /// If a kd-tree is still to be built, the host builds it. `triangles`: those of the structure.
    /// With several trees, those of each tree follow those of the one before.
    pub fn of(accel: &Accel, triangles: &[Triangle], traversal: Traversal) -> Self {
        match accel {
            Accel::KdTree(tree) => Self::new(tree, traversal),
            Accel::LazyTree(tree) => Self::new(tree.get(triangles), traversal),
            Accel::Grid(_) => Self::default(),
            Accel::TwoLevel(two) => {
                let mut all = Self::default();
                two.build_on_host(triangles);
                for tree in two.trees() {
                    let Self { boxes, ropes } = Self::new(tree, traversal);
                    all.boxes.extend(boxes);
                    all.ropes.extend(ropes);
                }
                all
            }
        }
    }

    /// Returns the arrays that the traversal reads in addition to the tree.
    pub fn new(tree: &KdTree, traversal: Traversal) -> Self {
        let boxes = if traversal.needs_boxes() { tree.boxes() } else { Vec::new() };
        let ropes = if traversal.needs_ropes() { tree.ropes(&tree.boxes()) } else { Vec::new() };
        Self { boxes, ropes }
    }

    /// Returns all arrays, for any traversal.
    pub fn all(tree: &KdTree) -> Self {
        let boxes = tree.boxes();
        Self { ropes: tree.ropes(&boxes), boxes }
    }
}
