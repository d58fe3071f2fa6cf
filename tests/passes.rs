//! Each kernel on the device against its twin on the CPU, under the validation layer: exact for integers, within a
//! stated tolerance for floats; with no ray, one, and one more or less than a workgroup and than each level of a scan.

mod support;

#[path = "passes/accumulate.rs"]
mod accumulate;
#[path = "passes/barriers.rs"]
mod barriers;
#[path = "passes/compact.rs"]
mod compact;
#[path = "passes/comparers.rs"]
mod comparers;
#[path = "passes/denoise.rs"]
mod denoise;
#[path = "passes/false_color.rs"]
mod false_color;
#[path = "passes/features.rs"]
mod features;
#[path = "passes/primary_hit.rs"]
mod primary_hit;
#[path = "passes/rasterize.rs"]
mod rasterize;
#[path = "passes/resolve.rs"]
mod resolve;
#[path = "passes/shade.rs"]
mod shade;
#[path = "passes/shadow.rs"]
mod shadow;
#[path = "passes/stage.rs"]
mod stage;
#[path = "passes/tonemap.rs"]
mod tonemap;
#[path = "passes/trace.rs"]
mod trace;
#[path = "passes/visibility.rs"]
mod visibility;
