//! The command line: arguments, progress, reports and exit codes.
//!
//! Reports go to standard output. Progress, notes and errors go to standard error, but progress for a scheduler goes to
//! standard output.

mod args;
#[cfg(feature = "bench")]
mod bench;
mod cast;
mod cast_report;
mod convert;
mod device_args;
mod devices;
mod doctor;
mod error;
mod file_roles;
mod inspect;
mod interrupt;
mod load_args;
mod log;
mod look_args;
mod merge;
mod openjd;
mod or_auto;
mod pack;
mod picture_args;
mod progress;
mod render;
mod report;
#[cfg(unix)]
mod signals;
mod spans;
mod table;
mod trace;
#[cfg(feature = "view")]
mod view;
#[cfg(feature = "view")]
mod view_args;

use std::{
    ffi::OsString,
    io::{self, Write},
    process::ExitCode,
};

use args::{Args, Command};
use clap::Parser;
use error::CliError;
use kdray::util::text::{escape_controls, one_line};
use openjd::ProgressKind;

/// Runs the command that `arguments` describe. The first argument is the program's name.
pub fn main(arguments: impl Iterator<Item = OsString>) -> ExitCode {
    #[cfg(unix)]
    signals::handle();
    let words: Vec<_> = arguments.collect();
    let progress = ProgressKind::of_words(&words);
    let result = match Args::try_parse_from(words) {
        Ok(args) => run(args).inspect(|()| progress.end(None)),
        // clap returns the texts of --help and --version as errors that belong on standard output.
        Err(request) if !request.use_stderr() => print(&request.render().to_string()),
        Err(mistake) => Err(CliError::from(mistake)),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            print_line("error", &error.to_string());
            progress.end(Some(&error.to_string()));
            ExitCode::from(error.exit_code())
        }
    }
}

fn run(args: Args) -> Result<(), CliError> {
    match args.command {
        Command::Render(args) => render::run(args),
        #[cfg(feature = "view")]
        Command::View(args) => view::run(&args),
        Command::Cast(args) => cast::run(&args),
        Command::Merge(args) => merge::run(&args),
        Command::Pack(args) => pack::run(&args),
        Command::Devices => devices::run(),
        Command::Doctor(args) => doctor::run(&args),
        Command::ProbeDrivers => doctor::probe::print_devices(),
        Command::Inspect(args) => inspect::run(&args),
        Command::Convert(args) => convert::run(&args),
        #[cfg(feature = "bench")]
        Command::Bench(suite) => bench::run(&suite),
    }
}

/// Writes a report to standard output. Control characters are escaped within each line, since a report quotes names
/// from files.
fn print(text: &str) -> Result<(), CliError> {
    print_raw(&text.split('\n').map(escape_controls).collect::<Vec<_>>().join("\n"))
}

/// Writes text to standard output without escaping. A closed pipe is not an error.
fn print_raw(text: &str) -> Result<(), CliError> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(CliError::Stdout(error)),
        _ => Ok(()),
    }
}

/// Writes `label: message` to standard error. Line breaks in the message are escaped, so that it stays one line.
fn print_line(label: &str, message: &str) {
    // If standard error fails, there is nowhere left to report it.
    let _ = writeln!(io::stderr(), "{label}: {}", one_line(message));
}
