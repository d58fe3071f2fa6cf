//! The reference: every pass again over slices, without Vulkan. For the tests, and for the paper's CPU column.
//!
//! A file here is the twin of the kernel or shared file of its name: the same operations in the same order, so that
//! hits agree to the last bits. Rays are handled in tasks of a fixed size, whatever the number of threads: so is the
//! picture.

pub mod accumulate;
pub mod bindings;
pub mod brute;
pub mod camera;
pub mod cast;
pub mod children;
pub mod columns;
pub mod compact;
pub mod companions;
pub mod costs;
pub mod denoise;
pub mod display;
pub mod false_color;
pub mod features;
pub mod kd_boxes;
pub mod kdtree;
pub mod leaf;
pub mod light;
pub mod material;
pub mod packet;
pub mod packet_traverser;
pub mod packet_triangle;
pub mod pending_backtrack;
pub mod pending_mask;
pub mod pending_mask_boxes;
pub mod pending_restart;
pub mod pending_short_stack;
pub mod pending_stack;
pub mod primary_hit;
pub mod probe;
mod queue;
mod render;
pub mod resolve;
pub mod ropes;
pub mod shade;
pub mod shadow;
pub mod slab;
pub mod steps;
pub mod surface;
pub mod table;
mod timing;
pub mod tone_curves;
pub mod tonemap;
pub mod trace;
pub mod traverser;
pub mod triangle;
pub mod visibility;

pub use self::render::{Batching, Renderer};
use crate::{
    frame::{Picture, Profile, RenderOptions},
    world::World,
};

/// Rays that one thread handles at a time: enough to pay for handing them out, few enough to balance.
const RAYS_PER_TASK: usize = 512;

/// Renders a frame of one sample a pixel on the current rayon pool.
pub fn render(world: &World, options: &RenderOptions) -> (Picture, Profile) {
    render_in_batches(world, options, Batching::default())
}

/// As [`render`], in batches of a given size.
pub fn render_in_batches(world: &World, options: &RenderOptions, batching: Batching) -> (Picture, Profile) {
    let mut renderer = Renderer::new(world, options, batching);
    let profile = renderer.draw_sample();
    (renderer.picture(), profile)
}
