//! Sixteen rays as columns: where they are in a cell, and a leaf's triangles against those that are in it.
//!
//! Whatever computes with columns is inlined into the function that `dispatch!` compiles for a set of instructions, and
//! does so in no closure: elsewhere, each operation would be a call.

use fearless_simd::{Simd, f32x16, mask32x16, prelude::*, u32x16};
use glam::{Vec3, Vec3A, Vec4};

use super::{
    lanes::{LANES, LaneMask},
    packet_triangle::{Found, Shears},
    soa::{HitsSoa, RaysSoa},
};
use crate::{
    layout::{Hit, KD_LEAST_COMPONENT, KD_PLANE_EPSILON, KdNode, Slab},
    reference::{
        candidate::Target,
        counting::table::ReadCounter,
        inputs::KernelInputs,
        leaf::entries_of,
        traversal_ray::{TraversalRay, largest_coordinate, origin_reach, signs_of},
    },
};

/// Triangles of a leaf whose planes are tried before the first of them is tested.
const BLOCK: usize = 8;

/// Where the rays are in a cell. A ray that is not in it enters after it leaves.
#[derive(Clone, Copy)]
pub struct Interval<S: Simd> {
    pub enter: f32x16<S>,
    pub exit: f32x16<S>,
}

/// The middles of the rays' ways through a cell, and half their lengths, in t.
struct Segments<S: Simd> {
    middle: f32x16<S>,
    half: f32x16<S>,
}

/// The rays as columns, and what each has found.
pub struct Packet<S: Simd> {
    origin: [f32x16<S>; 3],
    direction: [f32x16<S>; 3],
    pub inv_direction: [f32x16<S>; 3],
    /// By axis, whether the rays come to the upper child first.
    pub first_is_above: [u32; 3],
    /// Where the rays meet the plane at 0 on each axis, in t.
    pub bias: [f32x16<S>; 3],
    plane_epsilon: f32,
    shears: Shears<S>,
    t_min: f32x16<S>,
    source_triangle: u32x16<S>,
    best: Found<S>,
    /// The rays' `best` t; before everything where a ray is done.
    pub t_best: f32x16<S>,
}

impl<S: Simd> Interval<S> {
    /// The rays that are in the cell.
    #[inline(always)]
    pub fn lanes(&self) -> LaneMask {
        self.enter.simd_le(self.exit).to_bitmask() as LaneMask
    }

    /// Without the other rays.
    #[inline(always)]
    pub fn of(self, lanes: LaneMask) -> Self {
        let simd = self.enter.simd;
        let is_in = mask32x16::from_bitmask(simd, lanes.into());
        Self {
            enter: is_in.select(self.enter, f32x16::splat(simd, 1.0)),
            exit: is_in.select(self.exit, f32x16::splat(simd, 0.0)),
        }
    }
}

/// Of vectors, one a ray.
#[inline(always)]
pub fn columns<S: Simd>(simd: S, [x, y, z]: &[[f32; LANES]; 3]) -> [f32x16<S>; 3] {
    [f32x16::load_array_ref(simd, x), f32x16::load_array_ref(simd, y), f32x16::load_array_ref(simd, z)]
}

/// One ray's, by axis; a fourth is 0.
#[inline(always)]
fn row<S: Simd>(columns: &[f32x16<S>; 3], lane: usize) -> [f32; 4] {
    [columns[0].as_array()[lane], columns[1].as_array()[lane], columns[2].as_array()[lane], 0.0]
}

/// A direction in the plane is taken as all but in it.
#[inline(always)]
fn inverse<S: Simd>(direction: f32x16<S>) -> f32x16<S> {
    let tiny = f32x16::splat(direction.simd, KD_LEAST_COMPONENT);
    1.0 / direction.abs().simd_lt(tiny).select(tiny, direction)
}

/// a * b + c, rounded twice.
#[inline(always)]
fn times_plus<S: Simd, A: std::ops::Mul<f32x16<S>, Output = f32x16<S>>>(
    [ax, ay, az]: [A; 3],
    b: &[f32x16<S>; 3],
    c: &[f32x16<S>; 3],
) -> [f32x16<S>; 3] {
    [ax * b[0] + c[0], ay * b[1] + c[1], az * b[2] + c[2]]
}

#[inline(always)]
fn dot<S: Simd>(normal: Vec3, v: &[f32x16<S>; 3]) -> f32x16<S> {
    normal.x * v[0] + normal.y * v[1] + normal.z * v[2]
}

impl<S: Simd> Packet<S> {
    /// The first `n_rays`, and where they are in the root's cell: the operations of `TraversalRay::new`.
    #[inline(always)]
    pub fn new(
        simd: S,
        inputs: &KernelInputs<impl ReadCounter>,
        probes: &RaysSoa,
        n_rays: usize,
    ) -> (Self, Interval<S>) {
        let (origin, direction) = (columns(simd, &probes.origin), columns(simd, &probes.direction));
        let inv_direction = [inverse(direction[0]), inverse(direction[1]), inverse(direction[2])];
        let bias = [-origin[0] * inv_direction[0], -origin[1] * inv_direction[1], -origin[2] * inv_direction[2]];
        let [x0, y0, z0] = times_plus(inputs.cell_min.to_array(), &inv_direction, &bias);
        let [x1, y1, z1] = times_plus(inputs.cell_max.to_array(), &inv_direction, &bias);
        let t_min = f32x16::load_array_ref(simd, &probes.t_min);
        let t_max = f32x16::load_array_ref(simd, &probes.t_max);
        let whole = Interval {
            enter: x0.min(x1).max(y0.min(y1)).max(z0.min(z1).max(t_min)),
            exit: x0.max(x1).min(y0.max(y1)).min(z0.max(z1).min(t_max)),
        };
        let packet = Self {
            origin,
            direction,
            inv_direction,
            first_is_above: [0, 1, 2].map(|axis| signs_of(probes.direction(0)) >> axis & 1),
            bias,
            plane_epsilon: KD_PLANE_EPSILON * largest_coordinate(inputs),
            shears: Shears::of(&origin, &direction),
            t_min,
            source_triangle: u32x16::load_array_ref(simd, &probes.source_triangle),
            best: Found::nothing(t_max),
            t_best: t_max,
        };
        (packet, whole.of((1 << n_rays) - 1))
    }

    /// Whether all rays start within reach. Missing ones are asked, too: they are those of an earlier packet, and near as a
    /// rule.
    #[inline(always)]
    pub fn is_within_reach(&self, inputs: &KernelInputs<impl ReadCounter>) -> bool {
        let reach = origin_reach(inputs);
        let [x, y, z] = [self.origin[0].abs(), self.origin[1].abs(), self.origin[2].abs()];
        (x.simd_gt(reach) | y.simd_gt(reach) | z.simd_gt(reach)).all_false()
    }

    /// The rays' ways through the cell, but for what lies beyond their best hits.
    #[inline(always)]
    fn ways(&self, cell: &Interval<S>) -> Segments<S> {
        let exit = cell.exit.min(self.t_best);
        Segments { middle: (cell.enter + exit) * 0.5, half: (exit - cell.enter) * 0.5 }
    }

    /// Which of the rays do not keep to one side of a plane on their ways, farther from it than `reach`.
    #[inline(always)]
    fn lanes_near(&self, ways: &Segments<S>, normal: Vec3, distance: f32, reach: f32) -> LaneMask {
        let height = dot(normal, &self.origin) - distance;
        let slope = dot(normal, &self.direction);
        let is_clear = (ways.middle * slope + height).abs().simd_gt(ways.half * slope.abs() + reach);
        !is_clear.to_bitmask() as LaneMask
    }

    /// Which of the rays come into a slab within the cell.
    #[inline(always)]
    pub fn lanes_in_slab(&self, slab: &Slab, cell: &Interval<S>) -> LaneMask {
        self.lanes_near(&self.ways(cell), slab.normal, slab.offset, 1.0)
    }

    /// The leaf's triangles against the rays that are in it.
    #[inline(always)]
    pub fn intersect_leaf<const ANY_HIT: bool>(
        &mut self,
        inputs: &KernelInputs<impl ReadCounter>,
        leaf: KdNode,
        cell: &Interval<S>,
    ) {
        let entries = entries_of(leaf);
        if entries.is_empty() {
            return;
        }
        let in_cell = cell.lanes();
        let ways = self.ways(cell);
        // Planes first, triangles after: so that the loads of several triangles are on their way at once.
        for (triangles, first) in inputs.leaf_triangles[entries.clone()].chunks(BLOCK).zip(entries.step_by(BLOCK)) {
            let mut near = [in_cell; BLOCK];
            for (lanes, entry) in near.iter_mut().zip(first..first + triangles.len()) {
                let Some(plane) = inputs.leaf_planes.get(entry) else { break };
                *lanes &= self.lanes_near(&ways, plane.normal, plane.distance, self.plane_epsilon);
            }
            for (&triangle_ix, lanes) in triangles.iter().zip(near) {
                if lanes != 0 {
                    self.intersect(inputs, triangle_ix, lanes);
                }
            }
        }
        self.note_best::<ANY_HIT>();
    }

    /// A triangle against some of the rays: `candidate::intersect` for all at once.
    #[inline(always)]
    fn intersect(&mut self, inputs: &KernelInputs<impl ReadCounter>, triangle_ix: u32, lanes: LaneMask) {
        let triangle = &inputs.triangles[triangle_ix as usize];
        for axis in 0..3 {
            let lanes = lanes & self.shears.lanes_of_axis[axis];
            if lanes == 0 {
                continue;
            }
            if let Some((found, hit)) = self.shears.intersect_triangle(triangle, triangle_ix, axis, lanes) {
                let nearer = found.t.simd_lt(self.best.t)
                    | (found.t.simd_eq(self.best.t) & found.triangle_ix.simd_lt(self.best.triangle_ix));
                let is_new = found.t.simd_gt(self.t_min) & found.triangle_ix.simd_ne(self.source_triangle);
                let is_better = hit & nearer & is_new;
                if inputs.is_accepted(triangle_ix) {
                    self.best = found.or(self.best, is_better);
                }
            }
        }
    }

    #[inline(always)]
    pub fn note_best<const ANY_HIT: bool>(&mut self) {
        let best = &self.best;
        self.t_best = best.t;
        if ANY_HIT {
            self.t_best = best.is_hit().select(f32x16::splat(best.t.simd, f32::NEG_INFINITY), best.t);
        }
    }

    /// One of the rays, for itself.
    #[inline(always)]
    pub fn ray(&self, lane: usize) -> TraversalRay {
        TraversalRay {
            target: Target {
                shear: self.shears.of_lane(lane),
                t_min: self.t_min.as_array()[lane],
                source_triangle: self.source_triangle.as_array()[lane],
            },
            origin: Vec3A::from_vec4(Vec4::from_array(row(&self.origin, lane))),
            direction: Vec3A::from_vec4(Vec4::from_array(row(&self.direction, lane))),
            plane_epsilon: self.plane_epsilon,
            inv_direction: row(&self.inv_direction, lane),
            bias: row(&self.bias, lane),
            t_enter: 0.0,
            t_exit: 0.0,
        }
    }

    /// What a ray has found.
    #[inline(always)]
    pub fn hit(&self, lane: usize) -> Hit {
        self.best.of_lane(lane)
    }

    /// What the rays have found.
    #[inline(always)]
    pub fn hits(&self) -> HitsSoa {
        let best = &self.best;
        HitsSoa {
            t: best.t.to_array(),
            triangle_ix: best.triangle_ix.to_array(),
            u: best.u.to_array(),
            v: best.v.to_array(),
        }
    }

    /// A ray has found this by itself.
    #[inline(always)]
    pub fn set_hit<const ANY_HIT: bool>(&mut self, lane: usize, hit: &Hit) {
        self.best.set_lane(lane, hit);
        self.note_best::<ANY_HIT>();
    }
}
