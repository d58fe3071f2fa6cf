//! Sizes and cost of kd-trees.

use std::ops::Add;

use serde::Serialize;

use super::{BuildOptions, KdTree, Node};
use crate::{
    accel::bounds::Bounds,
    layout::{KdNode, Plane, Slab},
};

/// Statistics of a kd-tree.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Statistics {
    /// Splits and leaves, without the unused node 1.
    pub n_nodes: u64,
    /// Leaves, including the empty ones.
    pub n_leaves: u64,
    /// Leaves without triangles. Like the other figures that may be missing, none if a device has built the tree.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub n_empty_leaves: Option<u64>,
    /// Nodes with a slab around their triangles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub n_slabs: Option<u64>,
    /// The number of levels below the root.
    pub depth: u32,
    /// References: entries of all leaves.
    pub n_references: u64,
    /// References divided by the number of triangles; 0 if there are no triangles.
    pub references_per_triangle: f64,
    /// Expected cost of a ray that crosses the root's cell, in the unit of the build's costs (MacDonald and Booth
    /// 1990). It is the sum over all nodes of the node's own cost times its cell's share of the root's surface.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sah_cost: Option<f64>,
    /// Size on the host of nodes, parents, leaves with their planes, and slabs, bytes.
    pub bytes: u64,
}

impl KdTree {
    /// Computes the tree's statistics. `options`: those that it was built with, of which only the costs are read.
    pub fn statistics(&self, n_triangles: usize, options: &BuildOptions) -> Statistics {
        let mut statistics = Statistics {
            depth: self.depth(),
            n_references: self.leaf_triangles().len() as u64,
            references_per_triangle: self.leaf_triangles().len() as f64 / n_triangles.max(1) as f64,
            bytes: (size_of_val(self.nodes())
                + size_of_val(self.parents())
                + size_of_val(self.leaf_triangles())
                + size_of_val(self.leaf_planes())
                + size_of_val(self.slabs())) as u64,
            ..Default::default()
        };
        let root = Bounds::from(self.bounds());
        let root_area = root.half_area();
        let (mut n_slabs, mut n_empty_leaves, mut sah_cost) = (0, 0, 0.0);
        let mut stack = vec![(0, root)];
        while let Some((node_ix, cell)) = stack.pop() {
            // If the root's cell has no surface (a point, a line), all cells count like the root.
            let share = if root_area > 0.0 { cell.half_area() / root_area } else { 1.0 };
            statistics.n_nodes += 1;
            n_slabs += u64::from(self.has_slab(node_ix));
            match self.node(node_ix) {
                Node::Leaf { count, .. } => {
                    statistics.n_leaves += 1;
                    n_empty_leaves += u64::from(count == 0);
                    sah_cost += f64::from(options.intersection_cost) * f64::from(count) * share;
                }
                Node::Split { axis, position, child } => {
                    sah_cost += f64::from(options.traversal_cost) * share;
                    let [below, above] = cell.split(axis, position);
                    stack.extend([(child + 1, above), (child, below)]);
                }
            }
        }
        let (n_slabs, n_empty_leaves, sah_cost) = (Some(n_slabs), Some(n_empty_leaves), Some(sah_cost));
        Statistics { n_slabs, n_empty_leaves, sah_cost, ..statistics }
    }
}

impl Statistics {
    /// Adds the figures of another tree, but for `references_per_triangle`. A figure that one of them lacks is lost.
    pub(in crate::accel) fn add(&mut self, other: &Self) {
        fn sum<T: Add<Output = T>>(a: Option<T>, b: Option<T>) -> Option<T> {
            a.zip(b).map(|(a, b)| a + b)
        }
        *self = Self {
            n_nodes: self.n_nodes + other.n_nodes,
            n_leaves: self.n_leaves + other.n_leaves,
            n_empty_leaves: sum(self.n_empty_leaves, other.n_empty_leaves),
            n_slabs: sum(self.n_slabs, other.n_slabs),
            depth: self.depth.max(other.depth),
            n_references: self.n_references + other.n_references,
            references_per_triangle: self.references_per_triangle,
            sah_cost: sum(self.sah_cost, other.sah_cost),
            bytes: self.bytes + other.bytes,
        };
    }

    /// Returns what is known of a tree by its numbers of nodes, with the unused node 1, and of references.
    /// `has_slabs`: whether there is room for slabs.
    pub(crate) fn of_device(
        n_triangles: usize,
        [n_nodes, n_references]: [u64; 2],
        depth: u32,
        has_slabs: bool,
    ) -> Self {
        let node_bytes = 2 * size_of::<KdNode>() + size_of::<u32>() + if has_slabs { 2 * size_of::<Slab>() } else { 0 };
        let reference_bytes = size_of::<u32>() + size_of::<Plane>();
        Self {
            n_nodes: n_nodes - 1,
            n_leaves: n_nodes / 2,
            depth,
            n_references,
            references_per_triangle: n_references as f64 / n_triangles.max(1) as f64,
            bytes: n_nodes / 2 * node_bytes as u64 + n_references * reference_bytes as u64,
            ..Self::default()
        }
    }
}
