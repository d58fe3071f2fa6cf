//! The ways by which a device finds triangles soonest.

use crate::{
    frame::{Primary, RenderOptions, Traversal},
    gpu::Context,
    passes::Raster,
};

/// How rays are to find triangles; none: as suits the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ways {
    pub traversal: Option<Traversal>,
    pub primary: Option<Primary>,
}

impl Ways {
    /// The options with the ways asked for, or what suits the device, or without one the CPU, in pictures of that size.
    pub fn suited(
        self,
        options: &RenderOptions,
        context: Option<&Context>,
        n_triangles: usize,
        size: (u32, u32),
    ) -> RenderOptions {
        let traversal = self.traversal.unwrap_or_else(|| suited_traversal(context));
        let primary = self.primary.unwrap_or_else(|| suited_primary(context, n_triangles, size));
        RenderOptions { traversal, primary, ..options.clone() }
    }
}

/// The way through the tree that is fastest on a device; without one, on the CPU.
pub fn suited_traversal(context: Option<&Context>) -> Traversal {
    match context {
        None => Traversal::OF_CPU,
        Some(context) if context.runs_both_sides() => Traversal::OF_SOFTWARE_DRIVERS,
        Some(_) => Traversal::OF_GPUS,
    }
}

/// The primary rays that a device finds soonest in a picture of that size; without one, the CPU.
pub fn suited_primary(context: Option<&Context>, n_triangles: usize, size: (u32, u32)) -> Primary {
    match context {
        // Mesa's lavapipe: 870,000 triangles in 72 ms, 790,000 rays in 242 (benches/EXPERIMENTS.md).
        Some(context) if context.runs_both_sides() => Primary::suited_to(n_triangles, size, 4),
        Some(context) if context.has_wide_atomics() && Raster::has_room(context, n_triangles) => Primary::Compute,
        _ => Primary::suited_to(n_triangles, size, 1),
    }
}
