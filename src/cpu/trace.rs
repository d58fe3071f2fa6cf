//! The reference's passes that take rays through the tree, by the engine's tracer.

use std::ops::Range;

use super::tracer::FastTracer;
use crate::{
    accel::{Query, kdtree::Traversal},
    layout::{Hit, PathRay, Ray},
    reference::{self, bindings::Bindings},
};

/// Does what [`reference::trace::trace`] does.
pub fn trace(bindings: &Bindings, traversal: Traversal, rays: &[PathRay], hits: &mut [Hit]) -> u32 {
    reference::trace::trace_by::<FastTracer>(bindings, traversal, rays, hits)
}

/// Does what [`reference::shadow::shadow`] does.
pub fn shadow(
    bindings: &Bindings,
    traversal: Traversal,
    places: &Range<usize>,
    rays_and_hits: (&[PathRay], &[Hit]),
    light_visibility: &mut [u32],
) -> u32 {
    reference::shadow::shadow_by::<FastTracer>(bindings, traversal, places, rays_and_hits, light_visibility)
}

/// Does what [`reference::visibility::visibility`] does.
pub fn visibility(bindings: &Bindings, traversal: Traversal, triangle_ids: &mut [u32]) {
    reference::visibility::visibility_by::<FastTracer>(bindings, traversal, triangle_ids);
}

/// Does what [`reference::cast::cast`] does.
pub fn cast(bindings: &Bindings, traversal: Traversal, query: Query, rays: &[Ray], hits: &mut [Hit]) {
    reference::cast::cast_by::<FastTracer>(bindings, traversal, query, rays, hits);
}
