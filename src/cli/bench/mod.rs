//! `kdray bench`: measures, and prints a table; one file a suite.

mod args;
mod paper;

pub use args::Suite;

use super::error::CliError;

pub fn run(suite: &Suite) -> Result<(), CliError> {
    match suite {
        Suite::Paper(args) => paper::run(args),
    }
}
