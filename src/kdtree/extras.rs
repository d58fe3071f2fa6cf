//! What some traversals read beside the tree.

use super::KdTree;
use crate::{frame::Traversal, layout::KdBox};

/// Empty where a traversal asks for nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Extras {
    /// One a node.
    pub boxes: Vec<KdBox>,
}

impl Extras {
    /// What the traversal reads of the tree.
    pub fn new(tree: &KdTree, traversal: Traversal) -> Self {
        Self { boxes: if traversal.needs_boxes() { tree.boxes() } else { Vec::new() } }
    }

    /// What any traversal reads.
    pub fn all(tree: &KdTree) -> Self {
        Self { boxes: tree.boxes() }
    }
}
