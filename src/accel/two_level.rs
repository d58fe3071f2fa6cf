//! The structure of a world of instances: a kd-tree for each geometry, and a hierarchy over the instances.

use std::sync::{Arc, Weak};

use glam::Vec3;
use rayon::prelude::*;

use super::{
    kdtree::{BuildOptions, KdTree, Statistics},
    top_level::TopLevel,
};
use crate::{
    layout::{GeometryConstants, Instance, KD_MAX_ORIGIN_DISTANCE, KD_NODE_BYTES, Triangle},
    util::progress::Progress,
};

/// Where a geometry's triangles are among all stored ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StoredRange {
    /// Index of the geometry's first triangle.
    pub first_row: u32,
    /// The number of its triangles.
    pub n_triangles: u32,
}

impl StoredRange {
    /// Returns the geometry's elements of an array with an element for each stored triangle.
    pub fn of<'a, T>(&self, stored: &'a [T]) -> &'a [T] {
        &stored[self.first_row as usize..][..self.n_triangles as usize]
    }
}

/// Identity of the trees of all geometries. It does not keep them.
#[derive(Clone, Debug)]
pub struct TreesId(Weak<Vec<Arc<KdTree>>>);

impl PartialEq for TreesId {
    fn eq(&self, other: &Self) -> bool {
        Weak::ptr_eq(&self.0, &other.0)
    }
}

/// The trees of all geometries, and the hierarchy over their instances.
#[derive(Clone, Debug, PartialEq)]
pub struct TwoLevel {
    /// A tree for each geometry, in its own space.
    trees: Arc<Vec<Arc<KdTree>>>,
    /// The index at which each tree's nodes begin where all trees are stored one after the other. All are even.
    node_begins: Arc<Vec<usize>>,
    top: TopLevel,
}

impl TwoLevel {
    /// Builds all trees, and the hierarchy, on the current rayon pool. `stored`: the triangles of all geometries.
    pub fn build(
        stored: &[Triangle],
        ranges: &[StoredRange],
        instances: &[Instance],
        options: &BuildOptions,
        progress: &Progress,
    ) -> Self {
        let build = |range: &StoredRange| Arc::new(KdTree::build_observed(range.of(stored), options, progress));
        let trees: Vec<_> = ranges.par_iter().map(build).collect();
        Self::of_trees(trees, instances)
    }

    fn of_trees(trees: Vec<Arc<KdTree>>, instances: &[Instance]) -> Self {
        let top = Self::top_of(&trees, instances);
        let node_begins = begins(trees.iter().map(|tree| tree.nodes().len()));
        Self { trees: Arc::new(trees), node_begins: Arc::new(node_begins), top }
    }

    /// Returns the structure of geometries some of which have other vertices. Only their trees are built, and the
    /// hierarchy. `deformed`: their indices. The other arguments are those of [`TwoLevel::build`].
    pub fn deformed(
        &self,
        deformed: &[usize],
        (stored, ranges): (&[Triangle], &[StoredRange]),
        instances: &[Instance],
        options: &BuildOptions,
    ) -> Self {
        let build = |ix: &usize| Arc::new(KdTree::build(ranges[*ix].of(stored), options));
        let built: Vec<_> = deformed.par_iter().map(build).collect();
        let mut trees = Vec::clone(&self.trees);
        deformed.iter().zip(built).for_each(|(ix, tree)| trees[*ix] = tree);
        Self::of_trees(trees, instances)
    }

    /// Returns the structure of the same geometries in other places. Only the hierarchy is built. `instances`: as many
    /// as before, each of the same geometry.
    pub fn moved(&self, instances: &[Instance]) -> Self {
        Self { top: Self::top_of(&self.trees, instances), ..self.clone() }
    }

    /// Returns what tells these trees, and those of all structures that share them, from all others.
    pub fn trees_id(&self) -> TreesId {
        TreesId(Arc::downgrade(&self.trees))
    }

    fn top_of(trees: &[Arc<KdTree>], instances: &[Instance]) -> TopLevel {
        let boxes: Vec<_> = trees.iter().map(|tree| [tree.box_min(), tree.box_max()]).collect();
        TopLevel::new(instances, &boxes)
    }

    /// The tree of each geometry.
    pub fn trees(&self) -> &[Arc<KdTree>] {
        &self.trees
    }

    /// The hierarchy over the instances.
    pub fn top(&self) -> &TopLevel {
        &self.top
    }

    /// The number of stored triangles.
    pub fn n_stored(&self) -> usize {
        self.trees.iter().map(|tree| tree.n_triangles()).sum()
    }

    /// The least and the greatest corner of a box that holds all instances, world units.
    pub fn bounds(&self) -> [Vec3; 2] {
        [self.top.bounds.min.into(), self.top.bounds.max.into()]
    }

    /// The greatest magnitude of a coordinate of a ray's origin up to which a search does not move the origin, world
    /// units.
    pub fn origin_reach(&self) -> f32 {
        KD_MAX_ORIGIN_DISTANCE * self.top.bounds.largest_coordinate()
    }

    /// The greatest number of levels of a tree below its root.
    pub fn depth(&self) -> u32 {
        self.trees.iter().map(|tree| tree.depth()).max().unwrap_or_default()
    }

    /// Computes the statistics of all trees together. The cost is the mean over the trees, weighted by their triangles.
    /// `options`: those that the trees were built with.
    pub fn statistics(&self, options: &BuildOptions) -> Statistics {
        let n_stored = self.n_stored().max(1) as f64;
        let mut all = Statistics { depth: self.depth(), ..Statistics::default() };
        for tree in self.trees.iter() {
            let own = tree.statistics(tree.n_triangles(), options);
            all.n_nodes += own.n_nodes;
            all.n_leaves += own.n_leaves;
            all.n_empty_leaves += own.n_empty_leaves;
            all.n_slabs += own.n_slabs;
            all.n_references += own.n_references;
            all.sah_cost += own.sah_cost * tree.n_triangles() as f64 / n_stored;
            all.bytes += own.bytes;
        }
        all.references_per_triangle = all.n_references as f64 / n_stored;
        all.bytes += size_of_val(&self.top.nodes[..]) as u64;
        all
    }

    /// The index at which each tree's nodes begin where all trees are stored one after the other, and the number of all
    /// nodes. All are even.
    pub fn node_begins(&self) -> &[usize] {
        &self.node_begins
    }

    /// The share of the distance of a ray's origin by which the hierarchy's boxes are too small for the ray, if the
    /// origin is beyond [`TwoLevel::origin_reach`].
    pub fn pad_from_afar(&self) -> f32 {
        self.top.pad_from_afar
    }

    /// Returns the index at which the entries of each tree's leaves begin.
    pub fn entry_begins(&self) -> Vec<usize> {
        begins(self.trees.iter().map(|tree| tree.leaf_triangles().len()))
    }

    /// Returns what a search through each geometry needs beside the arrays.
    pub fn geometry_constants(&self) -> Vec<GeometryConstants> {
        let rows = begins(self.trees.iter().map(|tree| tree.n_triangles()));
        let constants = |((tree, first_node), first_row): ((&Arc<KdTree>, &usize), usize)| {
            let of_tree = tree.constants();
            GeometryConstants {
                box_min: of_tree.box_min,
                plane_epsilon: of_tree.plane_epsilon,
                box_max: of_tree.box_max,
                origin_reach: of_tree.origin_reach,
                root_offset: KD_NODE_BYTES * *first_node as u32,
                first_row: first_row as u32,
                n_triangles: tree.n_triangles() as u32,
                reserved: 0,
            }
        };
        self.trees.iter().zip(self.node_begins.iter()).zip(rows).map(constants).collect()
    }
}

/// Returns the sum of all lengths before each, and of all.
fn begins(lens: impl Iterator<Item = usize>) -> Vec<usize> {
    let sums = lens.scan(0, |sum, len| {
        *sum += len;
        Some(*sum)
    });
    std::iter::once(0).chain(sums).collect()
}
