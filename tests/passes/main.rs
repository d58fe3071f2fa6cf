//! Tests of each kernel on the device against its twin, the same function on the CPU, under the validation layer.
//! Integers agree exactly, floats within a stated tolerance. The numbers of rays are 0, 1, and one more and less than
//! a workgroup and than each level of a scan.

#[path = "../support/mod.rs"]
mod support;

mod accumulate;
mod atrous_filter;
mod auxiliary;
mod barriers;
mod closest_point;
mod compact;
mod comparers;
mod deform;
mod demodulate;
mod denoise;
mod false_color;
mod kdtree_build;
mod path_accumulate;
mod path_begin;
mod path_compact;
mod path_layers;
mod path_resolve;
mod path_scatter;
mod path_stage;
mod path_trace;
mod pixel_aovs;
mod primary_hit;
mod rasterize;
mod resolve;
mod shade;
mod shadow;
mod stage;
mod surface_layers;
mod tonemap;
mod trace;
mod visibility;
