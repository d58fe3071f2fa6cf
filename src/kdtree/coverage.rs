//! Is every part of every triangle in a leaf that has it? By cutting up each triangle, in f64 and independently of the
//! builder's own clipping.

use glam::DVec3;
use rayon::prelude::*;

use super::{Invalid, KdTree, Node, bounds::is_finite};
use crate::layout::Triangle;

/// Times a triangle's largest coordinate: nearer to a plane than this is a touch. The builder cuts a triangle by at most
/// seven planes, each of which moves a point by at most four roundings, 2^-53 of the coordinate each: 2^-48 together.
const TOUCH: f64 = 1.0 / (1u64 << 44) as f64;

/// The corners of a convex polygon; fewer than three for what degenerates.
type Polygon = Vec<DVec3>;

/// A part of a triangle in a leaf that does not have it.
struct Missing {
    leaf: u32,
    part: Polygon,
}

/// One triangle on its way down a tree.
struct Descent<'a> {
    tree: &'a KdTree,
    triangle_ix: u32,
    /// World units.
    touch: f64,
}

/// The first triangle, by index, of which a part is missing.
pub fn check(tree: &KdTree, triangles: &[Triangle]) -> Result<(), Invalid> {
    let missing = triangles.par_iter().enumerate().find_map_first(|(ix, triangle)| {
        let corners = [triangle.v0, triangle.v1, triangle.v2].map(|v| v.as_dvec3());
        let largest = corners.iter().fold(0.0, |largest: f64, v| largest.max(v.abs().max_element()));
        let descent = Descent { tree, triangle_ix: ix as u32, touch: TOUCH * largest };
        let missing = if is_finite(triangle) { descent.missing(0, corners.to_vec()) } else { Vec::new() };
        missing.first().map(|missing| Invalid::Missing { node: missing.leaf, triangle: ix as u32 })
    });
    missing.map_or(Ok(()), Err)
}

impl Descent<'_> {
    /// What no leaf below a node has of a polygon in its cell.
    fn missing(&self, node: u32, polygon: Polygon) -> Vec<Missing> {
        let (axis, position, child) = match self.tree.node(node) {
            Node::Split { axis, position, child } => (axis, f64::from(position), child),
            Node::Leaf { first, count } => {
                let entries = &self.tree.leaf_triangles[first as usize..][..count as usize];
                let has_it = entries.binary_search(&self.triangle_ix).is_ok();
                return if has_it { Vec::new() } else { vec![Missing { leaf: node, part: polygon }] };
            }
        };
        let min = polygon.iter().fold(f64::INFINITY, |min, v| min.min(v[axis]));
        let max = polygon.iter().fold(f64::NEG_INFINITY, |max, v| max.max(v[axis]));
        let (is_below, is_above) = (max <= position + self.touch, min >= position - self.touch);
        match (is_below, is_above) {
            (true, false) => self.missing(child, polygon),
            (false, true) => self.missing(child + 1, polygon),
            // In the plane: what the lower side lacks the upper side must have.
            (true, true) => {
                let below = self.missing(child, polygon);
                below.into_iter().flat_map(|missing| self.missing(child + 1, missing.part)).collect()
            }
            // Clear of the plane by a touch, so that rounding never makes a part in a cell that the triangle misses.
            (false, false) => {
                let mut missing = self.missing(child, clip(&polygon, |v| position - self.touch - v[axis]));
                missing.extend(self.missing(child + 1, clip(&polygon, |v| v[axis] - position - self.touch)));
                missing
            }
        }
    }
}

/// What of a polygon has a height of 0 or more (Sutherland-Hodgman).
fn clip(polygon: &[DVec3], height: impl Fn(DVec3) -> f64) -> Polygon {
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
