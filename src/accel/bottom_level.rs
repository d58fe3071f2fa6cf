//! The structure of a geometry in a world of instances: a kd-tree or a grid.

use glam::Vec3;

use super::{
    AccelOptions, DeviceBuild,
    grid::{Grid, Lattice, LazyGrid},
    kdtree::{BuildOptions, KdTree, LazyTree},
};
use crate::{
    layout::{
        AccelConstants, GeometryConstants, GridCell, KD_NODE_BYTES, KD_WORD_DEPTH, KdNode, Plane, Slab, StructurePlace,
        Triangle,
    },
    util::progress::Progress,
};

/// The fewest triangles of a geometry whose structure devices build. A device's build is many dispatches, one after the
/// other, however few triangles there are. The host's build of fewer triangles takes less time.
pub const LEAST_DEVICE_TRIANGLES: usize = 2048;

/// A structure over the triangles of a geometry, in its own space. An array that the structure does not have is empty.
#[derive(Clone, Debug, PartialEq)]
pub enum BottomLevel {
    /// A kd-tree that the host has built.
    KdTree(KdTree),
    /// A kd-tree that each device builds. The host's arrays exist after [`BottomLevel::build_on_host`].
    LazyTree(Box<LazyTree>),
    /// A grid that the host has built.
    Grid(Grid),
    /// A grid that each device builds. The host's arrays exist after [`BottomLevel::build_on_host`].
    LazyGrid(Box<LazyGrid>),
}

/// A structure that each device builds.
#[derive(Clone, Copy)]
pub enum LazyStructure<'a> {
    KdTree(&'a LazyTree),
    Grid(&'a LazyGrid),
}

impl LazyStructure<'_> {
    pub fn n_triangles(&self) -> usize {
        match self {
            Self::KdTree(tree) => tree.n_triangles(),
            Self::Grid(grid) => grid.n_triangles(),
        }
    }

    /// Keeps a device's report, if it is the first one.
    pub fn note(&self, build: DeviceBuild) {
        match self {
            Self::KdTree(tree) => tree.note(build),
            Self::Grid(grid) => grid.note(build),
        }
    }
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
            AccelOptions::Grid(options) if triangles.len() >= LEAST_DEVICE_TRIANGLES => {
                Self::LazyGrid(Box::new(LazyGrid::new(triangles, options.clone())))
            }
            AccelOptions::Grid(options) => Self::Grid(Grid::build(triangles, options)),
        }
    }

    /// Returns the structure that devices build over `n` triangles, whose corners a function returns; none if the host
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
            AccelOptions::Grid(options) if n >= LEAST_DEVICE_TRIANGLES => {
                Some(Self::LazyGrid(Box::new(LazyGrid::of_corners(n, corners, options.clone()))))
            }
            _ => None,
        }
    }

    /// Builds the host's arrays if devices build the structure, unless the host has done so already. `triangles`: those
    /// of the geometry.
    pub fn build_on_host(&self, triangles: &[Triangle]) {
        match self {
            Self::LazyTree(tree) => _ = tree.get(triangles),
            Self::LazyGrid(grid) => _ = grid.get(triangles),
            Self::KdTree(_) | Self::Grid(_) => {}
        }
    }

    /// The structure that each device builds, if it is one.
    pub fn as_lazy(&self) -> Option<LazyStructure<'_>> {
        match self {
            Self::LazyTree(tree) => Some(LazyStructure::KdTree(tree)),
            Self::LazyGrid(grid) => Some(LazyStructure::Grid(grid)),
            Self::KdTree(_) | Self::Grid(_) => None,
        }
    }

    /// The host's kd-tree.
    ///
    /// # Panics
    /// Devices build the tree, and the host has not.
    pub fn as_kdtree(&self) -> Option<&KdTree> {
        match self {
            Self::KdTree(tree) => Some(tree),
            Self::LazyTree(tree) => Some(tree.on_host().expect("a tree that the host has built, too")),
            Self::Grid(_) | Self::LazyGrid(_) => None,
        }
    }

    /// The host's grid.
    ///
    /// # Panics
    /// Devices build the grid, and the host has not.
    pub fn as_grid(&self) -> Option<&Grid> {
        match self {
            Self::Grid(grid) => Some(grid),
            Self::LazyGrid(grid) => Some(grid.on_host().expect("a grid that the host has built, too")),
            Self::KdTree(_) | Self::LazyTree(_) => None,
        }
    }

    /// The number of levels of a grid's cells, 1 or 2; 0 for a kd-tree.
    pub fn n_grid_levels(&self) -> u32 {
        match self {
            Self::KdTree(_) | Self::LazyTree(_) => 0,
            Self::Grid(grid) => grid.n_levels(),
            Self::LazyGrid(grid) => grid.options().levels.n_levels(),
        }
    }

    /// The least and the greatest corner of a box that holds all triangles.
    pub fn bounds(&self) -> [Vec3; 2] {
        match self {
            Self::KdTree(tree) => tree.bounds(),
            Self::LazyTree(tree) => tree.bounds(),
            Self::Grid(grid) => grid.bounds(),
            Self::LazyGrid(grid) => grid.bounds(),
        }
    }

    pub fn n_triangles(&self) -> usize {
        match self {
            Self::KdTree(tree) => tree.n_triangles(),
            Self::LazyTree(tree) => tree.n_triangles(),
            Self::Grid(grid) => grid.n_triangles(),
            Self::LazyGrid(grid) => grid.n_triangles(),
        }
    }

    /// Returns what a search needs beside the arrays.
    ///
    /// # Panics
    /// Devices build the grid, and the host has not.
    pub fn constants(&self) -> AccelConstants {
        match self {
            Self::KdTree(tree) => tree.constants(),
            Self::LazyTree(tree) => tree.constants(),
            Self::Grid(_) | Self::LazyGrid(_) => self.as_grid().expect("a grid").constants(),
        }
    }

    /// Returns what a search through the geometry needs beside the arrays. `place`: where its parts of them begin.
    /// `lattice`: that of the grid that a device has built; none for the host's structure, and for kd-trees.
    pub fn geometry_constants(&self, place: &StructurePlace, lattice: Option<&Lattice>) -> GeometryConstants {
        let own = match (self, lattice) {
            (Self::LazyGrid(grid), Some(lattice)) => lattice.constants(grid.origin_reach()),
            _ => self.constants(),
        };
        let is_grid = self.n_grid_levels() > 0;
        GeometryConstants {
            box_min: own.box_min,
            plane_epsilon: own.plane_epsilon,
            box_max: own.box_max,
            origin_reach: own.origin_reach,
            root_offset: if is_grid { 0 } else { KD_NODE_BYTES * place.first_element },
            first_row: place.first_row,
            n_triangles: self.n_triangles() as u32,
            first_cell: if is_grid { place.first_element } else { 0 },
            n_cells_x: own.n_cells_x,
            n_cells_y: own.n_cells_y,
            n_cells_z: own.n_cells_z,
            cell_size: own.cell_size,
        }
    }

    /// The number of the host's nodes or cells, and that of entries (indices of triangles).
    pub fn sizes(&self) -> (usize, usize) {
        (self.nodes().len() + self.cells().len(), self.leaf_triangles().len())
    }

    /// The indices of the triangles in leaves or cells.
    pub fn leaf_triangles(&self) -> &[u32] {
        match self.as_grid() {
            Some(grid) => grid.leaf_triangles(),
            None => self.as_kdtree().map_or(&[], KdTree::leaf_triangles),
        }
    }

    /// The plane of each triangle in [`BottomLevel::leaf_triangles`].
    pub fn leaf_planes(&self) -> &[Plane] {
        match self.as_grid() {
            Some(grid) => grid.leaf_planes(),
            None => self.as_kdtree().map_or(&[], KdTree::leaf_planes),
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
