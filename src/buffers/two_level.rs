//! The contents of a world of instances for the arrays of a device: the structures of all geometries, one after the
//! other, with their indices counted from the first one, and the rows of `instance_rows`.

use bytemuck::{Pod, cast_slice};
use rayon::prelude::*;

use crate::{
    accel::{
        bottom_level::BottomLevel,
        grid::Grid,
        two_level::{GeometryPlace, TwoLevel},
    },
    gpu::GpuError,
    layout::{
        AccelConstants, GEOMETRY_ROWS, GridCell, INSTANCE_ROWS, InstanceRow, KD_LEAF, KD_NODE_BYTES, KD_PAIR_SHIFT,
        KdNode, KdRope, LeafTriangle, Plane, Slab, StructurePlace, TOP_NODE_ROWS, Triangle,
    },
    world::Instances,
};

/// Arrays of all structures, one after the other.
pub struct Joined<'a> {
    two: &'a TwoLevel,
    /// The place of each tree's first node, and the number of all nodes.
    first_nodes: &'a [usize],
    /// The place of each geometry's first entry of a leaf or cell, and the number of all entries.
    first_entries: Vec<usize>,
    /// The place of each grid's first cell, and the number of all cells.
    first_cells: Vec<usize>,
    /// The place of each geometry's first triangle.
    first_rows: Vec<u32>,
}

impl<'a> Joined<'a> {
    pub fn new(two: &'a TwoLevel, instances: &Instances) -> Self {
        let first_rows = instances.ranges.iter().map(|range| range.first_row).collect();
        let (first_entries, first_cells) = (two.entry_begins(), two.cell_begins());
        Self { two, first_nodes: two.node_begins(), first_entries, first_cells, first_rows }
    }

    /// Checks that the offsets of nodes and the indices of entries fit in words.
    ///
    /// # Errors
    /// There are too many.
    pub fn check(&self) -> Result<(), GpuError> {
        let nodes = (self.n_nodes() as u64, u64::from(u32::MAX / KD_NODE_BYTES));
        let entries = (self.n_entries() as u64, u64::from(u32::MAX));
        let cells = (self.n_cells() as u64, u64::from(u32::MAX));
        let all = [("nodes of all kd-trees", nodes), ("entries of all leaves", entries), ("cells of all grids", cells)];
        for (what, (value, limit)) in all {
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

    pub fn n_cells(&self) -> usize {
        *self.first_cells.last().expect("the number of all")
    }

    /// Writes the elements of all structures from element `first` on. `begins`: the places of their first
    /// elements. `element(geometry_ix, ix)` is an element of a structure.
    fn write<T: Pod + Send>(
        begins: &[usize],
        first: usize,
        elements: &mut [T],
        element: impl Fn(usize, usize) -> T + Sync,
    ) {
        const CHUNK: usize = 1 << 14;
        elements.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk_ix, chunk)| {
            let first = first + chunk_ix * CHUNK;
            let mut geometry_ix = begins.partition_point(|begin| *begin <= first) - 1;
            for (ix, written) in (first..).zip(chunk) {
                while begins[geometry_ix + 1] <= ix {
                    geometry_ix += 1;
                }
                *written = element(geometry_ix, ix - begins[geometry_ix]);
            }
        });
    }

    fn structure(&self, geometry_ix: usize) -> &BottomLevel {
        &self.two.structures()[geometry_ix]
    }

    pub fn write_nodes(&self, first: usize, chunk: &mut [KdNode]) {
        Self::write(self.first_nodes, first, chunk, |geometry_ix, ix| {
            let place = StructurePlace {
                first_element: self.first_nodes[geometry_ix] as u32,
                first_entry: self.first_entries[geometry_ix] as u32,
                first_row: self.first_rows[geometry_ix],
            };
            relocated(self.structure(geometry_ix).nodes()[ix], &place)
        });
    }

    pub fn write_parents(&self, first: usize, chunk: &mut [u32]) {
        let first_pairs: Vec<_> = self.first_nodes.iter().map(|first| first / 2).collect();
        Self::write(&first_pairs, first, chunk, |geometry_ix, ix| {
            self.structure(geometry_ix).parents()[ix] + self.first_nodes[geometry_ix] as u32
        });
    }

    pub fn write_entries(&self, stored: &[Triangle], first: usize, chunk: &mut [LeafTriangle]) {
        Self::write(&self.first_entries, first, chunk, |geometry_ix, ix| {
            leaf_triangle(stored, self.first_rows[geometry_ix] + self.structure(geometry_ix).leaf_triangles()[ix])
        });
    }

    pub fn write_planes(&self, first: usize, chunk: &mut [Plane]) {
        Self::write(&self.first_entries, first, chunk, |geometry_ix, ix| self.structure(geometry_ix).leaf_planes()[ix]);
    }

    pub fn write_cells(&self, first: usize, chunk: &mut [GridCell]) {
        Self::write(&self.first_cells, first, chunk, |geometry_ix, ix| {
            let place = StructurePlace {
                first_element: self.first_cells[geometry_ix] as u32,
                first_entry: self.first_entries[geometry_ix] as u32,
                first_row: self.first_rows[geometry_ix],
            };
            let grid = self.structure(geometry_ix).as_grid().expect("only grids have cells");
            relocated_cell(grid, ix, &place)
        });
    }

    /// The number of slabs: one for each node, or none if no tree has any.
    pub fn n_slabs(&self) -> usize {
        if self.two.structures().iter().all(|it| it.slabs().is_empty()) { 0 } else { self.n_nodes() }
    }

    pub fn write_slabs(&self, first: usize, chunk: &mut [Slab]) {
        Self::write(self.first_nodes, first, chunk, |geometry_ix, ix| {
            self.structure(geometry_ix).slabs().get(ix).copied().unwrap_or_default()
        });
    }

    /// Counts the nodes to which ropes lead from the first tree's. 0 leads out of the geometry.
    pub fn move_ropes(&self, ropes: &mut [KdRope]) {
        for (geometry_ix, range) in self.first_nodes.windows(2).enumerate() {
            let first_node = self.first_nodes[geometry_ix] as u32;
            for rope in ropes[6 * range[0]..6 * range[1]].iter_mut().filter(|rope| rope.node_ix != 0) {
                rope.node_ix += first_node;
            }
        }
    }
}

/// Returns a tree's node as it is among those of several trees. Twin of glsl/passes/kdtree_relocate.comp.
pub fn relocated(KdNode { split_or_first, axis_and_child }: KdNode, place: &StructurePlace) -> KdNode {
    match axis_and_child & KD_LEAF != 0 {
        true => KdNode { split_or_first: split_or_first + place.first_entry, axis_and_child },
        false => {
            KdNode { split_or_first, axis_and_child: axis_and_child + ((place.first_element / 2) << KD_PAIR_SHIFT) }
        }
    }
}

/// Returns a grid's cell as it is among those of several grids. Twin of glsl/passes/grid_relocate.comp.
pub fn relocated_cell(grid: &Grid, ix: usize, place: &StructurePlace) -> GridCell {
    let GridCell { first, count } = grid.cells()[ix];
    let is_block = grid.n_levels() == 2 && ix < grid.lattice().n_cubes();
    GridCell { first: first + if is_block { place.first_element } else { place.first_entry }, count }
}

/// Returns a leaf's entry of a stored triangle.
pub fn leaf_triangle(stored: &[Triangle], triangle_ix: u32) -> LeafTriangle {
    let Triangle { v0, v1, v2, .. } = stored[triangle_ix as usize];
    LeafTriangle { v0, triangle_ix, v1, v2, ..LeafTriangle::default() }
}

/// Returns the rows of `instance_rows`, and notes where its parts begin. `places`: of the structures.
pub fn instance_rows(
    two: &TwoLevel,
    instances: &Instances,
    places: &[GeometryPlace],
    constants: &mut AccelConstants,
) -> Vec<InstanceRow> {
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
    rows.extend_from_slice(cast_slice(&two.geometry_constants(places)));
    constants.top_nodes_begin = rows.len() as u32;
    debug_assert_eq!(
        constants.top_nodes_begin - constants.geometries_begin,
        GEOMETRY_ROWS * two.structures().len() as u32
    );
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
