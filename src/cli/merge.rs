//! `kdray merge`: joins the parts of a picture.

use kdray::{merge, output};

use super::{
    args::MergeArgs, error::CliError, file_roles::FileRoles, openjd::ProgressKind, print, print_line,
    progress::Progress,
};

/// What a scheduler is told of the shares of the work: reading and joining, and writing.
const SHARES: [f64; 2] = [0.7, 0.3];

/// Reads the parts, checks that they make up one picture, and writes it.
pub fn run(args: &MergeArgs) -> Result<(), CliError> {
    let mut roles = FileRoles::default();
    args.parts.iter().for_each(|part| roles.read("PART", part));
    roles.write("--output", &args.output)?;
    output::Format::of(&args.output)?;
    output::check(&args.output)?;
    // Joining is quick, so only a scheduler is told of it.
    let kind = if args.progress == ProgressKind::Auto { ProgressKind::None } else { args.progress };
    let progress = Progress::of_kind(kind, args.quiet, (&SHARES, 1), None);
    let noun = if args.parts.len() == 1 { "part" } else { "parts" };
    let joining = format!("joining {} {noun}", args.parts.len());
    let merged = progress.stage(&joining, || merge::merge(&args.parts)).0?;
    let writing = format!("writing {}", args.output.display());
    progress.stage(&writing, || merged.write(&args.output)).0?;
    if args.quiet {
        return Ok(());
    }
    if merged.devices.len() > 1 {
        let devices = merged.devices.join("; ");
        print_line(
            "note",
            &format!("the parts come from several devices, which may round in different ways: {devices}"),
        );
    }
    let merge::Merged { n_parts, picture, record, .. } = &merged;
    let (width, height, n_samples) = (picture.width, picture.height, record.whole.n_samples);
    let parts = if *n_parts == 1 { "part" } else { "parts" };
    print(&args.progress.report(&format!(
        "{n_parts} {parts} of {}, {width}x{height} pixels with {n_samples} samples\nwrote {}\n",
        record.scene,
        args.output.display()
    )))
}
