//! The reference's passes that trace rays, with [`FastTracer`] in place of the reference's tracer.

use std::ops::Range;

use super::tracer::{CpuSearch, FastTracer};
use crate::{
    accel::Query,
    layout::{Hit, PathRay, Ray},
    reference::{self, inputs::KernelInputs},
};

/// Does what [`reference::trace::trace`] does.
pub fn trace(inputs: &KernelInputs, search: CpuSearch, rays: &[PathRay], hits: &mut [Hit]) -> u32 {
    reference::trace::trace_by(inputs, || FastTracer::new(inputs, search), rays, hits)
}

/// Does what [`reference::shadow::shadow`] does.
pub fn shadow(
    inputs: &KernelInputs,
    search: CpuSearch,
    places: &Range<usize>,
    rays_and_hits: (&[PathRay], &[Hit]),
    light_visibility: &mut [u32],
) -> u32 {
    reference::shadow::shadow_by(inputs, || FastTracer::new(inputs, search), places, rays_and_hits, light_visibility)
}

/// Does what [`reference::visibility::visibility`] does.
pub fn visibility(inputs: &KernelInputs, search: CpuSearch, triangle_ids: &mut [u32]) {
    reference::visibility::visibility_by(inputs, || FastTracer::new(inputs, search), triangle_ids);
}

/// Does what [`reference::cast::cast`] does.
pub fn cast(inputs: &KernelInputs, search: CpuSearch, query: Query, rays: &[Ray], hits: &mut [Hit]) {
    reference::cast::cast_by(inputs, || FastTracer::new(inputs, search), query, rays, hits);
}
