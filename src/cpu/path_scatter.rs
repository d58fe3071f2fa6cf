//! Path scatter: the light at the hits of paths, and the way on. It does what the reference's pass does, with the random
//! numbers of sixteen paths computed together.

use fearless_simd::{Level, dispatch};
use glam::vec2;
use rayon::prelude::*;

use super::{
    lanes::LANES,
    path_begin::PixelOfBatch,
    sampler::{KeysSoa, random_pairs},
};
use crate::{
    layout::{Batch, Hit, SCAN_GROUP_SIZE, SEGMENT_NONE},
    reference::{
        inputs::KernelInputs,
        live_paths::parts,
        path_scatter::PathBuffers,
        path_vertex::{PAIRS_OF_HIT, first_pair_of, step_path},
    },
};

/// Does what [`reference::path_scatter`](crate::reference::path_scatter::path_scatter) does. `pixels`: of the batch.
pub fn path_scatter(
    inputs: &KernelInputs,
    (batch, pixels): (&Batch, &[PixelOfBatch]),
    (live, hits): (&[u32], &[Hit]),
    paths: PathBuffers,
    (child_kinds, scan_blocks): (&mut [u32], &mut [u32]),
) {
    let (level, block_size) = (Level::new(), SCAN_GROUP_SIZE as usize);
    let of_blocks = (live.par_chunks(block_size), child_kinds.par_chunks_mut(block_size), scan_blocks.par_iter_mut());
    let of_paths = (
        parts(paths.rays, live, block_size),
        parts(paths.states, live, block_size),
        parts(paths.segments, live, block_size),
    );
    of_blocks.into_par_iter().zip(of_paths).for_each(|(of_block, (mut rays, mut states, mut segments))| {
        let (live, kinds, n_going_on) = of_block;
        for (live, kinds) in live.chunks(LANES).zip(kinds.chunks_mut(LANES)) {
            let mut keys = KeysSoa::default();
            for (lane, &path_ix) in live.iter().enumerate() {
                keys.set(lane, pixels[(path_ix % batch.n_pixels) as usize].key_of_path(batch, path_ix));
            }
            let first_pair = first_pair_of(batch.depth);
            let pairs = dispatch!(level, simd => random_pairs::<_, PAIRS_OF_HIT>(simd, &keys, first_pair));
            for (lane, (&path_ix, kind)) in live.iter().zip(&mut *kinds).enumerate() {
                let random_pairs = || pairs.map(|[x, y]| vec2(x[lane], y[lane]));
                let (ray, state) = (rays.of_path(path_ix), states.of_path(path_ix));
                let hit = &hits[path_ix as usize];
                let (goes_on, segment) = step_path(inputs, random_pairs, batch.depth, hit, ray, state);
                // A path without a segment has none already.
                if segment.state != SEGMENT_NONE {
                    *segments.of_path(path_ix) = segment;
                }
                *kind = goes_on.into();
            }
        }
        *n_going_on = kinds.iter().sum();
    });
}
