//! Buffers of rays.

use std::sync::Arc;

use crate::{
    frame::NoiseTiles,
    gpu::{Buffer, BufferUse, Context, GpuError},
    layout::{Hit, MOST_SAMPLES_LOG2, PathRay, PathState, SCAN_GROUP_SIZE, ShadowRay},
};

/// What a batch of paths has beside the buffers of [`Queue`], in which each path has one ray. A clone is a second
/// handle to the same buffers.
#[derive(Clone)]
pub struct PathQueue {
    /// One element per path.
    pub path_states: Buffer<PathState>,
    /// One element per path.
    pub shadow_rays: Buffer<ShadowRay>,
    /// Three lists, each with room for all paths: those that are alive at this bounce, those that are alive at the
    /// next, and those that have a shadow ray.
    pub live_paths: Buffer<u32>,
    /// The radiance of each path when the last layer of light was complete. Empty if the picture has no such layers.
    pub path_snapshots: Buffer<[f32; 4]>,
    /// The places of the noise tiles of which the window consists ([`NoiseTiles`]). Not read if it is a rectangle.
    pub noise_tiles: Buffer<u32>,
}

impl PathQueue {
    /// Bytes that a path takes, with its ray and hit, whether it goes on, and its places in the lists. Layers of light
    /// take 16 more.
    pub const BYTES_PER_PATH: usize = size_of::<PathRay>()
        + size_of::<Hit>()
        + size_of::<PathState>()
        + size_of::<ShadowRay>()
        + 4 * size_of::<u32>();

    /// The part of a device's memory that paths may take is 1 / this.
    pub const MEMORY_PER_PATHS: u64 = 8;

    /// Returns an upper bound of the bytes by which the queue grows when a frame draws several of `n_samples` samples
    /// of each pixel. It begins with room for one.
    pub fn bytes_of_more_samples(n_pixels: u64, n_samples: u32, memory_bytes: u64) -> u64 {
        let n_more = u64::from(n_samples.clamp(1, 1 << MOST_SAMPLES_LOG2) - 1);
        (Self::BYTES_PER_PATH as u64 * n_pixels * n_more).min(memory_bytes / Self::MEMORY_PER_PATHS)
    }

    /// Makes the buffers for `capacity` paths. `has_layers`: whether the picture has layers of light.
    ///
    /// # Errors
    /// A buffer is beyond the device's limits, or memory runs out.
    pub fn new(context: &Arc<Context>, capacity: u32, has_layers: bool) -> Result<Self, GpuError> {
        let storage = BufferUse::Storage;
        let capacity = capacity as usize;
        Ok(Self {
            path_states: Buffer::new(context, "path_states", capacity, storage)?,
            shadow_rays: Buffer::new(context, "shadow_rays", capacity, storage)?,
            live_paths: Buffer::new(context, "live_paths", 3 * capacity, storage)?,
            path_snapshots: Buffer::new(context, "path_snapshots", if has_layers { capacity } else { 0 }, storage)?,
            noise_tiles: Buffer::new(context, "noise_tiles", NoiseTiles::MOST, BufferUse::Uniform)?,
        })
    }
}

/// Queue of the rays of all bounces of a batch, at most `queue_capacity`, with the hit, the children, the radiance
/// and the shadows of each ray. A clone is a second handle to the same buffers.
#[derive(Clone)]
pub struct Queue {
    /// The rays, bounce after bounce. There are `queue_capacity` elements, as in all buffers here but the last two.
    /// The camera's rays come first and are never stored: kernels compute them from their indices
    /// (glsl/shared/rays/rays.glsl).
    pub rays: Buffer<PathRay>,
    pub hits: Buffer<Hit>,
    /// Bits that say which rays continue from each hit: a reflected one, a transmitted one (layout.glsl).
    pub child_flags: Buffer<u32>,
    /// The index in `rays` at which a ray's children begin, or would begin if it had any.
    pub first_children: Buffer<u32>,
    pub ray_radiance: Buffer<[f32; 4]>,
    /// `n_lights * queue_capacity` elements, lights outermost.
    pub light_visibility: Buffer<u32>,
    /// The number of children of each block of `SCAN_GROUP_SIZE` rays. After the prefix sum, it is the number of
    /// children of all blocks before. There are `queue_capacity / SCAN_GROUP_SIZE` elements, rounded up, and for
    /// paths twice as many.
    pub scan_blocks: Buffer<u32>,
}

impl Queue {
    /// Makes the buffers for `capacity` rays and `n_lights` lights.
    ///
    /// # Errors
    /// A buffer is beyond the device's limits, or memory runs out.
    pub fn new(context: &Arc<Context>, capacity: u32, n_lights: u32) -> Result<Self, GpuError> {
        let storage = BufferUse::Storage;
        let (capacity, n_lights) = (capacity as usize, n_lights as usize);
        let n_blocks = capacity.div_ceil(SCAN_GROUP_SIZE as usize);
        Ok(Self {
            rays: Buffer::new(context, "rays", capacity, storage)?,
            hits: Buffer::new(context, "hits", capacity, storage)?,
            child_flags: Buffer::new(context, "child_flags", capacity, storage)?,
            first_children: Buffer::new(context, "first_children", capacity, storage)?,
            ray_radiance: Buffer::new(context, "ray_radiance", capacity, storage)?,
            light_visibility: Buffer::new(context, "light_visibility", n_lights * capacity, storage)?,
            scan_blocks: Buffer::new(context, "scan_blocks", n_blocks, storage)?,
        })
    }

    /// Makes the buffers for `capacity` paths. What ray trees need beside them is empty.
    ///
    /// # Errors
    /// Fails as [`Queue::new`] does.
    pub fn of_paths(context: &Arc<Context>, capacity: u32) -> Result<Self, GpuError> {
        let storage = BufferUse::Storage;
        let capacity = capacity as usize;
        let n_blocks = capacity.div_ceil(SCAN_GROUP_SIZE as usize);
        Ok(Self {
            rays: Buffer::new(context, "rays", capacity, storage)?,
            hits: Buffer::new(context, "hits", capacity, storage)?,
            child_flags: Buffer::new(context, "child_flags", capacity, storage)?,
            first_children: Buffer::new(context, "first_children", 0, storage)?,
            ray_radiance: Buffer::new(context, "ray_radiance", 0, storage)?,
            light_visibility: Buffer::new(context, "light_visibility", 0, storage)?,
            scan_blocks: Buffer::new(context, "scan_blocks", 2 * n_blocks, storage)?,
        })
    }

    /// The number of rays for which there is room.
    pub fn capacity(&self) -> u32 {
        self.hits.len() as u32
    }
}
