//! Streams of rays: while a device casts some of them, the host makes others, and takes the hits of others.
//!
//! Each thread has a lane: it makes rays in mapped memory, waits until the device has cast them, and takes their hits.
//! A thread's own work takes longer than the device's, so that there are always rays to cast, and no thread needs the
//! help of another one.

use std::{
    array, mem,
    ops::Range,
    sync::atomic::{AtomicUsize, Ordering},
};

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use rayon::prelude::*;

use super::{CpuCaster, GpuCaster, Hit, Ray, most_rays};
use crate::{
    accel::Query,
    buffers::{AccelBuffers, CastResources, ResumePass},
    gpu::{BindingSet, Commands, Exchange, GpuError},
    passes::{self, Bare},
};

/// Number of rays that are made at a time, and of hits that are taken. Those of a thread stay in its cache: 256 KiB of
/// rays, and 128 KiB of hits.
pub const RAYS_PER_CHUNK: usize = 1 << 13;
/// Bounds of the number of rays that the device casts at a time, if there are so many. Fewer do not fill a large
/// device, and hits of more leave the caches before they are taken (docs/experiments.md). If rays and hits are
/// bare, submissions have up to twice as many.
const RAYS_PER_SUBMISSION: [usize; 2] = [1 << 16, 1 << 18];
/// A stream is divided into this number of submissions, if their size stays within the bounds. While the device casts
/// the rays of one, the host makes those of the next.
const SUBMISSIONS_PER_STREAM: usize = 4;
/// The most lanes. Each has at most 12 MiB of mapped memory, or 14 MiB if rays and hits are bare.
const MOST_LANES: usize = 16;
/// In one of so many lanes, the host writes the rays to the device's memory. In the others, the device copies them from
/// the host's memory, if it can do so while kernels run. So both ways are in use, each of which alone is slower than
/// the bus. This is for streams of bare rays and hits: with whole hits, the host's memory is too busy
/// (docs/experiments.md).
const LANES_PER_WRITTEN: usize = 4;
/// Number of rays that the CPU casts at a time.
const RAYS_PER_CPU_CAST: usize = 1 << 19;

/// A ray of a stream: a [`Ray`], or origin and direction alone, whose t is from 0 to infinity. The fewer bytes, the
/// faster they reach the device.
pub trait StreamRay: Pod + Send + Sync + sealed::Sealed {
    #[doc(hidden)]
    const IS_BARE: bool;

    /// Returns the whole ray.
    fn to_ray(&self) -> Ray;
}

/// A hit of a stream: a [`Hit`], or its t alone, which is infinite for a miss.
pub trait StreamHit: Pod + Send + Sync + sealed::Sealed {
    #[doc(hidden)]
    const IS_BARE: bool;

    /// Returns what is left of the whole hit.
    fn of_hit(hit: &Hit) -> Self;
}

/// The kernel knows no other types.
mod sealed {
    pub trait Sealed {}
    impl Sealed for super::Ray {}
    impl Sealed for [f32; 6] {}
    impl Sealed for super::Hit {}
    impl Sealed for f32 {}
}

impl StreamRay for Ray {
    const IS_BARE: bool = false;

    fn to_ray(&self) -> Ray {
        *self
    }
}

impl StreamRay for [f32; 6] {
    const IS_BARE: bool = true;

    fn to_ray(&self) -> Ray {
        let [x, y, z, dx, dy, dz] = *self;
        Ray { origin: Vec3::new(x, y, z), t_min: 0.0, direction: Vec3::new(dx, dy, dz), t_max: f32::INFINITY }
    }
}

impl StreamHit for Hit {
    const IS_BARE: bool = false;

    fn of_hit(hit: &Hit) -> Self {
        *hit
    }
}

impl StreamHit for f32 {
    const IS_BARE: bool = true;

    fn of_hit(hit: &Hit) -> Self {
        hit.t
    }
}

/// The memory through which a thread casts its rays. The thread waits for the device before it writes there again.
pub(super) struct Lane {
    exchange: Exchange,
    /// The structure, and the descriptor set over it and the lane's memory; none after the world has changed.
    bound: Option<(AccelBuffers, BindingSet)>,
}

/// The lanes for streams in which rays or hits are whole, and those for streams in which both are bare.
pub(super) type Lanes = [Vec<Lane>; 2];

impl GpuCaster {
    /// Casts `n_rays` rays of which only some are in memory at a time. `make` writes the rays from an index on, and
    /// `take` gets their hits: chunks of [`RAYS_PER_CHUNK`], which begin at multiples of this number, and a last one of
    /// fewer; smaller ones if batches are limited to fewer ([`GpuCaster::with_batches_of`]). Both are called by several
    /// threads of the current rayon pool, in any order, and once for each chunk. What `make` gets may be
    /// write-combined memory: it should write the rays in order and not read them. The types of rays and hits say what
    /// is moved: rays as `[f32; 6]` take three quarters of the bytes, and hits as `f32` one quarter.
    ///
    /// # Errors
    /// Memory runs out, or a call fails. Then some chunks may have been taken.
    pub fn cast_stream<R: StreamRay, H: StreamHit>(
        &mut self,
        n_rays: usize,
        query: Query,
        make: impl Fn(usize, &mut [R]) + Sync,
        take: impl Fn(usize, &[H]) + Sync,
    ) -> Result<(), GpuError> {
        let kernel = self.prepare_kernel(query)?;
        let n_threads = rayon::current_num_threads();
        let are_bare = R::IS_BARE && H::IS_BARE;
        let most = rays_per_submission(n_rays, self.rays_per_batch, are_bare);
        let n_lanes = n_rays.div_ceil(most).min(n_threads).min(MOST_LANES);
        let submissions = submissions(n_rays, most, n_lanes);
        // A thread that shares its work while no other one is idle could be made to run the whole of another lane.
        let chunks_per_task = if 2 * n_lanes <= n_threads.max(2) { 1 } else { usize::MAX };
        let mut lanes = self.lanes(n_lanes, most, [size_of::<R>(), size_of::<H>()], are_bare)?;
        let (next, caster) = (AtomicUsize::new(0), &*self);
        let run = |lane: &mut Lane| {
            while let Some(range) = submissions.get(next.fetch_add(1, Ordering::Relaxed)) {
                let rays = lane.exchange.inputs::<R>(range.len()).par_chunks_mut(RAYS_PER_CHUNK).enumerate();
                let make = |(ix, rays): (usize, &mut [R])| make(range.start + ix * RAYS_PER_CHUNK, rays);
                rays.with_min_len(chunks_per_task).for_each(make);
                let hits = caster.cast_in_lane::<R, H>(lane, &kernel, range.len());
                // After an error, the other lanes need not go on.
                let hits = hits.inspect_err(|_| next.store(submissions.len(), Ordering::Relaxed))?;
                let hits = hits.par_chunks(RAYS_PER_CHUNK).enumerate();
                let take = |(ix, hits): (usize, &[H])| take(range.start + ix * RAYS_PER_CHUNK, hits);
                hits.with_min_len(chunks_per_task).for_each(take);
            }
            Ok::<_, GpuError>(())
        };
        lanes[..n_lanes].par_iter_mut().with_max_len(1).try_for_each(run)?;
        // A lane whose wait has failed is not used again, since the device may still read its memory.
        self.lanes[usize::from(are_bare)] = lanes;
        Ok(())
    }

    /// Casts the first `n` rays of a lane's memory, and returns their hits.
    fn cast_in_lane<'a, R: StreamRay, H: StreamHit>(
        &self,
        lane: &'a mut Lane,
        kernel: &passes::Cast,
        n: usize,
    ) -> Result<&'a [H], GpuError> {
        let (tree, set) = lane.bound.as_ref().expect("the lanes of a cast are bound");
        let bare = Bare { rays: R::IS_BARE, hits: H::IS_BARE };
        let record = |commands: &Commands, pass| kernel.record_bare(commands, set, self.masked(n as u32), bare, pass);
        let begin = |commands: &Commands| {
            tree.suspended_rays.reset(commands);
            record(commands, ResumePass::Begin);
        };
        lane.exchange.run(n, begin, || Ok(tree.suspended_rays.finish(&self.context, record)? > 0))
    }

    /// Takes the lanes, each with room for `len` rays and hits of these sizes in bytes. At least the first `n` are
    /// bound.
    fn lanes(&mut self, n: usize, len: usize, sizes: [usize; 2], are_bare: bool) -> Result<Vec<Lane>, GpuError> {
        let mut lanes = mem::take(&mut self.lanes[usize::from(are_bare)]);
        let room = len.next_power_of_two().min(most_rays(self.context.limits()));
        // Lanes that were too small for whole rays have room for whole hits, too.
        let before = lanes.first().map_or([0; 2], |lane| lane.exchange.bytes());
        lanes.retain(|lane| array::from_fn(|ix| lane.exchange.bytes()[ix] >= len * sizes[ix]) == [true; 2]);
        let bytes = array::from_fn(|ix| (room * sizes[ix]).max(before[ix]));
        while lanes.len() < n {
            let is_written = lanes.len().is_multiple_of(LANES_PER_WRITTEN) && !self.context.overrides().copies_inputs;
            let by_copies = are_bare && !is_written;
            let exchange = Exchange::new(&self.context, ["stream_rays", "stream_hits"], bytes, by_copies)?;
            lanes.push(Lane { exchange, bound: None });
        }
        for lane in lanes[..n].iter_mut().filter(|lane| lane.bound.is_none()) {
            let tree = self.tree.with_own_suspended_rays(&self.context)?;
            let set = CastResources::set_over(&self.bindings, &tree, "stream", lane.exchange.bindings())?;
            lane.bound = Some((tree, set));
        }
        Ok(lanes)
    }

    /// Lets go of the structure. The lanes' memory stays: to map it takes longer than many casts.
    pub(super) fn unbind_lanes(&mut self) {
        self.lanes.iter_mut().flatten().for_each(|lane| lane.bound = None);
    }
}

/// Returns the greatest number of rays of a submission. Where it is more than a chunk, it is a multiple of a chunk.
fn rays_per_submission(n_rays: usize, rays_per_batch: usize, are_bare: bool) -> usize {
    let [least, most] = RAYS_PER_SUBMISSION;
    let most = if are_bare { 2 * most } else { most };
    let n = (n_rays / SUBMISSIONS_PER_STREAM).clamp(least, most).min(rays_per_batch);
    if n > RAYS_PER_CHUNK { n / RAYS_PER_CHUNK * RAYS_PER_CHUNK } else { n }
}

/// Divides rays into submissions of at most `most`. If lanes have several, their first ones grow from lane to lane, so
/// that the device has rays early, and the lanes do not wait for it at the same time.
fn submissions(n_rays: usize, most: usize, n_lanes: usize) -> Vec<Range<usize>> {
    let grow = n_rays > most * n_lanes;
    let mut submissions = Vec::new();
    let mut begin = 0;
    while begin < n_rays {
        let share = (most * (submissions.len() + 1)).div_ceil(n_lanes).next_multiple_of(RAYS_PER_CHUNK);
        let n = if grow { share.min(most) } else { most };
        let end = n_rays.min(begin + n);
        submissions.push(begin..end);
        begin = end;
    }
    submissions
}

impl CpuCaster<'_> {
    /// Does what [`GpuCaster::cast_stream`] does.
    pub fn cast_stream<R: StreamRay, H: StreamHit>(
        &self,
        n_rays: usize,
        query: Query,
        make: impl Fn(usize, &mut [R]) + Sync,
        take: impl Fn(usize, &[H]) + Sync,
    ) {
        let mut rays = vec![Ray::zeroed(); RAYS_PER_CPU_CAST.min(n_rays)];
        for first in (0..n_rays).step_by(RAYS_PER_CPU_CAST) {
            let rays = &mut rays[..RAYS_PER_CPU_CAST.min(n_rays - first)];
            let chunks = rays.par_chunks_mut(RAYS_PER_CHUNK).enumerate();
            chunks.for_each_init(Vec::new, |made, (ix, rays)| {
                made.resize(rays.len(), R::zeroed());
                make(first + ix * RAYS_PER_CHUNK, made);
                rays.iter_mut().zip(&*made).for_each(|(to, made)| *to = made.to_ray());
            });
            let hits = self.cast(rays, query);
            let chunks = hits.par_chunks(RAYS_PER_CHUNK).enumerate();
            chunks.for_each_init(Vec::new, |taken, (ix, hits)| {
                taken.clear();
                taken.extend(hits.iter().map(H::of_hit));
                take(first + ix * RAYS_PER_CHUNK, taken);
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn submissions_hold_all_rays_in_chunks() {
        for (n_rays, most, n_lanes) in [
            (0, 1 << 16, 0),
            (7, 7, 1),
            (1000, 130, 3),
            (1000, 1, 16),
            (1 << 20, 1 << 18, 4),
            (16_000_000, 1 << 19, 16),
            (16_000_000, 1 << 19, 5),
            (16_000_001, 1 << 18, 1),
        ] {
            let ranges = submissions(n_rays, most, n_lanes);
            let ends = [0].into_iter().chain(ranges.iter().map(|range| range.end));
            assert!(ranges.iter().map(|range| range.start).eq(ends.take(ranges.len())));
            assert_eq!(ranges.last().map_or(0, |range| range.end), n_rays);
            assert!(ranges.iter().all(|range| (1..=most).contains(&range.len())));
            let has_chunks = |range: &Range<usize>| range.start.is_multiple_of(RAYS_PER_CHUNK);
            assert!(most < RAYS_PER_CHUNK || ranges.iter().all(has_chunks));
        }
        let lens: Vec<_> = submissions(1 << 20, 1 << 16, 4).iter().map(Range::len).collect();
        assert_eq!(lens[..5], [1 << 14, 1 << 15, 3 << 14, 1 << 16, 1 << 16]);
    }

    #[test]
    fn submissions_fill_a_device_and_leave_hits_in_caches() {
        let sizes = [1000, 1 << 20, 1 << 24].map(|n| rays_per_submission(n, 1 << 21, false));
        assert_eq!(sizes, [1 << 16, 1 << 18, 1 << 18]);
        assert_eq!(rays_per_submission(1 << 24, 1 << 21, true), 1 << 19);
        assert_eq!(rays_per_submission(1 << 24, 20_000, true), 2 * RAYS_PER_CHUNK);
        assert_eq!(rays_per_submission(1000, 130, false), 130);
    }
}
