//! Traversal of single rays through a [`WideBvh`]. Rays that have nothing in common gain nothing from a packet, so each
//! of them tests sixteen boxes or triangles at once. A thread takes several rays by turns: while one waits for memory,
//! the others go on. The hits are those of all other traversals, bit for bit, unless the length of a ray's direction
//! underflows.

use fearless_simd::{Level, Simd, dispatch, f32x16, mask32x16, prelude::*, u32x16};
use glam::Vec3;

use super::{lanes::LaneMask, packet_triangle::Shears, prefetch::prefetch, tracer::CpuSearch};
use crate::{
    accel::{
        kdtree::Traversal,
        wide_bvh::{IS_BLOCK, MOST_LEVELS, TriangleBlock, WIDTH, WideBvh, WideNode},
    },
    layout::{Hit, NO_TRIANGLE},
    reference::{
        candidate::HitFilter,
        counting::table::ReadCounter,
        inputs::KernelInputs,
        kdtree::is_done,
        search_ray::SearchRay,
        traversal_ray::{TraversalRay, near_scene, t_from_origin},
        traverser::Tracer,
    },
    world::World,
};

/// The least number of triangles with which single rays through a [`WideBvh`] are faster than packets of scattered rays
/// (docs/experiments.md).
const LEAST_TRIANGLES: usize = 2048;
/// The least size of the machine's vectors, in floats, with which this is so. With four floats, packets are faster in
/// some scenes.
const LEAST_VECTOR_SIZE: usize = 8;
/// The most subtrees that are pending: at each level, all children but one.
const MOST_PENDING: usize = MOST_LEVELS * (WIDTH - 1);

/// Returns the number of floats in a vector of the machine.
#[inline(always)]
fn vector_size<S: Simd>(_: S) -> usize {
    size_of::<S::f32s>() / size_of::<f32>()
}

/// Whether scattered rays are traced one by one. `traversal`: the algorithm that the options name. Only the default
/// one, by packets, leaves these rays to the hierarchy.
fn traces_one_by_one(n_triangles: usize, vector_size: usize, traversal: Traversal) -> bool {
    n_triangles >= LEAST_TRIANGLES && vector_size >= LEAST_VECTOR_SIZE && traversal == Traversal::OF_CPU
}

/// Returns whether single rays through the hierarchy of a kd-tree are faster than packets if they are scattered.
pub fn suits_scattered_rays(n_triangles: usize, traversal: Traversal) -> bool {
    let vector_size = dispatch!(Level::new(), simd => vector_size(simd));
    traces_one_by_one(n_triangles, vector_size, traversal)
}

/// Returns how rays of a frame find their hits. `is_scattered`: whether they have little in common.
pub fn search_for(world: &World, traversal: Traversal, is_scattered: bool) -> CpuSearch<'_> {
    let takes_wide = is_scattered && suits_scattered_rays(world.scene().triangles.len(), traversal);
    CpuSearch { traversal, wide: if takes_wide { world.wide_bvh() } else { None } }
}

/// Number of rays of a packet, and number of packets in a list of rays that are looked at.
const PACKET: usize = 16;
const N_PACKETS: usize = 64;
/// The rays of a packet have much in common if the cosine of the angle to the first ray's direction is at least this,
/// and the distance from its origin at most this share of the diagonal of the box of all triangles.
const LEAST_COSINE: f32 = 0.95;
const MOST_DISTANCE: f32 = 1.0 / 32.0;

/// Returns whether most rays have little in common with those beside them in the list. `of`: a ray's origin and
/// direction.
pub fn are_scattered<R>(rays: &[R], [min, max]: [Vec3; 2], of: impl Fn(&R) -> (Vec3, Vec3)) -> bool {
    let nearby = MOST_DISTANCE * (max - min).length();
    let is_alike = |packet: &&[R]| {
        let (first, direction) = of(&packet[0]);
        let direction = direction.normalize_or_zero();
        packet.iter().map(&of).all(|(origin, other)| {
            other.normalize_or_zero().dot(direction) >= LEAST_COSINE && origin.distance(first) <= nearby
        })
    };
    let packets = rays.chunks_exact(PACKET);
    let step = (packets.len() / N_PACKETS).max(1);
    let (n_packets, n_alike) = (packets.len().div_ceil(step), packets.step_by(step).filter(is_alike).count());
    2 * n_alike < n_packets
}

/// A pending subtree: one that the ray visits later.
#[derive(Clone, Copy, Default)]
struct Pending {
    /// The t at which the ray enters the subtree's box.
    t_enter: f32,
    /// A reference to the subtree.
    subtree: u32,
}

/// The stack of pending subtrees. Of one node's children, the nearest one is on top.
pub(super) struct Stack {
    entries: [Pending; MOST_PENDING],
    size: usize,
}

/// The number of rays that a thread takes by turns. With half as many, scattered rays take a fifth longer, and with
/// twice as many no shorter (docs/experiments.md).
const RAYS_IN_FLIGHT: usize = 8;

/// Traces rays through a [`WideBvh`] on one thread, and owns the working memory for that.
pub struct WideTraverser<'a> {
    bvh: &'a WideBvh,
    simd_level: Level,
    /// One for each ray in flight.
    stacks: Box<[Stack]>,
}

/// A ray that is on its way.
struct Flight {
    ray: TraversalRay,
    /// Whether it enters boxes through their upper sides, for each axis.
    goes_down: [bool; 3],
    best: Hit,
    /// The subtree that it visits next.
    subtree: u32,
    /// The t by which the origin was moved.
    t_start: f32,
    /// The end of the interval, counted from the ray's own origin.
    t_max: f32,
}

/// A ray as columns that are the same in all lanes.
struct RayColumns<S: Simd> {
    inv_direction: [f32x16<S>; 3],
    bias: [f32x16<S>; 3],
    t_enter: f32x16<S>,
    shears: Shears<S>,
    /// Whether the ray enters boxes through their upper sides, for each axis.
    goes_down: [bool; 3],
}

/// Returns the lanes whose interval of t is not empty. An end that is NaN ends no interval: it comes from `min` and
/// `max` of a side's NaN, which on x86 return another side, and on ARM NaN. So no box is missed on either.
#[inline(always)]
fn entered<S: Simd>(t_enter: f32x16<S>, t_exit: f32x16<S>) -> LaneMask {
    lanes_of(!t_enter.simd_gt(t_exit))
}

/// Returns the lanes of a mask.
#[inline(always)]
pub(super) fn lanes_of<S: Simd>(mask: mask32x16<S>) -> LaneMask {
    LaneMask::from(mask.to_bitmask() as u16)
}

/// The children whose boxes a ray meets, and the t at which it enters each box; or those that may hold a point's
/// closest one, and the squares of their distances.
pub(super) struct Entered {
    pub lanes: LaneMask,
    pub t_enter: [f32; WIDTH],
}

impl<S: Simd> RayColumns<S> {
    #[inline(always)]
    fn new(simd: S, Flight { ray, goes_down, .. }: &Flight) -> Self {
        let [x, y, z, _] = ray.inv_direction;
        let [bias_x, bias_y, bias_z, _] = ray.bias;
        Self {
            inv_direction: [f32x16::splat(simd, x), f32x16::splat(simd, y), f32x16::splat(simd, z)],
            bias: [f32x16::splat(simd, bias_x), f32x16::splat(simd, bias_y), f32x16::splat(simd, bias_z)],
            t_enter: f32x16::splat(simd, ray.t_enter),
            shears: Shears::splat(simd, &ray.hit_filter.shear),
            goes_down: *goes_down,
        }
    }

    /// Returns the t at which the ray meets the lower or the upper side of each box on an axis.
    #[inline(always)]
    fn t_at(&self, node: &WideNode, axis: usize, is_upper: bool) -> f32x16<S> {
        let side = f32x16::load_array_ref(self.t_enter.simd, &node.sides[axis][usize::from(is_upper)]);
        side * self.inv_direction[axis] + self.bias[axis]
    }

    /// Returns the children whose boxes the ray enters no farther than `t_best`. If a product overflows, the t of a
    /// side may be NaN. Then the ray may seem to enter a box that it misses.
    #[inline(always)]
    fn enter(&self, node: &WideNode, t_best: f32) -> Entered {
        let [x_down, y_down, z_down] = self.goes_down;
        let (x, y, z) = (self.t_at(node, 0, x_down), self.t_at(node, 1, y_down), self.t_at(node, 2, z_down));
        let t_enter = x.max(y).max(z.max(self.t_enter));
        let (x, y, z) = (self.t_at(node, 0, !x_down), self.t_at(node, 1, !y_down), self.t_at(node, 2, !z_down));
        let t_exit = x.min(y).min(z.min(f32x16::splat(self.t_enter.simd, t_best)));
        Entered { lanes: entered(t_enter, t_exit), t_enter: t_enter.to_array() }
    }

    /// Tests a block's triangles, as `candidate::intersect` does with each.
    #[inline(always)]
    fn intersect(
        &self,
        inputs: &KernelInputs<impl ReadCounter>,
        filter: &HitFilter,
        block: &TriangleBlock,
        best: &mut Hit,
    ) {
        let triangle_ixs = u32x16::load_array_ref(self.t_enter.simd, &block.triangle_ixs);
        let Some((found, is_hit, _)) = self.shears.intersect_triangles(&block.corners, triangle_ixs, filter.shear.axis)
        else {
            return;
        };
        let may_count = is_hit & found.t.simd_le(best.t) & found.t.simd_gt(filter.t_min);
        let mut lanes = may_count.to_bitmask() as LaneMask;
        while lanes != 0 {
            let hit = found.of_lane(lanes.trailing_zeros() as usize);
            filter.keep_nearest(inputs, &hit, best);
            lanes &= lanes - 1;
        }
    }
}

impl Stack {
    pub fn new() -> Self {
        Self { entries: [Pending::default(); MOST_PENDING], size: 0 }
    }

    pub fn clear(&mut self) {
        self.size = 0;
    }

    /// Makes those children pending that the ray enters, apart from the nearest one, which is returned.
    #[inline(always)]
    pub fn push_all_but_nearest(&mut self, node: &WideNode, entered: &Entered) -> Option<u32> {
        let mut lanes = entered.lanes;
        let mut next = || {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes.wrapping_sub(1);
            (lane < WIDTH).then(|| Pending { t_enter: entered.t_enter[lane], subtree: node.children[lane] })
        };
        let (bottom, mut nearest) = (self.size, next()?);
        while let Some(mut pending) = next() {
            if pending.t_enter < nearest.t_enter {
                std::mem::swap(&mut pending, &mut nearest);
            }
            let mut place = self.size;
            while place > bottom && self.entries[place - 1].t_enter < pending.t_enter {
                self.entries[place] = self.entries[place - 1];
                place -= 1;
            }
            self.entries[place] = pending;
            self.size += 1;
        }
        Some(nearest.subtree)
    }

    /// Makes those children pending that the ray enters, in any order, apart from one, which is returned.
    #[inline(always)]
    fn push_all_but_one(&mut self, node: &WideNode, entered: &Entered) -> Option<u32> {
        let mut lanes = entered.lanes;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            self.entries[self.size] = Pending { t_enter: entered.t_enter[lane], subtree: node.children[lane] };
            self.size += 1;
            lanes &= lanes - 1;
        }
        (entered.lanes != 0).then(|| {
            self.size -= 1;
            self.entries[self.size].subtree
        })
    }

    /// Returns the next pending subtree that the ray enters no farther than `t_best`, or at NaN.
    #[inline(always)]
    pub fn pop(&mut self, t_best: f32) -> Option<u32> {
        while self.size > 0 {
            self.size -= 1;
            let Pending { t_enter, subtree } = self.entries[self.size];
            // The comparison is not `<=`, since a NaN counts.
            if !(t_enter > t_best) {
                return Some(subtree);
            }
        }
        None
    }
}

impl Flight {
    /// Returns the ray at the root, or none if it misses the box of all triangles.
    #[inline(always)]
    fn begin(inputs: &KernelInputs<impl ReadCounter>, search_ray: &SearchRay) -> Option<Self> {
        let (near, t_start) = near_scene(inputs, search_ray);
        let ray = TraversalRay::new(inputs, &near);
        // The comparison is not `>`, since a NaN has to miss.
        let enters = ray.t_enter <= ray.t_exit;
        enters.then(|| {
            let [x, y, z, _] = ray.inv_direction.map(|d| d < 0.0);
            Self { ray, goes_down: [x, y, z], best: near.miss(), subtree: 0, t_start, t_max: search_ray.t_max }
        })
    }

    /// Visits a node or a block. Returns whether the ray goes on, to `subtree`.
    #[inline(always)]
    fn step<S: Simd, const ANY_HIT: bool>(
        &mut self,
        simd: S,
        inputs: &KernelInputs<impl ReadCounter>,
        (nodes, blocks): (&[WideNode], &[TriangleBlock]),
        stack: &mut Stack,
    ) -> bool {
        let columns = RayColumns::new(simd, self);
        let next = if self.subtree & IS_BLOCK != 0 {
            let block = &blocks[(self.subtree & !IS_BLOCK) as usize];
            columns.intersect(inputs, &self.ray.hit_filter, block, &mut self.best);
            if is_done::<ANY_HIT>(&self.best) {
                return false;
            }
            None
        } else {
            let node = &nodes[self.subtree as usize];
            let entered = columns.enter(node, self.best.t);
            if ANY_HIT { stack.push_all_but_one(node, &entered) } else { stack.push_all_but_nearest(node, &entered) }
        };
        let Some(next) = next.or_else(|| stack.pop(self.best.t)) else { return false };
        if next & IS_BLOCK != 0 {
            prefetch(simd, &blocks[(next & !IS_BLOCK) as usize]);
        } else {
            prefetch(simd, &nodes[next as usize]);
        }
        self.subtree = next;
        true
    }

    /// Returns the hit with t counted from the ray's own origin. A miss has t = t_max.
    #[inline(always)]
    fn hit(&self) -> Hit {
        let is_miss = self.best.triangle_ix == NO_TRIANGLE;
        let t = if is_miss { self.t_max } else { t_from_origin(self.best.t, self.t_start, self.t_max) };
        Hit { t, ..self.best }
    }
}

impl<'a> WideTraverser<'a> {
    /// Creates a traverser that uses the instructions of `simd_level`, which the machine must have. The hits are the
    /// same at every SIMD level, bit for bit.
    pub fn new(bvh: &'a WideBvh, simd_level: Level) -> Self {
        Self { bvh, simd_level, stacks: (0..RAYS_IN_FLIGHT).map(|_| Stack::new()).collect() }
    }

    /// Takes rays from `search_rays` whenever one has come to its end, until all have.
    #[inline(always)]
    fn trace<S: Simd, const ANY_HIT: bool, Key>(
        &mut self,
        simd: S,
        inputs: &KernelInputs<impl ReadCounter>,
        mut search_rays: impl Iterator<Item = (Key, SearchRay)>,
        mut found: impl FnMut(Key, Hit),
    ) {
        let mut begin = |found: &mut dyn FnMut(Key, Hit)| {
            for (key, search_ray) in search_rays.by_ref() {
                if let Some(flight) = Flight::begin(inputs, &search_ray) {
                    return Some((key, flight));
                }
                found(key, search_ray.miss());
            }
            None
        };
        let bvh = (self.bvh.nodes(), self.bvh.blocks());
        let mut flights: [_; RAYS_IN_FLIGHT] = std::array::from_fn(|_| begin(&mut found));
        while flights.iter().any(Option::is_some) {
            for (slot, stack) in flights.iter_mut().zip(&mut self.stacks) {
                let Some((_, flight)) = slot else { continue };
                if flight.step::<S, ANY_HIT>(simd, inputs, bvh, stack) {
                    continue;
                }
                stack.clear();
                if let Some((key, flight)) = std::mem::replace(slot, begin(&mut found)) {
                    found(key, flight.hit());
                }
            }
        }
    }
}

impl Tracer for WideTraverser<'_> {
    #[inline]
    fn traverse<const ANY_HIT: bool>(
        &mut self,
        inputs: &KernelInputs<impl ReadCounter>,
        search_ray: &SearchRay,
    ) -> Hit {
        let mut hit = search_ray.miss();
        self.trace_all::<ANY_HIT, _>(inputs, std::iter::once(((), *search_ray)), |(), found| hit = found);
        hit
    }

    #[inline]
    fn trace_all<const ANY_HIT: bool, Key>(
        &mut self,
        inputs: &KernelInputs<impl ReadCounter>,
        search_rays: impl Iterator<Item = (Key, SearchRay)>,
        found: impl FnMut(Key, Hit),
    ) {
        dispatch!(self.simd_level, simd => self.trace::<_, ANY_HIT, Key>(simd, inputs, search_rays, found));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `min` and `max` return a NaN on some platforms, and the other number on others. Neither loses a box.
    #[test]
    fn no_box_is_missed_for_a_nan() {
        let (nan, infinity) = (f32::NAN, f32::INFINITY);
        let ends = [-infinity, -1.0, 0.0, 1.0, 2.0, infinity, nan];
        for (t_enter, t_exit) in ends.iter().flat_map(|&a| ends.map(|b| (a, b))) {
            let is_met = t_enter.is_nan() || t_exit.is_nan() || t_enter <= t_exit;
            for lane in 0..WIDTH {
                // All other lanes are empty.
                let (mut enter, mut exit) = ([1.0; WIDTH], [0.0; WIDTH]);
                (enter[lane], exit[lane]) = (t_enter, t_exit);
                let lanes = dispatch!(Level::new(), simd => {
                    entered(f32x16::load_array(simd, enter), f32x16::load_array(simd, exit))
                });
                assert_eq!(lanes, LaneMask::from(is_met) << lane, "{t_enter}, {t_exit}");
            }
        }
        let mut stack = Stack { entries: [Pending::default(); MOST_PENDING], size: 3 };
        stack.entries[..3].copy_from_slice(&[
            Pending { t_enter: nan, subtree: 1 },
            Pending { t_enter: 3.0, subtree: 2 },
            Pending { t_enter: 2.0, subtree: 3 },
        ]);
        assert_eq!([(); 3].map(|()| stack.pop(2.0)), [Some(3), Some(1), None]);
    }

    #[test]
    fn few_triangles_narrow_vectors_and_other_algorithms_keep_to_the_tree() {
        assert!(traces_one_by_one(2048, 8, Traversal::Stack) && traces_one_by_one(1 << 20, 16, Traversal::Stack));
        assert!(!traces_one_by_one(2047, 8, Traversal::Stack) && !traces_one_by_one(2048, 4, Traversal::Stack));
        assert!(!traces_one_by_one(2048, 8, Traversal::Mask));
    }
}
