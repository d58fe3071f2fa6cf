//! The light tree: samples one of many lights by what they may send to a point. Twin of `emitters/tree.glsl`, which
//! names the source.

use glam::Vec3;

use super::alias::ALMOST_ONE;
use crate::layout::{LIGHT_NODE_LEAF, LIGHT_NODE_TWO_SIDED, LightNode};

/// The least squared distance from a light, square world units, which bounds what lights without a size send.
const LEAST_SQUARED: f32 = 1.0e-30;
/// The step of a random number below which the digits of another one continue it.
const COARSE_STEP: f32 = 1.0 / 4096.0;

/// A light that is sampled, and the probability with which the tree samples it at this point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TreeSample {
    pub emitter_ix: u32,
    pub probability: f32,
}

/// The cosine of the angle `a - b`, or 1 if `a` is less than `b`. Both are between 0 and pi.
fn cos_beyond(cos_a: f32, cos_b: f32) -> f32 {
    if cos_a > cos_b {
        return 1.0;
    }
    let sines = ((1.0 - cos_a * cos_a) * (1.0 - cos_b * cos_b)).max(0.0).sqrt();
    cos_a * cos_b + sines
}

/// What the lights of a node may send to a point: an estimate, which is 0 only if none of them shines there.
pub fn importance(node: &LightNode, point_world: Vec3) -> f32 {
    let way = point_world - node.centre;
    let (squared, radius_squared) = (way.dot(way), node.radius * node.radius);
    let largest = squared.max(radius_squared).max(LEAST_SQUARED);
    let mut cosine = if squared > 0.0 { (node.axis.dot(way) / squared.sqrt()).clamp(-1.0, 1.0) } else { 1.0 };
    if node.flags & LIGHT_NODE_TWO_SIDED != 0 {
        cosine = cosine.abs();
    }
    // The angle in which the node's sphere is seen: from inside it is obtuse, and grows to the centre.
    let seen = (1.0 - squared.min(radius_squared) / largest).max(0.0).sqrt();
    let cos_seen = if squared < radius_squared { -seen } else { seen };
    let cosine = cos_beyond(cos_beyond(cosine, node.cos_spread), cos_seen);
    if cosine > node.cos_end { node.intensity * cosine / largest } else { 0.0 }
}

/// The probability with which the left child of a node is sampled.
fn share_of_left(nodes: &[LightNode], left_ix: usize, right_ix: usize, point_world: Vec3) -> f32 {
    let (left, right) = (importance(&nodes[left_ix], point_world), importance(&nodes[right_ix], point_world));
    let sum = left + right;
    if sum > 0.0 { left / sum } else { 0.5 }
}

/// Samples a light. `u` is in [0, 1), and `more`, also in [0, 1), continues it below the 24 bits that a float has.
pub fn sample_in_tree(nodes: &[LightNode], point_world: Vec3, mut u: f32, mut more: f32) -> TreeSample {
    let (mut ix, mut probability, mut step) = (0, 1.0, 1.0 / 16_777_216.0);
    while nodes[ix].flags & LIGHT_NODE_LEAF == 0 {
        let right_ix = nodes[ix].next as usize;
        let left = share_of_left(nodes, ix + 1, right_ix, point_world);
        let is_left = u < left;
        let share = if is_left { left } else { 1.0 - left };
        ix = if is_left { ix + 1 } else { right_ix };
        u = if is_left { u / share } else { (u - left) / share };
        step /= share;
        if step > COARSE_STEP {
            u += more * step;
            more = 0.0;
        }
        u = u.min(ALMOST_ONE);
        probability *= share;
    }
    TreeSample { emitter_ix: nodes[ix].next, probability }
}

/// The probability with which [`sample_in_tree`] samples the light of a leaf at a point.
pub fn tree_probability(nodes: &[LightNode], point_world: Vec3, leaf_ix: u32) -> f32 {
    let (leaf_ix, mut ix, mut probability) = (leaf_ix as usize, 0, 1.0);
    while ix != leaf_ix {
        let right_ix = nodes[ix].next as usize;
        let left = share_of_left(nodes, ix + 1, right_ix, point_world);
        // Nodes are in preorder.
        let is_left = leaf_ix < right_ix;
        ix = if is_left { ix + 1 } else { right_ix };
        probability *= if is_left { left } else { 1.0 - left };
    }
    probability
}
