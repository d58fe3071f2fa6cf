//! The structure of a geometry in a world of instances: a kd-tree or a grid.

use glam::Vec3;

use super::{AccelOptions, grid::Grid, kdtree::KdTree};
use crate::{
    layout::{AccelConstants, GridCell, KdNode, Plane, Slab, Triangle},
    util::progress::Progress,
};

/// A structure over the triangles of a geometry, in its own space, which the host builds. An array that the structure
/// does not have is empty.
#[derive(Clone, Debug, PartialEq)]
pub enum BottomLevel {
    KdTree(KdTree),
    Grid(Grid),
}

impl BottomLevel {
    /// Builds the structure on the current rayon pool, and reports the progress of a kd-tree's build.
    pub fn build(triangles: &[Triangle], options: &AccelOptions, progress: &Progress) -> Self {
        match options {
            AccelOptions::KdTree(options) | AccelOptions::LazyTree(options) => {
                Self::KdTree(KdTree::build_observed(triangles, options, progress))
            }
            AccelOptions::Grid(options) => Self::Grid(Grid::build(triangles, options)),
        }
    }

    pub fn as_kdtree(&self) -> Option<&KdTree> {
        if let Self::KdTree(tree) = self { Some(tree) } else { None }
    }

    pub fn as_grid(&self) -> Option<&Grid> {
        if let Self::Grid(grid) = self { Some(grid) } else { None }
    }

    /// The least and the greatest corner of a box that holds all triangles.
    pub fn bounds(&self) -> [Vec3; 2] {
        match self {
            Self::KdTree(tree) => tree.bounds(),
            Self::Grid(grid) => grid.bounds(),
        }
    }

    pub fn n_triangles(&self) -> usize {
        match self {
            Self::KdTree(tree) => tree.n_triangles(),
            Self::Grid(grid) => grid.n_triangles(),
        }
    }

    /// Returns what a search needs beside the arrays.
    pub fn constants(&self) -> AccelConstants {
        match self {
            Self::KdTree(tree) => tree.constants(),
            Self::Grid(grid) => grid.constants(),
        }
    }

    /// The indices of the triangles in leaves or cells.
    pub fn leaf_triangles(&self) -> &[u32] {
        match self {
            Self::KdTree(tree) => tree.leaf_triangles(),
            Self::Grid(grid) => grid.leaf_triangles(),
        }
    }

    /// The plane of each triangle in [`BottomLevel::leaf_triangles`].
    pub fn leaf_planes(&self) -> &[Plane] {
        match self {
            Self::KdTree(tree) => tree.leaf_planes(),
            Self::Grid(grid) => grid.leaf_planes(),
        }
    }

    pub fn nodes(&self) -> &[KdNode] {
        self.as_kdtree().map_or(&[], KdTree::nodes)
    }

    pub fn parents(&self) -> &[u32] {
        self.as_kdtree().map_or(&[], KdTree::parents)
    }

    pub fn slabs(&self) -> &[Slab] {
        self.as_kdtree().map_or(&[], KdTree::slabs)
    }

    pub fn cells(&self) -> &[GridCell] {
        self.as_grid().map_or(&[], Grid::cells)
    }
}
