//! Check that each triangle is in all leaves whose cells the triangle comes near to, and within the slabs of the
//! nodes above these leaves. Each triangle is cut up in f64, independently of the builder's own clipping.

use glam::DVec3;
use rayon::prelude::*;

use super::{Invalid, KdTree, Node, scales::length_of};
use crate::{
    accel::bounds::{Bounds, is_finite},
    layout::Triangle,
};

/// Share of a margin, and of the reach of slabs, that is checked. The rest is room for two kinds of rounding:
/// bounds are rounded to f32, and a corner may be the result of seven cuts, by six faces of a cell and a plane
/// (clip.rs), each of which is off by four times 2^-53 of the coordinates.
const CHECKED: f64 = 0.96;

/// A triangle on its way down a tree.
struct Descent<'a> {
    tree: &'a KdTree,
    triangle_ix: u32,
    triangle: &'a Triangle,
    /// Distance from a cell within which a leaf must have the triangle, world units.
    margin: f64,
}

/// Defect of a node that the check has found for a triangle.
enum Lack {
    /// The leaf of this index has no entry of the triangle.
    Entry(u32),
    /// The node of this index has a slab that does not hold the triangle.
    Slab(u32),
}

/// Checks that every leaf within a triangle's margin has it, and that no triangle reaches out of a node's slab.
///
/// # Errors
/// The first triangle, by index, for which this does not hold, and the node.
pub fn check(tree: &KdTree, triangles: &[Triangle]) -> Result<(), Invalid> {
    let root = Bounds::from(tree.bounds());
    let missing = triangles.par_iter().enumerate().find_map_first(|(ix, triangle)| {
        let corners = [triangle.v0, triangle.v1, triangle.v2].map(|v| v.as_dvec3());
        let lack = if is_finite(triangle) {
            let margin = CHECKED * f64::from(tree.scales.margin_of(triangle));
            Descent { tree, triangle_ix: ix as u32, triangle, margin }.lack_below(0, &root, &corners)
        } else {
            None
        };
        lack.map(|lack| match lack {
            Lack::Entry(node) => Invalid::Missing { node, triangle: ix as u32 },
            Lack::Slab(node) => Invalid::OutsideSlab { node, triangle: ix as u32 },
        })
    });
    missing.map_or(Ok(()), Err)
}

impl Descent<'_> {
    /// Searches the subtree of `node` for a leaf near the polygon that lacks the triangle, or a slab that the polygon
    /// leaves.
    fn lack_below(&self, node: u32, cell: &Bounds, polygon: &[DVec3]) -> Option<Lack> {
        if polygon.is_empty() {
            return None;
        }
        if let Some(slab) = self.tree.slab_of(node) {
            let (normal, offset) = (slab.normal.as_dvec3(), f64::from(slab.offset));
            // In the slab's unit, half of its thickness is 1, and a world unit is the normal's length (`Slab`).
            let room = 1.0 - self.slab_reach(cell) * normal.length();
            if polygon.iter().any(|&corner| (normal.dot(corner) - offset).abs() > room) {
                return Some(Lack::Slab(node));
            }
        }
        match self.tree.node(node) {
            Node::Leaf { first, count } => {
                let entries = &self.tree.leaf_triangles()[first as usize..][..count as usize];
                entries.binary_search(&self.triangle_ix).is_err().then_some(Lack::Entry(node))
            }
            Node::Split { axis, position, child } => {
                let above_plane = |v: DVec3| v[axis] - f64::from(position);
                let near_below = clip(polygon, |v| self.margin - above_plane(v));
                let near_above = clip(polygon, |v| self.margin + above_plane(v));
                let [below, above] = cell.split(axis, position);
                let lack = self.lack_below(child, &below, &near_below);
                lack.or_else(|| self.lack_below(child + 1, &above, &near_above))
            }
        }
    }

    /// Returns the distance by which a slab must reach beyond the triangle in a cell, world units.
    fn slab_reach(&self, cell: &Bounds) -> f64 {
        let scale = self.tree.scales.of_triangle(self.triangle).min(self.tree.scales.of_cell(cell));
        CHECKED * f64::from(self.tree.constants().plane_epsilon * length_of(scale))
    }
}

/// Returns the part of a polygon whose height is 0 or more (Sutherland-Hodgman).
fn clip(polygon: &[DVec3], height: impl Fn(DVec3) -> f64) -> Vec<DVec3> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    let following = polygon.iter().cycle().skip(1);
    for (&a, &b) in polygon.iter().zip(following) {
        let (height_a, height_b) = (height(a), height(b));
        if height_a >= 0.0 {
            kept.push(a);
        }
        if height_a * height_b < 0.0 {
            kept.push(a + (b - a) * (height_a / (height_a - height_b)));
        }
    }
    kept
}
