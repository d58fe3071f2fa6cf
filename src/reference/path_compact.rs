//! Path compact: the list of the paths that go on. Twin of `path_compact.comp`, and of `compact_spine.comp` for paths.

use super::compact::exclusive_prefix_sum;
use crate::layout::{Bounce, Frame, SCAN_GROUP_SIZE};

/// Turns the blocks' sums into their exclusive prefix sums, and sizes the next bounce.
pub fn spine(scan_blocks: &mut [u32], constants: &Frame, this: &Bounce, next: &mut Bounce) {
    next.set_paths(exclusive_prefix_sum(scan_blocks), this.n_rays, constants);
}

/// Writes those of the paths `live` that go on, as `child_kinds` says, to `next`.
pub fn path_compact(live: &[u32], child_kinds: &[u32], scan_blocks: &[u32], next: &mut [u32]) {
    let block_size = SCAN_GROUP_SIZE as usize;
    for ((live, kinds), &begin) in live.chunks(block_size).zip(child_kinds.chunks(block_size)).zip(scan_blocks) {
        let going_on = live.iter().zip(kinds).filter(|(_, kind)| **kind != 0);
        going_on.zip(&mut next[begin as usize..]).for_each(|((path_ix, _), place)| *place = *path_ix);
    }
}
