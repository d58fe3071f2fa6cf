//! Which rays go into each pass and come out of it, alike on GPU and CPU.

use crate::{
    frame::{BounceStats, PassTime, Primary},
    layout::{Bounce, Counters},
};

/// Fills in a pass's rays. `bounces`: of the pass's batch.
pub(crate) fn count_rays(pass: &mut PassTime, bounces: &[BounceStats], primary: Primary) {
    let Some(bounce_ix) = pass.bounce.map(|bounce| bounce as usize) else { return };
    let Some(bounce) = bounces.get(bounce_ix) else { return };
    pass.n_rays_in = Some(bounce.n_rays);
    pass.n_rays_out = match pass.name {
        "primary_hit" if primary == Primary::Trace => Some(bounce.n_rays),
        "primary_hit" | "trace" => Some(bounce.n_hits),
        "shadow" => Some(bounce.n_shadow_rays),
        "shade" | "compact_reduce" | "compact_spine" | "compact_scatter" => {
            Some(bounces.get(bounce_ix + 1).map_or(0, |next| next.n_rays))
        }
        _ => None, // resolve: rays end in pixels
    };
}

/// The counts that a device has left, one row a batch and bounce.
pub(crate) fn device_counts(bounces: &[Bounce], counters: &[Counters]) -> Vec<BounceStats> {
    let row = |(bounce, counters): (&Bounce, &Counters)| BounceStats {
        n_rays: bounce.n_rays.into(),
        n_hits: counters.n_hits.into(),
        n_shadow_rays: counters.n_shadow_rays.into(),
    };
    bounces.iter().zip(counters).map(row).collect()
}

/// Fills in the batch and the rays of each pass of a device's frame. `counts`: as [`device_counts`] gives them,
/// `max_depth` rows a batch.
pub(crate) fn count_batches(passes: &mut [PassTime], counts: &[BounceStats], max_depth: u32, primary: Primary) {
    let batches = || (0..).zip(counts.chunks_exact(max_depth as usize));
    // Every batch is recorded alike, whatever becomes of its rays.
    let passes_a_batch = passes.iter().filter(|pass| pass.bounce.is_some()).count() / batches().count().max(1);
    let mut in_batches = passes.iter_mut().filter(|pass| pass.bounce.is_some());
    for (batch_ix, bounces) in batches() {
        for pass in in_batches.by_ref().take(passes_a_batch) {
            pass.batch = Some(batch_ix);
            count_rays(pass, bounces, primary);
        }
    }
}

/// The batches' counts added up, one row a bounce.
pub(crate) fn sum_of_batches(counts: &[BounceStats], max_depth: u32) -> Vec<BounceStats> {
    let mut sums = vec![BounceStats::default(); max_depth as usize];
    for batch in counts.chunks_exact(max_depth as usize) {
        sums.iter_mut().zip(batch).for_each(|(sum, bounce)| sum.add(bounce));
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stats(n_rays: u64, n_hits: u64, n_shadow_rays: u64) -> BounceStats {
        BounceStats { n_rays, n_hits, n_shadow_rays }
    }

    fn pass(name: &'static str, bounce: Option<u32>) -> PassTime {
        PassTime { name, bounce, ..PassTime::default() }
    }

    #[test]
    fn each_pass_has_the_rays_of_its_batch_and_bounce() {
        let names = ["primary_hit", "shadow", "shade", "resolve", "compact_scatter"];
        let second = ["trace", "shade"];
        let mut passes = vec![pass("visibility", None)];
        for _ in 0..2 {
            passes.extend(names.map(|name| pass(name, Some(0))));
            passes.extend(second.map(|name| pass(name, Some(1))));
        }
        passes.push(pass("tonemap", None));
        let counts = [stats(64, 60, 50), stats(20, 10, 0), stats(32, 30, 9), stats(8, 7, 0)];
        count_batches(&mut passes, &counts, 2, Primary::Raster);
        let found: Vec<_> = passes.iter().map(|p| (p.batch, p.n_rays_in, p.n_rays_out)).collect();
        let batch = |ix, [first, second]: [BounceStats; 2]| {
            let [n, m] = [first.n_rays, second.n_rays].map(Some);
            let [hits, more_hits] = [first.n_hits, second.n_hits].map(Some);
            let outs = [hits, Some(first.n_shadow_rays), m, None, m].map(|out| (Some(ix), n, out));
            [&outs[..], &[(Some(ix), m, more_hits), (Some(ix), m, Some(0))]].concat()
        };
        let [a, b, c, d] = counts;
        let once = (None, None, None);
        assert_eq!(found, [vec![once], batch(0, [a, b]), batch(1, [c, d]), vec![once]].concat());
        assert_eq!(sum_of_batches(&[a, b, c, d], 2), [stats(96, 90, 59), stats(28, 17, 0)]);
    }

    #[test]
    fn camera_rays_that_are_traced_are_only_made_by_primary_hit() {
        let mut passes = [pass("primary_hit", Some(0))];
        count_batches(&mut passes, &[stats(64, 60, 0)], 1, Primary::Trace);
        assert_eq!((passes[0].n_rays_in, passes[0].n_rays_out), (Some(64), Some(64)));
    }
}
