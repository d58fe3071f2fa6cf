//! `kdray bench`: measures and prints a table. Each suite has a file.

mod args;
mod driver;
mod paper;
mod size;
mod traversal;

pub use args::Suite;

use super::error::CliError;

pub fn run(suite: &Suite) -> Result<(), CliError> {
    match suite {
        Suite::Paper(args) => paper::run(args),
        Suite::Traversal(args) => traversal::run(args),
        Suite::Driver(args) => driver::run(args),
        Suite::Size(args) => size::run(args),
    }
}
