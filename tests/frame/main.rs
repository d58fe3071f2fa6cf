//! Tests of whole frames on the device, under the validation layer, and on the CPU. They are compared with each
//! other, with closed forms, and with the same frames in other batches and on other numbers of threads.

#[path = "../support/mod.rs"]
mod support;

mod agreement;
mod back_faces;
mod bands;
mod batches;
mod blended;
mod closed_forms;
mod compiler;
mod crop;
mod device_trees;
mod edge;
mod grids;
mod incremental;
mod lamps;
mod lanes;
mod large;
mod living;
mod many_lamps;
mod mean_layers;
mod mismatch;
mod motion_vectors;
mod normal_maps;
mod orthographic;
mod paths;
mod pixel_aovs;
mod primaries;
mod refused;
mod samples;
mod slabs;
mod studio;
mod textures;
mod unused;
