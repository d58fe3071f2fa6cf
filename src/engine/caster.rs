//! Casts the caller's rays, on the device or on the CPU.

use std::{sync::Arc, time::Instant};

use crate::{
    accel::{Query, kdtree::Traversal},
    cast::{self, AllHits, CastResult, CpuCaster, Hit, QueryPoint, Ray, StreamHit, StreamRay},
    frame::BadOptions,
    gpu::{Context, GpuError},
    world::{Geometry, World},
};

/// Casts rays, on the device or on the CPU.
pub struct Caster<'a>(Backend<'a>);

enum Backend<'a> {
    Device(Box<cast::GpuCaster>),
    Cpu(Box<CpuCaster<'a>>),
}

impl<'a> Caster<'a> {
    /// Creates a caster on the device. If `context` is none, the caster is the one of the CPU.
    pub(super) fn new(
        context: Option<&Arc<Context>>,
        geometry: Geometry,
        traversal: Traversal,
        of_cpu: impl FnOnce() -> CpuCaster<'a>,
    ) -> Result<Self, GpuError> {
        Ok(Self(match context {
            Some(context) => Backend::Device(Box::new(cast::GpuCaster::new(context, geometry, traversal)?)),
            None => Backend::Cpu(Box::new(of_cpu())),
        }))
    }

    /// Makes rays pass through the triangles with these indices. A second call replaces the indices of the first.
    ///
    /// # Errors
    /// There is no triangle with one of the indices, or the buffers are beyond the device's limits or memory.
    pub fn hiding(self, triangles: &[u32]) -> Result<Self, GpuError> {
        Ok(Self(match self.0 {
            Backend::Device(caster) => Backend::Device(Box::new(caster.hiding(triangles)?)),
            Backend::Cpu(caster) => Backend::Cpu(Box::new(caster.hiding(triangles)?)),
        }))
    }

    /// Casts rays into a world whose instances have changed, or into another moment of the same film, as
    /// [`GpuCaster::set_world`](cast::GpuCaster::set_world) does.
    ///
    /// # Errors
    /// The world was not made of this caster's, or memory runs out. Then nothing has changed, unless several meshes are
    /// deformed: some of them may have changed until a world is set again.
    pub fn set_world(&mut self, world: &World) -> Result<(), GpuError> {
        match &mut self.0 {
            Backend::Device(caster) => caster.set_world(world),
            Backend::Cpu(caster) => caster.set_world(world),
        }
    }

    /// Makes later rays and points meet some instances alone, as
    /// [`GpuCaster::set_mask`](cast::GpuCaster::set_mask) does.
    ///
    /// # Errors
    /// The mask is 0.
    pub fn set_mask(&mut self, mask: u8) -> Result<(), GpuError> {
        match &mut self.0 {
            Backend::Device(caster) => caster.set_mask(mask)?,
            Backend::Cpu(caster) => caster.set_mask(mask)?,
        }
        Ok(())
    }

    /// Casts all rays `n_times` (at least once) for timing. Every repetition finds the same hits. The times of the
    /// result are those of the device's kernel, or wall-clock times on the CPU.
    ///
    /// # Errors
    /// There are more than [`MOST_REPETITIONS`](cast::MOST_REPETITIONS), memory runs out, or a call fails.
    pub fn cast(&mut self, rays: &[Ray], query: Query, n_times: u32) -> Result<CastResult, GpuError> {
        cast::check_repetitions(n_times)?;
        match &mut self.0 {
            Backend::Device(caster) => caster.cast(rays, query, n_times),
            Backend::Cpu(caster) => {
                let (hits, ms) = timed(n_times, || Ok(caster.cast(rays, query)))?;
                Ok(CastResult { hits, gpu_ms: Some(ms), n_invalid: cast::count_invalid(rays) })
            }
        }
    }

    /// Casts rays of which only some are in memory at a time, as
    /// [`GpuCaster::cast_stream`](cast::GpuCaster::cast_stream) does.
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
        match &mut self.0 {
            Backend::Device(caster) => caster.cast_stream(n_rays, query, make, take),
            Backend::Cpu(caster) => {
                caster.cast_stream(n_rays, query, make, take);
                Ok(())
            }
        }
    }

    /// Finds the point of the triangles that is closest to each of `points`, as
    /// [`GpuCaster::closest_points`](cast::GpuCaster::closest_points) does.
    ///
    /// # Errors
    /// The triangles are in grids, there are more than [`MOST_REPETITIONS`](cast::MOST_REPETITIONS), memory runs out,
    /// or a call fails.
    pub fn closest_points(&mut self, points: &[QueryPoint], n_times: u32) -> Result<CastResult, GpuError> {
        cast::check_repetitions(n_times)?;
        match &mut self.0 {
            Backend::Device(caster) => caster.closest_points(points, n_times),
            Backend::Cpu(caster) => {
                let (hits, ms) = timed(n_times, || caster.closest_points(points))?;
                Ok(CastResult { hits, gpu_ms: Some(ms), n_invalid: cast::count_invalid_points(points) })
            }
        }
    }

    /// Counts the triangles that each ray meets in (`t_min`, `t_max`]. Each counts once, also if it coincides with
    /// others.
    ///
    /// # Errors
    /// Memory runs out, or a call fails.
    pub fn count_hits(&mut self, rays: &[Ray]) -> Result<Vec<u32>, GpuError> {
        match &mut self.0 {
            Backend::Device(caster) => caster.count_hits(rays),
            Backend::Cpu(caster) => Ok(caster.count_hits(rays)),
        }
    }

    /// Lists the hits that [`Self::count_hits`] counts, or of each ray the `most_per_ray` nearest ones.
    ///
    /// # Errors
    /// A ray has more hits than a buffer of the device holds, memory runs out, or a call fails.
    pub fn all_hits(&mut self, rays: &[Ray], most_per_ray: Option<u32>) -> Result<AllHits, GpuError> {
        match &mut self.0 {
            Backend::Device(caster) => caster.all_hits(rays, most_per_ray),
            Backend::Cpu(caster) => Ok(caster.all_hits(rays, most_per_ray)),
        }
    }
}

/// Runs a cast `n_times`, at least once. Returns the hits and the milliseconds of each repetition.
fn timed(n_times: u32, cast: impl Fn() -> Result<Vec<Hit>, BadOptions>) -> Result<(Vec<Hit>, Vec<f64>), BadOptions> {
    let (mut hits, mut ms) = (Vec::new(), Vec::new());
    for _ in 0..n_times.max(1) {
        let start = Instant::now();
        hits = cast()?;
        ms.push(start.elapsed().as_secs_f64() * 1e3);
    }
    Ok((hits, ms))
}
