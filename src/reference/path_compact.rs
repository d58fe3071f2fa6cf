//! Path compact: the lists of the paths that go on, and of those with a shadow ray to a light. Twin of
//! `path_compact.comp`, and of `compact_spine.comp` for paths.

use rayon::prelude::*;

use super::compact::places_of_blocks;
use crate::layout::{Bounce, Frame, PATH_GOES_ON, PATH_HAS_SHADOW_RAY, SCAN_GROUP_SIZE};

/// The fewest blocks that one thread takes at a time.
const BLOCKS_PER_TASK: usize = 16;

/// Returns what `child_flags` has for a path.
pub fn flags_of_path(goes_on: bool, has_shadow_ray: bool) -> u32 {
    u32::from(goes_on) * PATH_GOES_ON + u32::from(has_shadow_ray) * PATH_HAS_SHADOW_RAY
}

/// Counts the paths of a block that go on, and those with a shadow ray.
pub fn counts_of_block(child_flags: &[u32]) -> [u32; 2] {
    let both: u32 = child_flags.iter().sum();
    [both % PATH_HAS_SHADOW_RAY, both / PATH_HAS_SHADOW_RAY]
}

/// Turns the blocks' counts into their exclusive prefix sums. Stores the number of shadow rays in the bounce's row, and
/// sizes the next bounce.
pub fn spine(scan_blocks: &mut [[u32; 2]], constants: &Frame, this: &mut Bounce, next: &mut Bounce) {
    let mut carry = [0, 0];
    for counts in scan_blocks {
        let before = std::mem::replace(counts, carry);
        carry = [carry[0] + before[0], carry[1] + before[1]];
    }
    this.n_shadow_rays = carry[1];
    next.set_paths(carry[0], carry[1], constants);
}

/// Writes to `next` those of the paths `live` that go on, as `child_flags` says, and to `with_shadow_ray` those that
/// have a shadow ray.
pub fn path_compact(
    live: &[u32],
    child_flags: &[u32],
    scan_blocks: &[[u32; 2]],
    next: &mut [u32],
    with_shadow_ray: &mut [u32],
) {
    let block_size = SCAN_GROUP_SIZE as usize;
    let blocks = (live.par_chunks(block_size), child_flags.par_chunks(block_size));
    let places_in_next = places_of_blocks(scan_blocks, |begins| begins[0], next);
    let places = (places_in_next, places_of_blocks(scan_blocks, |begins| begins[1], with_shadow_ray));
    blocks.into_par_iter().zip(places).with_min_len(BLOCKS_PER_TASK).for_each(|((live, flags), places)| {
        for (places, bit) in [(places.0, PATH_GOES_ON), (places.1, PATH_HAS_SHADOW_RAY)] {
            let listed = live.iter().zip(flags).filter(|(_, flags)| **flags & bit != 0);
            listed.zip(places).for_each(|((path_ix, _), place)| *place = *path_ix);
        }
    });
}
