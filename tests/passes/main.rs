//! Each kernel on the device against its twin on the CPU, under the validation layer: exact for integers, within a
//! stated tolerance for floats; with no ray, one, and one more or less than a workgroup and than each level of a scan.

#[path = "../support/mod.rs"]
mod support;

mod accumulate;
mod barriers;
mod compact;
mod comparers;
mod denoise;
mod false_color;
mod features;
mod primary_hit;
mod rasterize;
mod resolve;
mod shade;
mod shadow;
mod stage;
mod tonemap;
mod trace;
mod visibility;
