//! The command line: words to options, progress, reports, exit codes.
//!
//! What a command was asked for goes to standard output; progress, notes and errors go to standard error.

mod args;
#[cfg(feature = "bench")]
mod bench;
mod build;
mod cast;
mod cast_report;
mod devices;
mod error;
mod file_roles;
mod inspect;
mod log;
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
mod wanted;

use std::{
    ffi::OsString,
    io::{self, Write},
    process::ExitCode,
    sync::Arc,
};

use args::{Args, Command};
use clap::Parser;
use error::CliError;
use kdray::{
    gpu::{Context, ContextOptions, GpuError},
    util::text::{escape_controls, one_line},
};
use progress::Progress;

/// Runs the command that `arguments`, the program's name first, ask for.
pub fn main(arguments: impl Iterator<Item = OsString>) -> ExitCode {
    #[cfg(unix)]
    signals::handle();
    let result = match Args::try_parse_from(arguments) {
        Ok(args) => run(args),
        Err(request) if !request.use_stderr() => print(&request.render().to_string()),
        Err(mistake) => Err(CliError::from(mistake)),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            complain("error", &error.to_string());
            ExitCode::from(error.exit_code())
        }
    }
}

fn run(args: Args) -> Result<(), CliError> {
    match args.command {
        Command::Render(args) => render::run(&args),
        #[cfg(feature = "view")]
        Command::View(args) => view::run(&args),
        Command::Cast(args) => cast::run(&args),
        Command::Devices => devices::run(),
        Command::Inspect(args) => inspect::run(&args),
        #[cfg(feature = "bench")]
        Command::Bench(suite) => bench::run(&suite),
    }
}

/// Opens the device that is meant, and says so where that is none but the CPU.
fn open_device(options: &ContextOptions, progress: &Progress) -> Result<Arc<Context>, GpuError> {
    let context = Context::new(options)?;
    if options.device.is_none() && context.is_software() {
        progress.note(&format!("no GPU found, rendering in software on {}", context.info().name));
    }
    Ok(context)
}

/// Writes a report to standard output, line by line, with control characters of the names that it quotes escaped.
fn print(text: &str) -> Result<(), CliError> {
    print_raw(&text.split('\n').map(escape_controls).collect::<Vec<_>>().join("\n"))
}

/// Writes what was asked for to standard output, as it is. A reader that has seen enough is no error.
fn print_raw(text: &str) -> Result<(), CliError> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(CliError::Stdout(error)),
        _ => Ok(()),
    }
}

/// Writes `label: message` to standard error, as one line whatever the message quotes.
fn complain(label: &str, message: &str) {
    // There is nobody left to tell where this fails.
    let _ = writeln!(io::stderr(), "{label}: {}", one_line(message));
}
