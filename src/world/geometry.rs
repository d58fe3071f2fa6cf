//! Triangles with an acceleration structure over them.

use super::{Mismatch, World};
use crate::{accel::kdtree::KdTree, layout::Triangle};

/// Borrowed triangles and the kd-tree over them; every index in the tree names one of the triangles.
#[derive(Clone, Copy, Debug)]
pub struct Geometry<'a> {
    triangles: &'a [Triangle],
    tree: &'a KdTree,
}

impl<'a> Geometry<'a> {
    /// Joins triangles and the kd-tree that was built from them.
    ///
    /// # Errors
    /// The tree is one of more or fewer triangles.
    pub fn new(triangles: &'a [Triangle], tree: &'a KdTree) -> Result<Self, Mismatch> {
        match (tree.n_triangles(), triangles.len()) {
            (of_tree, given) if of_tree == given => Ok(Self { triangles, tree }),
            (tree, triangles) => Err(Mismatch::Tree { tree, triangles }),
        }
    }

    pub(super) fn of_world(world: &'a World) -> Self {
        Self { triangles: &world.scene().triangles, tree: world.tree() }
    }

    /// World-space triangles.
    pub fn triangles(&self) -> &'a [Triangle] {
        self.triangles
    }

    /// The kd-tree over the triangles.
    pub fn tree(&self) -> &'a KdTree {
        self.tree
    }
}
