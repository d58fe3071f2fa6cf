//! Twin of the kernels `kdtree_*`: builds the tree that a device builds, one node after the other in depth-first order,
//! if no capacity is passed. The trees are the same on devices whose divisions are correctly rounded.

use crate::{
    accel::{
        bounds::{Bounds, is_finite},
        kdtree::BuildOptions,
    },
    layout::{KD_BINS, KD_LEAF, KD_NO_AXIS, KD_PAIR_SHIFT, KD_SMALL_CELL, KD_WORD_DEPTH, KdNode, Triangle},
};

/// Bounds of a reference and its triangle.
type Reference = (Bounds, u32);

/// Arrays of a tree ([`KdArrays`](crate::accel::kdtree::KdArrays)), without planes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tree {
    pub nodes: Vec<KdNode>,
    pub parents: Vec<u32>,
    pub leaf_triangles: Vec<u32>,
}

/// The most corners of a clipped triangle.
const MAX_CORNERS: usize = 9;

/// Inputs of a build.
struct Input<'a> {
    triangles: &'a [Triangle],
    options: &'a BuildOptions,
    /// The margin of all triangles, world units.
    margin: f32,
}

/// Builds the tree of triangles that all have scale 0 (scales.rs).
pub fn kdtree_build(triangles: &[Triangle], options: &BuildOptions) -> Tree {
    let exact_bounds = Bounds::of_all(triangles);
    let margin = exact_bounds.margin();
    let leaf = KdNode { split_or_first: 0, axis_and_child: KD_LEAF };
    let mut tree = Tree { nodes: vec![leaf; 2], parents: vec![0], leaf_triangles: Vec::new() };
    let finite = triangles.iter().zip(0..).filter(|(triangle, _)| is_finite(triangle));
    let references = finite.map(|(triangle, ix)| (Bounds::of(triangle).grown(margin), ix)).collect();
    node(&Input { triangles, options, margin }, &mut tree, (0, 0), &exact_bounds.grown(margin), references);
    tree
}

fn node(input: &Input, tree: &mut Tree, (node_ix, level): (usize, u32), cell: &Bounds, references: Vec<Reference>) {
    let Some((axis, position)) = choose(input, level, cell, &references) else {
        let (first, count) = (tree.leaf_triangles.len() as u32, references.len() as u32);
        tree.nodes[node_ix] = KdNode { split_or_first: first, axis_and_child: count << KD_PAIR_SHIFT | KD_LEAF };
        tree.leaf_triangles.extend(references.iter().map(|(_, triangle_ix)| triangle_ix));
        return;
    };
    let pair_ix = tree.parents.len();
    let axis_and_child = (pair_ix as u32) << KD_PAIR_SHIFT | axis as u32;
    tree.nodes[node_ix] = KdNode { split_or_first: position.to_bits(), axis_and_child };
    tree.nodes.resize(2 * pair_ix + 2, KdNode { split_or_first: 0, axis_and_child: KD_LEAF });
    tree.parents.push(node_ix as u32);
    let (mut below, mut above) = (Vec::new(), Vec::new());
    for reference in &references {
        let pieces = sort_out(input, cell, (axis, position), reference);
        below.extend(pieces[0]);
        above.extend(pieces[1]);
    }
    let children = cell.split(axis, position);
    node(input, tree, (2 * pair_ix, level + 1), &children[0], below);
    node(input, tree, (2 * pair_ix + 1, level + 1), &children[1], above);
}

/// Twin of `Areas` in kd_areas.glsl.
struct Areas {
    axis: usize,
    least: f32,
    greatest: f32,
    quarter: f32,
    per_quarter: f32,
    base: f32,
    slope: f32,
    empty_factor: f32,
}

impl Areas {
    fn new(cell: &Bounds, axis: usize, options: &BuildOptions) -> Option<Self> {
        let quarters = [0, 1, 2].map(|k| 0.25 * cell.max[k] - 0.25 * cell.min[k]);
        let longest = quarters.into_iter().fold(f32::NEG_INFINITY, f32::max);
        let [side, u, v] = [axis, (axis + 1) % 3, (axis + 2) % 3].map(|k| quarters[k] / longest);
        let half_area = side * u + side * v + u * v;
        let limits = f32::from_bits((127 - 117) << 23)..=0.25 * f32::MAX;
        (limits.contains(&quarters[axis]) && half_area > 0.0).then(|| Self {
            axis,
            least: cell.min[axis],
            greatest: cell.max[axis],
            quarter: quarters[axis],
            per_quarter: 1.0 / quarters[axis],
            base: u * v / half_area,
            slope: side * (u + v) / half_area,
            empty_factor: 1.0 - options.empty_bonus,
        })
    }

    fn fraction(&self, position: f32) -> f32 {
        (0.25 * position - 0.25 * self.least) * self.per_quarter
    }

    fn weight(&self, position: f32, [n_below, n_above]: [u32; 2]) -> f32 {
        let fraction = self.fraction(position);
        let below = self.base + self.slope * fraction;
        let above = self.base + self.slope * (1.0 - fraction);
        let weight = below * n_below as f32 + above * n_above as f32;
        if n_below == 0 || n_above == 0 { weight * self.empty_factor } else { weight }
    }

    fn bin(&self, position: f32) -> usize {
        (self.fraction(position) * KD_BINS as f32).clamp(0.0, (KD_BINS - 1) as f32) as usize
    }
}

/// Maps floats to integers of the same order.
fn ordered(x: f32) -> u32 {
    let bits = x.to_bits();
    bits ^ if bits >> 31 == 1 { u32::MAX } else { 1 << 31 }
}

/// A split as integers that sort by weight, axis and position, and its position.
type Best = ([u32; 3], f32);

fn consider(best: &mut Best, areas: &Areas, position: f32, n: [u32; 2]) {
    if position > areas.least && position < areas.greatest {
        let split = [areas.weight(position, n).to_bits(), areas.axis as u32, ordered(position)];
        if split < best.0 {
            *best = (split, position);
        }
    }
}

/// Twin of kdtree_choose.comp: the axis and the position of the cheapest split, none if a leaf is cheaper.
fn choose(input: &Input, level: u32, cell: &Bounds, references: &[Reference]) -> Option<(usize, f32)> {
    let options = input.options;
    let n = references.len();
    let leaf_cost = options.intersection_cost * n as f32;
    if leaf_cost <= options.traversal_cost || level >= options.depth_limit().min(KD_WORD_DEPTH) {
        return None;
    }
    let mut best = ([f32::INFINITY.to_bits(), KD_NO_AXIS, u32::MAX], 0.0);
    for areas in (0..3).filter_map(|axis| Areas::new(cell, axis, options)) {
        if n <= KD_SMALL_CELL as usize {
            consider_all(&mut best, &areas, references);
        } else {
            consider_bins(&mut best, &areas, references);
        }
    }
    let cost = options.traversal_cost + options.intersection_cost * f32::from_bits(best.0[0]);
    (best.0[1] < KD_NO_AXIS && cost < leaf_cost).then_some((best.0[1] as usize, best.1))
}

fn consider_all(best: &mut Best, areas: &Areas, references: &[Reference]) {
    let axis = areas.axis;
    for position in references.iter().flat_map(|(bounds, _)| [bounds.min[axis], bounds.max[axis]]) {
        let count = |is_on: &dyn Fn(&Bounds) -> bool| references.iter().filter(|(b, _)| is_on(b)).count() as u32;
        let n = [count(&|b| b.min[axis] < position), count(&|b| b.max[axis] > position)];
        consider(best, areas, position, n);
    }
}

fn consider_bins(best: &mut Best, areas: &Areas, references: &[Reference]) {
    let n = references.len() as u32;
    let mut begins = vec![Vec::new(); KD_BINS as usize];
    let mut ends = begins.clone();
    for (bounds, _) in references {
        let (begin, end) = (bounds.min[areas.axis], bounds.max[areas.axis]);
        begins[areas.bin(begin)].push(begin);
        ends[areas.bin(end)].push(end);
    }
    let mut before = [0, 0];
    for (bin, (begins, ends)) in begins.iter().zip(&ends).enumerate() {
        let after = [before[0] + begins.len() as u32, before[1] + ends.len() as u32];
        if let Some(&least) = begins.iter().min_by_key(|&&x| ordered(x)) {
            consider(best, areas, least, [before[0], n - before[1]]);
        }
        if let Some(&greatest) = ends.iter().max_by_key(|&&x| ordered(x)) {
            consider(best, areas, greatest, [after[0], n - after[1]]);
        }
        let edge = 4.0 * (0.25 * areas.least + areas.quarter * ((bin + 1) as f32 / KD_BINS as f32));
        consider(best, areas, edge, [after[0], n - after[1]]);
        before = after;
    }
}

/// Twin of kdtree_sort_out.comp: a reference's pieces below and above a plane.
fn sort_out(
    input: &Input,
    cell: &Bounds,
    (axis, position): (usize, f32),
    &(bounds, triangle_ix): &Reference,
) -> [Option<Reference>; 2] {
    if bounds.max[axis] <= position {
        return [Some((bounds, triangle_ix)), None];
    }
    if bounds.min[axis] >= position {
        return [None, Some((bounds, triangle_ix))];
    }
    let pieces = bounds.split(axis, position);
    if !(f32::from_bits((127 - 90) << 23)..=f32::from_bits((127 + 110) << 23)).contains(&input.margin) {
        return pieces.map(|piece| Some((piece, triangle_ix)));
    }
    let triangle = &input.triangles[triangle_ix as usize];
    let reach = input.margin + slack_of(triangle);
    let mut polygon = vec![triangle.v0.to_array(), triangle.v1.to_array(), triangle.v2.to_array()];
    for face in 0..3 {
        for (is_above, limit) in [(false, cell.min[face] - reach), (true, cell.max[face] + reach)] {
            let Some(kept) = cut(&polygon, face, is_above, limit) else {
                return pieces.map(|piece| Some((piece, triangle_ix)));
            };
            polygon = kept;
        }
    }
    let piece = |limits: &Bounds, is_below, limit| {
        let corners = cut_off(&polygon, axis, is_below, limit).0;
        let point = |p: &[f32; 3]| Bounds { min: p.map(|x| x - reach), max: p.map(|x| x + reach) };
        let bounds = corners.iter().map(point).reduce(|a, b| a.union(&b))?.intersection(limits);
        (0..3).all(|k| bounds.min[k] <= bounds.max[k]).then_some((bounds, triangle_ix))
    };
    [piece(&pieces[0], true, position + reach), piece(&pieces[1], false, position - reach)]
}

/// Room for the rounding of clipping, whose proof is in kd_clip.glsl.
fn slack_of(triangle: &Triangle) -> f32 {
    let bounds = Bounds::of(triangle);
    let extent = [0, 1, 2].map(|k| bounds.max[k] - bounds.min[k]).into_iter().fold(0.0, f32::max);
    let unit = 1.0 / (1 << 24) as f32;
    9.0 * unit * bounds.largest_coordinate() + 20.0 * unit * extent
}

/// Twin of `cut` in kd_clip.glsl: cuts off what is above a plane, or below it. Returns none if there are too many
/// corners.
fn cut(polygon: &[[f32; 3]], axis: usize, is_above: bool, position: f32) -> Option<Vec<[f32; 3]>> {
    let (kept, has_room) = cut_off(polygon, axis, is_above, position);
    has_room.then_some(kept)
}

/// Returns what is left, and whether the kernel has room for it, which replaces the corners that it has read.
fn cut_off(polygon: &[[f32; 3]], axis: usize, is_above: bool, position: f32) -> (Vec<[f32; 3]>, bool) {
    let is_out = |p: &[f32; 3]| if is_above { p[axis] > position } else { p[axis] < position };
    if !polygon.iter().any(is_out) {
        return (polygon.to_vec(), true);
    }
    let mut kept = Vec::new();
    let mut has_room = true;
    let before = polygon.iter().cycle().skip(polygon.len() - 1);
    for (i, (a, b)) in before.zip(polygon).enumerate() {
        if is_out(a) != is_out(b) {
            kept.push(crossing(a, b, axis, position));
        }
        if !is_out(b) {
            kept.push(*b);
        }
        has_room &= kept.len() <= MAX_CORNERS.min(i + 2);
    }
    (kept, has_room)
}

fn crossing(a: &[f32; 3], b: &[f32; 3], axis: usize, position: f32) -> [f32; 3] {
    let along = b[axis] - a[axis];
    let t = if along.abs() < f32::from_bits((127 - 100) << 23) { 0.5 } else { (position - a[axis]) / along };
    let t = t.clamp(0.0, 1.0);
    [0, 1, 2].map(|k| a[k] + t * (b[k] - a[k]))
}
