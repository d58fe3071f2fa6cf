//! Is every triangle in all leaves whose cells it comes near? By cutting up each one, in f64 and independently of the
//! builder's own clipping.

use glam::DVec3;
use rayon::prelude::*;

use super::{Invalid, KdTree, Node, bounds::is_finite};
use crate::layout::Triangle;

/// Of the margin: what is checked. The rest is room for rounding: of bounds to f32, and of points cut by seven planes,
/// each off by four times 2^-53 of the coordinates.
const CHECKED: f64 = 0.96;

/// One triangle on its way down a tree.
struct Descent<'a> {
    tree: &'a KdTree,
    triangle_ix: u32,
    /// World units.
    margin: f64,
}

/// The first triangle, by index, that a leaf within `margin` lacks.
pub fn check(tree: &KdTree, triangles: &[Triangle], margin: f32) -> Result<(), Invalid> {
    let missing = triangles.par_iter().enumerate().find_map_first(|(ix, triangle)| {
        let corners = [triangle.v0, triangle.v1, triangle.v2].map(|v| v.as_dvec3());
        let descent = Descent { tree, triangle_ix: ix as u32, margin: CHECKED * f64::from(margin) };
        let node = if is_finite(triangle) { descent.leaf_without_it(0, &corners) } else { None };
        node.map(|node| Invalid::Missing { node, triangle: ix as u32 })
    });
    missing.map_or(Ok(()), Err)
}

impl Descent<'_> {
    /// The first leaf below a node that comes near a polygon and does not have the triangle.
    fn leaf_without_it(&self, node: u32, polygon: &[DVec3]) -> Option<u32> {
        if polygon.is_empty() {
            return None;
        }
        match self.tree.node(node) {
            Node::Leaf { first, count } => {
                let entries = &self.tree.leaf_triangles[first as usize..][..count as usize];
                entries.binary_search(&self.triangle_ix).is_err().then_some(node)
            }
            Node::Split { axis, position, child } => {
                let above_plane = |v: DVec3| v[axis] - f64::from(position);
                let near_below = clip(polygon, |v| self.margin - above_plane(v));
                let near_above = clip(polygon, |v| self.margin + above_plane(v));
                self.leaf_without_it(child, &near_below).or_else(|| self.leaf_without_it(child + 1, &near_above))
            }
        }
    }
}

/// What of a polygon has a height of 0 or more (Sutherland-Hodgman).
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
