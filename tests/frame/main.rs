//! Tests of whole frames on the device, under the validation layer, and on the CPU. They are compared with each
//! other, with closed forms, and with the same frames in other batches and on other numbers of threads.

#[path = "../support/mod.rs"]
mod support;

mod agreement;
mod bands;
mod batches;
mod closed_forms;
mod compiler;
mod crop;
mod edge;
mod grids;
mod lamps;
mod lanes;
mod large;
mod light_layers;
mod living;
mod many_lamps;
mod mismatch;
mod orthographic;
mod parts;
mod paths;
mod pixel_aovs;
mod primaries;
mod refused;
mod samples;
mod slabs;
mod studio;
mod textures;
mod unused;
