//! Eight rays as columns: where they are in a cell, and a leaf's triangles against those that are in it.

use std::array::from_fn;

use glam::{Vec3A, Vec4};
use wide::f32x8;

use super::{
    bindings::Bindings,
    kdtree::{TraversalRay, is_done, largest_coordinate},
    leaf::{Target, entries_of, intersect},
    table::Reads,
    traverser::Probe,
};
use crate::layout::{Hit, KD_PLANE_REACH, KdNode, Plane};

/// Rays of a packet.
pub const LANES: usize = 8;

/// Triangles of a leaf whose planes are tried before the first of them is tested.
const BLOCK: usize = 8;

/// Where the rays are in a cell. A ray that is not in it enters after it leaves.
#[derive(Clone, Copy)]
pub struct Interval {
    pub enter: f32x8,
    pub exit: f32x8,
}

/// One bit a ray.
pub type Lanes = u32;

/// The rays as columns, and what each has found.
pub struct Packet {
    origin: [f32x8; 3],
    direction: [f32x8; 3],
    pub inv_direction: [f32x8; 3],
    /// Where the rays meet the plane at 0 on each axis, in t.
    pub bias: [f32x8; 3],
    plane_reach: f32,
    targets: [Target; LANES],
    pub best: [Hit; LANES],
    /// The rays' `best` t; before everything where a ray is done.
    pub t_best: f32x8,
}

impl Interval {
    pub fn empty() -> Self {
        Self { enter: f32x8::splat(1.0), exit: f32x8::splat(0.0) }
    }

    /// The rays that are in the cell.
    #[inline(always)]
    pub fn lanes(&self) -> Lanes {
        self.enter.simd_le(self.exit).to_bitmask()
    }

    /// Without the other rays.
    pub fn of(self, lanes: Lanes) -> Self {
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
    pub fn new(bindings: &Bindings<impl Reads>, probes: &[Probe]) -> (Self, Interval) {
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
            targets: from_fn(|lane| Target::of(&probe(lane).ray, probe(lane).t_min)),
            best: from_fn(|lane| probe(lane).miss()),
            t_best: t_max,
        };
        (packet, whole.of((1 << probes.len()) - 1))
    }

    /// The rays that go the same way as one of them on all axes.
    #[inline(always)]
    pub fn like(&self, lane: u32) -> Lanes {
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
    pub fn intersect_leaf<const ANY_HIT: bool>(
        &mut self,
        bindings: &Bindings<impl Reads>,
        leaf: KdNode,
        cell: &Interval,
    ) {
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
    pub fn note_best<const ANY_HIT: bool>(&mut self) {
        let t_best = |hit: &Hit| if is_done::<ANY_HIT>(hit) { f32::NEG_INFINITY } else { hit.t };
        self.t_best = from_fn(|lane| t_best(&self.best[lane])).into();
    }

    /// One of the rays, for itself.
    #[inline(always)]
    pub fn ray(&self, lane: usize) -> TraversalRay {
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
