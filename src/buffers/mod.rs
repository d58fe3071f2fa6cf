//! Buffers and images that kernels read and write, and the descriptor sets over them. Each file has a group of
//! buffers that are made and grow together.
//!
//! ```text
//! accel           triangles and their acceleration structure, with the arrays of scene_arrays
//! queue           rays or paths of a batch and what belongs to each
//! pixels          samples, sums, filtered and displayed pixels
//! raster_queue    large triangles, between the two kernels that rasterize
//! vertex_indices  the index buffer of the triangles that the graphics pipeline rasterizes
//! texture_words   textures, and what leads from triangles to them
//! surface_features   which features the surfaces of a scene have, as specialization constants
//! suspended_rays  rays that have spent a dispatch's loop iterations
//! resources       all of these, with the frame's descriptor set
//! grid            the build of a grid
//! kdtree          the build of a kd-tree
//! device_structures   the kd-trees or grids of geometries that the device builds, and builds again
//! geometries      the geometries of a world, and the arrays of the scene into which they go
//! kd_slabs        the slabs of a kd-tree, while they are computed
//! deform          a mesh that is deformed
//! cast            given rays, their hits, and the cast's descriptor set
//! closest_point   given points, their hits, and the descriptor set of the search
//! all_hits        given rays, all of their hits, and the descriptor set over them
//! ```

mod accel;
mod all_hits;
mod cast;
mod closest_point;
mod deform;
mod device_structures;
mod geometries;
mod grid;
mod kd_slabs;
mod kdtree;
mod pixels;
mod queue;
mod raster_queue;
mod resources;
mod scene_arrays;
mod structure_builder;
mod surface_features;
mod suspended_rays;
mod texture_words;
mod two_level;
mod vertex_indices;

pub use self::{
    accel::AccelBuffers,
    all_hits::AllHitsResources,
    cast::CastResources,
    closest_point::PointResources,
    deform::{DeformBuffers, DeformTarget},
    grid::{GridBuffers, GridCapacities, PairSets},
    kd_slabs::{KdSlabBuffers, TreeBuffers},
    kdtree::{KdTreeBuffers, KdTreeCapacities, KdTreeRoom},
    pixels::Pixels,
    queue::{PathQueue, Queue},
    raster_queue::{RasterQueue, RasterState},
    resources::{Needs, Resources},
    scene_arrays::{SceneAccess, SceneArrays},
    suspended_rays::{ResumePass, SuspendedRays},
};
pub(crate) use self::{accel::hidden_words, device_structures::DeviceStructures, pixels::uses_graphics_pipeline};
use crate::{
    gpu::BindingKind,
    layout::{BIND_ACCEL, BIND_FRAME, BIND_KD_BUILD, BIND_NOISE_TILES, BIND_TEXELS, BIND_TRIANGLE_IDS},
};

/// Returns a binding number of layout.glsl with the kind of object that it is bound to.
fn binding(number: u32) -> (u32, BindingKind) {
    let kind = match number {
        BIND_KD_BUILD.. => BindingKind::Storage,
        BIND_TEXELS.. => BindingKind::Texels,
        BIND_FRAME | BIND_ACCEL | BIND_NOISE_TILES => BindingKind::Uniform,
        BIND_TRIANGLE_IDS => BindingKind::Image,
        _ => BindingKind::Storage,
    };
    (number, kind)
}
