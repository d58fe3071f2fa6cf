//! The reference: every kernel again over slices, without Vulkan. It is the oracle of the kernels' tests, and what is
//! not worth more speed on the CPU.
//!
//! A file is the twin of the kernel or the shared GLSL file of its name: the same operations in the same order, so that
//! hits agree to the last bits. Nothing here is clever. Rays are handled in tasks of a fixed size, so the picture does
//! not depend on the number of threads.
//!
//! ```text
//! passes      primary_hit, trace, features, compact, shadow, shade, resolve, accumulate, denoise, false_color, tonemap,
//!             cast; visibility, which the device rasterizes
//! traversal   traverser: one ray by any algorithm
//!               kdtree, leaf, slab, ropes, brute and the pending_* of each algorithm; grid; candidate
//! geometry    triangle, surface, camera; search_ray and traversal_ray: a ray as the traversal takes it
//! light       light, material, children, display, tone_curves
//! inputs      what kernels only read
//! counting    the same traversal, with its reads counted
//! ```

pub mod accumulate;
pub mod brute;
pub mod camera;
pub mod candidate;
pub mod cast;
pub mod children;
pub mod compact;
pub mod counting;
pub mod denoise;
pub mod display;
pub mod false_color;
pub mod features;
pub mod grid;
pub mod inputs;
pub mod kd_boxes;
pub mod kdtree;
pub mod leaf;
pub mod light;
pub mod material;
pub mod pending_backtrack;
pub mod pending_mask;
pub mod pending_mask_boxes;
pub mod pending_restart;
pub mod pending_short_stack;
pub mod pending_stack;
pub mod primary_hit;
pub mod resolve;
pub mod ropes;
pub mod search_ray;
pub mod shade;
pub mod shadow;
pub mod slab;
pub mod surface;
pub mod tone_curves;
pub mod tonemap;
pub mod trace;
pub mod traversal_ray;
pub mod traverser;
pub mod triangle;
pub mod visibility;

/// Rays that one thread handles at a time: enough to pay for handing them out, few enough to balance.
const RAYS_PER_TASK: usize = 512;
