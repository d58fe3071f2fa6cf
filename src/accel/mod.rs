//! Acceleration structures: what leads a ray to the triangles that it can hit.

mod bounds;
pub mod grid;
pub mod kdtree;
mod query;

use glam::Vec3;

pub use self::query::Query;
pub use crate::layout::{Hit, NO_TRIANGLE, Ray};

/// An acceleration structure over the triangles of a world, as the host has it.
#[derive(Clone, Debug, PartialEq)]
pub enum Accel {
    /// A kd-tree.
    KdTree(kdtree::KdTree),
}

/// The kinds of acceleration structures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AccelKind {
    /// A kd-tree, which `--traversal` has several algorithms for.
    #[default]
    KdTree,
}

named_enum!(AccelKind { KdTree = "kdtree" });

impl Accel {
    /// The kind of the structure.
    pub fn kind(&self) -> AccelKind {
        match self {
            Self::KdTree(_) => AccelKind::KdTree,
        }
    }

    /// The least and the greatest corner of a box that holds all triangles (world units).
    pub fn bounds(&self) -> [Vec3; 2] {
        match self {
            Self::KdTree(tree) => tree.bounds(),
        }
    }
}
