//! How rays are traced where nothing is known but the device and the sizes of scene and picture.

use super::Processor;
use crate::{accel::kdtree::Traversal, buffers::RasterQueue, frame::Primary, gpu::Context};

/// The traversal that is fastest on an processor in most scenes.
pub fn traversal_by_rule(processor: Processor) -> Traversal {
    match processor {
        Processor::Cpu => Traversal::OF_CPU,
        Processor::SoftwareDriver => Traversal::OF_SOFTWARE_DRIVERS,
        Processor::Gpu => Traversal::OF_GPUS,
    }
}

/// The primary rays that a device finds soonest in a picture of that size; without a device, the CPU.
pub fn primary_by_rule(context: Option<&Context>, n_triangles: usize, size: (u32, u32)) -> Primary {
    match context {
        // Mesa's lavapipe: 870,000 triangles in 72 ms, 790,000 rays in 242 (benches/EXPERIMENTS.md).
        Some(context) if context.predicates_branches() => Primary::suited_to(n_triangles, size, 4),
        Some(context) if context.has_wide_atomics() && RasterQueue::has_room(context, n_triangles) => Primary::Compute,
        _ => Primary::suited_to(n_triangles, size, 1),
    }
}
