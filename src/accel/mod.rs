//! Acceleration structures: what leads a ray to the triangles that it can hit.

pub mod kdtree;
mod query;

pub use self::query::Query;

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
}
