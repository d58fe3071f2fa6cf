//! Whole frames on the device, under the validation layer, and on the CPU: against one another, against closed forms,
//! and against themselves in other batches and on other numbers of threads.

mod support;

#[path = "frame/agreement.rs"]
mod agreement;
#[path = "frame/bands.rs"]
mod bands;
#[path = "frame/batches.rs"]
mod batches;
#[path = "frame/closed_forms.rs"]
mod closed_forms;
#[path = "frame/compiler.rs"]
mod compiler;
#[path = "frame/crop.rs"]
mod crop;
#[path = "frame/features.rs"]
mod features;
#[path = "frame/lanes.rs"]
mod lanes;
#[path = "frame/large.rs"]
mod large;
#[path = "frame/living.rs"]
mod living;
#[path = "frame/mismatch.rs"]
mod mismatch;
#[path = "frame/parts.rs"]
mod parts;
#[path = "frame/primaries.rs"]
mod primaries;
#[path = "frame/refused.rs"]
mod refused;
#[path = "frame/samples.rs"]
mod samples;
#[path = "frame/slabs.rs"]
mod slabs;
#[path = "frame/studio.rs"]
mod studio;
#[path = "frame/unused.rs"]
mod unused;
