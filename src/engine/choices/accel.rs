//! The choice of the acceleration structure.

use super::{Chosen, Processor, TreeKind};
use crate::accel::{AccelKind, AccelOptions, grid::GridOptions};

/// The acceleration structure that was chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChosenAccel {
    /// A kd-tree of the chosen kind.
    KdTree(Chosen<TreeKind>),
    /// A uniform grid.
    Grid,
    /// A grid of two levels.
    Grid2,
}

impl ChosenAccel {
    /// Returns the options for building the structure for a processor.
    pub fn options(self, processor: Processor) -> AccelOptions {
        match self {
            Self::KdTree(Chosen { value: kind @ TreeKind::Gpu, .. }) => AccelOptions::LazyTree(kind.options(processor)),
            Self::KdTree(tree_kind) => AccelOptions::KdTree(tree_kind.value.options(processor)),
            Self::Grid => AccelOptions::Grid(GridOptions::uniform()),
            Self::Grid2 => AccelOptions::Grid(GridOptions::two_level()),
        }
    }

    /// Returns the kind of the structure.
    pub fn kind(self) -> AccelKind {
        match self {
            Self::KdTree(_) => AccelKind::KdTree,
            Self::Grid => AccelKind::Grid,
            Self::Grid2 => AccelKind::Grid2,
        }
    }

    /// Returns which kd-tree is built, or none for grids.
    pub fn tree_kind(self) -> Option<Chosen<TreeKind>> {
        match self {
            Self::KdTree(tree_kind) => Some(tree_kind),
            Self::Grid | Self::Grid2 => None,
        }
    }
}
