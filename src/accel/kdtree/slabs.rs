//! Slabs: the space between two parallel planes that holds the surface in a cell (Kay, Kajiya: Ray Tracing Complex
//! Scenes, SIGGRAPH 1986). A ray that passes by a surface goes through many cells that have a part of it. Where the
//! ray keeps clear of a cell's slab, it need not go down to the leaves.
//!
//! A slab holds the parts of triangles within their margins (bounds.rs) of the cell. It reaches beyond them by the
//! epsilon of planes.rs at the coarsest of the scales of the cell and its triangles. The proof is that of planes.rs,
//! except that rounding moves a slab by 5 of the units there, and a plane by 4.
//!
//! Kernels can compute the slabs of a tree, too (src/passes/kd_slabs.rs).

use glam::DVec3;
use rayon::prelude::*;

use super::{KdTree, Node, clip::Polygon, scales::length_of};
use crate::{
    accel::bounds::Bounds,
    layout::{KD_HAS_SLAB, KdSlabTree, Slab, Triangle},
};

/// Limits of the number of entries below a split, by which the splits that may get a slab are chosen. On each path
/// from the root, the first split within each limit is chosen. It gets a slab if the surface in its cell is flat
/// enough. A piece of the surface with more entries than the last limit is hardly ever flat enough
/// (docs/experiments.md).
const SLAB_ENTRY_LIMITS: [u32; 5] = [8, 32, 128, 512, MAX_SLAB_ENTRIES];
/// The largest of `SLAB_ENTRY_LIMITS`.
const MAX_SLAB_ENTRIES: u32 = 2048;
/// The fewest entries of a leaf that gets a slab. For a single entry, the plane of its triangle does as well.
const LEAF_ENTRIES: u32 = 2;
/// The greatest thickness of a split's slab, as a share of the longest side of the cell.
const THICKEST_SPLIT: f64 = 0.2;
/// The greatest thickness of a leaf's slab, as a share of the longest side of the cell.
const THICKEST_LEAF: f64 = 0.3;

/// Slabs of a tree's nodes: the node's index and its slab.
type Slabs = Vec<(u32, Slab)>;

impl KdTree {
    /// Finds flat pieces of the surface, and gives slabs to their nodes.
    ///
    /// The same triangles and tree give the same slabs on any number of threads. This takes some 200 ns for each
    /// entry of the leaves.
    pub(super) fn add_slabs(&mut self, triangles: &[Triangle]) {
        let bounds = Bounds::from(self.bounds());
        let fitting = Fitting { tree: self, triangles, n_entries: self.entries_below() };
        let slabs: Vec<Slabs> = fitting.patches(bounds).par_iter().map(|patch| fitting.slabs_of(patch)).collect();
        let arrays = &mut self.arrays;
        arrays.slabs = vec![Slab::default(); arrays.nodes.len()];
        for (node, slab) in slabs.into_iter().flatten() {
            arrays.slabs[node as usize] = slab;
            arrays.nodes[node as usize].axis_and_child |= KD_HAS_SLAB;
        }
    }

    /// Returns what kernels need to know of the tree to compute its slabs.
    pub(crate) fn slab_tree(&self) -> KdSlabTree {
        KdSlabTree {
            box_min: self.box_min(),
            n_nodes: self.nodes().len() as u32,
            box_max: self.box_max(),
            n_entries: self.leaf_triangles().len() as u32,
            ..self.scales.slab_tree()
        }
    }

    /// Returns the slab of a node, if it has one.
    pub fn slab_of(&self, node_ix: u32) -> Option<&Slab> {
        self.has_slab(node_ix).then(|| &self.slabs()[node_ix as usize])
    }

    /// Whether a node has a slab.
    pub(super) fn has_slab(&self, node_ix: u32) -> bool {
        self.nodes()[node_ix as usize].axis_and_child & KD_HAS_SLAB != 0
    }

    /// Returns for each node the number of entries of all leaves below it.
    fn entries_below(&self) -> Vec<u32> {
        let mut n_entries = vec![0; self.nodes().len()];
        // Children come after their parents, so the reverse order visits them first.
        for node in (0..self.nodes().len()).rev() {
            n_entries[node] = match self.node(node as u32) {
                Node::Leaf { count, .. } => count,
                Node::Split { child, .. } => n_entries[child as usize] + n_entries[child as usize + 1],
            };
        }
        n_entries
    }
}

/// A node and its cell.
struct NodeCell {
    node: u32,
    cell: Bounds,
}

/// Inputs of the search for slabs.
struct Fitting<'a> {
    tree: &'a KdTree,
    triangles: &'a [Triangle],
    n_entries: Vec<u32>,
}

/// What [`Fitting::fit`] finds out about the surface below a node.
#[derive(Clone, Copy)]
struct Surface {
    /// The sum of the polygons' area vectors. A vector that points away from the sum so far is negated, so the
    /// triangles' winding does not matter.
    area: DVec3,
    /// The coarsest of the triangles' scales.
    scale: u32,
}

/// The part of the surface that is in the leaves below a node, and the slabs that were found there.
#[derive(Default)]
struct FlatPiece {
    /// The corners of all polygons, leaf after leaf.
    corners: Vec<DVec3>,
    slabs: Slabs,
}

impl Fitting<'_> {
    /// Returns the topmost nodes with no more than `MAX_SLAB_ENTRIES` entries below them, and the leaves that have
    /// more entries.
    fn patches(&self, root: Bounds) -> Vec<NodeCell> {
        let mut patches = Vec::new();
        let mut stack = vec![NodeCell { node: 0, cell: root }];
        while let Some(patch) = stack.pop() {
            match self.tree.node(patch.node) {
                Node::Split { axis, position, child } if self.n_entries[patch.node as usize] > MAX_SLAB_ENTRIES => {
                    let [below, above] = patch.cell.split(axis, position);
                    stack.extend([NodeCell { node: child, cell: below }, NodeCell { node: child + 1, cell: above }]);
                }
                _ => patches.push(patch),
            }
        }
        patches
    }

    /// Returns the slabs of a node and of all nodes below it.
    fn slabs_of(&self, patch: &NodeCell) -> Slabs {
        let mut piece = FlatPiece::default();
        self.fit(patch, u32::MAX, &mut piece);
        piece.slabs
    }

    /// Adds the polygons below a node to the piece, and the slabs there. `n_above`: the number of entries below the
    /// parent.
    fn fit(&self, patch: &NodeCell, n_above: u32, piece: &mut FlatPiece) -> Surface {
        let (n_entries, first_corner) = (self.n_entries[patch.node as usize], piece.corners.len());
        let (surface, thickest) = match self.tree.node(patch.node) {
            Node::Leaf { first, count } => {
                let entries = &self.tree.leaf_triangles()[first as usize..][..count as usize];
                let scales = &self.tree.scales;
                let surface = entries.iter().fold(Surface::NONE, |surface, &ix| {
                    let triangle = &self.triangles[ix as usize];
                    let polygon = Polygon::near(triangle, &patch.cell, scales.margin_of(triangle));
                    surface.and(Surface { area: piece.add(&polygon), scale: scales.of_triangle(triangle) })
                });
                (surface, if count >= LEAF_ENTRIES { THICKEST_LEAF } else { 0.0 })
            }
            Node::Split { axis, position, child } => {
                let [below, above] = patch.cell.split(axis, position);
                let below = self.fit(&NodeCell { node: child, cell: below }, n_entries, piece);
                let above = self.fit(&NodeCell { node: child + 1, cell: above }, n_entries, piece);
                let is_first = SLAB_ENTRY_LIMITS.iter().any(|&most| n_entries <= most && most < n_above);
                (below.and(above), if is_first { THICKEST_SPLIT } else { 0.0 })
            }
        };
        if thickest > 0.0 && n_entries > 0 {
            let longest = patch.cell.extent().into_iter().fold(0.0, f64::max);
            let scale = surface.scale.min(self.tree.scales.of_cell(&patch.cell));
            let reach = f64::from(self.tree.constants().plane_epsilon * length_of(scale));
            let slab = slab_around(&piece.corners[first_corner..], surface.area, thickest * longest, reach);
            piece.slabs.extend(slab.map(|slab| (patch.node, slab)));
        }
        surface
    }
}

impl FlatPiece {
    /// Adds a polygon's corners. Returns its area vector, whose length is twice the area.
    fn add(&mut self, polygon: &Polygon) -> DVec3 {
        let first_corner = self.corners.len();
        self.corners.extend(polygon.corners().iter().map(|&corner| DVec3::from_array(corner)));
        let Some((&apex, rest)) = self.corners[first_corner..].split_first() else { return DVec3::ZERO };
        rest.windows(2).map(|edge| (edge[0] - apex).cross(edge[1] - apex)).sum()
    }
}

impl Surface {
    /// A surface without triangles.
    const NONE: Self = Self { area: DVec3::ZERO, scale: u32::MAX };

    /// Joins two surfaces.
    fn and(self, other: Self) -> Self {
        let area = if self.area.dot(other.area) < 0.0 { self.area - other.area } else { self.area + other.area };
        Self { area, scale: self.scale.min(other.scale) }
    }
}

/// Returns the slab whose planes are perpendicular to the surface's mean normal, which is that of `area`. Returns none
/// if the surface is thicker than `thickest` (world units), or if its normals cancel out. `reach`: the distance by
/// which the slab reaches beyond the corners (world units).
fn slab_around(corners: &[DVec3], area: DVec3, thickest: f64, reach: f64) -> Option<Slab> {
    let across = area.try_normalize()?;
    let (low, high) = extent_along(corners, across);
    if high - low > thickest {
        return None;
    }
    let half = 0.5 * (high - low) + reach;
    let slab = Slab { normal: (across / half).as_vec3(), offset: (0.5 * (low + high) / half) as f32 };
    (slab.normal.is_finite() && slab.offset.is_finite()).then_some(slab)
}

/// Returns the least and the greatest height of corners along a direction.
fn extent_along(corners: &[DVec3], direction: DVec3) -> (f64, f64) {
    corners.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), corner| {
        let height = corner.dot(direction);
        (if height < low { height } else { low }, if height > high { height } else { high })
    })
}
