//! Compact: writes the child rays of all hits of a bounce in order and without gaps, by a prefix sum over their
//! counts. Twin of `compact_reduce.comp`, `compact_spine.comp` and `compact_scatter.comp`.

use rayon::prelude::*;

use super::{
    RAYS_PER_TASK,
    children::{child_flags_of, children_of},
    inputs::KernelInputs,
};
use crate::layout::{Bounce, Frame, Hit, PathRay, SCAN_GROUP_SIZE};

const BLOCK: usize = SCAN_GROUP_SIZE as usize;
const BLOCKS_PER_TASK: usize = RAYS_PER_TASK.div_ceil(BLOCK);

/// The rays of a bounce, whose children make up the next bounce.
#[derive(Clone, Copy)]
pub struct Parents<'a> {
    pub rays: &'a [PathRay],
    /// One for each ray.
    pub hits: &'a [Hit],
}

/// Writes which child rays start at each hit (`child_flags`, bits `CHILD_*`), and how many start at the hits of each
/// block of `SCAN_GROUP_SIZE` rays (`scan_blocks`).
pub fn reduce(inputs: &KernelInputs, parents: Parents, child_flags: &mut [u32], scan_blocks: &mut [u32]) {
    (parents.rays.par_chunks(BLOCK).zip(parents.hits.par_chunks(BLOCK)))
        .zip(child_flags.par_chunks_mut(BLOCK).zip(scan_blocks))
        .with_min_len(BLOCKS_PER_TASK)
        .for_each(|((rays, hits), (flags, sum))| {
            for ((ray, hit), flags) in rays.iter().zip(hits).zip(&mut *flags) {
                *flags = child_flags_of(inputs, ray, hit);
            }
            *sum = flags.iter().map(|flags| flags.count_ones()).sum();
        });
}

/// Turns the blocks' sums into their exclusive prefix sums and sizes the next bounce. If the queue, which holds
/// `constants.queue_capacity` rays, has no room for the next bounce's rays, that bounce is empty and its `overflow`
/// is set.
pub fn spine(scan_blocks: &mut [u32], constants: &Frame, this: &Bounce, next: &mut Bounce) {
    size_next_bounce(exclusive_prefix_sum(scan_blocks), constants, this, next);
}

/// Replaces numbers by the sums of those before them. Returns the sum of all.
pub fn exclusive_prefix_sum(numbers: &mut [u32]) -> u32 {
    let mut carry = 0;
    for number in numbers {
        carry += std::mem::replace(number, carry);
    }
    carry
}

/// Cuts a list into the places of each block. The last block gets the rest of the list. `begin_of`: returns from a
/// block's element of `scan_blocks` where the block's places begin.
pub(super) fn places_of_blocks<'a, B, T>(
    scan_blocks: &[B],
    begin_of: impl Fn(&B) -> u32,
    mut list: &'a mut [T],
) -> Vec<&'a mut [T]> {
    let place_of = |block: usize| {
        let begin = begin_of(&scan_blocks[block]);
        let n_places = scan_blocks.get(block + 1).map_or(list.len(), |next| (begin_of(next) - begin) as usize);
        let (places, rest) = std::mem::take(&mut list).split_at_mut(n_places);
        list = rest;
        places
    };
    (0..scan_blocks.len()).map(place_of).collect()
}

fn size_next_bounce(n_wanted: u32, constants: &Frame, this: &Bounce, next: &mut Bounce) {
    let first_ray = this.first_ray + this.n_rays;
    let n_rays = if n_wanted <= constants.queue_capacity.saturating_sub(first_ray) { n_wanted } else { 0 };
    next.overflow = u32::from(n_rays != n_wanted);
    next.n_wanted = n_wanted;
    next.set_rays(first_ray, n_rays, constants);
}

/// Writes the child rays to `next_rays`, which is the queue from `first_ray` on, and the queue index of each hit's
/// first child to `first_children`.
pub fn scatter(
    inputs: &KernelInputs,
    parents: Parents,
    child_flags: &[u32],
    scan_blocks: &[u32],
    first_ray: u32,
    first_children: &mut [u32],
    next_rays: &mut [PathRay],
) {
    let places = places_of_blocks(scan_blocks, |begin| *begin, next_rays);
    (parents.rays.par_chunks(BLOCK).zip(parents.hits.par_chunks(BLOCK)).zip(child_flags.par_chunks(BLOCK)))
        .zip(first_children.par_chunks_mut(BLOCK).zip(scan_blocks).zip(places))
        .with_min_len(BLOCKS_PER_TASK)
        .for_each(|(((rays, hits), flags), ((first_children, &begin), place))| {
            let mut n_made = 0;
            for (((ray, hit), &flags), first_child) in rays.iter().zip(hits).zip(flags).zip(first_children) {
                *first_child = first_ray + begin + n_made as u32;
                for child in children_of(inputs, ray, hit, flags) {
                    place[n_made] = child;
                    n_made += 1;
                }
            }
        });
}
