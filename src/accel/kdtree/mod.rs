//! Kd-trees built from triangles by the surface area heuristic (SAH), with their statistics and their validator.
//!
//! ```text
//! triangles ─> build ─────> subtree ─────> flatten ─> KdTree ─> statistics
//!              large cells, └ small cells,            ├─> planes, slabs: let rays skip most triangles
//!              all threads    a thread each           └─> validate, coverage
//!                   │              │       scales: margins, the larger the farther a triangle is from 0
//!                   └──> split  <──┘   binned: counts by bins, sweeps the few that may hold the best plane
//!                        and clip      counted: counts at every plane, for cells of at most 32 triangles
//! ```
//!
//! Wald and Havran, "On building fast kd-trees for ray tracing, and on doing that in O(N log N)", 2006.

mod arrays;
mod binned;
mod boxes;
mod build;
mod clip;
mod counted;
mod coverage;
mod flatten;
mod links;
mod planes;
mod ropes;
mod sah;
pub(super) mod scales;
mod slabs;
mod statistics;
mod subtree;
mod traversal;
mod validate;

use glam::Vec3;

use crate::accel::{Lazy, bounds::Bounds};
use crate::layout::{
    AccelConstants, KD_AXIS_MASK, KD_LEAF, KD_MAX_DEPTH, KD_PAIR_SHIFT, KD_PLANE_EPSILON, KdNode, Triangle,
};

pub use arrays::KdArrays;
pub use links::TraversalLinks;
use scales::Scales;
pub use statistics::Statistics;
pub use traversal::Traversal;
pub use validate::Invalid;

/// A kd-tree over triangles, as the kernels read it.
///
/// Kernels read it without bounds checks. So a tree comes either from [`KdTree::build`], which makes only valid
/// trees, or from [`KdTree::from_arrays`], which validates. Nothing can change it afterwards.
#[derive(Clone, Debug, PartialEq)]
pub struct KdTree {
    arrays: KdArrays,
    /// The number of triangles that the tree was built from. Every triangle index in a leaf is less than this number.
    n_triangles: usize,
    scales: Scales,
}

impl KdTree {
    /// Returns the uniform constants that kernels need in addition to the tree's arrays. All other members are 0.
    pub fn constants(&self) -> AccelConstants {
        let bounds = self.bounds();
        constants(bounds, self.scales.origin_reach(Bounds::from(bounds).largest_coordinate()))
    }

    /// Returns the distance from a cell within which a triangle counts as inside the cell, world units.
    pub(super) fn margin_of(&self, triangle: &Triangle) -> f32 {
        self.scales.margin_of(triangle)
    }
}

/// Returns the constants of a tree whose root has this cell.
fn constants(bounds: [Vec3; 2], origin_reach: f32) -> AccelConstants {
    let [box_min, box_max] = bounds;
    let plane_epsilon = KD_PLANE_EPSILON * Bounds::from(bounds).largest_coordinate();
    AccelConstants { box_min, box_max, plane_epsilon, origin_reach, ..AccelConstants::default() }
}

/// A kd-tree that each device builds for itself.
pub type LazyTree = Lazy<KdTree>;

impl LazyTree {
    /// Returns the same constants as [`KdTree::constants`].
    pub(crate) fn constants(&self) -> AccelConstants {
        constants(self.bounds(), self.origin_reach())
    }

    /// Returns what a traversal reads beside the tree, for any nodes of a tree over the triangles.
    pub(crate) fn links_of(&self, nodes: Vec<KdNode>, traversal: Traversal) -> TraversalLinks {
        let [box_min, box_max] = self.bounds();
        let arrays = KdArrays { nodes, box_min, box_max, ..KdArrays::default() };
        TraversalLinks::new(&KdTree { arrays, n_triangles: self.n_triangles(), scales: Scales::default() }, traversal)
    }
}

/// Build options of a kd-tree. Costs may be in any unit; only their ratio matters.
#[derive(Clone, Debug, PartialEq)]
pub struct BuildOptions {
    /// Cost of a step from a split to a child.
    pub traversal_cost: f32,
    /// Cost of a ray-triangle test.
    pub intersection_cost: f32,
    /// Bonus for a split that cuts off empty space: the share by which its intersection cost is reduced, 0 to 1.
    pub empty_bonus: f32,
    /// The most levels below the root. `None` and all values above `KD_MAX_DEPTH - 2` mean `KD_MAX_DEPTH - 2`.
    pub max_depth: Option<u32>,
    /// Limit of the number of references, as a multiple of the number of triangles, plus 1024. The limit is never
    /// more than 2^25 or the number of triangles, whichever is larger. A single leaf of all triangles is always
    /// allowed.
    pub max_references_per_triangle: u32,
    /// Whether a cell of more than 32 references is split at the best of all planes through the sides of its
    /// triangles' bounds. If not, it is split at the best of up to 1023 planes on each axis, which takes less time.
    pub exact_planes: bool,
    /// Whether nodes get slabs, which takes some 200 ns a reference. The CPU and GPUs use slabs, software drivers do
    /// not.
    pub slabs: bool,
}

/// Options of the tree that traces fastest on a GPU (docs/experiments.md). An intersection cost of 0.7 makes a
/// tree that is 1.5 times as large and no faster.
impl Default for BuildOptions {
    fn default() -> Self {
        Self {
            traversal_cost: 1.0,
            intersection_cost: 0.5,
            empty_bonus: 0.0,
            max_depth: None,
            max_references_per_triangle: 16,
            exact_planes: true,
            slabs: true,
        }
    }
}

impl BuildOptions {
    /// Options of a tree that is built in half the time of the default one, with a fifth of its nodes and without
    /// slabs. Rays take up to a tenth longer on the CPU and up to twice as long on a GPU.
    pub fn fast() -> Self {
        Self { intersection_cost: 0.15, exact_planes: false, slabs: false, ..Self::default() }
    }

    /// Returns the most levels below the root that the tree may have.
    pub fn depth_limit(&self) -> u32 {
        self.max_depth.unwrap_or(u32::MAX).min(KD_MAX_DEPTH - 2)
    }
}

/// Node of a kd-tree, decoded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Node {
    /// A split. The child below `position` has the index `child`, which is even; the child above has `child + 1`.
    Split {
        /// The axis that the plane is perpendicular to: 0, 1 or 2.
        axis: usize,
        /// The plane's coordinate on the axis, world units.
        position: f32,
        /// Index of the child below the plane.
        child: u32,
    },
    /// A leaf. Its triangles are `leaf_triangles[first .. first + count]`.
    Leaf {
        /// Index of the leaf's first entry.
        first: u32,
        /// The number of the leaf's triangles.
        count: u32,
    },
}

/// A leaf without triangles.
pub(crate) const EMPTY_LEAF: KdNode = KdNode { split_or_first: 0, axis_and_child: KD_LEAF };

impl From<KdNode> for Node {
    fn from(node: KdNode) -> Self {
        let high = node.axis_and_child >> KD_PAIR_SHIFT;
        if node.axis_and_child & KD_LEAF != 0 {
            return Self::Leaf { first: node.split_or_first, count: high };
        }
        let axis = (node.axis_and_child & KD_AXIS_MASK) as usize;
        Self::Split { axis, position: f32::from_bits(node.split_or_first), child: 2 * high }
    }
}

impl From<Node> for KdNode {
    fn from(node: Node) -> Self {
        match node {
            Node::Leaf { first, count } => {
                Self { split_or_first: first, axis_and_child: count << KD_PAIR_SHIFT | KD_LEAF }
            }
            Node::Split { axis, position, child } => {
                debug_assert!(child % 2 == 0, "child {child}");
                Self { split_or_first: position.to_bits(), axis_and_child: (child / 2) << KD_PAIR_SHIFT | axis as u32 }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use crate::layout::Triangle;

    /// Makes `n` small triangles in the shape of a winding stair.
    pub fn staircase(n: usize) -> Vec<Triangle> {
        let corner = |i: usize| vec3((i as f32 * 0.7).cos(), i as f32 * 0.1, (i as f32 * 0.7).sin());
        let step = |i| Triangle { v0: corner(i), v1: corner(i + 1), v2: 0.5 * corner(i), ..Triangle::default() };
        (0..n).map(step).collect()
    }
}
