//! Streams of rays: while a device casts some of them, the host makes others, and takes the hits of others.
//!
//! Each thread has a lane: it makes rays in mapped memory, waits until the device has cast them, and takes their hits.
//! A thread's own work takes longer than the device's, so that there are always rays to cast, and no thread needs the
//! help of another one.

use std::{
    mem,
    sync::atomic::{AtomicUsize, Ordering},
};

use bytemuck::Zeroable;
use rayon::prelude::*;

use super::{CpuCaster, GpuCaster, Hit, Ray, most_rays};
use crate::{
    accel::Query,
    buffers::{AccelBuffers, CastResources, ResumePass},
    gpu::{BindingSet, Commands, Exchange, GpuError},
    passes,
};

/// Number of rays that are made at a time, and of hits that are taken. Those of a thread stay in its cache: 256 KiB of
/// rays, and 128 KiB of hits.
pub const RAYS_PER_CHUNK: usize = 1 << 13;
/// Bounds of the number of rays that the device casts at a time, if there are so many. Fewer do not fill a large
/// device (docs/experiments.md).
const RAYS_PER_SUBMISSION: [usize; 2] = [1 << 16, 1 << 18];
/// Number of rays above which a stream is long, and the size of a long stream's submissions, in rays. With larger
/// ones, casts that take all columns are slower (docs/experiments.md).
const LONG_STREAM: [usize; 2] = [1 << 21, 1 << 17];
/// A stream is divided into this number of submissions, if their size stays within the bounds. While the device casts
/// the rays of one, the host makes those of the next.
const SUBMISSIONS_PER_STREAM: usize = 4;
/// The most lanes. Each has at most 8 MiB of rays and 4 MiB of hits.
const MOST_LANES: usize = 32;
/// Number of rays that the CPU casts at a time.
const RAYS_PER_CPU_CAST: usize = 1 << 19;

/// The memory through which a thread casts its rays. The thread waits for the device before it writes there again.
pub(super) struct Lane {
    exchange: Exchange<Ray, Hit>,
    /// The structure, and the descriptor set over it and the lane's memory; none after the world has changed.
    bound: Option<(AccelBuffers, BindingSet)>,
}

impl GpuCaster {
    /// Casts `n_rays` rays of which only some are in memory at a time. `make` writes the rays from an index on, and
    /// `take` gets their hits: chunks of [`RAYS_PER_CHUNK`], which begin at multiples of this number, and a last one of
    /// fewer; smaller ones if batches are limited to fewer ([`GpuCaster::with_batches_of`]). Both are called by several
    /// threads of the current rayon pool, in any order, and once for each chunk. What `make` gets may be
    /// write-combined memory: it should write the rays in order and not read them.
    ///
    /// # Errors
    /// Memory runs out, or a call fails. Then some chunks may have been taken.
    pub fn cast_stream(
        &mut self,
        n_rays: usize,
        query: Query,
        make: impl Fn(usize, &mut [Ray]) + Sync,
        take: impl Fn(usize, &[Hit]) + Sync,
    ) -> Result<(), GpuError> {
        let kernel = self.prepare_kernel(query)?;
        let n_threads = rayon::current_num_threads();
        let most = rays_per_submission(n_rays, self.rays_per_batch);
        let n_lanes = n_rays.div_ceil(most).min(n_threads).min(MOST_LANES);
        // A thread that shares its work while no other one is idle could be made to run the whole of another lane.
        let chunks_per_task = if 2 * n_lanes <= n_threads.max(2) { 1 } else { usize::MAX };
        let mut lanes = self.lanes(n_lanes, most)?;
        let (next, caster) = (AtomicUsize::new(0), &*self);
        let run = |lane: &mut Lane| loop {
            let first = next.fetch_add(most, Ordering::Relaxed);
            if first >= n_rays {
                return Ok::<_, GpuError>(());
            }
            let n = most.min(n_rays - first);
            let rays = lane.exchange.inputs()[..n].par_chunks_mut(RAYS_PER_CHUNK).enumerate();
            rays.with_min_len(chunks_per_task).for_each(|(ix, rays)| make(first + ix * RAYS_PER_CHUNK, rays));
            let hits = caster.cast_in_lane(lane, &kernel, n);
            // After an error, the other lanes need not go on.
            let hits = hits.inspect_err(|_| next.store(n_rays, Ordering::Relaxed))?;
            let hits = hits.par_chunks(RAYS_PER_CHUNK).enumerate();
            hits.with_min_len(chunks_per_task).for_each(|(ix, hits)| take(first + ix * RAYS_PER_CHUNK, hits));
        };
        lanes[..n_lanes].par_iter_mut().with_max_len(1).try_for_each(run)?;
        // A lane whose wait has failed is not used again, since the device may still read its memory.
        self.lanes = lanes;
        Ok(())
    }

    /// Casts the first `n` rays of a lane's memory, and returns their hits.
    fn cast_in_lane<'a>(&self, lane: &'a mut Lane, kernel: &passes::Cast, n: usize) -> Result<&'a [Hit], GpuError> {
        let (tree, set) = lane.bound.as_ref().expect("the lanes of a cast are bound");
        let record = |commands: &Commands, pass| kernel.record(commands, set, self.masked(n as u32), pass);
        let begin = |commands: &Commands| {
            tree.suspended_rays.reset(commands);
            record(commands, ResumePass::Begin);
        };
        lane.exchange.run(n, begin, || Ok(tree.suspended_rays.finish(&self.context, record)? > 0))
    }

    /// Takes the lanes, each with room for `len` rays. At least the first `n` are bound.
    fn lanes(&mut self, n: usize, len: usize) -> Result<Vec<Lane>, GpuError> {
        let mut lanes = mem::take(&mut self.lanes);
        lanes.retain(|lane| lane.exchange.room() >= len);
        while lanes.len() < n {
            let room = len.next_power_of_two().min(most_rays(self.context.limits()));
            let exchange = Exchange::new(&self.context, ["stream_rays", "stream_hits"], room)?;
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
        self.lanes.iter_mut().for_each(|lane| lane.bound = None);
    }
}

/// Returns the number of rays of a submission. Where there are more rays than in a chunk, it is a multiple of a chunk.
fn rays_per_submission(n_rays: usize, rays_per_batch: usize) -> usize {
    let [least, most] = RAYS_PER_SUBMISSION;
    let [long, of_long] = LONG_STREAM;
    let n = if n_rays > long { of_long } else { (n_rays / SUBMISSIONS_PER_STREAM).clamp(least, most) };
    let n = n.min(rays_per_batch);
    if n > RAYS_PER_CHUNK { n / RAYS_PER_CHUNK * RAYS_PER_CHUNK } else { n }
}

impl CpuCaster<'_> {
    /// Does what [`GpuCaster::cast_stream`] does.
    pub fn cast_stream(
        &self,
        n_rays: usize,
        query: Query,
        make: impl Fn(usize, &mut [Ray]) + Sync,
        take: impl Fn(usize, &[Hit]) + Sync,
    ) {
        let mut rays = vec![Ray::zeroed(); RAYS_PER_CPU_CAST.min(n_rays)];
        for first in (0..n_rays).step_by(RAYS_PER_CPU_CAST) {
            let rays = &mut rays[..RAYS_PER_CPU_CAST.min(n_rays - first)];
            let chunks = rays.par_chunks_mut(RAYS_PER_CHUNK).enumerate();
            chunks.for_each(|(ix, rays)| make(first + ix * RAYS_PER_CHUNK, rays));
            let hits = self.cast(rays, query);
            let chunks = hits.par_chunks(RAYS_PER_CHUNK).enumerate();
            chunks.for_each(|(ix, hits)| take(first + ix * RAYS_PER_CHUNK, hits));
        }
    }
}
