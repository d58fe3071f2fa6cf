//! The fast CPU engine: renders frames and casts rays without Vulkan. The traversal is implemented here, and so are the
//! bounces of path tracing that sixteen paths can take together. All other kernels are those of the
//! [reference](crate::reference). All results equal the reference's, bit for bit.
//!
//! ```text
//! render   the frame, batch by batch, in the order of its plan
//!   queue    the rays of a batch
//!   paths    the passes of a batch of paths
//!     path_begin, path_scatter   the rays of paths, and their scattering at hits
//!       sampler                  the random numbers of sixteen paths
//!       environment_samples        the samples of sixteen directions of the environment
//!       lambertian_surfaces, lambertian_scatter, area_lights   bounces of sixteen paths at Lambertian surfaces
//!       vec3x16, turns           sixteen vectors; sines and cosines of sixteen angles
//!   timing   wall-clock times of passes
//! motion_vectors   where the points that pixels show are in the next frame
//! meter    the exposure of a scene whose light has physical units
//! trace    the reference's passes that trace rays, with the tracer of this folder
//!   tracer   traces rays one after the other, or as packets:
//!     direction_bins     collect rays of one class of directions until they fill a packet
//!     soa                rays and hits as structures of arrays
//!     packet, packet_triangle, packet_traverser   trace sixteen rays through the tree together
//!   wide_traverser   traces single rays of paths, several by turns, through a wide hierarchy of boxes
//!     prefetch       loads into the cache ahead of need
//! closest_points     the closest points of the triangles, through that hierarchy
//!   point_triangles  the closest points of sixteen triangles
//! ```

mod area_lights;
pub mod closest_points;
pub mod direction_bins;
mod environment_samples;
mod lambertian_scatter;
mod lambertian_surfaces;
pub mod lanes;
mod meter;
mod motion_vectors;
pub mod packet;
pub mod packet_traverser;
pub mod packet_triangle;
mod path_begin;
mod path_scatter;
mod paths;
mod point_triangles;
mod prefetch;
mod queue;
mod render;
mod sampler;
pub mod soa;
mod timing;
mod trace;
pub mod tracer;
mod turns;
mod vec3x16;
pub mod wide_traverser;

pub use self::{
    closest_points::closest_points,
    meter::metered_exposure,
    motion_vectors::motion_vectors,
    render::{Batching, CpuRenderer},
    trace::{cast, shadow, trace, visibility},
    tracer::CpuSearch,
    wide_traverser::{are_scattered, suits_scattered_rays},
};
use crate::{
    frame::{Picture, Profile, RenderOptions, Tonemap},
    layout::Frame,
    reference,
    world::World,
};

/// Returns what a display shows of a picture's radiance: sRGB-encoded RGBA pixels. Kernels may round a few of them to
/// the next value.
pub fn display(radiance: &[[f32; 4]], exposure: f32, tonemap: Tonemap) -> Vec<[u8; 4]> {
    let mut display = vec![[0; 4]; radiance.len()];
    reference::tonemap::tonemap(&Frame { exposure, ..Frame::default() }, tonemap, radiance, &mut display);
    display
}

/// Renders a frame of one sample a pixel on the current rayon pool.
pub fn render(world: &World, options: &RenderOptions) -> (Picture, Profile) {
    render_in_batches(world, options, Batching::default())
}

/// Renders as [`render()`] does, in batches of a given size. The picture does not depend on the size.
pub fn render_in_batches(world: &World, options: &RenderOptions, batching: Batching) -> (Picture, Profile) {
    let mut renderer = CpuRenderer::new(world, options, batching);
    let profile = renderer.draw_sample();
    (renderer.picture(), profile)
}
