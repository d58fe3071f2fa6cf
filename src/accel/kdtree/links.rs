//! What some traversals read beside the tree.

use super::KdTree;
use crate::{
    accel::{Accel, kdtree::Traversal},
    layout::{KdBox, KdRope},
};

/// Empty where a traversal asks for nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TraversalLinks {
    /// One a node.
    pub boxes: Vec<KdBox>,
    /// Six a node: below and above on x, y, z.
    pub ropes: Vec<KdRope>,
}

impl TraversalLinks {
    /// What the traversal reads beside the scene's structure: nothing where that is a grid.
    pub fn of(accel: &Accel, traversal: Traversal) -> Self {
        match accel {
            Accel::KdTree(tree) => Self::new(tree, traversal),
            Accel::Grid(_) => Self::default(),
        }
    }

    /// What the traversal reads of the tree.
    pub fn new(tree: &KdTree, traversal: Traversal) -> Self {
        let boxes = if traversal.needs_boxes() { tree.boxes() } else { Vec::new() };
        let ropes = if traversal.needs_ropes() { tree.ropes(&tree.boxes()) } else { Vec::new() };
        Self { boxes, ropes }
    }

    /// What any traversal reads.
    pub fn all(tree: &KdTree) -> Self {
        let boxes = tree.boxes();
        Self { ropes: tree.ropes(&boxes), boxes }
    }
}
