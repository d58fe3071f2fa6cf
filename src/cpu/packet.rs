//! A packet: sixteen rays as a structure of arrays, their t intervals in a cell, and the test of a leaf's triangles
//! against those rays whose t interval in the leaf's cell is not empty. A *column* is one component of all sixteen
//! rays.
//!
//! `dispatch!` compiles a function for an instruction set. Code that computes with columns has to be inlined into
//! that function, and must not be in a closure: otherwise each operation would be a call.

use fearless_simd::{Simd, f32x16, mask32x16, prelude::*, u32x16};
use glam::{Vec3, Vec3A, Vec4};

use super::{
    lanes::{LANES, LaneMask},
    packet_triangle::{HitColumns, Shears},
    soa::{HitsSoa, RaysSoa},
    vec3x16::Vec3x16,
};
use crate::{
    layout::{Hit, KD_LEAST_COMPONENT, KD_PLANE_EPSILON, KdNode, NO_TRIANGLE, Slab},
    reference::{
        candidate::HitFilter,
        counting::table::ReadCounter,
        inputs::KernelInputs,
        leaf::entries_of,
        traversal_ray::{TraversalRay, largest_coordinate, signs_of},
    },
};

/// Number of triangles in a block of a leaf. All planes of a block are tested before its first triangle is tested.
const BLOCK: usize = 8;

/// The rays' t intervals in a cell. A ray that is not in the cell has `enter` above `exit`.
#[derive(Clone, Copy)]
pub struct PacketIntervals<S: Simd> {
    pub enter: f32x16<S>,
    pub exit: f32x16<S>,
}

/// The rays' t intervals in a cell, as middles and half lengths.
struct CenteredIntervals<S: Simd> {
    middle: f32x16<S>,
    half: f32x16<S>,
}

/// Sixteen rays whose directions have the same signs, as columns, and the best hit of each so far.
pub struct Packet<S: Simd> {
    origin: [f32x16<S>; 3],
    direction: [f32x16<S>; 3],
    /// Inverse of `direction`, with a least magnitude for each component of `direction`: see `inverse`.
    pub inv_direction: [f32x16<S>; 3],
    /// For each axis, 1 if the rays visit the child above the split plane first, else 0.
    pub first_is_above: [u32; 3],
    /// For each axis, the t at which the rays meet the plane at coordinate 0.
    pub bias: [f32x16<S>; 3],
    /// Distance from a triangle's plane up to which a ray counts as meeting the plane (world units).
    plane_epsilon: f32,
    shears: Shears<S>,
    t_min: f32x16<S>,
    source_triangle: u32x16<S>,
    alpha_seed: [u32; LANES],
    best: HitColumns<S>,
    /// The t of the rays' `best` hits. It is minus infinity for a ray that is done, so that all its t intervals are
    /// empty.
    pub t_best: f32x16<S>,
}

impl<S: Simd> PacketIntervals<S> {
    /// Returns the rays that are in the cell.
    #[inline(always)]
    pub fn lanes(&self) -> LaneMask {
        self.enter.simd_le(self.exit).to_bitmask() as LaneMask
    }

    /// Returns the intervals of the rays in `lanes`, and empty intervals for all other rays.
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

/// Returns one ray's components, followed by a 0.
#[inline(always)]
fn row<S: Simd>(columns: &[f32x16<S>; 3], lane: usize) -> [f32; 4] {
    [columns[0].as_array()[lane], columns[1].as_array()[lane], columns[2].as_array()[lane], 0.0]
}

/// Returns 1 / direction. A component whose magnitude is below `KD_LEAST_COMPONENT` is replaced by the positive
/// `KD_LEAST_COMPONENT`, whatever its sign.
#[inline(always)]
fn inverse<S: Simd>(direction: f32x16<S>) -> f32x16<S> {
    let tiny = f32x16::splat(direction.simd, KD_LEAST_COMPONENT);
    1.0 / direction.abs().simd_lt(tiny).select(tiny, direction)
}

/// Returns `a * b + c` for each axis. Product and sum are rounded separately: there is no fused multiply-add.
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

/// Returns those of `lanes` whose hits pass the alpha test, and are not on hidden triangles.
#[cold]
fn solid<S: Simd>(
    inputs: &KernelInputs<impl ReadCounter>,
    found: &HitColumns<S>,
    alpha_seed: &[u32; LANES],
    lanes: LaneMask,
) -> LaneMask {
    let counts = |lane: &usize| lanes >> lane & 1 == 1 && inputs.is_solid_at(&found.of_lane(*lane), alpha_seed[*lane]);
    (0..LANES).filter(counts).fold(0, |mask, lane| mask | 1 << lane)
}

impl<S: Simd> Packet<S> {
    /// Makes a packet of the first `n_rays` rays, and returns it with the rays' t intervals in the root's cell. The
    /// operations are those of `TraversalRay::new`.
    #[inline(always)]
    pub fn new(
        simd: S,
        inputs: &KernelInputs<impl ReadCounter>,
        search_rays: &RaysSoa,
        n_rays: usize,
    ) -> (Self, PacketIntervals<S>) {
        let [Vec3x16(origin), Vec3x16(direction)] =
            [Vec3x16::load(simd, &search_rays.origin), Vec3x16::load(simd, &search_rays.direction)];
        let inv_direction = [inverse(direction[0]), inverse(direction[1]), inverse(direction[2])];
        let bias = [-origin[0] * inv_direction[0], -origin[1] * inv_direction[1], -origin[2] * inv_direction[2]];
        let [x0, y0, z0] = times_plus(inputs.box_min.to_array(), &inv_direction, &bias);
        let [x1, y1, z1] = times_plus(inputs.box_max.to_array(), &inv_direction, &bias);
        let t_min = f32x16::load_array_ref(simd, &search_rays.t_min);
        let t_max = f32x16::load_array_ref(simd, &search_rays.t_max);
        let whole = PacketIntervals {
            enter: x0.min(x1).max(y0.min(y1)).max(z0.min(z1).max(t_min)),
            exit: x0.max(x1).min(y0.max(y1)).min(z0.max(z1).min(t_max)),
        };
        let packet = Self {
            origin,
            direction,
            inv_direction,
            first_is_above: [0, 1, 2].map(|axis| signs_of(search_rays.direction(0)) >> axis & 1),
            bias,
            plane_epsilon: KD_PLANE_EPSILON * largest_coordinate(inputs),
            shears: Shears::of(&origin, &direction),
            t_min,
            source_triangle: u32x16::load_array_ref(simd, &search_rays.source_triangle),
            alpha_seed: search_rays.alpha_seed,
            best: HitColumns::nothing(t_max),
            t_best: t_max,
        };
        (packet, whole.of((1 << n_rays) - 1))
    }

    /// Tells whether `near_scene` moves no ray: no coordinate of an origin exceeds `origin_reach`. It also tests unused
    /// lanes, which still hold rays of an earlier packet. A far ray in an unused lane costs time but changes no hit.
    #[inline(always)]
    pub fn is_within_reach(&self, inputs: &KernelInputs<impl ReadCounter>) -> bool {
        let reach = inputs.origin_reach;
        let [x, y, z] = [self.origin[0].abs(), self.origin[1].abs(), self.origin[2].abs()];
        (x.simd_gt(reach) | y.simd_gt(reach) | z.simd_gt(reach)).all_false()
    }

    /// Returns the rays' t intervals in the cell, cut off at their best hits.
    #[inline(always)]
    fn centered_intervals(&self, cell: &PacketIntervals<S>) -> CenteredIntervals<S> {
        let exit = cell.exit.min(self.t_best);
        CenteredIntervals { middle: (cell.enter + exit) * 0.5, half: (exit - cell.enter) * 0.5 }
    }

    /// Returns the rays that cross a plane or come within `reach` of it in their t intervals. `reach` has the unit of
    /// `dot(normal, point)`: world units if the normal has unit length. A NaN counts as near.
    #[inline(always)]
    fn lanes_near(
        &self,
        centered_intervals: &CenteredIntervals<S>,
        normal: Vec3,
        distance: f32,
        reach: f32,
    ) -> LaneMask {
        let height = dot(normal, &self.origin) - distance;
        let slope = dot(normal, &self.direction);
        let is_clear =
            (centered_intervals.middle * slope + height).abs().simd_gt(centered_intervals.half * slope.abs() + reach);
        !is_clear.to_bitmask() as LaneMask
    }

    /// Returns the rays that enter a slab within the cell. The slab's normal is scaled such that its half thickness
    /// is 1.
    #[inline(always)]
    pub fn lanes_in_slab(&self, slab: &Slab, cell: &PacketIntervals<S>) -> LaneMask {
        self.lanes_near(&self.centered_intervals(cell), slab.normal, slab.offset, 1.0)
    }

    /// Tests the leaf's triangles against the rays that are in its cell.
    #[inline(always)]
    pub fn intersect_leaf<const ANY_HIT: bool>(
        &mut self,
        inputs: &KernelInputs<impl ReadCounter>,
        leaf: KdNode,
        cell: &PacketIntervals<S>,
    ) {
        let entries = entries_of(leaf);
        if entries.is_empty() {
            return;
        }
        let in_cell = cell.lanes();
        let centered_intervals = self.centered_intervals(cell);
        // A block's planes are tested before its triangles, so that the loads of several triangles overlap.
        for (triangles, first) in inputs.leaf_triangles[entries.clone()].chunks(BLOCK).zip(entries.step_by(BLOCK)) {
            let mut near = [in_cell; BLOCK];
            for (lanes, entry) in near.iter_mut().zip(first..first + triangles.len()) {
                let Some(plane) = inputs.leaf_planes.get(entry) else { break };
                *lanes &= self.lanes_near(&centered_intervals, plane.normal, plane.distance, self.plane_epsilon);
            }
            for (&triangle_ix, lanes) in triangles.iter().zip(near) {
                if lanes != 0 {
                    self.intersect(inputs, triangle_ix, lanes);
                }
            }
        }
        self.note_best::<ANY_HIT>();
    }

    /// Tests a triangle against the rays of `lanes`, as `candidate::intersect` does for one ray.
    #[inline(always)]
    fn intersect(&mut self, inputs: &KernelInputs<impl ReadCounter>, triangle_ix: u32, lanes: LaneMask) {
        let triangle = &inputs.triangles[triangle_ix as usize];
        for axis in 0..3 {
            let lanes = lanes & self.shears.lanes_of_axis[axis];
            if lanes == 0 {
                continue;
            }
            if let Some((found, hit, is_back)) = self.shears.intersect_triangle(triangle, triangle_ix, axis, lanes) {
                let nearer = found.t.simd_lt(self.best.t)
                    | (found.t.simd_eq(self.best.t) & found.triangle_ix.simd_lt(self.best.triangle_ix));
                let is_new = found.t.simd_gt(self.t_min) & found.triangle_ix.simd_ne(self.source_triangle);
                let mut is_better = hit & nearer & is_new;
                if inputs.passes_from_behind(triangle_ix) {
                    is_better &= !is_back;
                }
                if inputs.lets_rays_pass() {
                    let lanes = solid(inputs, &found, &self.alpha_seed, is_better.to_bitmask() as LaneMask);
                    is_better = mask32x16::from_bitmask(self.t_min.simd, lanes.into());
                }
                self.best = found.or(self.best, is_better);
            }
        }
    }

    /// Updates `t_best` from `best`. With `ANY_HIT`, rays with a hit are done.
    #[inline(always)]
    pub fn note_best<const ANY_HIT: bool>(&mut self) {
        let best = &self.best;
        self.t_best = best.t;
        if ANY_HIT {
            self.t_best = best.is_hit().select(f32x16::splat(best.t.simd, f32::NEG_INFINITY), best.t);
        }
    }

    /// Returns one ray in the form in which it is traced alone. Its t interval is not set.
    #[inline(always)]
    pub fn ray(&self, lane: usize) -> TraversalRay {
        TraversalRay {
            hit_filter: HitFilter {
                shear: self.shears.of_lane(lane),
                t_min: self.t_min.as_array()[lane],
                source_triangle: self.source_triangle.as_array()[lane],
                alpha_seed: self.alpha_seed[lane],
                last_triangle: NO_TRIANGLE,
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

    /// Returns a ray's best hit.
    #[inline(always)]
    pub fn hit(&self, lane: usize) -> Hit {
        self.best.of_lane(lane)
    }

    /// Returns the rays' best hits.
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

    /// Stores a hit that a ray has found outside the packet.
    #[inline(always)]
    pub fn set_hit<const ANY_HIT: bool>(&mut self, lane: usize, hit: &Hit) {
        self.best.set_lane(lane, hit);
        self.note_best::<ANY_HIT>();
    }
}
