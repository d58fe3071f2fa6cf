//! Streams of rays: while a device casts some of them, the host makes others, and takes the hits of others.

use std::{
    mem,
    sync::atomic::{AtomicUsize, Ordering},
};

use bytemuck::{Zeroable, cast_slice_mut};
use rayon::prelude::*;

use super::{CpuCaster, GpuCaster, Hit, Ray};
use crate::{
    accel::Query,
    buffers::{AccelBuffers, CastResources},
    gpu::GpuError,
};

/// Number of rays of a chunk: 16 MiB, and 8 MiB of hits. The device casts them in a fraction of a millisecond.
pub const RAYS_PER_CHUNK: usize = 1 << 19;
/// Number of chunks that are on their way at the same time. One is cast, one is uploaded or downloaded, and others are
/// made or taken.
const N_LANES: usize = 4;

/// What a chunk on its way needs, on the device and on the host.
pub(super) struct Lane {
    tree: AccelBuffers,
    resources: CastResources,
    rays: Vec<Ray>,
    hits: Vec<Hit>,
}

impl GpuCaster {
    /// Casts `n_rays` rays of which only some are in memory at a time. `make` writes the rays from an index on, at most
    /// [`RAYS_PER_CHUNK`], and `take` gets their hits. Both are called by several threads of the current rayon pool, in
    /// any order, and once for each chunk.
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
        let most = RAYS_PER_CHUNK.min(self.rays_per_batch).min(n_rays.max(1));
        let mut lanes = self.lanes(n_rays.div_ceil(most).min(N_LANES), most)?;
        let (next, caster) = (AtomicUsize::new(0), &*self);
        let run = |lane: &mut Lane| loop {
            let first = next.fetch_add(most, Ordering::Relaxed);
            if first >= n_rays {
                return Ok(());
            }
            let n = most.min(n_rays - first);
            let Lane { tree, resources: CastResources { cast_rays, cast_hits, set }, rays, hits } = lane;
            make(first, &mut rays[..n]);
            cast_rays.upload(&rays[..n])?;
            caster.run(tree, 1, |commands, pass| kernel.record(commands, set, caster.masked(n as u32), pass))?;
            cast_hits.download_bytes(0, cast_slice_mut(&mut hits[..n]))?;
            take(first, &hits[..n]);
        };
        let result = lanes.par_iter_mut().with_max_len(1).try_for_each(run);
        self.lanes = lanes;
        result
    }

    /// Takes the lanes, at least `n`, each with room for `len` rays.
    fn lanes(&mut self, n: usize, len: usize) -> Result<Vec<Lane>, GpuError> {
        let mut lanes = mem::take(&mut self.lanes);
        lanes.retain(|lane| lane.rays.len() >= len);
        while lanes.len() < n {
            let tree = self.tree.with_own_suspended_rays(&self.context)?;
            let resources = CastResources::new(&self.context, &self.bindings, &tree, len)?;
            lanes.push(Lane { tree, resources, rays: vec![Ray::zeroed(); len], hits: vec![Hit::zeroed(); len] });
        }
        Ok(lanes)
    }
}

impl CpuCaster<'_> {
    /// Does what [`GpuCaster::cast_stream`] does, chunk after chunk.
    pub fn cast_stream(
        &self,
        n_rays: usize,
        query: Query,
        make: impl Fn(usize, &mut [Ray]),
        take: impl Fn(usize, &[Hit]),
    ) {
        let mut rays = vec![Ray::zeroed(); RAYS_PER_CHUNK.min(n_rays)];
        for first in (0..n_rays).step_by(RAYS_PER_CHUNK) {
            let chunk = &mut rays[..RAYS_PER_CHUNK.min(n_rays - first)];
            make(first, chunk);
            take(first, &self.cast(chunk, query));
        }
    }
}
