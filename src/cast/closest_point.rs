//! The closest points of the triangles to the caller's points, by [`GpuCaster`] and [`CpuCaster`].

use std::sync::Arc;

use bytemuck::Zeroable;
use rayon::prelude::*;

use super::{CastResult, CpuCaster, GpuCaster, Hit, QueryPoint, check_repetitions};
use crate::{
    accel::AccelKind,
    buffers::PointResources,
    cpu,
    frame::BadOptions,
    gpu::{BindingLayout, Commands, GpuError},
    passes, reference,
};

/// The kernel that finds closest points, and its buffers.
pub(super) struct PointSearch {
    bindings: Arc<BindingLayout>,
    kernel: passes::ClosestPoint,
    resources: PointResources,
}

impl GpuCaster {
    /// Finds the point of the triangles that is closest to each of `points`, batch by batch. Each batch runs `n_times`
    /// (at least once). In a hit, `t` is the distance (world units). It is right to 2^-20 of the distance to the
    /// triangle's farthest corner. If several triangles are equally close by the distance as it is computed, one of
    /// them is the hit. A point misses if no triangle is within its `t_max`, if its position is not finite, or if its
    /// `t_max` is NaN or negative. Hidden triangles are not there.
    ///
    /// # Errors
    /// The triangles are in grids, there are more than [`MOST_REPETITIONS`](super::MOST_REPETITIONS), memory runs out,
    /// or a call fails.
    pub fn closest_points(&mut self, points: &[QueryPoint], n_times: u32) -> Result<CastResult, GpuError> {
        check_repetitions(n_times)?;
        check_structure(self.accel_kind)?;
        let search = self.prepared_for(points.len())?;
        let PointResources { cast_points, cast_hits, set } = &search.resources;
        let record =
            |commands: &Commands, n_points, pass| search.kernel.record(commands, set, self.masked(n_points), pass);
        let found = self.run_batches(points, (cast_points, cast_hits), n_times.max(1), record);
        self.point_search = Some(search);
        let (hits, gpu_ms) = found?;
        Ok(CastResult { hits, gpu_ms, n_invalid: count_invalid_points(points) })
    }

    /// Takes the search, which has buffers for a batch of the points. Creates what does not exist.
    fn prepared_for(&mut self, n_points: usize) -> Result<PointSearch, GpuError> {
        let len = n_points.min(self.rays_per_batch);
        let new_resources =
            |bindings: &Arc<BindingLayout>| PointResources::new(&self.context, bindings, &self.tree, len);
        Ok(match self.point_search.take() {
            Some(search) if search.resources.cast_points.len() >= len => search,
            Some(search) => PointSearch { resources: new_resources(&search.bindings)?, ..search },
            None => {
                let bindings = PointResources::bindings(&self.context, &self.tree)?;
                let kernel = passes::ClosestPoint::new(&self.context, &bindings)?;
                PointSearch { resources: new_resources(&bindings)?, bindings, kernel }
            }
        })
    }
}

/// The number of scattered rays that gain as much from the wide hierarchy as one point does (docs/experiments.md).
const RAYS_PER_POINT: usize = 64;

impl CpuCaster<'_> {
    /// Finds the point of the triangles that is closest to each of `points`, as [`GpuCaster::closest_points`] does, on
    /// the current rayon pool.
    ///
    /// # Errors
    /// The triangles are in grids.
    pub fn closest_points(&self, points: &[QueryPoint]) -> Result<Vec<Hit>, BadOptions> {
        check_structure(self.geometry().accel().kind())?;
        let mut hits = vec![Hit::zeroed(); points.len()];
        match self.wide_after(points.len().saturating_mul(RAYS_PER_POINT)) {
            Some(bvh) => cpu::closest_points(&self.inputs(), bvh, points, &mut hits),
            None => reference::closest_point::closest_point(&self.inputs(), points, &mut hits),
        }
        Ok(hits)
    }
}

fn check_structure(kind: AccelKind) -> Result<(), BadOptions> {
    let refusal = "closest points are found in kd-trees (--accel kdtree)";
    if kind == AccelKind::KdTree { Ok(()) } else { Err(BadOptions(refusal.to_owned())) }
}

/// Counts the points that can only miss. Their position is not finite, or their `t_max` is NaN or negative.
pub fn count_invalid_points(points: &[QueryPoint]) -> u64 {
    points.par_iter().with_min_len(1024).filter(|point| !reference::closest_point::is_point(point)).count() as u64
}
