//! The hierarchy over instances: a binary tree of boxes, built by the surface area heuristic over bins of the boxes'
//! centres (Wald: On fast Construction of SAH-based Bounding Volume Hierarchies, Interactive Ray Tracing 2007). Each
//! leaf is one instance.
//!
//! # Why no ray misses an instance
//!
//! A search transforms a ray to the space of an instance, and finds all hits of the transformed ray, as it does in a
//! scene of that geometry alone. Rounding makes the transformed ray another one than the ray of the world. So the box
//! of an instance has a margin that covers the distance between both. With M the linear map, N its rounded inverse,
//! u = 2^-24, o the ray's origin, d its direction and c the translation, the transformed ray starts at N (o - c) and
//! goes along N d. Each of the sums is rounded 4 times, and each coefficient of N once, so in the world the start is
//! off by at most 5 u |M| |N| |o - c|, and the point at t by 5 u |M| |N| t |d| more. Let m be the largest coordinate of
//! the world's box, and m' the larger one of m and the largest coordinate of c. No coordinate of o exceeds 4 m: for
//! rays from farther away, boxes are enlarged by `TopLevel::pad_from_afar`. So the coordinates of o - c are at most 5
//! m', and those of t d at most 5 m. Where the start is moved along the ray to the geometry's box, that rounds thrice
//! more, by 3 u |M| |N| |o - c|. Let k be `Instance::condition`, the largest sum of a row of |M| |N|. Then the point is
//! off by 65 u k m'. The planes of boxes are off by 35 u m, as those of splits are (bounds.rs). The margin is 68 u m'
//! (k + 1).

use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

use super::bounds::Bounds;
use crate::layout::{Instance, TOP_LEAF, TOP_MAX_DEPTH, TopNode};

/// The margin of an instance's box for each unit of 1 + `Instance::condition`, as a multiple of the largest coordinate
/// of the world.
const MARGIN: f64 = 68.0 / (1 << 24) as f64;
/// Margins enlarge the largest coordinate m', and thus themselves, by at most 1.7 % ([`MAX_CONDITION`]). This factor
/// covers that.
const GROWTH: f64 = 1.02;
/// The greatest `Instance::condition` for which an instance keeps its own space.
pub const MAX_CONDITION: f64 = 4096.0;
/// Bins along the axis of a split.
const N_BINS: usize = 16;
/// Instances below a node from which its children are built by several threads.
const PARALLEL: usize = 512;

/// The hierarchy over the instances of a world.
#[derive(Clone, Debug, PartialEq)]
pub struct TopLevel {
    /// The nodes. Node 0 is the root, and node 1 is unused.
    pub nodes: Vec<TopNode>,
    /// The box that holds all instances, with their margins. World units.
    pub bounds: Bounds,
    /// For rays whose origin is beyond 4 times the largest coordinate of `bounds`: all boxes have to be grown by this
    /// factor times the origin's distance. It is the greatest margin, divided by that coordinate.
    pub pad_from_afar: f32,
}

/// An instance's box.
#[derive(Clone, Copy)]
struct Item {
    bounds: Bounds,
    centre: Vec3,
    instance_ix: u32,
}

/// Returns the box in the world of a box of a geometry's space, without the margin.
fn placed(instance: &Instance, [min, max]: [Vec3; 2]) -> [DVec3; 2] {
    let axes = [instance.axis_x, instance.axis_y, instance.axis_z].map(Vec3::as_dvec3);
    let [from, to] = [min, max].map(|corner| corner.as_dvec3().to_array());
    let (mut low, mut high) = (instance.translation.as_dvec3(), instance.translation.as_dvec3());
    for axis in 0..3 {
        let [a, b] = [from[axis] * axes[axis], to[axis] * axes[axis]];
        low += a.min(b);
        high += a.max(b);
    }
    [low, high]
}

/// Returns the least and the greatest corner, rounded outwards.
fn outwards([low, high]: [DVec3; 2], margin: f64) -> Bounds {
    let (low, high) = ((low - margin).as_vec3(), (high + margin).as_vec3());
    Bounds { min: low.to_array().map(f32::next_down), max: high.to_array().map(f32::next_up) }
}

impl TopLevel {
    /// Builds the hierarchy. `boxes`: of each geometry, with its own margin, in its space. Instances without triangles
    /// are in no leaf; there must be one with triangles. The result does not depend on the number of threads.
    pub fn new(instances: &[Instance], boxes: &[[Vec3; 2]]) -> Self {
        let of_instance = |(ix, instance): (usize, &Instance)| {
            let bounds = placed(instance, boxes[instance.geometry_ix as usize]);
            (instance.n_triangles > 0).then_some((ix, bounds))
        };
        let exact: Vec<_> = instances.par_iter().enumerate().filter_map(of_instance).collect();
        let largest = exact.iter().flat_map(|(_, corners)| corners).map(|corner| corner.abs().max_element());
        let exact_largest = largest.fold(0.0, f64::max);
        let worst = |m: f64| exact.iter().map(|(ix, _)| margin_of(&instances[*ix], m)).fold(0.0, f64::max);
        let largest = GROWTH * (exact_largest + exact_largest * worst(exact_largest));
        let item = |&(ix, corners): &(usize, [DVec3; 2])| {
            let margin = largest * margin_of(&instances[ix], largest);
            let bounds = outwards(corners, margin.max(f64::from(f32::MIN_POSITIVE)));
            let centre = Vec3::from(bounds.min) / 2.0 + Vec3::from(bounds.max) / 2.0;
            Item { bounds, centre, instance_ix: ix as u32 }
        };
        let mut items: Vec<Item> = exact.par_iter().map(item).collect();
        let bounds = union(&items);
        let mut nodes = vec![TopNode::default(); 2 * items.len()];
        let (root, below) = nodes.split_at_mut(2);
        let link = build(&mut items, below, 1, 0, 0);
        root[0] = node_of(&bounds, link, 0);
        Self { nodes, bounds, pad_from_afar: worst(largest) as f32 }
    }
}

/// Returns the margin of an instance's box as a multiple of the largest coordinate of the world.
fn margin_of(instance: &Instance, largest: f64) -> f64 {
    let farthest = f64::from(instance.translation.abs().max_element()).max(largest);
    let relative = if largest > 0.0 { farthest / largest } else { 1.0 };
    MARGIN * relative * (1.0 + f64::from(instance.condition))
}

fn union(items: &[Item]) -> Bounds {
    items.iter().map(|item| item.bounds).reduce(|a, b| a.union(&b)).expect("an instance with triangles")
}

fn node_of(bounds: &Bounds, link: u32, parent: u32) -> TopNode {
    TopNode { box_min: bounds.min.into(), link, box_max: bounds.max.into(), parent }
}

/// Builds all nodes below the node `parent` into `nodes`, whose first pair has the number `pair`. Returns the link of
/// the parent. `depth`: of the parent.
fn build(items: &mut [Item], nodes: &mut [TopNode], pair: u32, parent: u32, depth: u32) -> u32 {
    if let [item] = items {
        return TOP_LEAF | item.instance_ix;
    }
    let n_left = split(items, depth);
    let n = items.len();
    let (left_items, right_items) = items.split_at_mut(n_left);
    let (own, below) = nodes.split_at_mut(2);
    let (left, right) = below.split_at_mut(2 * (n_left - 1));
    let [left_box, right_box] = [union(left_items), union(right_items)];
    let mut build_left = || build(left_items, left, pair + 1, 2 * pair, depth + 1);
    let mut build_right = || build(right_items, right, pair + n_left as u32, 2 * pair + 1, depth + 1);
    let (left_link, right_link) =
        if n >= PARALLEL { rayon::join(build_left, build_right) } else { (build_left(), build_right()) };
    own[0] = node_of(&left_box, left_link, parent);
    own[1] = node_of(&right_box, right_link, parent);
    pair
}

/// Orders items so that those of the first child come first, and returns their number, at least 1 and less than all.
/// `depth`: of the node that is split.
fn split(items: &mut [Item], depth: u32) -> usize {
    let (low, high) = items
        .iter()
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), item| (low.min(item.centre), high.max(item.centre)));
    let extent = high - low;
    let axis = if extent.x >= extent.y && extent.x >= extent.z { 0 } else { 1 + usize::from(extent.z > extent.y) };
    // Halving needs this many levels. What is left of the limit can be spent on splits of other sizes.
    let n_levels_of_halving = usize::BITS - (items.len() - 1).leading_zeros();
    let may_choose = depth + n_levels_of_halving < TOP_MAX_DEPTH;
    let by_bins = (extent[axis] > 0.0 && may_choose).then(|| best_of_bins(items, axis, low[axis], extent[axis]));
    let half = items.len() / 2;
    let halved = |items: &mut [Item]| {
        items.select_nth_unstable_by(half, |a, b| {
            a.centre[axis].total_cmp(&b.centre[axis]).then(a.instance_ix.cmp(&b.instance_ix))
        });
        half
    };
    let Some(last_bin) = by_bins else { return halved(items) };
    let mut n_left = 0;
    for ix in 0..items.len() {
        if bin_of(&items[ix], axis, low[axis], extent[axis]) <= last_bin {
            items.swap(n_left, ix);
            n_left += 1;
        }
    }
    if n_left > 0 && n_left < items.len() { n_left } else { halved(items) }
}

fn bin_of(item: &Item, axis: usize, low: f32, extent: f32) -> usize {
    (((item.centre[axis] - low) / extent * N_BINS as f32) as usize).min(N_BINS - 1)
}

/// Returns the last bin of the first child for the least expected cost.
fn best_of_bins(items: &[Item], axis: usize, low: f32, extent: f32) -> usize {
    let mut bins: [(usize, Option<Bounds>); N_BINS] = [(0, None); N_BINS];
    for item in items {
        let (n, bounds) = &mut bins[bin_of(item, axis, low, extent)];
        *n += 1;
        *bounds = Some(bounds.map_or(item.bounds, |bounds| bounds.union(&item.bounds)));
    }
    let cost = |(n, bounds): (usize, Option<Bounds>)| n as f64 * bounds.map_or(0.0, |bounds| bounds.half_area());
    let add = |a: (usize, Option<Bounds>), b: (usize, Option<Bounds>)| {
        let both = a.1.zip(b.1).map(|(a, b)| a.union(&b));
        (a.0 + b.0, both.or(a.1).or(b.1))
    };
    let mut right = [0.0; N_BINS];
    let mut sum = (0, None);
    for bin in (1..N_BINS).rev() {
        sum = add(sum, bins[bin]);
        right[bin - 1] = cost(sum);
    }
    let (mut best, mut sum) = ((f64::INFINITY, 0), (0, None));
    for bin in 0..N_BINS - 1 {
        sum = add(sum, bins[bin]);
        let of_both = cost(sum) + right[bin];
        // Both children have items.
        if sum.0 > 0 && sum.0 < items.len() && of_both < best.0 {
            best = (of_both, bin);
        }
    }
    best.1
}

/// Returns the largest sum of a row of |M| |N|, at least 1: by how much a linear map and its inverse magnify rounding.
pub fn condition_of(linear: DMat3, inverse: DMat3) -> f64 {
    let abs = |m: DMat3| DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs());
    (abs(linear) * abs(inverse) * DVec3::ONE).max_element().max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Instances of one geometry at pseudo-random places, or all at one place.
    fn instances(n: u32, spread: f32) -> Vec<Instance> {
        let number = |i: u32| {
            let x = (i ^ (i >> 15)).wrapping_mul(0x7feb_352d);
            ((x ^ (x >> 13)).wrapping_mul(0x846c_a68b) >> 8) as f32 / (1 << 24) as f32
        };
        let instance = |i| Instance {
            axis_x: Vec3::X,
            axis_y: Vec3::Y,
            axis_z: Vec3::Z,
            translation: spread * Vec3::new(number(3 * i), number(3 * i + 1), number(3 * i + 2)),
            condition: 1.0,
            n_triangles: 1,
            ..Instance::default()
        };
        (0..n).map(instance).collect()
    }

    const BOX: [[Vec3; 2]; 1] = [[Vec3::splat(-0.5), Vec3::splat(0.5)]];

    /// Walks all nodes, and returns the instances of the leaves. Checks boxes, parents and depths.
    fn leaves(top: &TopLevel, node_ix: u32, depth: u32) -> Vec<u32> {
        assert!(depth <= TOP_MAX_DEPTH);
        let node = &top.nodes[node_ix as usize];
        if node.link & TOP_LEAF != 0 {
            return vec![node.link & !TOP_LEAF];
        }
        let children = [2 * node.link, 2 * node.link + 1];
        let mut found = Vec::new();
        for child_ix in children {
            let child = &top.nodes[child_ix as usize];
            assert_eq!(child.parent, node_ix);
            assert!(child.box_min.cmpge(node.box_min).all() && child.box_max.cmple(node.box_max).all());
            found.extend(leaves(top, child_ix, depth + 1));
        }
        found
    }

    #[test]
    fn every_instance_is_in_one_leaf() {
        for (n, spread) in [(1, 1.0), (2, 0.0), (3, 10.0), (1000, 100.0), (5000, 0.0), (20_000, 1e6)] {
            let top = TopLevel::new(&instances(n, spread), &BOX);
            let mut found = leaves(&top, 0, 0);
            found.sort_unstable();
            assert_eq!(found, (0..n).collect::<Vec<_>>(), "{n} instances");
            assert_eq!(top.nodes.len(), 2 * n as usize);
        }
    }

    #[test]
    fn centres_that_crowd_together_stay_within_the_greatest_depth() {
        // Each is half as far from 0 as the one before, so that a split by bins separates few.
        let place = |(i, mut it): (usize, Instance)| {
            it.translation = Vec3::splat((-(i as f32) / 40.0).exp2());
            it
        };
        let crowded: Vec<_> = instances(4000, 1.0).into_iter().enumerate().map(place).collect();
        assert_eq!(leaves(&TopLevel::new(&crowded, &[[Vec3::splat(-1e-20), Vec3::splat(1e-20)]]), 0, 0).len(), 4000);
    }

    #[test]
    fn instances_without_triangles_are_left_out() {
        let mut some = instances(10, 5.0);
        some[3].n_triangles = 0;
        let mut found = leaves(&TopLevel::new(&some, &BOX), 0, 0);
        found.sort_unstable();
        assert_eq!(found, [0, 1, 2, 4, 5, 6, 7, 8, 9]);
    }
}
