//! Rules for how rays are traced, from the device and the sizes of scene and picture alone.

use super::Processor;
use crate::{accel::kdtree::Traversal, buffers::RasterQueue, frame::Primary, gpu::Context};

/// Returns the traversal that is fastest on a processor in most scenes.
pub fn traversal_by_rule(processor: Processor) -> Traversal {
    match processor {
        Processor::Cpu => Traversal::OF_CPU,
        Processor::SoftwareDriver => Traversal::OF_SOFTWARE_DRIVERS,
        Processor::Gpu => Traversal::OF_GPUS,
    }
}

/// Returns the kind of primary visibility that is fastest for a picture of this size on the device. If `context` is
/// none, returns the kind that is fastest on the CPU.
#[doc(hidden)]
pub fn primary_by_rule(context: Option<&Context>, n_triangles: usize, size: (u32, u32)) -> Primary {
    match context {
        // Mesa's lavapipe rasterizes 870,000 triangles in 72 ms, and traces 790,000 rays in 242 ms: about 4 triangles
        // in the time of a ray (docs/experiments.md).
        Some(context) if context.predicates_branches() => Primary::suited_to(n_triangles, size, 4),
        Some(context) if context.has_int64_atomics() && RasterQueue::has_room(context, n_triangles) => {
            Primary::SoftwareRaster
        }
        _ => Primary::suited_to(n_triangles, size, 1),
    }
}

/// Triangles of instances that compute kernels rasterize in the time in which a ray is traced, about: an H200
/// rasterizes 10,000 knots of 20,000 triangles in 9.9 ms, and traces the rays of the same picture in 1.3 ms.
const PLACED_TRIANGLES_PER_RAY: u64 = 16;

/// Returns whether the instances of a world have so many triangles that primary rays are traced through them, whatever
/// [`primary_by_rule`] says.
pub(super) fn traces_instances(n_triangles: usize, size: (u32, u32)) -> bool {
    Primary::suited_to(n_triangles, size, PLACED_TRIANGLES_PER_RAY) == Primary::Trace
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crowded_instances_are_traced() {
        let traced = [1, 16 * 64 * 48, 16 * 64 * 48 + 1, 200_000_000].map(|n| traces_instances(n, (64, 48)));
        assert_eq!(traced, [false, false, true, true]);
    }
}
