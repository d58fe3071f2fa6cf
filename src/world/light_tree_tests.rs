//! Tests of light trees: their structure, and the probabilities with which lights are sampled from them.

use std::f32::consts::FRAC_PI_2;

use glam::{Vec3, vec3};

use super::{
    light_bounds::{Cone, LightBounds},
    light_tree::{TreeLight, light_tree},
};
use crate::{
    layout::{LIGHT_NODE_LEAF, LIGHT_NODE_TWO_SIDED, LightNode, Triangle},
    reference::{
        chi_square::{LARGEST_DEVIATION, Uniform, deviations},
        emitters::tree::{sample_in_tree, tree_probability},
    },
};

/// Lights without a size, lights of one axis, and triangles of two sides, in a long box.
fn lights(n: usize) -> Vec<TreeLight> {
    let mut random = Uniform(n as u64);
    let light = |ix: usize| {
        let place = random.point() * vec3(100.0, 3.0, 4.0);
        let (axis, size) = ((random.point() - 0.5).normalize_or(Vec3::X), 0.3 * random.point());
        let intensity = f64::from(random.point().x) + 0.1;
        let small = LightBounds { min: place, max: place + size, cone: Cone::ALL, intensity };
        match ix % 4 {
            0 => LightBounds { max: place, ..small },
            1 => LightBounds { cone: Cone::around(axis, FRAC_PI_2, false), ..small },
            2 => LightBounds { cone: Cone::around(axis, 0.5, false), max: place, ..small },
            _ => {
                let t = Triangle { v0: place, v1: place + size, v2: place + axis, ..Triangle::default() };
                LightBounds::of_triangle(&t, intensity)
            }
        }
    };
    with_indices((0..n).map(light))
}

/// Gives lights the indices of entries, of which the first is 5.
fn with_indices(bounds: impl Iterator<Item = LightBounds>) -> Vec<TreeLight> {
    (5..).zip(bounds).map(|(emitter_ix, bounds)| TreeLight { bounds, emitter_ix }).collect()
}

/// Point lights at places.
fn points(places: &[Vec3]) -> Vec<TreeLight> {
    let bounds = |&place| LightBounds { min: place, max: place, cone: Cone::ALL, intensity: 1.0 };
    with_indices(places.iter().map(bounds))
}

/// Returns the index of the leaf of each light.
fn leaves(nodes: &[LightNode], n: usize) -> Vec<u32> {
    let mut leaves = vec![u32::MAX; n];
    for (ix, node) in nodes.iter().enumerate().filter(|(_, node)| node.flags & LIGHT_NODE_LEAF != 0) {
        let leaf = &mut leaves[node.next as usize - 5];
        assert_eq!(*leaf, u32::MAX, "a light has two leaves");
        *leaf = ix as u32;
    }
    assert!(!leaves.contains(&u32::MAX), "a light has no leaf");
    leaves
}

fn probabilities(nodes: &[LightNode], n: usize, point: Vec3) -> Vec<f64> {
    leaves(nodes, n).into_iter().map(|leaf| f64::from(tree_probability(nodes, point, leaf))).collect()
}

/// Points far away, between the lights, and at the middle of nodes.
fn receivers(nodes: &[LightNode]) -> Vec<Vec3> {
    let mut receivers = vec![vec3(-900.0, 3.0, 70.0), Vec3::ZERO, vec3(40.0, 1.0, 1.0), vec3(99.0, -2.0, 5.0)];
    receivers.extend(nodes.iter().step_by(nodes.len() / 5 + 1).map(|node| node.centre));
    receivers
}

/// Checks a node and those below it. Returns the leaves below, and the index behind the last node.
fn check(nodes: &[LightNode], lights: &[TreeLight], ix: usize) -> (Vec<usize>, usize) {
    let node = &nodes[ix];
    if node.flags & LIGHT_NODE_LEAF != 0 {
        return (vec![node.next as usize - 5], ix + 1);
    }
    let (mut below, middle) = check(nodes, lights, ix + 1);
    assert_eq!(middle, node.next as usize, "nodes are in preorder");
    let (others, end) = check(nodes, lights, middle);
    below.extend(others);
    let whole: f64 = lights.iter().map(|light| light.bounds.intensity).sum();
    let mut sum = 0.0;
    for LightBounds { min, max, cone, intensity } in below.iter().map(|&ix| lights[ix].bounds) {
        let farthest = (min - node.centre).abs().max((max - node.centre).abs());
        assert!(farthest.length() <= node.radius * 1.0001 + 1e-4, "{node:?} does not hold {min} {max}");
        let cosine = cone.axis.dot(node.axis);
        let is_two_sided = node.flags & LIGHT_NODE_TWO_SIDED != 0;
        let cosine = if is_two_sided { cosine.abs() } else { cosine };
        let angle = cosine.clamp(-1.0, 1.0).acos() + cone.spread;
        let held = node.cos_spread.clamp(-1.0, 1.0).acos();
        assert!(node.cos_spread < -0.999 || angle <= held + 2e-3, "{node:?} does not hold {cone:?}");
        assert!(is_two_sided || node.cos_spread < -0.999 || !cone.is_two_sided);
        assert!(cone.end.cos() >= node.cos_end - 1e-5);
        sum += intensity / whole;
    }
    assert!((f64::from(node.intensity) - sum).abs() < 1e-5, "{} is not {sum}", node.intensity);
    (below, end)
}

#[test]
fn nodes_hold_what_is_below() {
    for n in [1, 2, 3, 64, 1000] {
        let lights = lights(n);
        let nodes = light_tree(lights.clone());
        let (mut below, end) = check(&nodes, &lights, 0);
        below.sort_unstable();
        assert_eq!((nodes.len(), end), (2 * n - 1, 2 * n - 1));
        assert!(below.into_iter().eq(0..n));
        leaves(&nodes, n);
    }
}

#[test]
#[should_panic(expected = "does not hold")]
fn a_sphere_that_is_too_small_is_noticed() {
    let lights = lights(64);
    let mut nodes = light_tree(lights.clone());
    nodes[0].radius *= 0.8;
    check(&nodes, &lights, 0);
}

#[test]
fn probabilities_of_all_lights_are_whole() {
    let everywhere_alike = vec![Vec3::ONE; 100];
    let in_a_row: Vec<Vec3> = (0..200).map(|ix| vec3(0.0, 1.5_f32.powi(ix / 3), 0.0)).collect();
    let trees = [1, 2, 3, 100, 1000].map(lights).into_iter();
    for lights in trees.chain([points(&everywhere_alike), points(&in_a_row)]) {
        let n = lights.len();
        let nodes = light_tree(lights);
        for point in receivers(&nodes).into_iter().chain([Vec3::ONE]) {
            let sum: f64 = probabilities(&nodes, n, point).iter().sum();
            assert!((sum - 1.0).abs() < 1e-5, "{n} lights from {point}: {sum}");
        }
    }
}

/// The depth bounds how long a search for a light takes, whatever the places of the lights.
#[test]
fn trees_are_not_deep() {
    fn depth(nodes: &[LightNode], ix: usize) -> usize {
        let node = &nodes[ix];
        if node.flags & LIGHT_NODE_LEAF != 0 {
            1
        } else {
            1 + depth(nodes, ix + 1).max(depth(nodes, node.next as usize))
        }
    }
    let growing: Vec<Vec3> = (0..240).map(|ix| vec3(1.4_f32.powi(ix - 120), 0.0, 0.0)).collect();
    assert!(depth(&light_tree(points(&growing)), 0) < 60);
    assert_eq!(depth(&light_tree(points(&[Vec3::ONE; 1024])), 0), 11);
}

/// Samples `n` lights at a point. Returns how often each was sampled. Each sample has the probability that is computed
/// from the leaf.
fn counts(nodes: &[LightNode], n_lights: usize, point: Vec3, n: usize) -> Vec<f64> {
    let (leaves, mut random) = (leaves(nodes, n_lights), Uniform(3));
    let mut counts = vec![0.0; n_lights];
    for _ in 0..n {
        let u = random.point();
        let sample = sample_in_tree(nodes, point, u.x, u.y);
        let light_ix = sample.emitter_ix as usize - 5;
        assert_eq!(sample.probability, tree_probability(nodes, point, leaves[light_ix]));
        counts[light_ix] += 1.0;
    }
    counts
}

#[test]
fn lights_are_sampled_as_often_as_stated() {
    let nodes = light_tree(lights(100));
    for point in receivers(&nodes) {
        let stated = probabilities(&nodes, 100, point);
        let counts = counts(&nodes, 100, point, 100_000);
        let found = deviations(&counts, &stated);
        assert!(found < LARGEST_DEVIATION, "{found} deviations from {point}");
        // Lights whose probability is 0 are never sampled.
        assert!(counts.iter().zip(&stated).all(|(count, stated)| *count == 0.0 || *stated > 0.0));
        // A tree whose left half is a tenth brighter has other probabilities.
        let mut other = nodes.clone();
        other[1].intensity *= 1.1;
        let changed = probabilities(&other, 100, point);
        let found = deviations(&counts, &changed);
        let greatest = stated.iter().zip(&changed).map(|(a, b)| (a - b).abs()).sum::<f64>();
        assert!(found > LARGEST_DEVIATION || greatest < 0.02, "{found} deviations from {point}");
    }
}

/// A float has 24 bits, of which a sample among many lights that are alike needs more.
#[test]
fn rare_lights_are_sampled() {
    let nodes = light_tree(points(&vec![Vec3::ONE; 1 << 14]));
    // Numbers that differ only in the digits that continue the first number.
    let samples = [0.1, 0.9].map(|more| sample_in_tree(&nodes, Vec3::ZERO, 0.3, more));
    assert_eq!(samples[0].probability, 1.0 / (1 << 14) as f32);
    let deep = light_tree(points(&vec![Vec3::ONE; 1 << 17]));
    let mut found: Vec<u32> =
        (0..64).map(|ix| sample_in_tree(&deep, Vec3::ZERO, 0.3, ix as f32 / 64.0).emitter_ix).collect();
    found.dedup();
    assert_eq!(found.len(), 1, "24 bits tell 2^17 lights apart");
    let mut nodes = deep;
    // The light is in the half that has the share 2^-10.
    nodes[1].intensity /= 1024.0;
    let samples = (0..64).map(|ix| sample_in_tree(&nodes, Vec3::ZERO, 0.0003, ix as f32 / 64.0).emitter_ix);
    let mut found: Vec<u32> = samples.collect();
    found.sort_unstable();
    found.dedup();
    assert!(found.len() > 4, "{found:?}");
}

/// A light that shines at a point can be sampled there, from near and from afar.
#[test]
fn what_shines_can_be_sampled() {
    let lights = lights(400);
    let nodes = light_tree(lights.clone());
    let mut n_dark = 0;
    let mut random = Uniform(9);
    for _ in 0..300 {
        let point = random.point() * vec3(140.0, 9.0, 9.0) - 3.0;
        for (probability, light) in probabilities(&nodes, 400, point).into_iter().zip(&lights) {
            let LightBounds { min, max, cone, .. } = light.bounds;
            let cosine = cone.axis.dot((point - 0.5 * (min + max)).normalize());
            let shines = cone.spread > 3.0 || cone.is_two_sided || cosine > cone.end.cos() + 1e-3;
            assert!(probability > 0.0 || !shines, "{light:?} at {point}");
            n_dark += usize::from(probability == 0.0);
        }
    }
    assert!(n_dark > 1000, "lights that shine elsewhere are not sampled: {n_dark}");
}

#[test]
fn near_lights_are_sampled_more_often() {
    let nodes = light_tree(points(&[vec3(1.0, 0.0, 0.0), vec3(0.0, 10.0, 0.0)]));
    let stated = probabilities(&nodes, 2, Vec3::ZERO);
    assert!((stated[0] / stated[1] - 100.0).abs() < 0.01, "{stated:?}");
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let lights = lights(20_000);
    let on = |n_threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().expect("threads");
        pool.install(|| light_tree(lights.clone()))
    };
    assert!(on(1) == on(5));
}
