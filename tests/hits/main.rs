//! Tests that rays find the right hits where that is hard, in all structures, on the CPU and on a device.

#[path = "../support/mod.rs"]
mod support;

mod all_hits;
mod device_slabs;
mod grid;
mod hidden;
mod huge_ground;
mod mixed_scales;
mod needles;
mod packets;
