//! The structure of a geometry in a world of instances: a kd-tree or a grid.

use glam::Vec3;

use super::{
    AccelOptions,
    grid::Grid,
    kdtree::{BuildOptions, KdTree, LazyTree},
};
use crate::{
    layout::{AccelConstants, GridCell, KD_WORD_DEPTH, KdNode, Plane, Slab, Triangle},
    util::progress::Progress,
};

/// The fewest triangles of a geometry whose tree devices build. A device's build is hundreds of dispatches, one after
/// the other, however few triangles there are. The host's build of fewer triangles takes less time.
pub const LEAST_DEVICE_TRIANGLES: usize = 2048;

/// A structure over the triangles of a geometry, in its own space. An array that the structure does not have is empty.
#[derive(Clone, Debug, PartialEq)]
pub enum BottomLevel {
    /// A kd-tree that the host has built.
    KdTree(KdTree),
    /// A kd-tree that each device builds. The host's arrays exist after [`BottomLevel::build_on_host`].
    LazyTree(Box<LazyTree>),
    Grid(Grid),
}

impl BottomLevel {
    /// Builds the structure on the current rayon pool, and reports the progress of a kd-tree's build.
    pub fn build(triangles: &[Triangle], options: &AccelOptions, progress: &Progress) -> Self {
        let of_host = |options: &BuildOptions| Self::KdTree(KdTree::build_observed(triangles, options, progress));
        match options {
            AccelOptions::KdTree(options) => of_host(options),
            AccelOptions::LazyTree(options) if triangles.len() >= LEAST_DEVICE_TRIANGLES => {
                Self::LazyTree(Box::new(LazyTree::new(triangles, options.clone())))
            }
            // Kernels are made for trees as deep as those that devices build.
            AccelOptions::LazyTree(options) => {
                let max_depth = Some(options.depth_limit().min(KD_WORD_DEPTH));
                of_host(&BuildOptions { max_depth, ..options.clone() })
            }
            AccelOptions::Grid(options) => Self::Grid(Grid::build(triangles, options)),
        }
    }

    /// Returns the tree that devices build over `n` triangles, whose corners a function returns; none if the host
    /// builds the structure of so many triangles.
    pub fn of_corners(
        n: usize,
        corners: impl Fn(usize) -> [Vec3; 3] + Sync + Send,
        options: &AccelOptions,
    ) -> Option<Self> {
        match options {
            AccelOptions::LazyTree(options) if n >= LEAST_DEVICE_TRIANGLES => {
                Some(Self::LazyTree(Box::new(LazyTree::of_corners(n, corners, options.clone()))))
            }
            _ => None,
        }
    }

    /// Builds the host's tree if devices build the structure, unless the host has done so already. `triangles`: those
    /// of the geometry.
    pub fn build_on_host(&self, triangles: &[Triangle]) {
        if let Self::LazyTree(tree) = self {
            tree.get(triangles);
        }
    }

    /// The tree that each device builds, if it is one.
    pub fn as_lazy(&self) -> Option<&LazyTree> {
        if let Self::LazyTree(tree) = self { Some(tree) } else { None }
    }

    /// The host's kd-tree.
    ///
    /// # Panics
    /// Devices build the tree, and the host has not.
    pub fn as_kdtree(&self) -> Option<&KdTree> {
        match self {
            Self::KdTree(tree) => Some(tree),
            Self::LazyTree(tree) => Some(tree.on_host().expect("a tree that the host has built, too")),
            Self::Grid(_) => None,
        }
    }

    pub fn as_grid(&self) -> Option<&Grid> {
        if let Self::Grid(grid) = self { Some(grid) } else { None }
    }

    /// The least and the greatest corner of a box that holds all triangles.
    pub fn bounds(&self) -> [Vec3; 2] {
        match self {
            Self::KdTree(tree) => tree.bounds(),
            Self::LazyTree(tree) => tree.bounds(),
            Self::Grid(grid) => grid.bounds(),
        }
    }

    pub fn n_triangles(&self) -> usize {
        match self {
            Self::KdTree(tree) => tree.n_triangles(),
            Self::LazyTree(tree) => tree.n_triangles(),
            Self::Grid(grid) => grid.n_triangles(),
        }
    }

    /// Returns what a search needs beside the arrays.
    pub fn constants(&self) -> AccelConstants {
        match self {
            Self::KdTree(tree) => tree.constants(),
            Self::LazyTree(tree) => tree.constants(),
            Self::Grid(grid) => grid.constants(),
        }
    }

    /// The indices of the triangles in leaves or cells.
    pub fn leaf_triangles(&self) -> &[u32] {
        match self {
            Self::Grid(grid) => grid.leaf_triangles(),
            _ => self.as_kdtree().map_or(&[], KdTree::leaf_triangles),
        }
    }

    /// The plane of each triangle in [`BottomLevel::leaf_triangles`].
    pub fn leaf_planes(&self) -> &[Plane] {
        match self {
            Self::Grid(grid) => grid.leaf_planes(),
            _ => self.as_kdtree().map_or(&[], KdTree::leaf_planes),
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
