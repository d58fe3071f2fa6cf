//! The light tree: a hierarchy of the lights of a scene with many of them, from which the path tracer samples a light
//! by what it may send to a point (Conty Estevez, Kulla: Importance Sampling of Many Lights with Adaptive Tree
//! Splitting, HPG 2018). The descent is in `reference::emitters::tree`.

use std::f32::consts::FRAC_PI_2;

use glam::Vec3;

use super::light_bounds::LightBounds;
use crate::layout::{LIGHT_NODE_LEAF, LIGHT_NODE_TWO_SIDED, LightNode};

/// Bins of centres along an axis, between which splits are tried.
const N_BINS: usize = 12;
/// Depth from which on nodes are halved by the number of their lights, so that no tree is deep.
const BINNED_DEPTH: u32 = 40;
/// Number of lights from which on the two halves of a node are built at the same time.
const PARALLEL_FROM: usize = 4096;

/// A light that the tree gets.
#[derive(Clone, Copy, Debug)]
pub(super) struct TreeLight {
    pub bounds: LightBounds,
    /// Index of its entry among the emitters.
    pub emitter_ix: u32,
}

/// Builds the tree on the current rayon pool. It depends on the lights and their order alone. Its nodes are in
/// preorder, and every leaf has one light. `lights`: at least one, with intensities above 0.
pub(super) fn light_tree(mut lights: Vec<TreeLight>) -> Vec<LightNode> {
    let mut nodes = vec![LightNode::default(); 2 * lights.len() - 1];
    let whole = lights.iter().map(|light| light.bounds.intensity).sum();
    build(&mut lights, &mut nodes, Place { first: 0, depth: 0, whole });
    nodes
}

/// Where a node is in the tree.
#[derive(Clone, Copy)]
struct Place {
    /// Index of the node.
    first: usize,
    depth: u32,
    /// Intensity of the whole tree.
    whole: f64,
}

/// Builds the nodes of some lights. Returns the bounds of the lights.
fn build(lights: &mut [TreeLight], nodes: &mut [LightNode], place: Place) -> LightBounds {
    if let [light] = lights {
        nodes[0] = node(&light.bounds, place.whole, (light.emitter_ix, LIGHT_NODE_LEAF));
        return light.bounds;
    }
    let n_left = split(lights, place.depth);
    let is_parallel = lights.len() >= PARALLEL_FROM;
    let (left, right) = lights.split_at_mut(n_left);
    let (root, below) = nodes.split_first_mut().expect("a node for each light");
    let (left_nodes, right_nodes) = below.split_at_mut(2 * n_left - 1);
    let at = |first| Place { first, depth: place.depth + 1, ..place };
    let right_ix = place.first + 2 * n_left;
    let (of_left, of_right) = if is_parallel {
        rayon::join(|| build(left, left_nodes, at(place.first + 1)), || build(right, right_nodes, at(right_ix)))
    } else {
        (build(left, left_nodes, at(place.first + 1)), build(right, right_nodes, at(right_ix)))
    };
    let bounds = of_left.union(of_right);
    *root = node(&bounds, place.whole, (right_ix as u32, 0));
    bounds
}

/// Returns a node. `whole`: intensity of the tree.
fn node(bounds: &LightBounds, whole: f64, (next, flags): (u32, u32)) -> LightNode {
    let LightBounds { min, max, cone, intensity } = *bounds;
    LightNode {
        centre: bounds.centre(),
        radius: 0.5 * (max - min).length(),
        axis: cone.axis,
        cos_spread: cone.spread.cos(),
        intensity: (intensity / whole) as f32,
        // The cosine of a right angle in single precision is not 0.
        cos_end: if cone.end < FRAC_PI_2 { cone.end.cos() } else { 0.0 },
        next,
        flags: flags | if cone.is_two_sided { LIGHT_NODE_TWO_SIDED } else { 0 },
    }
}

/// Brings the lights of the left child to the front. Returns their number.
fn split(lights: &mut [TreeLight], depth: u32) -> usize {
    let (mut min, mut max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for light in &*lights {
        (min, max) = (min.min(light.bounds.centre()), max.max(light.bounds.centre()));
    }
    let extent = max - min;
    let bin_of = |light: &TreeLight, axis: usize| {
        let share = (light.bounds.centre()[axis] - min[axis]) / extent[axis];
        ((share * N_BINS as f32) as usize).min(N_BINS - 1)
    };
    let mut best = (f64::INFINITY, 0, 0);
    for axis in (0..3).filter(|&axis| depth < BINNED_DEPTH && extent[axis] > 0.0) {
        let (cost, n_bins) = best_of_axis(lights, |light| bin_of(light, axis));
        // Boxes are cut across their longer edges, if nothing else tells the splits apart.
        let cost = cost * f64::from(extent.max_element() / extent[axis]);
        if cost < best.0 {
            best = (cost, axis, n_bins);
        }
    }
    let (cost, axis, n_bins) = best;
    if cost.is_infinite() {
        let axis = (0..3).max_by(|&a, &b| extent[a].total_cmp(&extent[b])).expect("three axes");
        lights.sort_by(|a, b| a.bounds.centre()[axis].total_cmp(&b.bounds.centre()[axis]));
        return lights.len() / 2;
    }
    // A stable sort: the tree depends on the order of the lights alone.
    lights.sort_by_key(|light| bin_of(light, axis) >= n_bins);
    lights.partition_point(|light| bin_of(light, axis) < n_bins)
}

/// Returns the least cost of a split between bins, and the number of bins to its left. The cost is infinite if all
/// lights are in one bin.
fn best_of_axis(lights: &[TreeLight], bin_of: impl Fn(&TreeLight) -> usize) -> (f64, usize) {
    let joined = |a: Option<LightBounds>, b: Option<LightBounds>| match (a, b) {
        (Some(a), Some(b)) => Some(a.union(b)),
        (a, b) => a.or(b),
    };
    let mut bins = [None; N_BINS];
    for light in lights {
        let bin = &mut bins[bin_of(light)];
        *bin = joined(*bin, Some(light.bounds));
    }
    let mut rights = bins;
    for ix in (0..N_BINS - 1).rev() {
        rights[ix] = joined(rights[ix], rights[ix + 1]);
    }
    let (mut left, mut best) = (None, (f64::INFINITY, 0));
    for n_bins in 1..N_BINS {
        left = joined(left, bins[n_bins - 1]);
        let (Some(left), Some(right)) = (left, rights[n_bins]) else { continue };
        let cost = left.cost() + right.cost();
        if cost < best.0 {
            best = (cost, n_bins);
        }
    }
    best
}
