//! The CPU engine: frames and casts without Vulkan, as fast as the CPU goes. What is no traversal comes from the
//! [reference](crate::reference).
//!
//! ```text
//! render   the frame, batch by batch, as the plan says
//!   queue    the rays of a batch
//!   timing   wall-clock times of passes
//! trace    the reference's passes that trace rays, by
//!   tracer   rays one after the other, or as packets:
//!     octant_bins        rays of one octant, until they are a packet
//!     soa                rays and hits as structures of arrays
//!     packet, packet_triangle, packet_traverser   sixteen rays through the tree together
//! ```

pub mod lanes;
pub mod octant_bins;
pub mod packet;
pub mod packet_traverser;
pub mod packet_triangle;
mod queue;
mod render;
pub mod soa;
mod timing;
mod trace;
pub mod tracer;

pub use self::{
    render::{Batching, Renderer},
    trace::{cast, shadow, trace, visibility},
};
use crate::{
    frame::{Picture, Profile, RenderOptions},
    world::World,
};

/// Renders a frame of one sample a pixel on the current rayon pool.
pub fn render(world: &World, options: &RenderOptions) -> (Picture, Profile) {
    render_in_batches(world, options, Batching::default())
}

/// As `render`, in batches of a given size.
pub fn render_in_batches(world: &World, options: &RenderOptions, batching: Batching) -> (Picture, Profile) {
    let mut renderer = Renderer::new(world, options, batching);
    let profile = renderer.draw_sample();
    (renderer.picture(), profile)
}
