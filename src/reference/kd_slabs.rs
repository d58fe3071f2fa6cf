//! Slabs of a kd-tree. Twin of the kernels `kd_slab_*`, whose shared files in `kdtree/slab_*.glsl` define the terms and
//! prove the bounds.

use glam::Vec3;

use crate::{
    accel::kdtree::{KdTree, Node},
    layout::{KD_PLANE_EPSILON, KD_SLAB_MAX_ENTRIES, KD_SLAB_SMALL, KdSlabTree, SCAN_GROUP_SIZE, Slab, Triangle},
};

const MAX_CORNERS: usize = 9;
const SLACK: f32 = 1.0 / (1 << 15) as f32;
const LEAST_COORDINATE: f32 = 1.0 / (1u64 << 60) as f32;
const LEAST_AREA: f32 = 1e-18;
const N_SQUARINGS: u32 = 6;
const REACH: f32 = 1.0625;
const THICKENING: f32 = 1.000_001;
const LEAST_COMPONENT: f32 = 7.8886e-31;
const MOST_COMPONENT: f32 = 1.2676e30;

/// Returns the slab of each node of a tree, zeros for a node without.
pub fn kd_slabs(tree: &KdTree, triangles: &[Triangle]) -> Vec<Slab> {
    Builder::new(tree, triangles).slabs()
}

/// A range of entries: the first one and their number.
type Range = (usize, usize);

/// A cell: its least and its greatest corner, world units.
type Cell = [Vec3; 2];

struct Builder<'a> {
    tree: &'a KdTree,
    triangles: &'a [Triangle],
    constants: KdSlabTree,
    /// The entries below each node.
    ranges: Vec<Range>,
    cells: Vec<Cell>,
    /// The leaf of each entry.
    entry_leaves: Vec<usize>,
}

/// Extent of a surface along its normal, and the coarsest scale of its triangles.
struct Extent {
    low: f32,
    high: f32,
    scale: u32,
}

impl<'a> Builder<'a> {
    fn new(tree: &'a KdTree, triangles: &'a [Triangle]) -> Self {
        let mut ranges = vec![(0, 0); tree.nodes().len()];
        let mut cells = vec![[tree.box_min(), tree.box_max()]; tree.nodes().len()];
        let mut entry_leaves = vec![0; tree.leaf_triangles().len()];
        for node_ix in 0..tree.nodes().len() {
            if let Node::Split { axis, position, child } = tree.node(node_ix as u32) {
                let cell = cells[node_ix];
                let [below, above] = &mut cells[child as usize..][..2] else { unreachable!("a pair of children") };
                (*below, *above) = (cell, cell);
                below[1][axis] = position;
                above[0][axis] = position;
            }
        }
        for node_ix in (0..tree.nodes().len()).rev() {
            ranges[node_ix] = match tree.node(node_ix as u32) {
                Node::Leaf { first, count } => (first as usize, count as usize),
                Node::Split { child, .. } => {
                    let [below, above] = [ranges[child as usize], ranges[child as usize + 1]];
                    (below.0, below.1 + above.1)
                }
            };
            if let Node::Leaf { first, count } = tree.node(node_ix as u32) {
                entry_leaves[first as usize..][..count as usize].fill(node_ix);
            }
        }
        Self { tree, triangles, constants: tree.slab_tree(), ranges, cells, entry_leaves }
    }

    fn slabs(&self) -> Vec<Slab> {
        let areas: Vec<Vec3> = (0..self.entry_leaves.len()).map(|entry| area_of(&self.piece_of(entry).0)).collect();
        let slab_of = |node_ix: usize| {
            let (share, range) = (self.thickest_share(node_ix), self.ranges[node_ix]);
            if share == 0.0 {
                return Slab::default();
            }
            let normal = main_axis(&sum_over(&areas[range.0..][..range.1]));
            if normal == Vec3::ZERO {
                return Slab::default();
            }
            self.slab_around(node_ix, normal, &self.extent_of(node_ix, normal), share)
        };
        (0..self.ranges.len()).map(slab_of).collect()
    }

    fn thickest_share(&self, node_ix: usize) -> f32 {
        let n_entries = self.ranges[node_ix].1;
        if n_entries == 0 || n_entries > KD_SLAB_MAX_ENTRIES as usize {
            return 0.0;
        }
        if let Node::Leaf { .. } = self.tree.node(node_ix as u32) {
            return if n_entries >= 2 { 0.3 } else { 0.0 };
        }
        let limit = [8, 32, 128, 512, 2048].into_iter().find(|limit| n_entries <= *limit).expect("one of the limits");
        let parent = self.tree.parents()[node_ix / 2] as usize;
        if node_ix == 0 || self.ranges[parent].1 > limit { 0.2 } else { 0.0 }
    }

    fn largest_of_cell(&self) -> f32 {
        self.constants.box_min.abs().max(self.constants.box_max.abs()).max_element()
    }

    fn world_scale(&self) -> f32 {
        f32::from_bits((255 - (self.largest_of_cell().to_bits() >> 23)) << 23)
    }

    fn scaled_centre(&self, [min, max]: Cell) -> Vec3 {
        0.5 * (self.world_scale() * min + self.world_scale() * max)
    }

    /// Returns the corners of an entry's piece from the centre of its leaf's cell, D, and the scale of its triangle.
    fn piece_of(&self, entry_ix: usize) -> (Vec<Vec3>, f32, u32) {
        let triangle = &self.triangles[self.tree.leaf_triangles()[entry_ix] as usize];
        let cell = self.cells[self.entry_leaves[entry_ix]];
        let (world_scale, centre) = (self.world_scale(), self.scaled_centre(cell));
        let corners = [triangle.v0, triangle.v1, triangle.v2];
        let local = corners.map(|v| snapped(world_scale * v - centre));
        let [low, high] = cell.map(|corner| world_scale * corner - centre);
        let greatest = local.into_iter().fold((-low).max(high), |most, v| most.max(v.abs()));
        let reach = greatest.max_element();
        let scale = self.scale_of_length(corners.into_iter().fold(0.0, |most, v| v.abs().max_element().max(most)));
        let margin = world_scale * self.constants.margin * length_of(scale) + SLACK * reach;
        let [low, high] = [snapped(low - margin), snapped(high + margin)];
        let mut piece = Some(local.to_vec());
        for axis in 0..3 {
            piece = piece.and_then(|piece| clipped(piece, axis, -1.0, low[axis]));
            piece = piece.and_then(|piece| clipped(piece, axis, 1.0, high[axis]));
        }
        (piece.unwrap_or(local.to_vec()), reach, scale)
    }

    fn scale_of_length(&self, extent: f32) -> u32 {
        let exponent = ((self.constants.largest / extent).to_bits() >> 23).saturating_sub(127);
        exponent.min(self.constants.finest_scale)
    }

    fn extent_of(&self, node_ix: usize, normal: Vec3) -> Extent {
        let (first, count) = self.ranges[node_ix];
        let mut extent = Extent { low: f32::INFINITY, high: f32::NEG_INFINITY, scale: u32::MAX };
        for entry_ix in first..first + count {
            let (piece, reach, scale) = self.piece_of(entry_ix);
            let leaf_cell = self.cells[self.entry_leaves[entry_ix]];
            let shift = self.scaled_centre(leaf_cell) - self.scaled_centre(self.cells[node_ix]);
            let slack = SLACK * reach.max(shift.abs().max_element());
            for corner in piece {
                let height = normal.dot(corner + shift);
                extent.low = extent.low.min(height - slack);
                extent.high = extent.high.max(height + slack);
            }
            extent.scale = extent.scale.min(scale);
        }
        extent
    }

    fn slab_around(&self, node_ix: usize, normal: Vec3, extent: &Extent, share: f32) -> Slab {
        let (world_scale, cell) = (self.world_scale(), self.cells[node_ix]);
        let longest = (world_scale * cell[1] - world_scale * cell[0]).max_element();
        let thickness = extent.high - extent.low;
        if thickness.is_nan() || thickness > share * longest {
            return Slab::default();
        }
        let largest = cell[0].abs().max(cell[1].abs()).max_element();
        let length = length_of(extent.scale.min(self.scale_of_length(largest)));
        let reach = REACH * KD_PLANE_EPSILON * (world_scale * self.largest_of_cell()) * length;
        let half = THICKENING * (0.5 * thickness + reach);
        let normal = normal / half;
        let offset = normal.dot(self.scaled_centre(cell)) + 0.5 * (extent.low + extent.high) / half;
        let in_world = normal * world_scale;
        let component = in_world.abs().max_element();
        if !(LEAST_COMPONENT..=MOST_COMPONENT).contains(&component) {
            return Slab::default();
        }
        Slab { normal: in_world, offset }
    }
}

fn length_of(scale: u32) -> f32 {
    f32::from_bits((127 - scale) << 23)
}

fn snapped(v: Vec3) -> Vec3 {
    Vec3::select(v.abs().cmplt(Vec3::splat(LEAST_COORDINATE)), Vec3::ZERO, v)
}

/// Cuts off what is above a position on an axis (`side` 1) or below it (-1). Returns none if there is no room.
fn clipped(piece: Vec<Vec3>, axis: usize, side: f32, position: f32) -> Option<Vec<Vec3>> {
    let height = |v: &Vec3| side * (v[axis] - position);
    if !piece.iter().any(|corner| height(corner) > 0.0) {
        return Some(piece);
    }
    let mut kept = Vec::new();
    let before = piece.last().into_iter().chain(&piece);
    for (i, (a, b)) in before.zip(&piece).enumerate() {
        let (height_a, height_b) = (height(a), height(b));
        if (height_a > 0.0 && height_b < 0.0) || (height_a < 0.0 && height_b > 0.0) {
            kept.push(snapped(a + height_a / (height_a - height_b) * (b - a)));
        }
        if height_b <= 0.0 {
            kept.push(*b);
        }
        // The kernel has no room for more, since it overwrites corners that it has read.
        if kept.len() > MAX_CORNERS.min(i + 2) {
            return None;
        }
    }
    Some(kept)
}

fn area_of(piece: &[Vec3]) -> Vec3 {
    let Some((apex, rest)) = piece.split_first() else { return Vec3::ZERO };
    rest.windows(2).fold(Vec3::ZERO, |area, edge| area + (edge[0] - apex).cross(edge[1] - apex))
}

/// A symmetric matrix: its diagonal, and the elements yz, zx and xy.
#[derive(Clone, Copy, Default)]
struct Tensor {
    diagonal: Vec3,
    mixed: Vec3,
}

impl Tensor {
    fn add_area(&mut self, area: Vec3) {
        let size = area.length();
        if size > LEAST_AREA {
            let share = area / size;
            self.diagonal += area * share;
            self.mixed += yzx(area) * zxy(share);
        }
    }

    fn plus(self, other: Self) -> Self {
        Self { diagonal: self.diagonal + other.diagonal, mixed: self.mixed + other.mixed }
    }
}

fn yzx(v: Vec3) -> Vec3 {
    Vec3::new(v.y, v.z, v.x)
}

fn zxy(v: Vec3) -> Vec3 {
    Vec3::new(v.z, v.x, v.y)
}

/// Returns the sum over area vectors, in the order of the kernels.
fn sum_over(areas: &[Vec3]) -> Tensor {
    let n_lanes = if areas.len() > KD_SLAB_SMALL as usize { SCAN_GROUP_SIZE as usize } else { 1 };
    let mut sums = vec![Tensor::default(); n_lanes];
    for (ix, &area) in areas.iter().enumerate() {
        sums[ix % n_lanes].add_area(area);
    }
    while sums.len() > 1 {
        let upper = sums.split_off(sums.len() / 2);
        sums.iter_mut().zip(upper).for_each(|(sum, other)| *sum = sum.plus(other));
    }
    sums[0]
}

fn trace_of(diagonal: Vec3) -> f32 {
    diagonal.x + diagonal.y + diagonal.z
}

/// Returns the axis of the largest eigenvalue, of unit length, or 0 if the tensor is 0.
fn main_axis(tensor: &Tensor) -> Vec3 {
    let trace = trace_of(tensor.diagonal);
    if trace.is_nan() || trace <= LEAST_AREA {
        return Vec3::ZERO;
    }
    let (mut d, mut m) = (tensor.diagonal / trace, tensor.mixed / trace);
    for _ in 0..N_SQUARINGS {
        let squared = d * d + zxy(m) * zxy(m) + yzx(m) * yzx(m);
        let trace = trace_of(squared);
        m = (m * (yzx(d) + zxy(d)) + yzx(m) * zxy(m)) / trace;
        d = squared / trace;
    }
    let columns = [Vec3::new(d.x, m.z, m.y), Vec3::new(m.z, d.y, m.x), Vec3::new(m.y, m.x, d.z)];
    let of_y = usize::from(d.y > d.x);
    columns[if d.z > d.x.max(d.y) { 2 } else { of_y }].normalize()
}
