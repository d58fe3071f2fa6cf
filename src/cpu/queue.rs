//! The buffers of a batch. They grow with its number of rays, and their memory is reused by the next batch.

use crate::layout::{Bounce, Hit, PathRay};

/// The rays of a batch, with their hits and all other results of passes.
#[derive(Default)]
pub struct Queue {
    /// The rays of all bounces, one bounce after the other.
    pub rays: Vec<PathRay>,
    /// For each bounce, its range in `rays` and its counts.
    pub bounces: Vec<Bounce>,
    /// The closest hit of each ray.
    pub hits: Vec<Hit>,
    /// For each ray, flags of its child rays: `CHILD_REFLECTED` and the other constants `CHILD_*`. For
    /// each path, whether it goes on and has a shadow ray.
    pub child_flags: Vec<u32>,
    /// For each ray, the index in `rays` of its first child, or the index that the child would have.
    pub first_children: Vec<u32>,
    /// For each ray, its radiance, weighted by its throughput.
    pub ray_radiance: Vec<[f32; 4]>,
    /// For each light and ray, one of `LIGHT_*`, at `[light * rays.len() + ray]`.
    pub light_visibility: Vec<u32>,
    /// For each block of `SCAN_GROUP_SIZE` rays of a bounce, the number of their children, and after the prefix sum
    /// the number in all blocks before.
    pub scan_blocks: Vec<u32>,
}
