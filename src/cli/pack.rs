//! `kdray pack`: one file of a scene and everything that it needs.

use std::path::PathBuf;

use kdray::{
    output,
    pack::{Packed, pack},
    scene::{PACK_ENDING, Scene},
};

use super::{
    args::PackArgs,
    error::CliError,
    file_roles::{FileRoles, require_ending},
    print,
};

/// Packs the scene, and reports the files and the pack's hash.
pub fn run(args: &PackArgs) -> Result<(), CliError> {
    let output = args.output.clone().unwrap_or_else(|| default_output(args));
    let shown = output.display();
    require_ending(&output, PACK_ENDING, "a pack")?;
    let mut roles = FileRoles::default();
    roles.read_scene("SCENE", &args.scene, args.load.options());
    args.path.iter().for_each(|path| roles.read("--path", path));
    roles.write("--output", &output)?;
    output::check(&output)?;
    let Packed { hash, files } = pack(&args.scene, args.path.as_deref(), &args.load.options(), &output)?;
    if args.quiet {
        return Ok(());
    }
    let mut text = String::new();
    for (name, n_bytes) in &files {
        text += &format!("{n_bytes:>12}  {name}\n");
    }
    let n_bytes: u64 = files.iter().map(|(_, n_bytes)| n_bytes).sum();
    let noun = if files.len() == 1 { "file" } else { "files" };
    print(&format!("{text}{n_bytes:>12}  bytes in {} {noun}\nhash {hash}\nwrote {shown}\n", files.len()))
}

/// Returns a file in the working directory, named after the scene.
fn default_output(args: &PackArgs) -> PathBuf {
    format!("{}.{PACK_ENDING}", output::stem_of(&Scene::name_of(&args.scene))).into()
}
