//! Which acceleration structure to build.

use super::{Chosen, Processor, TreeKind};
use crate::accel::{AccelKind, AccelOptions, grid::GridOptions};

/// The acceleration structure that was chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChosenAccel {
    /// A kd-tree of a kind.
    KdTree(Chosen<TreeKind>),
    /// A uniform grid.
    Grid,
    /// A grid of two levels.
    Grid2,
}

impl ChosenAccel {
    /// How the structure is built for a processor.
    pub fn options(self, processor: Processor) -> AccelOptions {
        match self {
            Self::KdTree(tree_kind) => AccelOptions::KdTree(tree_kind.value.options(processor)),
            Self::Grid => AccelOptions::Grid(GridOptions::uniform()),
            Self::Grid2 => AccelOptions::Grid(GridOptions::two_level()),
        }
    }

    /// The kind of the structure.
    pub fn kind(self) -> AccelKind {
        match self {
            Self::KdTree(_) => AccelKind::KdTree,
            Self::Grid => AccelKind::Grid,
            Self::Grid2 => AccelKind::Grid2,
        }
    }

    /// Which kd-tree is built; none for grids.
    pub fn tree_kind(self) -> Option<Chosen<TreeKind>> {
        match self {
            Self::KdTree(tree_kind) => Some(tree_kind),
            Self::Grid | Self::Grid2 => None,
        }
    }
}
