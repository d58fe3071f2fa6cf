//! Compact: the children of all rays, in order and without gaps, by a prefix sum over their counts. Twin of
//! `compact_reduce.comp`, `compact_spine.comp` and `compact_scatter.comp`.

use rayon::prelude::*;

use crate::layout::{Bounce, Frame, Ray, SCAN_BLOCK_SIZE};

const BLOCK: usize = SCAN_BLOCK_SIZE as usize;

/// Writes the child counts of each block of `SCAN_BLOCK_SIZE` rays, added up.
pub fn reduce(child_counts: &[u32], scan_blocks: &mut [u32]) {
    child_counts.par_chunks(BLOCK).zip(scan_blocks).for_each(|(counts, sum)| *sum = counts.iter().sum());
}

/// Turns the blocks' sums into their exclusive prefix sums and sizes the next bounce. Where a queue of
/// `constants.queue_capacity` cannot hold that many rays, the next bounce is empty and says `overflow`.
pub fn spine(scan_blocks: &mut [u32], constants: &Frame, next: &mut Bounce) {
    let mut carry = 0;
    for block in scan_blocks {
        let sum = *block;
        *block = carry;
        carry += sum;
    }
    size_next_bounce(carry, constants, next);
}

fn size_next_bounce(n_wanted: u32, constants: &Frame, next: &mut Bounce) {
    let n_rays = if n_wanted <= constants.queue_capacity { n_wanted } else { 0 };
    next.overflow = u32::from(n_rays != n_wanted);
    next.n_wanted = n_wanted;
    next.set_n_rays(n_rays, constants);
}

/// Moves the children of each ray (two places a ray, `child_counts` of them filled) to the next queue, which is
/// exactly as long as all of them.
pub fn scatter(child_rays: &[Ray], child_counts: &[u32], scan_blocks: &[u32], next_rays: &mut [Ray]) {
    let mut places = Vec::with_capacity(scan_blocks.len());
    let mut rest = next_rays;
    for (block, &begin) in scan_blocks.iter().enumerate() {
        let end = scan_blocks.get(block + 1).map_or(begin as usize + rest.len(), |&end| end as usize);
        let (place, behind) = rest.split_at_mut(end - begin as usize);
        places.push(place);
        rest = behind;
    }
    child_rays.par_chunks(2 * BLOCK).zip(child_counts.par_chunks(BLOCK)).zip(places).for_each(
        |((children, counts), place)| {
            let filled = children.chunks_exact(2).zip(counts).flat_map(|(pair, &count)| &pair[..count as usize]);
            place.iter_mut().zip(filled).for_each(|(place, child)| *place = *child);
        },
    );
}
