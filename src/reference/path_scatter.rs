//! Path scatter: the light at the hits of paths, and the way on. Twin of `path_scatter.comp`.

use rayon::prelude::*;

use super::{
    inputs::KernelInputs,
    live_paths::path_slices,
    path_compact::{counts_of_block, flags_of_path},
    path_vertex::{HitChoices, pairs_of_hit, scatter_path},
    paths::{key_of_path, pixel_of_path},
};
use crate::layout::{Batch, Hit, PathRay, PathState, SCAN_GROUP_SIZE, SHADOW_RAY_NONE, ShadowRay};

/// The paths of a batch, one element each.
pub struct PathBuffers<'a> {
    pub rays: &'a mut [PathRay],
    pub states: &'a mut [PathState],
    pub shadow_rays: &'a mut [ShadowRay],
}

/// Takes the paths `live` one bounce further. Writes whether the path at each place of the list goes on and has a
/// shadow ray (`child_flags`). Counts both in each block of `SCAN_GROUP_SIZE` places (`scan_blocks`). `live` is in
/// ascending order.
pub fn path_scatter(
    inputs: &KernelInputs,
    batch: &Batch,
    (live, hits): (&[u32], &[Hit]),
    paths: PathBuffers,
    (child_flags, scan_blocks): (&mut [u32], &mut [[u32; 2]]),
) {
    let block_size = SCAN_GROUP_SIZE as usize;
    let of_blocks = (live.par_chunks(block_size), child_flags.par_chunks_mut(block_size), scan_blocks.par_iter_mut());
    let of_paths = (
        path_slices(paths.rays, live, block_size),
        path_slices(paths.states, live, block_size),
        path_slices(paths.shadow_rays, live, block_size),
    );
    of_blocks.into_par_iter().zip(of_paths).for_each(|(of_block, (mut rays, mut states, mut shadow_rays))| {
        let (live, flags, counts) = of_block;
        for (&path_ix, flags) in live.iter().zip(&mut *flags) {
            let key = key_of_path(inputs, path_ix, pixel_of_path(inputs.frame(), batch, path_ix));
            let (ray, state) = (rays.of_path(path_ix), states.of_path(path_ix));
            let choices = || HitChoices { pairs: pairs_of_hit(key, batch.depth), of_environment: None };
            let (goes_on, shadow_ray) = scatter_path(inputs, choices, batch.depth, &hits[path_ix as usize], ray, state);
            // A path without a shadow ray has none already.
            if shadow_ray.state != SHADOW_RAY_NONE {
                *shadow_rays.of_path(path_ix) = shadow_ray;
            }
            *flags = flags_of_path(goes_on, shadow_ray.state != SHADOW_RAY_NONE);
        }
        *counts = counts_of_block(flags);
    });
}
