//! `kdray render`: renders scene files to pictures.
//!
//! ```text
//! inputs     which scenes the user wants
//! names      the names of the pictures of several scenes
//! files      the files of a picture
//! views      the pictures of a scene: one, or one for each frame of a path
//! session    one scene after the other on the same devices: loads, builds, draws
//! motion     the way of the camera, and the shutter
//! seed       which random numbers a picture has
//! draw       draws the pictures of a scene, and writes them
//! several    several scenes: what fails does not stop the others
//! ```

mod deadline;
mod draw;
mod files;
mod inputs;
mod motion;
mod names;
mod noise;
mod seed;
mod session;
mod several;
mod views;

use std::path::{Path, PathBuf};

use kdray::gpu::Device;

use self::{
    files::{STDOUT, check_outputs, only_job, roles},
    session::Session,
    views::{NamedPath, views},
};
pub use self::{motion::Shutter, seed::Seed};
use super::{args::RenderArgs, error::CliError, interrupt, print, print_line, report::write_json};

/// Runs `kdray render`.
pub fn run(args: RenderArgs) -> Result<(), CliError> {
    let mut scenes = inputs::scenes(&args)?;
    match (scenes.pop(), &args.list) {
        (Some(scene), None) if scenes.is_empty() => run_one(args, scene)?,
        (last, _) => {
            scenes.extend(last);
            several::run(&args, scenes)?;
        }
    }
    interrupt::end_if_asked();
    Ok(())
}

/// Draws the only scene, and reports. Arguments, files and memory are checked before the work that an error would
/// waste.
fn run_one(args: RenderArgs, scene: PathBuf) -> Result<(), CliError> {
    let args = &args.with_packed_path(&scene)?;
    args.check()?;
    let job = only_job(args, scene);
    let roles = roles(args, std::slice::from_ref(&job))?;
    check_outputs(args, &job)?;
    set_threads(args.threads)?;
    args.check_kind_of_devices()?;

    let session = Session::new(args, 1);
    let path = args.path.as_deref().map(NamedPath::load).transpose()?;
    let views = views(args, (&job.scene, &job.output), path.as_ref(), roles, &session.progress)?;
    if views.is_empty() {
        return Ok(());
    }
    let report = session.draw(&job.scene, views, path)?;
    let engine = session.end()?;
    write_json(args.profile.as_ref(), &report)?;
    if !args.quiet && job.output != Path::new(STDOUT) {
        print(&args.progress.report(&report.text()))?;
    }
    engine.devices().try_for_each(report_validation)
}

/// Sets the number of threads of rayon's global pool. Without a number, rayon chooses.
pub(super) fn set_threads(n_threads: Option<u16>) -> Result<(), CliError> {
    let Some(n_threads) = n_threads else { return Ok(()) };
    (rayon::ThreadPoolBuilder::new().num_threads(n_threads.into()).build_global())
        .map_err(|error| CliError::Usage(format!("--threads {n_threads}: {error}")))
}

/// Prints the validation layer's messages. Fails if there is any.
pub(super) fn report_validation(device: &Device) -> Result<(), CliError> {
    let messages = device.validation_messages();
    for message in &messages {
        print_line("validation", message);
    }
    if messages.is_empty() { Ok(()) } else { Err(CliError::Validation(messages.len())) }
}
