//! Eight rays through the tree together (Wald et al., "Interactive rendering with coherent ray tracing", 2001): a node is
//! read and a plane is tried once for all that go the same way. Every ray finds what it would find alone, bit for bit: a
//! packet visits the leaves of all its rays, and a triangle that only another ray needs is one that this one misses.

use std::array::from_fn;

use glam::{Vec3A, Vec4};
use wide::f32x8;

use super::{
    bindings::Bindings,
    kdtree::{Cell, Pending, TraversalRay, axis_of, is_done, largest_coordinate, search_cell},
    leaf::{Target, entries_of, intersect},
    pending_stack::PendingStack,
    table::Reads,
    traverser::Probe,
    triangle::Shear,
};
use crate::layout::{Hit, KD_CHILD_SHIFT, KD_LEAF, KD_MAX_DEPTH, KD_PLANE_REACH, KdNode, Plane};

/// Rays of a packet.
pub const LANES: usize = 8;

/// Triangles of a leaf whose planes are tried before the first of them is tested.
const BLOCK: usize = 8;

/// Where the rays are in a cell. A ray that is not in it enters after it leaves.
#[derive(Clone, Copy)]
struct Interval {
    enter: f32x8,
    exit: f32x8,
}

/// One bit a ray.
type Lanes = u32;

/// The rays as columns, and what each has found.
struct Packet {
    origin: [f32x8; 3],
    direction: [f32x8; 3],
    inv_direction: [f32x8; 3],
    /// Where the rays meet the plane at 0 on each axis, in t.
    bias: [f32x8; 3],
    plane_reach: f32,
    targets: [Target; LANES],
    best: [Hit; LANES],
    /// The rays' `best` t; before everything where a ray is done.
    t_best: f32x8,
}

/// The working memory of a thread.
pub struct PacketTraverser {
    pub single: PendingStack,
    entries: [(u32, Interval); KD_MAX_DEPTH as usize],
    size: usize,
}

impl Interval {
    fn empty() -> Self {
        Self { enter: f32x8::splat(1.0), exit: f32x8::splat(0.0) }
    }

    /// The rays that are in the cell.
    #[inline(always)]
    fn lanes(&self) -> Lanes {
        self.enter.simd_le(self.exit).to_bitmask()
    }

    /// Without the other rays.
    fn of(self, lanes: Lanes) -> Self {
        let is_in = |lane: usize| lanes >> lane & 1 == 1;
        let (enter, exit) = (self.enter.to_array(), self.exit.to_array());
        Self {
            enter: from_fn(|i| if is_in(i) { enter[i] } else { 1.0 }).into(),
            exit: from_fn(|i| if is_in(i) { exit[i] } else { 0.0 }).into(),
        }
    }
}

fn columns(of: impl Fn(usize) -> [f32; 3]) -> [f32x8; 3] {
    let rows: [[f32; 3]; LANES] = from_fn(of);
    from_fn(|axis| from_fn(|lane| rows[lane][axis]).into())
}

impl Packet {
    /// The packet, and where its rays are in the root's cell: the operations of `TraversalRay::new`.
    #[inline(always)]
    fn new(bindings: &Bindings<impl Reads>, probes: &[Probe]) -> (Self, Interval) {
        // Missing rays copy the first, and are in no cell.
        let probe = |lane: usize| probes.get(lane).unwrap_or(&probes[0]);
        let origin = columns(|lane| probe(lane).ray.origin.to_array());
        let direction = columns(|lane| probe(lane).ray.direction.to_array());
        let tiny = f32x8::splat(1e-12);
        let inv_direction = direction.map(|d| 1.0 / d.abs().simd_lt(tiny).select(tiny, d));
        let bias = from_fn(|i| -origin[i] * inv_direction[i]);
        let at = |corner: [f32; 3]| from_fn(|i| f32x8::splat(corner[i]) * inv_direction[i] + bias[i]);
        let t0: [f32x8; 3] = at(bindings.frame.cell_min.to_array());
        let t1: [f32x8; 3] = at(bindings.frame.cell_max.to_array());
        let near: [f32x8; 3] = from_fn(|i| t0[i].fast_min(t1[i]));
        let far: [f32x8; 3] = from_fn(|i| t0[i].fast_max(t1[i]));
        let t_min: f32x8 = from_fn(|lane| probe(lane).t_min).into();
        let t_max: f32x8 = from_fn(|lane| probe(lane).ray.t_max).into();
        let whole = Interval {
            enter: near[0].fast_max(near[1]).fast_max(near[2].fast_max(t_min)),
            exit: far[0].fast_min(far[1]).fast_min(far[2].fast_min(t_max)),
        };
        let packet = Self {
            origin,
            direction,
            inv_direction,
            bias,
            plane_reach: KD_PLANE_REACH * largest_coordinate(bindings),
            targets: from_fn(|lane| probe(lane).target()),
            best: from_fn(|lane| probe(lane).miss()),
            t_best: t_max,
        };
        (packet, whole.of((1 << probes.len()) - 1))
    }

    /// The rays that go the same way as one of them on all axes.
    #[inline(always)]
    fn like(&self, lane: u32) -> Lanes {
        let same = |d: f32x8| {
            let below = d.simd_lt(f32x8::splat(0.0)).to_bitmask();
            if below >> lane & 1 == 1 { below } else { !below }
        };
        self.inv_direction.map(same).into_iter().fold(!0, |all, axis| all & axis)
    }

    /// Which of the rays do not keep to one side of a plane within the cell.
    #[inline(always)]
    fn near_plane(&self, plane: &Plane, from: &[f32x8; 3], to: &[f32x8; 3]) -> Lanes {
        let [x, y, z] = plane.normal.to_array().map(f32x8::splat);
        let height = |p: &[f32x8; 3]| x * p[0] + y * p[1] + z * p[2] - f32x8::splat(plane.distance);
        let (height_from, height_to) = (height(from), height(to));
        let one_side = (height_from * height_to).simd_gt(f32x8::splat(0.0));
        let apart = height_from.abs().fast_min(height_to.abs()).simd_gt(f32x8::splat(self.plane_reach));
        !(one_side & apart).to_bitmask()
    }

    /// The leaf's triangles against the rays that are in it.
    #[inline(always)]
    fn intersect_leaf<const ANY_HIT: bool>(&mut self, bindings: &Bindings<impl Reads>, leaf: KdNode, cell: &Interval) {
        let entries = entries_of(leaf);
        if entries.is_empty() {
            return;
        }
        let in_cell = cell.lanes();
        let at = |t: f32x8| from_fn(|i| self.origin[i] + t * self.direction[i]);
        let (from, to) = (at(cell.enter), at(cell.exit.fast_min(self.t_best)));
        // Planes first, triangles after: so that the loads of several triangles are on their way at once.
        for (triangles, first) in bindings.leaf_triangles[entries.clone()].chunks(BLOCK).zip(entries.step_by(BLOCK)) {
            let mut near = [0; BLOCK];
            for (lanes, entry) in near.iter_mut().zip(first..first + triangles.len()) {
                let plane = bindings.leaf_planes.get(entry);
                *lanes = in_cell & plane.map_or(!0, |plane| self.near_plane(plane, &from, &to));
            }
            for (&triangle_ix, mut lanes) in triangles.iter().zip(near) {
                while lanes != 0 {
                    let lane = lanes.trailing_zeros() as usize;
                    intersect(bindings, &self.targets[lane], triangle_ix, &mut self.best[lane]);
                    lanes &= lanes - 1;
                }
            }
        }
        self.note_best::<ANY_HIT>();
    }

    #[inline(always)]
    fn note_best<const ANY_HIT: bool>(&mut self) {
        let t_best = |hit: &Hit| if is_done::<ANY_HIT>(hit) { f32::NEG_INFINITY } else { hit.t };
        self.t_best = from_fn(|lane| t_best(&self.best[lane])).into();
    }

    /// One of the rays, for itself.
    #[inline(always)]
    fn ray(&self, lane: usize) -> TraversalRay {
        let row = |columns: &[f32x8; 3]| from_fn(|axis| columns.get(axis).map_or(0.0, |c| c.as_array()[lane]));
        TraversalRay {
            target: self.targets[lane],
            origin: Vec3A::from_vec4(Vec4::from_array(row(&self.origin))),
            direction: Vec3A::from_vec4(Vec4::from_array(row(&self.direction))),
            plane_reach: self.plane_reach,
            inv_direction: row(&self.inv_direction),
            bias: row(&self.bias),
            t_enter: 0.0,
            t_exit: 0.0,
        }
    }
}

impl Probe {
    #[inline(always)]
    fn target(&self) -> Target {
        Target {
            shear: Shear::of(self.ray.origin.to_array(), self.ray.direction.to_array()),
            t_min: self.t_min,
            source_triangle: self.ray.source_triangle,
        }
    }
}

impl Default for PacketTraverser {
    fn default() -> Self {
        Self { single: Pending::new(), entries: [(0, Interval::empty()); KD_MAX_DEPTH as usize], size: 0 }
    }
}

impl PacketTraverser {
    /// Down to the leaf where the rays of `cell` enter. One that is not in it goes nowhere.
    #[inline(always)]
    fn descend(
        &mut self,
        bindings: &Bindings<impl Reads>,
        packet: &Packet,
        first_is_above: [u32; 4],
        node_ix: &mut u32,
        cell: &mut Interval,
    ) -> KdNode {
        let mut node = bindings.kd_nodes[*node_ix as usize];
        while axis_of(node) != KD_LEAF {
            let axis = axis_of(node) as usize;
            let t_cross =
                f32x8::splat(f32::from_bits(node.split_or_first)) * packet.inv_direction[axis] + packet.bias[axis];
            let first_ix = (node.axis_and_child >> KD_CHILD_SHIFT) + first_is_above[axis];
            // Those in neither have met a NaN, or are not in the cell.
            let first = Interval { enter: cell.enter, exit: t_cross.fast_min(cell.exit) };
            let second = Interval { enter: t_cross.fast_max(cell.enter), exit: cell.exit };
            let (in_first, in_second) = (first.lanes(), second.lanes());
            if in_second == 0 {
                *node_ix = first_ix;
                *cell = first;
            } else {
                if in_first == 0 {
                    *node_ix = first_ix ^ 1;
                    *cell = second;
                } else {
                    self.entries[self.size] = (first_ix ^ 1, second);
                    self.size += 1;
                    *node_ix = first_ix;
                    *cell = first;
                }
            }
            node = bindings.kd_nodes[*node_ix as usize];
        }
        node
    }

    /// The next pending cell in which a ray may hit something nearer than it has, or none.
    #[inline(always)]
    fn pop(&mut self, t_best: f32x8) -> Option<(u32, Interval)> {
        while self.size > 0 {
            self.size -= 1;
            let (node_ix, cell) = self.entries[self.size];
            let cell = Interval { exit: cell.exit.fast_min(t_best), ..cell };
            if cell.lanes() != 0 {
                return Some((node_ix, cell));
            }
        }
        None
    }

    /// All leaves that the rays meet in `whole`, which go the same way on all axes. One that is left alone in a cell goes
    /// on alone there.
    #[inline(always)]
    fn search<const ANY_HIT: bool>(
        &mut self,
        bindings: &Bindings<impl Reads>,
        packet: &mut Packet,
        first_is_above: [u32; 4],
        whole: Interval,
    ) {
        let (mut node_ix, mut cell) = (0, whole);
        self.size = 0;
        loop {
            let lanes = cell.lanes();
            if lanes.is_power_of_two() {
                let lane = lanes.trailing_zeros() as usize;
                let [t_enter, t_exit] = [cell.enter, cell.exit].map(|t| t.as_array()[lane]);
                let (ray, alone) = (packet.ray(lane), Cell { node_ix, depth: 0, t_enter, t_exit });
                search_cell::<_, ANY_HIT>(bindings, &ray, &mut self.single, alone, &mut packet.best[lane]);
                packet.note_best::<ANY_HIT>();
            } else {
                let leaf = self.descend(bindings, packet, first_is_above, &mut node_ix, &mut cell);
                packet.intersect_leaf::<ANY_HIT>(bindings, leaf, &cell);
            }
            match self.pop(packet.t_best) {
                Some(next) => (node_ix, cell) = next,
                None => return,
            }
        }
    }

    /// The hits of up to `LANES` rays, at least one, that start within reach; void beyond them.
    pub fn traverse<const ANY_HIT: bool>(&mut self, bindings: &Bindings<impl Reads>, probes: &[Probe]) -> [Hit; LANES] {
        let (mut packet, whole) = Packet::new(bindings, probes);
        let mut remaining = whole.lanes();
        while remaining != 0 {
            let lane = remaining.trailing_zeros();
            let lanes = packet.like(lane) & remaining;
            remaining &= !lanes;
            let is_below = |axis: usize| packet.inv_direction[axis].as_array()[lane as usize] < 0.0;
            let first_is_above = [is_below(0), is_below(1), is_below(2), false].map(u32::from);
            self.search::<ANY_HIT>(bindings, &mut packet, first_is_above, whole.of(lanes));
        }
        packet.best
    }
}
