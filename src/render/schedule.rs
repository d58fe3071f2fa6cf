//! Batches of a frame: parts of the picture's pixels whose rays fit in the ray queue. No ray is dropped: a batch for
//! which the queue was too small is halved, and the sample is drawn again.

use std::{mem, sync::Arc};

use crate::{
    buffers::PathQueue,
    frame::{FrameProperties, Integrator, Plan, RenderOptions},
    gpu::{Buffer, BufferUse, Context, DeviceInfo, GpuError, Limits, Timer},
    layout::{Batch, Bounce, Frame, MOST_SAMPLES_LOG2, PASS_BEGIN, PathRay, RAY_GROUP_SIZE, SAMPLE_BLOCK_LOG2},
};

/// Upper limit of the queue's capacity, in rays, unless the caller sets the capacity. This number of rays keeps any
/// device busy. They take some 100 bytes each, 1.7 GB together, which fits well into memory.
const MOST_RAYS: u64 = 1 << 24;
/// The least capacity, so that the rays of one pixel fit in the queue of a tiny picture, too.
const LEAST_RAYS: u64 = 1 << 10;
/// The upper limit for paths. A dispatch traces all of them, and their shadow rays. On an H200, batches of 2^24 paths
/// are 10 to 40 % faster than those of 2^21: a dispatch ends with its slowest paths, and late bounces have few paths.
const MOST_PATHS: u64 = 1 << 24;
/// The number of paths of a batch on a device without much memory, or on a CPU, which has no use for more.
const FEW_PATHS: u64 = 1 << 21;
/// What a path takes in the queue's buffers, bytes.
const PATH_BYTES: u64 = PathQueue::BYTES_PER_PATH as u64;

/// The batches of a frame, and the objects whose size depends on their number.
pub struct Schedule {
    /// Each batch at depth 0; `bounce_ix` is its first row of `bounces`.
    pub batches: Vec<Batch>,
    /// The initial contents of `bounces`, for each bounce of each batch: a ray for each pixel at depth 0, and none at
    /// further depths.
    pub first_bounces: Buffer<Bounce>,
    /// None if the options do not ask for a profile.
    pub timer: Option<Timer>,
}

impl Schedule {
    /// Creates the batches. `spans`: first pixel and number of pixels of each.
    ///
    /// # Errors
    /// Out of memory.
    pub fn new(
        context: &Arc<Context>,
        constants: &Frame,
        spans: Vec<(u32, u32)>,
        options: &RenderOptions,
    ) -> Result<Self, GpuError> {
        let max_depth = constants.max_depth;
        let batches: Vec<_> = (0..)
            .zip(spans)
            .map(|(batch_ix, (first_pixel, n_pixels))| Batch {
                first_pixel,
                n_pixels,
                bounce_ix: batch_ix * max_depth,
                depth: 0,
                resume_pass: PASS_BEGIN,
            })
            .collect();
        let rows: Vec<_> = batches
            .iter()
            .flat_map(|batch| (0..max_depth).map(|depth| if depth == 0 { batch.n_pixels } else { 0 }))
            .map(|n_rays| match options.integrator {
                Integrator::Whitted => Bounce::of(n_rays, constants),
                Integrator::Path => Bounce::of_paths(n_rays << constants.samples_log2, constants),
            })
            .collect();
        let n_passes = Plan::new(&FrameProperties::new(options, constants)).n_passes(batches.len()) as u32;
        Ok(Self {
            first_bounces: Buffer::with(context, "first_bounces", &rows, BufferUse::Storage)?,
            timer: options.profile.then(|| Timer::new(context, n_passes)).transpose()?,
            batches,
        })
    }

    /// Number of rows of `bounces`: one for each bounce of each batch.
    pub fn n_rows(&self) -> usize {
        self.first_bounces.len()
    }

    /// Returns the spans for the next attempt: each batch in which a bounce overflowed is halved.
    ///
    /// # Errors
    /// One pixel alone makes more rays than the queue holds.
    pub fn split(&self, bounces: &[Bounce], constants: &Frame) -> Result<Vec<(u32, u32)>, GpuError> {
        let mut spans = Vec::new();
        for (batch, rows) in self.batches.iter().zip(bounces.chunks_exact(constants.max_depth as usize)) {
            let (first, n) = (batch.first_pixel, batch.n_pixels);
            match rows.iter().find(|row| row.overflow != 0) {
                None => spans.push((first, n)),
                Some(row) if n == 1 => {
                    return Err(GpuError::Limit {
                        what: "rays of one pixel",
                        value: u64::from(row.first_ray) + u64::from(row.n_wanted),
                        limit: u64::from(constants.queue_capacity),
                    });
                }
                Some(_) => spans.extend([(first, n / 2), (first + n / 2, n - n / 2)]),
            }
        }
        tracing::debug!(n_batches = spans.len(), "the ray queue overflowed");
        Ok(spans)
    }
}

/// Settings from which the capacity of the ray queue and the sizes of the batches are computed.
#[derive(Clone, Copy)]
pub struct QueueSizing {
    /// Capacity of the queue in rays, if the caller has set it. A batch then has at most that number of pixels, since
    /// one ray per pixel is expected.
    pub fixed_capacity: Option<u32>,
    /// Whether a hit can have two child rays, a reflected and a refracted one.
    pub branches: bool,
    /// Whether the queue holds paths, one ray each.
    pub of_paths: bool,
}

impl QueueSizing {
    /// Returns the base-2 logarithm of the most samples of each pixel that a frame of paths should draw. A small
    /// picture gets more of them than a large one, so that each dispatch keeps the device busy. Pictures have the same
    /// bits whatever it is.
    pub fn most_samples_log2(&self, info: &DeviceInfo, n_pixels: u64) -> u32 {
        if info.is_software() || self.fixed_capacity.is_some() {
            return SAMPLE_BLOCK_LOG2;
        }
        let with_room = most_paths(info) / n_pixels.max(1);
        with_room.max(1).ilog2().clamp(SAMPLE_BLOCK_LOG2, MOST_SAMPLES_LOG2)
    }

    /// Returns the capacity that the queue should have: the caller's, if it is set. Otherwise the rays that the whole
    /// picture is expected to make, or the paths of the frame's samples, but no more than [`MOST_RAYS`] or
    /// [`MOST_PATHS`], and no more than the device's limits allow.
    pub fn queue_capacity(&self, limits: &Limits, info: &DeviceInfo, constants: &Frame) -> u32 {
        if let Some(capacity) = self.fixed_capacity {
            return capacity;
        }
        let n_pixels = u64::from(constants.width) * u64::from(constants.height);
        if self.of_paths {
            let most = limits.storage_range / size_of::<PathRay>() as u64;
            let most_in_groups = u64::from(limits.n_groups) * u64::from(RAY_GROUP_SIZE) / 2;
            let wanted = n_pixels << constants.samples_log2;
            return wanted.min(most_paths(info)).min(most).min(most_in_groups).max(1 << MOST_SAMPLES_LOG2) as u32;
        }
        // The largest buffer of the queue is `rays` or `light_visibility`.
        let bytes_per_ray = mem::size_of::<PathRay>().max(4 * constants.n_lights as usize) as u64;
        let most = (limits.storage_range / bytes_per_ray).min(u64::from(limits.n_groups) * u64::from(RAY_GROUP_SIZE));
        let wanted = n_pixels * u64::from(self.rays_per_pixel(constants.max_depth));
        wanted.clamp(LEAST_RAYS, MOST_RAYS).min(most).max(1) as u32
    }

    /// Returns the first pixel and the number of pixels of each span. Spans are of equal size, but for the last one.
    /// The rays of each are expected to fit in a queue of `constants.queue_capacity`, and none has more than
    /// `most_pixels` pixels, if that is given.
    pub fn spans(&self, constants: &Frame, most_pixels: Option<u32>) -> Vec<(u32, u32)> {
        let n_pixels = constants.width * constants.height;
        let rays_per_pixel =
            if self.of_paths { 1 << constants.samples_log2 } else { self.rays_per_pixel(constants.max_depth) };
        let with_room = (constants.queue_capacity / rays_per_pixel).max(1);
        let n_batches = n_pixels.div_ceil(most_pixels.map_or(with_room, |most| most.clamp(1, with_room))).max(1);
        let size = n_pixels.div_ceil(n_batches);
        (0..n_batches).map(|i| (i * size, size.min(n_pixels - i * size))).collect()
    }

    /// Returns the rays that a pixel is expected to make, primary and secondary: as many as most scenes make.
    fn rays_per_pixel(&self, max_depth: u32) -> u32 {
        match self {
            Self { fixed_capacity: Some(_), .. } => 1,
            Self { branches: true, .. } => 8.min((1 << max_depth.min(4)) - 1),
            Self { branches: false, .. } => max_depth.min(2),
        }
    }
}

/// Returns the upper bound of paths per batch, from the device's memory. Pictures have the same bits whatever it is.
fn most_paths(info: &DeviceInfo) -> u64 {
    if info.is_software() {
        return FEW_PATHS;
    }
    (info.memory_bytes / PathQueue::MEMORY_PER_PATHS / PATH_BYTES).clamp(FEW_PATHS, MOST_PATHS)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits {
        storage_range: 1 << 27,
        n_texels: 1 << 27,
        buffer_bytes: u64::MAX,
        target_size: 16_384,
        n_groups: 65_535,
        group_size: 1024,
    };

    fn info(memory_bytes: u64, kind: &str) -> DeviceInfo {
        let text = String::new;
        let (name, driver, api_version) = (text(), text(), text());
        let kind = kind.to_owned();
        DeviceInfo { index: 0, name, kind, driver, api_version, subgroup_size: 32, memory_bytes, missing: Vec::new() }
    }

    #[test]
    fn a_batch_of_paths_grows_with_the_memory() {
        let capacity = |memory_bytes: u64, kind: &str| {
            let limits = Limits { storage_range: u64::MAX, n_groups: u32::MAX, ..LIMITS };
            let sizing = QueueSizing { fixed_capacity: None, branches: false, of_paths: true };
            let constants = Frame { width: 1024, height: 1024, samples_log2: 8, ..Frame::default() };
            sizing.queue_capacity(&limits, &info(memory_bytes, kind), &constants)
        };
        assert_eq!(capacity(1 << 40, "discrete GPU"), 1 << 24);
        assert_eq!(capacity(1 << 33, "discrete GPU"), ((1_u64 << 30) / PATH_BYTES) as u32);
        assert_eq!(capacity(1 << 28, "integrated GPU"), 1 << 21);
        assert_eq!(capacity(1 << 40, "CPU"), 1 << 21);
    }

    #[test]
    fn small_pictures_get_more_samples_a_frame() {
        let sizing = QueueSizing { fixed_capacity: None, branches: false, of_paths: true };
        let samples =
            |memory_bytes, kind: &str, n_pixels| 1 << sizing.most_samples_log2(&info(memory_bytes, kind), n_pixels);
        let of_gpu = [1, 1 << 16, 1 << 18, 1 << 20, 1 << 24].map(|n_pixels| samples(1 << 40, "discrete GPU", n_pixels));
        assert_eq!(of_gpu, [256, 256, 64, 16, 16]);
        assert_eq!(samples(1 << 28, "integrated GPU", 1 << 16), 32);
        assert_eq!(samples(1 << 40, "CPU", 1), 16);
    }

    #[test]
    fn batches_have_room_for_their_rays() {
        let limits = LIMITS;
        for (width, height, max_depth) in [(1, 1, 1), (1024, 768, 5), (3840, 2160, 8), (7, 9, 64)] {
            for (branches, fixed_capacity) in [(false, None), (true, None), (true, Some(50))] {
                let budget = QueueSizing { fixed_capacity, branches, of_paths: false };
                let mut constants = Frame { width, height, max_depth, n_lights: 3, ..Frame::default() };
                constants.queue_capacity = budget.queue_capacity(&limits, &info(1 << 33, "discrete GPU"), &constants);
                assert!(u64::from(constants.queue_capacity) * 48 <= limits.storage_range);
                for most_pixels in [None, Some(0), Some(10), Some(u32::MAX)] {
                    let spans = budget.spans(&constants, most_pixels);
                    let ends = spans.iter().scan(0, |end, &(first, n)| {
                        assert_eq!(first, *end);
                        *end += n;
                        Some(*end)
                    });
                    assert_eq!(ends.last(), Some(width * height));
                    let most = constants.queue_capacity / budget.rays_per_pixel(max_depth);
                    let fits =
                        |n: u32| n > 0 && n <= most.max(1) && most_pixels.is_none_or(|pixels| n <= pixels.max(1));
                    assert!(spans.iter().all(|&(_, n)| fits(n)), "{width}x{height}: {spans:?}");
                }
            }
        }
    }
}
