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
