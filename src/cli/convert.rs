//! `kdray convert`: a scene file made from any file that is a scene, to be edited.

use kdray::{
    output,
    scene::{LoadOptions, scene_file_of},
};

use super::{
    args::ConvertArgs,
    error::CliError,
    file_roles::{FileRoles, require_ending},
    print,
};

/// Loads the input and writes a scene file that shows the same. An existing file is only replaced with `--force`.
pub fn run(args: &ConvertArgs) -> Result<(), CliError> {
    let path = args.output.display();
    require_ending(&args.output, "toml", "a scene file")?;
    let mut roles = FileRoles::default();
    roles.read_scene("IN", &args.input, args.load.options());
    roles.write("OUT", &args.output)?;
    // A link that leads nowhere exists, too.
    if args.output.symlink_metadata().is_ok() && !args.force {
        return CliError::refuse(format!("`{path}` exists: --force replaces it"));
    }
    output::check(&args.output)?;
    let options = LoadOptions { look: args.look.look(), ..args.load.options_of_pictures() };
    let text = scene_file_of(&args.input, &args.output, &options)?;
    output::write(&args.output, text.as_bytes())?;
    if args.quiet { Ok(()) } else { print(&format!("wrote {path}\n")) }
}
