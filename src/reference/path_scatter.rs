//! Path scatter: the light at the hits of paths, and the way on. Twin of `path_scatter.comp`.

use rayon::prelude::*;

use super::{
    inputs::KernelInputs,
    path_vertex::step_path,
    paths::{key_of_path, pixel_of_path},
};
use crate::layout::{Batch, Hit, PathRay, PathState, SCAN_GROUP_SIZE, SEGMENT_NONE, Segment};

/// The paths of a batch, one element each.
pub struct PathBuffers<'a> {
    pub rays: &'a mut [PathRay],
    pub states: &'a mut [PathState],
    pub segments: &'a mut [Segment],
}

/// Takes the paths `live` one step further. Writes whether the path at each place of the list goes on (`child_kinds`),
/// and how many of each block of `SCAN_GROUP_SIZE` places do (`scan_blocks`).
pub fn path_scatter(
    inputs: &KernelInputs,
    batch: &Batch,
    (live, hits): (&[u32], &[Hit]),
    paths: PathBuffers,
    (child_kinds, scan_blocks): (&mut [u32], &mut [u32]),
) {
    let step = |&path_ix: &u32| {
        let ix = path_ix as usize;
        let key = key_of_path(inputs, batch, path_ix, pixel_of_path(inputs.frame(), batch, path_ix));
        let (mut ray, mut state) = (paths.rays[ix], paths.states[ix]);
        let (goes_on, segment) = step_path(inputs, key, batch.depth, &hits[ix], &mut ray, &mut state);
        (goes_on, ray, state, segment)
    };
    let steps: Vec<_> = live.par_iter().map(step).collect();
    for ((&path_ix, kind), (goes_on, ray, state, segment)) in live.iter().zip(&mut *child_kinds).zip(steps) {
        let ix = path_ix as usize;
        *kind = goes_on.into();
        paths.states[ix] = state;
        if segment.state != SEGMENT_NONE {
            paths.segments[ix] = segment;
        }
        if goes_on {
            paths.rays[ix] = ray;
        }
    }
    for (block, kinds) in scan_blocks.iter_mut().zip(child_kinds.chunks(SCAN_GROUP_SIZE as usize)) {
        *block = kinds.iter().sum();
    }
}
