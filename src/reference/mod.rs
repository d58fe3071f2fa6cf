//! The reference: every kernel as a function over slices, without Vulkan. The kernels' tests compare with it. The CPU
//! renderer also uses it for the passes that are not worth a faster version.
//!
//! Each file is the twin of the kernel or shared GLSL file of the same name. It does the same computation in the same
//! order. A device may round divisions differently, so its hits may differ in their last bits. Crossings of planes
//! are not fused (`fma`) here. Hits do not depend on their rounding, unless the ray is first moved to the scene
//! (`near_scene`). The code is as plain as possible. Rays are handled in tasks of a fixed size, so the picture does
//! not depend on the number of threads.
//!
//! ```text
//! passes      primary_hit, trace, pixel_aovs, compact, shadow, shade, resolve, accumulate, denoise, false_color,
//!             tonemap, cast, closest_point; path_* and auxiliary; demodulate and atrous_filter; visibility, for which
//!             the device rasterizes; kdtree_build
//! traversal   traverser: one ray by any algorithm
//!               kdtree, leaf, slab, kd_boxes, ropes, brute and the pending_* of each algorithm; grid; candidate
//! points      distant_cells: cells of the kd-tree as a point sees them; point_triangle
//! geometry    triangle, surface, camera; search_ray and traversal_ray: a ray in the form that searches use
//! light       light, material, microfacet, fresnel, children, display, tone_curves
//! paths       sampler, path_camera, paths, path_vertex; bsdf: surfaces; emitters: lights; noise: variances;
//!             sample_sums
//! textures    texture, maps, alpha_test
//! inputs      the data that kernels only read
//! builds      kd_slabs
//! meshes      deform
//! counting    the same traversal with its reads counted
//! ```

pub mod accumulate;
pub mod all_hits;
pub mod alpha_test;
pub mod atrous_filter;
pub mod auxiliary;
pub mod brute;
pub mod bsdf;
pub mod camera;
pub mod candidate;
pub mod cast;
#[cfg(test)]
pub(crate) mod chi_square;
pub mod children;
mod closest_instances;
pub mod closest_point;
pub mod compact;
pub mod counting;
pub mod deform;
pub mod demodulate;
pub mod denoise;
pub mod display;
pub mod distant_cells;
pub mod edge;
pub mod emitters;
pub mod false_color;
pub mod fresnel;
pub mod grid;
pub mod inputs;
pub mod instances;
pub mod kd_boxes;
pub mod kd_slabs;
pub mod kdtree;
pub mod kdtree_build;
pub mod leaf;
pub mod light;
pub(crate) mod live_paths;
pub mod maps;
pub mod material;
pub mod microfacet;
pub mod noise_tiles;
pub mod path_accumulate;
pub mod path_begin;
pub mod path_camera;
pub mod path_compact;
pub mod path_layers;
pub mod path_resolve;
pub mod path_scatter;
pub mod path_trace;
pub mod path_vertex;
pub mod paths;
pub mod pending_backtrack;
pub mod pending_mask;
pub mod pending_mask_boxes;
pub mod pending_restart;
pub mod pending_short_stack;
pub mod pending_stack;
pub mod pixel_aovs;
pub mod point_triangle;
pub mod primary_hit;
pub mod resolve;
pub mod ropes;
pub mod sample_sums;
pub mod sampler;
pub mod search_ray;
pub mod shade;
pub mod shadow;
pub mod slab;
pub mod studio;
pub mod surface;
pub mod surface_layers;
mod tent;
pub mod tone_curves;
pub mod tonemap;
pub mod trace;
pub mod traversal_ray;
pub mod traverser;
pub mod triangle;
pub mod turns;
pub mod visibility;

// Twins with which `frame` and `world` compute, too.
pub use crate::{frame::noise, world::texture};

/// Rays that one thread handles at a time. A task of this size is worth its scheduling, and small enough to balance
/// the threads' load.
const RAYS_PER_TASK: usize = 512;
