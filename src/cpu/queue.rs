//! The buffers of a batch. They are as long as its rays require, and their memory is reused by the next batch.

use crate::layout::{Bounce, Hit, PathRay};

/// The ray queue of a batch, and what belongs to its rays.
#[derive(Default)]
pub struct Queue {
    /// The rays of all bounces, one bounce after the other.
    pub rays: Vec<PathRay>,
    /// One for each bounce.
    pub bounces: Vec<Bounce>,
    /// One for each ray, like `child_kinds`, `first_children` and `ray_radiance`.
    pub hits: Vec<Hit>,
    pub child_kinds: Vec<u32>,
    pub first_children: Vec<u32>,
    pub ray_radiance: Vec<[f32; 4]>,
    /// `LIGHT_*` of each light and ray, at `[light * rays.len() + ray]`.
    pub light_visibility: Vec<u32>,
    /// One for each block of `SCAN_GROUP_SIZE` rays of a bounce.
    pub scan_blocks: Vec<u32>,
}
