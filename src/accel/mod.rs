//! Acceleration structures: kd-trees and grids, which find the triangles that a ray may hit. For single rays on the
//! CPU, a kd-tree is converted to a wide hierarchy of boxes.

pub(crate) mod bottom_level;
pub(crate) mod bounds;
pub mod grid;
pub mod kdtree;
mod lazy;
mod query;
mod search;
mod statistics;
pub(crate) mod top_level;
pub(crate) mod two_level;
pub mod wide_bvh;

use glam::Vec3;

use self::{
    grid::{GridLevels, GridOptions, LazyGrid},
    kdtree::{BuildOptions, KdTree, LazyTree},
    two_level::{GeometriesId, StructuresId, TwoLevel},
};
pub use self::{
    lazy::{BuildStage, DeviceBuild, Lazy, Structure},
    query::Query,
    search::Search,
    statistics::Statistics,
};
use crate::layout::Triangle;
pub use crate::layout::{Hit, NO_TRIANGLE, Ray};
use crate::util::progress::Progress;

/// An acceleration structure over the triangles of a world.
#[derive(Clone, Debug, PartialEq)]
pub enum Accel {
    /// A kd-tree, which the host builds.
    KdTree(KdTree),
    /// A kd-tree. Each device builds its own tree. The host builds a tree only at the first [`Lazy::get`].
    LazyTree(LazyTree),
    /// A grid. Each device builds its own grid. The host builds a grid only at the first [`Lazy::get`].
    Grid(LazyGrid),
    /// For worlds of instances: a kd-tree or a grid for each geometry, and a hierarchy over the instances. Devices may
    /// build the structures of geometries.
    TwoLevel(Box<TwoLevel>),
}

/// Build options of an acceleration structure.
#[derive(Clone, Debug, PartialEq)]
pub enum AccelOptions {
    /// Options of a kd-tree that the host builds.
    KdTree(BuildOptions),
    /// Options of a kd-tree that each device builds, of at most 32 levels. In a world of instances, each device builds
    /// the trees of geometries with 2048 triangles or more, and the host builds the others.
    LazyTree(BuildOptions),
    /// Options of a grid, which each device builds. In a world of instances, the host builds those of geometries with
    /// fewer than 2048 triangles.
    Grid(GridOptions),
}

impl AccelOptions {
    /// Returns what is out of range. Other costs could split empty cells without an end, and other densities ask for
    /// more cells than there is memory.
    pub(crate) fn check(&self) -> Result<(), String> {
        let within = |name: &str, value: f32, least: f32, most: f32| match value >= least && value <= most {
            true => Ok(()),
            false => Err(format!("{name} is {value}, not {least:e} to {most:e}")),
        };
        let density = |name: &str, value: f32| within(name, value, f32::MIN_POSITIVE, MOST_DENSITY);
        match self {
            Self::KdTree(options) | Self::LazyTree(options) => {
                within("traversal_cost", options.traversal_cost, 0.0, f32::MAX)?;
                within("intersection_cost", options.intersection_cost, 0.0, f32::MAX)?;
                within("empty_bonus", options.empty_bonus, 0.0, 1.0)
            }
            Self::Grid(GridOptions { levels: GridLevels::Uniform { density: cells }, .. }) => {
                density("density", *cells)
            }
            Self::Grid(GridOptions { levels: GridLevels::Two { upper_density, lower_density }, .. }) => {
                density("upper_density", *upper_density)?;
                density("lower_density", *lower_density)
            }
        }
    }
}

/// The most cells of a grid for each triangle. More of them take longer to build and to cross than they save.
const MOST_DENSITY: f32 = 1024.0;

/// The kinds of acceleration structures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AccelKind {
    /// A kd-tree: traces fastest, and `--traversal` has several algorithms for it.
    #[default]
    KdTree,
    /// A uniform grid: builds fastest, and traces well where triangles are spread evenly.
    Grid,
    /// A grid of two levels: cells with many triangles are cut once more.
    Grid2,
}

named_enum!(AccelKind {
    KdTree = "kdtree": "a kd-tree by the surface area heuristic: rays are fastest; the CPU builds it, or the device",
    Grid = "grid": "a uniform grid: the device builds it in about a millisecond; rays are 2 to 10 times slower",
    Grid2 = "grid2": "a grid of two levels: built in about two milliseconds; rays are 2 to 5 times slower",
});

impl AccelKind {
    /// The structure's name, as it is written in a sentence.
    pub fn name(self) -> &'static str {
        match self {
            Self::KdTree => "kd-tree",
            Self::Grid => "grid",
            Self::Grid2 => "two-level grid",
        }
    }

    /// The kind of a structure with so many levels of a grid's cells; 0 for a kd-tree.
    pub(crate) fn of_grid_levels(n_levels: u32) -> Self {
        match n_levels {
            0 => Self::KdTree,
            1 => Self::Grid,
            _ => Self::Grid2,
        }
    }
}

impl Accel {
    /// Builds a structure over triangles on the current rayon pool. For a structure that devices build, this only keeps
    /// the options: it is built at its first use ([`Lazy`]).
    pub fn new(triangles: &[Triangle], options: &AccelOptions) -> Self {
        Self::new_observed(triangles, options, &Progress::default())
    }

    /// Does what [`Accel::new`] does, and reports the progress of a kd-tree's build.
    pub fn new_observed(triangles: &[Triangle], options: &AccelOptions, progress: &Progress) -> Self {
        match options {
            AccelOptions::KdTree(options) => Self::KdTree(KdTree::build_observed(triangles, options, progress)),
            AccelOptions::LazyTree(options) => Self::LazyTree(LazyTree::new(triangles, options.clone())),
            AccelOptions::Grid(options) => Self::Grid(LazyGrid::new(triangles, options.clone())),
        }
    }

    /// The only kd-tree, which the host builds unless it has done so already; none if the structure is a grid or has
    /// two levels. `triangles`: those of the structure.
    pub fn as_kdtree(&self, triangles: &[Triangle]) -> Option<&KdTree> {
        match self {
            Self::KdTree(tree) => Some(tree),
            Self::LazyTree(tree) => Some(tree.get(triangles)),
            Self::Grid(_) | Self::TwoLevel(_) => None,
        }
    }

    /// The report of the first device that has built the structure, if there is one.
    pub fn device_build(&self) -> Option<&DeviceBuild> {
        match self {
            Self::KdTree(_) => None,
            Self::TwoLevel(two) => two.device_build(),
            Self::LazyTree(tree) => tree.device_build(),
            Self::Grid(grid) => grid.device_build(),
        }
    }

    /// What tells geometries, however they are deformed, from all others; none without instances.
    pub(crate) fn geometries_id(&self) -> Option<&GeometriesId> {
        if let Self::TwoLevel(two) = self { Some(two.geometries_id()) } else { None }
    }

    /// What tells the structures of geometries from all others; none without instances.
    pub(crate) fn structures_id(&self) -> Option<StructuresId> {
        if let Self::TwoLevel(two) = self { Some(two.structures_id()) } else { None }
    }

    /// The kind of the structure, or of that of each geometry.
    pub fn kind(&self) -> AccelKind {
        match self {
            Self::KdTree(_) | Self::LazyTree(_) => AccelKind::KdTree,
            Self::Grid(grid) => AccelKind::of_grid_levels(grid.options().levels.n_levels()),
            Self::TwoLevel(two) => AccelKind::of_grid_levels(two.n_grid_levels()),
        }
    }

    /// The number of stored triangles that the structure was made for.
    pub fn n_triangles(&self) -> usize {
        match self {
            Self::KdTree(tree) => tree.n_triangles(),
            Self::LazyTree(tree) => tree.n_triangles(),
            Self::Grid(grid) => grid.n_triangles(),
            Self::TwoLevel(two) => two.n_stored(),
        }
    }

    /// The least and the greatest corner of a box that holds all triangles, world units.
    pub fn bounds(&self) -> [Vec3; 2] {
        match self {
            Self::KdTree(tree) => tree.bounds(),
            Self::LazyTree(tree) => tree.bounds(),
            Self::Grid(grid) => grid.bounds(),
            Self::TwoLevel(two) => two.bounds(),
        }
    }

    /// The greatest magnitude of a coordinate of a ray's origin up to which a search does not move the origin, world
    /// units.
    pub fn origin_reach(&self) -> f32 {
        match self {
            Self::KdTree(tree) => tree.constants().origin_reach,
            Self::LazyTree(tree) => tree.origin_reach(),
            Self::Grid(grid) => grid.origin_reach(),
            Self::TwoLevel(two) => two.origin_reach(),
        }
    }
}
