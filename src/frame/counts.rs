//! Counts of the rays that go into each pass and come out of it, the same on GPU and CPU.

use crate::{
    frame::{BounceStats, PassTime, Role, Scope},
    layout::{Bounce, Counters},
};

/// Whether the pass belongs to a batch: it runs for the batch or for one of its bounces, not once a frame.
pub(crate) fn is_in_batch(pass: &PassTime) -> bool {
    pass.pass().scope() != Scope::Frame
}

/// Fills in a pass's counts of rays. `bounces`: the counts of the pass's batch, one row per bounce.
pub(crate) fn count_rays(pass: &mut PassTime, bounces: &[BounceStats]) {
    let role = pass.pass().role();
    if pass.pass().scope() == Scope::Batch {
        let sum = |count: fn(&BounceStats) -> u64| bounces.iter().map(count).sum();
        pass.n_rays_in = Some(sum(|bounce| bounce.n_rays));
        // Shade and resolve, the other passes with this scope, make no rays.
        pass.n_rays_out = (role == Role::Shadow).then(|| sum(|bounce| bounce.n_shadow_rays));
        return;
    }
    let Some(bounce_ix) = pass.bounce.map(|bounce| bounce as usize) else { return };
    let Some(bounce) = bounces.get(bounce_ix) else { return };
    pass.n_rays_in = Some(bounce.n_rays);
    pass.n_rays_out = match role {
        Role::ClosestHit => Some(bounce.n_hits),
        Role::Compaction => Some(bounces.get(bounce_ix + 1).map_or(0, |next| next.n_rays)),
        _ => None,
    };
}

/// Returns the counts of a device's frame, one row for each bounce of each batch. `bounces`: the contents of the
/// buffer. `counters`: the sums that [`Resources::counters`](crate::buffers::Resources::counters) returns.
pub(crate) fn device_counts(bounces: &[Bounce], counters: &[Counters]) -> Vec<BounceStats> {
    let row = |(bounce, counters): (&Bounce, &Counters)| BounceStats {
        n_rays: bounce.n_rays.into(),
        n_hits: counters.n_hits.into(),
        n_shadow_rays: counters.n_shadow_rays.into(),
    };
    bounces.iter().zip(counters).map(row).collect()
}

/// Fills in the batch and the counts of rays of each pass of a device's frame. `counts`: the rows that
/// [`device_counts`] returns, `max_depth` rows for each batch.
pub(crate) fn count_batches(passes: &mut [PassTime], counts: &[BounceStats], max_depth: u32) {
    let batches = || (0..).zip(counts.chunks_exact(max_depth as usize));
    // All batches have the same passes, no matter how many rays they have.
    let passes_per_batch = passes.iter().filter(|pass| is_in_batch(pass)).count() / batches().count().max(1);
    let mut in_batches = passes.iter_mut().filter(|pass| is_in_batch(pass));
    for (batch_ix, bounces) in batches() {
        for pass in in_batches.by_ref().take(passes_per_batch) {
            pass.batch = Some(batch_ix);
            count_rays(pass, bounces);
        }
    }
}

/// Returns the sums of the counts over all batches, one row per bounce.
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
        let mut passes = vec![pass("visibility", None)];
        for _ in 0..2 {
            passes.extend(["primary_hit", "pixel_aovs", "compact_scatter"].map(|name| pass(name, Some(0))));
            passes.push(pass("trace", Some(1)));
            passes.extend(["shadow", "shade", "resolve"].map(|name| pass(name, None)));
        }
        passes.push(pass("tonemap", None));
        let counts = [stats(64, 60, 50), stats(20, 10, 4), stats(32, 30, 9), stats(8, 7, 0)];
        count_batches(&mut passes, &counts, 2);
        let found: Vec<_> = passes.iter().map(|p| (p.batch, p.n_rays_in, p.n_rays_out)).collect();
        let batch = |ix, [first, second]: [BounceStats; 2]| {
            let [n, m, all] = [first.n_rays, second.n_rays, first.n_rays + second.n_rays].map(Some);
            let [hits, more_hits] = [first.n_hits, second.n_hits].map(Some);
            let n_tested = Some(first.n_shadow_rays + second.n_shadow_rays);
            let of_first = [hits, None, m].map(|out| (Some(ix), n, out));
            let of_all = [n_tested, None, None].map(|out| (Some(ix), all, out));
            [&of_first[..], &[(Some(ix), m, more_hits)], &of_all[..]].concat()
        };
        let [a, b, c, d] = counts;
        let once = (None, None, None);
        assert_eq!(found, [vec![once], batch(0, [a, b]), batch(1, [c, d]), vec![once]].concat());
        assert_eq!(sum_of_batches(&[a, b, c, d], 2), [stats(96, 90, 59), stats(28, 17, 4)]);
    }
}
