//! The contents of a world of instances for the arrays of a device: the trees of all geometries, one after the other,
//! with their indices counted from the first tree, and the rows of `instance_rows`.

use bytemuck::{Pod, cast_slice};
use rayon::prelude::*;

use crate::{
    accel::{kdtree::KdTree, two_level::TwoLevel},
    gpu::GpuError,
    layout::{
        AccelConstants, GEOMETRY_ROWS, INSTANCE_ROWS, InstanceRow, KD_LEAF, KD_NODE_BYTES, KD_PAIR_SHIFT, KdNode,
        KdRope, LeafTriangle, Slab, TOP_NODE_ROWS, Triangle,
    },
    world::Instances,
};

/// Arrays of all trees, one after the other.
pub struct Joined<'a> {
    two: &'a TwoLevel,
    /// The place of each tree's first node, and the number of all nodes.
    first_nodes: &'a [usize],
    /// The place of each tree's first entry of a leaf, and the number of all entries.
    first_entries: Vec<usize>,
    /// The place of each geometry's first triangle.
    first_rows: Vec<u32>,
}

impl<'a> Joined<'a> {
    pub fn new(two: &'a TwoLevel, instances: &Instances) -> Self {
        let first_rows = instances.ranges.iter().map(|range| range.first_row).collect();
        Self { two, first_nodes: two.node_begins(), first_entries: two.entry_begins(), first_rows }
    }

    /// Checks that the offsets of nodes and the indices of entries fit in words.
    ///
    /// # Errors
    /// There are too many.
    pub fn check(&self) -> Result<(), GpuError> {
        let nodes = (self.n_nodes() as u64, u64::from(u32::MAX / KD_NODE_BYTES));
        let entries = (self.n_entries() as u64, u64::from(u32::MAX));
        for (what, (value, limit)) in [("nodes of all kd-trees", nodes), ("entries of all leaves", entries)] {
            if value > limit {
                return Err(GpuError::Limit { what, value, limit });
            }
        }
        Ok(())
    }

    pub fn n_nodes(&self) -> usize {
        *self.first_nodes.last().expect("the number of all")
    }

    pub fn n_entries(&self) -> usize {
        *self.first_entries.last().expect("the number of all")
    }

    /// Writes the elements of all trees from element `first` on. `begins`: the places of the trees' first elements.
    /// `element(tree_ix, ix)` is an element of a tree.
    fn write<T: Pod + Send>(
        begins: &[usize],
        first: usize,
        part: &mut [T],
        element: impl Fn(usize, usize) -> T + Sync,
    ) {
        const CHUNK: usize = 1 << 14;
        part.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk_ix, chunk)| {
            let first = first + chunk_ix * CHUNK;
            let mut tree_ix = begins.partition_point(|begin| *begin <= first) - 1;
            for (ix, written) in (first..).zip(chunk) {
                while begins[tree_ix + 1] <= ix {
                    tree_ix += 1;
                }
                *written = element(tree_ix, ix - begins[tree_ix]);
            }
        });
    }

    fn tree(&self, tree_ix: usize) -> &KdTree {
        &self.two.trees()[tree_ix]
    }

    pub fn write_nodes(&self, first: usize, part: &mut [KdNode]) {
        Self::write(self.first_nodes, first, part, |tree_ix, ix| {
            let KdNode { split_or_first, axis_and_child } = self.tree(tree_ix).nodes()[ix];
            if axis_and_child & KD_LEAF != 0 {
                return KdNode { split_or_first: split_or_first + self.first_entries[tree_ix] as u32, axis_and_child };
            }
            let first_pair = (self.first_nodes[tree_ix] / 2) as u32;
            KdNode { split_or_first, axis_and_child: axis_and_child + (first_pair << KD_PAIR_SHIFT) }
        });
    }

    pub fn write_parents(&self, first: usize, part: &mut [u32]) {
        let first_pairs: Vec<_> = self.first_nodes.iter().map(|first| first / 2).collect();
        Self::write(&first_pairs, first, part, |tree_ix, ix| {
            self.tree(tree_ix).parents()[ix] + self.first_nodes[tree_ix] as u32
        });
    }

    pub fn write_entries(&self, stored: &[Triangle], first: usize, part: &mut [LeafTriangle]) {
        Self::write(&self.first_entries, first, part, |tree_ix, ix| {
            let triangle_ix = self.first_rows[tree_ix] + self.tree(tree_ix).leaf_triangles()[ix];
            let Triangle { v0, v1, v2, .. } = stored[triangle_ix as usize];
            LeafTriangle { v0, triangle_ix, v1, v2, ..LeafTriangle::default() }
        });
    }

    pub fn write_planes(&self, first: usize, part: &mut [crate::layout::Plane]) {
        Self::write(&self.first_entries, first, part, |tree_ix, ix| self.tree(tree_ix).leaf_planes()[ix]);
    }

    /// The number of slabs: one for each node, or none if no tree has any.
    pub fn n_slabs(&self) -> usize {
        if self.two.trees().iter().all(|tree| tree.slabs().is_empty()) { 0 } else { self.n_nodes() }
    }

    pub fn write_slabs(&self, first: usize, part: &mut [Slab]) {
        Self::write(self.first_nodes, first, part, |tree_ix, ix| {
            self.tree(tree_ix).slabs().get(ix).copied().unwrap_or_default()
        });
    }

    /// Counts the nodes to which ropes lead from the first tree's. 0 leads out of the geometry.
    pub fn move_ropes(&self, ropes: &mut [KdRope]) {
        for (tree_ix, range) in self.first_nodes.windows(2).enumerate() {
            let first_node = self.first_nodes[tree_ix] as u32;
            for rope in ropes[6 * range[0]..6 * range[1]].iter_mut().filter(|rope| rope.node_ix != 0) {
                rope.node_ix += first_node;
            }
        }
    }
}

/// Returns the rows of `instance_rows`, and notes where its parts begin.
pub fn instance_rows(two: &TwoLevel, instances: &Instances, constants: &mut AccelConstants) -> Vec<InstanceRow> {
    let firsts: Vec<u32> = instances.list.iter().map(|it| it.first_triangle).collect();
    let words = |words: &[u32]| {
        let row = |four: &[u32]| {
            let word = |ix: usize| four.get(ix).copied().unwrap_or_default();
            InstanceRow { x: word(0), y: word(1), z: word(2), w: word(3) }
        };
        words.chunks(4).map(row).collect::<Vec<_>>()
    };
    let mut rows: Vec<InstanceRow> = cast_slice(&instances.list).to_vec();
    debug_assert_eq!(rows.len(), INSTANCE_ROWS as usize * instances.list.len());
    constants.geometries_begin = rows.len() as u32;
    rows.extend_from_slice(cast_slice(&two.geometry_constants()));
    constants.top_nodes_begin = rows.len() as u32;
    debug_assert_eq!(constants.top_nodes_begin - constants.geometries_begin, GEOMETRY_ROWS * two.trees().len() as u32);
    rows.extend_from_slice(cast_slice(&two.top().nodes));
    constants.instance_firsts_begin = rows.len() as u32;
    debug_assert_eq!(
        constants.instance_firsts_begin - constants.top_nodes_begin,
        TOP_NODE_ROWS * two.top().nodes.len() as u32
    );
    rows.extend(words(&firsts));
    constants.instance_materials_begin = rows.len() as u32;
    rows.extend(words(&instances.materials));
    let [box_min, box_max] = two.bounds();
    *constants = AccelConstants {
        box_min,
        box_max,
        plane_epsilon: two.pad_from_afar(),
        origin_reach: two.origin_reach(),
        ..*constants
    };
    rows
}
