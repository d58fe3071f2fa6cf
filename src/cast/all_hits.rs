//! All hits of the caller's rays, on a device or on the CPU.
//!
//! A device first counts the hits of a batch. The host sums the counts up, which gives each ray a place in the list,
//! and the device then finds the hits again and writes them.

use std::{ops::Range, sync::Arc};

use bytemuck::Zeroable;

use super::{CpuCaster, GpuCaster, Hit, NO_TRIANGLE, Ray};
use crate::{
    buffers::{AllHitsResources, ResumePass},
    gpu::{BindingLayout, GpuError},
    layout::HitCursor,
    passes, reference,
};

/// All hits of rays.
#[derive(Clone, Debug, PartialEq)]
pub struct AllHits {
    /// One number for each ray, and one more: the hits of ray i are those from `ray_splits[i]` up to, but not
    /// including, `ray_splits[i + 1]`.
    pub ray_splits: Vec<u64>,
    /// The hits of each ray, in the order of t, and of the triangles' indices where t are the same.
    pub hits: Vec<Hit>,
}

impl AllHits {
    /// `ends`: where each ray's hits end. The `most` nearest hits of a ray are kept.
    fn new(ends: impl IntoIterator<Item = usize>, mut hits: Vec<Hit>, most: usize) -> Self {
        let (mut ray_splits, mut begin, mut n_kept) = (vec![0], 0, 0);
        for end in ends {
            // Hits of several instances have no order. Rays from afar were searched from a nearer origin: there t can
            // differ that are the same when they are counted from the ray's own origin.
            hits[begin..end].sort_by(|a, b| a.t.total_cmp(&b.t).then(a.triangle_ix.cmp(&b.triangle_ix)));
            let n = most.min(end - begin);
            hits.copy_within(begin..begin + n, n_kept);
            n_kept += n;
            ray_splits.push(n_kept as u64);
            begin = end;
        }
        hits.truncate(n_kept);
        Self { ray_splits, hits }
    }
}

impl CpuCaster<'_> {
    /// Counts the triangles that each ray meets in (`t_min`, `t_max`]. Each counts once, also if it coincides with
    /// others.
    pub fn count_hits(&self, rays: &[Ray]) -> Vec<u32> {
        reference::all_hits::count_hits(&self.inputs(), self.traversal, rays)
    }

    /// Lists the hits that [`Self::count_hits`] counts, or of each ray the `most_per_ray` nearest ones. The
    /// t that decide are those of the search, which without instances are not rounded to the far origin of a ray.
    pub fn all_hits(&self, rays: &[Ray], most_per_ray: Option<u32>) -> AllHits {
        let most = most_per_ray.map_or(usize::MAX, |most| most as usize);
        let (ends, hits) = reference::all_hits::list_hits(&self.inputs(), self.traversal, rays, most);
        AllHits::new(ends, hits, most)
    }
}

/// The kernels of a [`GpuCaster`], and what they bind.
struct Kernels {
    bindings: Arc<BindingLayout>,
    count: passes::AllHits,
    list: passes::AllHits,
}

impl GpuCaster {
    /// Counts the triangles that each ray meets in (`t_min`, `t_max`], batch by batch. Each counts once, also if it
    /// coincides with others.
    ///
    /// # Errors
    /// Memory runs out, or a call fails.
    pub fn count_hits(&mut self, rays: &[Ray]) -> Result<Vec<u32>, GpuError> {
        let kernels = self.hit_kernels()?;
        let mut counts = Vec::with_capacity(rays.len());
        for batch in rays.chunks(self.rays_per_batch) {
            counts.extend(self.count_batch(&kernels, batch, u32::MAX)?);
        }
        Ok(counts)
    }

    /// Lists the hits that [`Self::count_hits`] counts, or of each ray the `most_per_ray` nearest ones. The
    /// t that decide are those of the search, which without instances are not rounded to the far origin of a ray.
    ///
    /// # Errors
    /// A ray has more hits than a buffer of the device holds, memory runs out, or a call fails.
    pub fn all_hits(&mut self, rays: &[Ray], most_per_ray: Option<u32>) -> Result<AllHits, GpuError> {
        let kernels = self.hit_kernels()?;
        // Of several instances, the last one may have the nearest hit.
        let most_found = most_per_ray.filter(|_| self.structures_id.is_none()).unwrap_or(u32::MAX);
        let (mut ends, mut hits) = (Vec::with_capacity(rays.len()), Vec::new());
        for batch in rays.chunks(self.rays_per_batch) {
            let counts = self.count_batch(&kernels, batch, most_found)?;
            let mut end = hits.len();
            ends.extend(counts.iter().map(|count| {
                end += *count as usize;
                end
            }));
            for chunk in chunks(&counts, HITS_PER_RAY * self.rays_per_batch as u64) {
                hits.extend(self.list_chunk(&kernels, &batch[chunk.clone()], &counts[chunk])?);
            }
        }
        Ok(AllHits::new(ends, hits, most_per_ray.map_or(usize::MAX, |most| most as usize)))
    }

    fn hit_kernels(&self) -> Result<Kernels, GpuError> {
        let bindings = AllHitsResources::bindings(&self.context, &self.tree)?;
        let kernel = |lists| passes::AllHits::new(&self.context, &bindings, self.traversal, lists);
        Ok(Kernels { count: kernel(false)?, list: kernel(true)?, bindings })
    }

    fn count_batch(&self, kernels: &Kernels, rays: &[Ray], most: u32) -> Result<Vec<u32>, GpuError> {
        let resources = AllHitsResources::new(&self.context, &kernels.bindings, &self.tree, [rays.len(), 0])?;
        let cursor = cursor_at(0..most);
        self.find_hits(&kernels.count, &resources, rays, &vec![cursor; rays.len()])?;
        let cursors = resources.hit_cursors.download_first(rays.len())?;
        Ok(cursors.iter().map(|cursor| cursor.next_ix).collect())
    }

    /// Returns the hits of rays, as many of each as `counts` says.
    fn list_chunk(&self, kernels: &Kernels, rays: &[Ray], counts: &[u32]) -> Result<Vec<Hit>, GpuError> {
        let n_hits: u64 = counts.iter().map(|count| u64::from(*count)).sum();
        let limit = (self.context.limits().storage_range / size_of::<Hit>() as u64).min(u64::from(u32::MAX));
        if n_hits > limit {
            return Err(GpuError::Limit { what: "hits of a ray", value: n_hits, limit });
        }
        if n_hits == 0 {
            return Ok(Vec::new());
        }
        let resources =
            AllHitsResources::new(&self.context, &kernels.bindings, &self.tree, [rays.len(), n_hits as usize])?;
        let mut end_ix = 0;
        let cursor = |count: &u32| {
            let next_ix = end_ix;
            end_ix += count;
            cursor_at(next_ix..end_ix)
        };
        let cursors: Vec<_> = counts.iter().map(cursor).collect();
        self.find_hits(&kernels.list, &resources, rays, &cursors)?;
        resources.listed_hits.download_first(n_hits as usize)
    }

    /// Runs a kernel until every ray has come to its end.
    fn find_hits(
        &self,
        kernel: &passes::AllHits,
        resources: &AllHitsResources,
        rays: &[Ray],
        cursors: &[HitCursor],
    ) -> Result<(), GpuError> {
        resources.cast_rays.upload(rays)?;
        resources.hit_cursors.upload(cursors)?;
        let rays = self.masked(rays.len() as u32);
        self.context.run("all_hits", |commands| {
            self.tree.suspended_rays.reset(commands);
            kernel.record(commands, &resources.set, rays, ResumePass::Begin);
        })?;
        self.tree.suspended_rays.finish(&self.context, |commands, resume_pass| {
            kernel.record(commands, &resources.set, rays, resume_pass);
        })?;
        Ok(())
    }
}

/// Returns the cursor of a ray that begins, whose hits have these places.
fn cursor_at(places: Range<u32>) -> HitCursor {
    let Range { start: next_ix, end: end_ix } = places;
    HitCursor { next_ix, end_ix, triangle_ix: NO_TRIANGLE, mark: NO_TRIANGLE, ..HitCursor::zeroed() }
}

/// The hits that are listed at a time, as a multiple of a batch's rays. Their buffer is then as large as that of rays.
const HITS_PER_RAY: u64 = 2;

/// Cuts rays with these counts of hits into ranges that have at most `most` hits each, or a single ray.
fn chunks(counts: &[u32], most: u64) -> Vec<Range<usize>> {
    let (mut chunks, mut first, mut n_hits) = (Vec::new(), 0, 0);
    for (ray_ix, count) in counts.iter().enumerate() {
        n_hits += u64::from(*count);
        if n_hits > most && ray_ix > first {
            chunks.push(first..ray_ix);
            (first, n_hits) = (ray_ix, u64::from(*count));
        }
    }
    chunks.push(first..counts.len());
    chunks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_have_few_hits_or_one_ray() {
        assert_eq!(chunks(&[1, 2, 3, 9, 0, 4], 4), [0..2, 2..3, 3..4, 4..6]);
        assert_eq!(chunks(&[9], 4), vec![0..1]);
        assert_eq!(chunks(&[0, 0], 4), vec![0..2]);
    }
}
