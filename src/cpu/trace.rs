//! The reference's passes that trace rays, with [`FastTracer`] in place of the reference's tracer.

use std::ops::Range;

use super::tracer::FastTracer;
use crate::{
    accel::{Query, kdtree::Traversal},
    layout::{Hit, PathRay, Ray},
    reference::{self, inputs::KernelInputs},
};

/// Does what [`reference::trace::trace`] does.
pub fn trace(inputs: &KernelInputs, traversal: Traversal, rays: &[PathRay], hits: &mut [Hit]) -> u32 {
    reference::trace::trace_by(inputs, || FastTracer::new(inputs, traversal), rays, hits)
}

/// Does what [`reference::shadow::shadow`] does.
pub fn shadow(
    inputs: &KernelInputs,
    traversal: Traversal,
    places: &Range<usize>,
    rays_and_hits: (&[PathRay], &[Hit]),
    light_visibility: &mut [u32],
) -> u32 {
    reference::shadow::shadow_by(inputs, || FastTracer::new(inputs, traversal), places, rays_and_hits, light_visibility)
}

/// Does what [`reference::visibility::visibility`] does.
pub fn visibility(inputs: &KernelInputs, traversal: Traversal, triangle_ids: &mut [u32]) {
    reference::visibility::visibility_by(inputs, || FastTracer::new(inputs, traversal), triangle_ids);
}

/// Does what [`reference::cast::cast`] does.
pub fn cast(inputs: &KernelInputs, traversal: Traversal, query: Query, rays: &[Ray], hits: &mut [Hit]) {
    reference::cast::cast_by(inputs, || FastTracer::new(inputs, traversal), query, rays, hits);
}
