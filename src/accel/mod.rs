//! Acceleration structures: what leads a ray to the triangles that it can hit.

mod bounds;
pub mod grid;
pub mod kdtree;
mod query;
mod statistics;

use glam::Vec3;

use self::{
    grid::{GridOptions, LazyGrid},
    kdtree::{BuildOptions, KdTree},
};
pub use self::{query::Query, statistics::Statistics};
use crate::layout::Triangle;
pub use crate::layout::{Hit, NO_TRIANGLE, Ray};

/// An acceleration structure over the triangles of a world.
#[derive(Clone, Debug, PartialEq)]
pub enum Accel {
    /// A kd-tree, which the host builds.
    KdTree(KdTree),
    /// A grid, which a device builds, or the host when it needs it.
    Grid(LazyGrid),
}

/// How an acceleration structure is built.
#[derive(Clone, Debug, PartialEq)]
pub enum AccelOptions {
    /// How a kd-tree is built.
    KdTree(BuildOptions),
    /// How a grid is built.
    Grid(GridOptions),
}

/// The kinds of acceleration structures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AccelKind {
    /// A kd-tree: it traces fastest, and `--traversal` has several algorithms for it.
    #[default]
    KdTree,
    /// A uniform grid: it is built fastest, and traces well where triangles are spread evenly.
    Grid,
    /// A grid of two levels: cells with many triangles are cut once more.
    Grid2,
}

named_enum!(AccelKind { KdTree = "kdtree", Grid = "grid", Grid2 = "grid2" });

impl AccelKind {
    /// The structure's name in a sentence.
    pub fn name(self) -> &'static str {
        match self {
            Self::KdTree => "kd-tree",
            Self::Grid => "grid",
            Self::Grid2 => "two-level grid",
        }
    }
}

impl Accel {
    /// Builds a structure over triangles on the current rayon pool. A grid is built when it is first asked for.
    pub fn new(triangles: &[Triangle], options: &AccelOptions) -> Self {
        match options {
            AccelOptions::KdTree(options) => Self::KdTree(KdTree::build(triangles, options)),
            AccelOptions::Grid(options) => Self::Grid(LazyGrid::new(triangles, options.clone())),
        }
    }

    /// The kd-tree, if the structure is one.
    pub fn as_kdtree(&self) -> Option<&KdTree> {
        match self {
            Self::KdTree(tree) => Some(tree),
            Self::Grid(_) => None,
        }
    }

    /// The kind of the structure.
    pub fn kind(&self) -> AccelKind {
        match self {
            Self::KdTree(_) => AccelKind::KdTree,
            Self::Grid(grid) if grid.options().levels.n_levels() == 1 => AccelKind::Grid,
            Self::Grid(_) => AccelKind::Grid2,
        }
    }

    /// The number of triangles that the structure is over.
    pub fn n_triangles(&self) -> usize {
        match self {
            Self::KdTree(tree) => tree.n_triangles(),
            Self::Grid(grid) => grid.n_triangles(),
        }
    }

    /// The least and the greatest corner of a box that holds all triangles (world units).
    pub fn bounds(&self) -> [Vec3; 2] {
        match self {
            Self::KdTree(tree) => tree.bounds(),
            Self::Grid(grid) => grid.bounds(),
        }
    }
}
