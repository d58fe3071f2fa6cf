//! `kdray bench`: measures and prints a table. Each suite has a file.

mod args;
mod driver;
mod motion;
mod paper;
mod size;
mod traversal;

pub use args::Suite;
use kdray::{engine::choices::Processor, gpu::Device};

use super::error::CliError;

pub fn run(suite: &Suite) -> Result<(), CliError> {
    match suite {
        Suite::Paper(args) => paper::run(args),
        Suite::Traversal(args) => traversal::run(args),
        Suite::Driver(args) => driver::run(args),
        Suite::Size(args) => size::run(args),
        Suite::Motion(args) => motion::run(args),
    }
}

/// Returns the processor that an open device is, or without a device the CPU.
fn processor(device: Option<&Device>) -> Processor {
    device.map_or(Processor::Cpu, |device| Processor::of_device(device.info()))
}
