//! A batch's buffers, as long as the bounce at hand needs; kept from bounce to bounce and batch to batch.

use super::shade::Shaded;
use crate::layout::{Hit, Ray};

#[derive(Default)]
pub struct Queues {
    pub rays: Vec<Ray>,
    pub next_rays: Vec<Ray>,
    /// One a ray.
    pub hits: Vec<Hit>,
    /// `[light * rays.len() + ray]`, 1: lit.
    pub light_visibility: Vec<u32>,
    pub shaded: Shaded,
    /// One a block of `SCAN_BLOCK_SIZE` rays.
    pub scan_blocks: Vec<u32>,
}
