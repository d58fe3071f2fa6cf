//! The buffers of rays.

use std::sync::Arc;

use crate::{
    gpu::{Buffer, BufferUse, Context, GpuError},
    layout::{Hit, PathRay, SCAN_GROUP_SIZE},
};

/// Room for `queue_capacity` rays, those of all bounces of a batch, and what belongs to each. A clone is a second
/// handle to the same buffers.
#[derive(Clone)]
pub struct Queue {
    /// Bounce after bounce; `queue_capacity`, like what follows but for the last two. The camera's, which come first, are never
    /// stored: kernels make them anew from their places (glsl/shared/rays.glsl).
    pub rays: Buffer<PathRay>,
    pub hits: Buffer<Hit>,
    pub child_kinds: Buffer<u32>,
    /// Where a ray's children begin in `rays`, or would if it had any.
    pub first_children: Buffer<u32>,
    pub ray_radiance: Buffer<[f32; 4]>,
    /// `n_lights * queue_capacity`, lights outermost.
    pub light_visibility: Buffer<u32>,
    /// `queue_capacity / SCAN_GROUP_SIZE`, rounded up.
    pub scan_blocks: Buffer<u32>,
}

impl Queue {
    /// # Errors
    /// Beyond the device's limits, out of memory.
    pub fn new(context: &Arc<Context>, capacity: u32, n_lights: u32) -> Result<Self, GpuError> {
        let storage = BufferUse::Storage;
        let (capacity, n_lights) = (capacity as usize, n_lights as usize);
        let n_blocks = capacity.div_ceil(SCAN_GROUP_SIZE as usize);
        Ok(Self {
            rays: Buffer::new(context, "rays", capacity, storage)?,
            hits: Buffer::new(context, "hits", capacity, storage)?,
            child_kinds: Buffer::new(context, "child_kinds", capacity, storage)?,
            first_children: Buffer::new(context, "first_children", capacity, storage)?,
            ray_radiance: Buffer::new(context, "ray_radiance", capacity, storage)?,
            light_visibility: Buffer::new(context, "light_visibility", n_lights * capacity, storage)?,
            scan_blocks: Buffer::new(context, "scan_blocks", n_blocks, storage)?,
        })
    }

    /// Rays.
    pub fn capacity(&self) -> u32 {
        self.hits.len() as u32
    }
}
