//! The buffers of rays.

use std::sync::Arc;

use crate::{
    gpu::{Buffer, BufferUse, Context, GpuError},
    layout::{Hit, Ray, SCAN_BLOCK_SIZE},
};

/// Room for `queue_capacity` rays, and what belongs to each.
pub struct Queues {
    /// Even bounces read the first queue and fill the second, odd ones the other way round; `queue_capacity` each.
    pub ray_queues: [Buffer<Ray>; 2],
    /// Two places a ray: `2 * queue_capacity`.
    pub child_rays: Buffer<Ray>,
    /// `queue_capacity`, like hits and ray_radiance.
    pub child_counts: Buffer<u32>,
    pub hits: Buffer<Hit>,
    pub ray_radiance: Buffer<[f32; 4]>,
    /// `n_lights * queue_capacity`, lights outermost.
    pub light_visibility: Buffer<u32>,
    /// `queue_capacity / SCAN_BLOCK_SIZE`, rounded up.
    pub scan_blocks: Buffer<u32>,
}

impl Queues {
    /// # Errors
    /// Beyond the device's limits, out of memory.
    pub fn new(context: &Arc<Context>, capacity: u32, n_lights: u32) -> Result<Self, GpuError> {
        let storage = BufferUse::Storage;
        let (capacity, n_lights) = (capacity as usize, n_lights as usize);
        let queue = |name| Buffer::new(context, name, capacity, storage);
        let n_blocks = capacity.div_ceil(SCAN_BLOCK_SIZE as usize);
        Ok(Self {
            ray_queues: [queue("ray_queues[0]")?, queue("ray_queues[1]")?],
            child_rays: Buffer::new(context, "child_rays", 2 * capacity, storage)?,
            child_counts: Buffer::new(context, "child_counts", capacity, storage)?,
            hits: Buffer::new(context, "hits", capacity, storage)?,
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
