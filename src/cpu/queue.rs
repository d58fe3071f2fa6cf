//! A batch's buffers, as long as its rays need; kept from batch to batch.

use crate::layout::{Bounce, Hit, PathRay};

#[derive(Default)]
pub struct Queue {
    /// Bounce after bounce.
    pub rays: Vec<PathRay>,
    /// One a bounce.
    pub bounces: Vec<Bounce>,
    /// One a ray, like what follows but for the last two.
    pub hits: Vec<Hit>,
    pub child_kinds: Vec<u32>,
    pub first_children: Vec<u32>,
    pub ray_radiance: Vec<[f32; 4]>,
    /// `[light * rays.len() + ray]`, `LIGHT_*`.
    pub light_visibility: Vec<u32>,
    /// One a block of `SCAN_GROUP_SIZE` rays of a bounce.
    pub scan_blocks: Vec<u32>,
}
