//! Draws several scenes, one after the other. A scene that fails does not stop the others.

use std::path::PathBuf;

use kdray::util::text::one_line;

use super::{
    draw::FrameJob,
    files::{Files, Job, jobs_of_several, roles},
    inputs::remove_repeated,
    report_validation,
    session::Session,
    set_threads,
};
use crate::cli::{args::RenderArgs, error::CliError, interrupt, log, print, print_line};

/// Numbers of scenes by how they ended.
#[derive(Default)]
struct Tally {
    n_all: usize,
    n_drawn: usize,
    n_skipped: usize,
    n_failed: usize,
    /// The exit code of the first scene that has failed.
    exit_code: Option<u8>,
}

/// Draws the scenes, and reports a line for each and their number. All names of files are checked before the first
/// scene is loaded, and of each scene nothing is kept when the next one begins.
///
/// # Errors
/// A picture's name is refused, or scenes have failed or a device cannot be opened: the exit code is that of the first
/// failure.
pub fn run(args: &RenderArgs, mut scenes: Vec<PathBuf>) -> Result<(), CliError> {
    args.check_of_several()?;
    args.check()?;
    let n_repeated = remove_repeated(&mut scenes);
    let mut jobs = jobs_of_several(args, scenes)?;
    let n_all = jobs.len();
    if args.skip_existing {
        jobs.retain(|job| !files_of(args, job).exist());
    }
    roles(args, &jobs)?;
    jobs.iter().try_for_each(|job| files_of(args, job).check())?;
    set_threads(args.threads)?;
    args.check_kind_of_devices()?;

    let mut session = Session::new(args, jobs.len().max(1));
    if n_repeated > 0 {
        session.progress.note(&format!("{n_repeated} scenes are named more than once, and are drawn once"));
    }
    let mut tally = Tally { n_all, n_skipped: n_all - jobs.len(), ..Tally::default() };
    for (job_ix, job) in jobs.iter().enumerate() {
        session.progress.begin_scene(job_ix);
        if let Err(error) = session.engine() {
            // Without a device, no scene can be drawn.
            tally.exit_code.get_or_insert(error.exit_code());
            session.progress.error(&error.to_string());
            break;
        }
        log::set_scene(Some(&job.scene));
        let drawn = draw(&session, job);
        tally.count(&drawn);
        if let Err(error) = drawn {
            session.progress.error(&error.to_string());
        }
        log::set_scene(None);
        session.replace_lost_devices();
        if interrupt::is_asked() {
            break;
        }
    }
    drop(session);
    let result = tally.report(args);
    if let (Err(error), true) = (&result, interrupt::is_asked()) {
        // The command ends as by the signal.
        print_line("error", &error.to_string());
        interrupt::end_if_asked();
    }
    result
}

fn files_of(args: &RenderArgs, job: &Job) -> Files {
    Files::of(job.output.clone(), &args.aov)
}

/// Draws a scene, and reports it in a line.
fn draw(session: &Session, job: &Job) -> Result<(), CliError> {
    let args = session.args;
    let view = FrameJob { camera: None, frame: 0, ix: 0, shares_file: false, files: files_of(args, job) };
    let report = session.draw(&job.scene, vec![view], None)?;
    session.engine()?.devices().try_for_each(report_validation)?;
    if args.quiet {
        return Ok(());
    }
    let line = format!("{}\n", one_line(&report.line(&job.scene)));
    session.progress.beside(|| print(&args.progress.report(&line)))
}

impl Tally {
    fn count(&mut self, drawn: &Result<(), CliError>) {
        match drawn {
            Ok(()) => self.n_drawn += 1,
            Err(error) => {
                self.n_failed += 1;
                self.exit_code.get_or_insert(error.exit_code());
            }
        }
    }

    /// Returns the numbers of scenes, for example `3 drawn, 1 failed`.
    fn summary(&self) -> String {
        let Self { n_all, n_drawn, n_skipped, n_failed, .. } = *self;
        let n_left = n_all - n_drawn - n_skipped - n_failed;
        let counts = [(n_skipped, ", N exist already"), (n_left, ", N not begun")];
        let others = counts.iter().filter(|(n, _)| *n > 0).map(|(n, text)| text.replace('N', &n.to_string()));
        format!("{n_drawn} drawn, {n_failed} failed{}", others.collect::<String>())
    }

    /// Prints the summary, or returns it as the error of the command.
    fn report(&self, args: &RenderArgs) -> Result<(), CliError> {
        match self.exit_code {
            Some(exit_code) => Err(CliError::Scenes { summary: self.summary(), exit_code }),
            None if args.quiet => Ok(()),
            None => print(&args.progress.report(&format!("{}\n", self.summary()))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_failure_has_the_exit_code() {
        let mut tally = Tally { n_all: 6, n_skipped: 1, ..Tally::default() };
        let failed = |exit_code| Err(CliError::Scenes { summary: String::new(), exit_code });
        [Ok(()), failed(3), failed(4)].iter().for_each(|drawn| tally.count(drawn));
        assert_eq!(
            (tally.exit_code, tally.summary()),
            (Some(3), "1 drawn, 2 failed, 1 exist already, 2 not begun".to_owned())
        );
    }
}
