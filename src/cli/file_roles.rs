//! The roles of a command's files. They are recorded so that no output overwrites another output or a file that is
//! read.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
};

use kdray::{
    output::regular_file,
    scene::{LoadOptions, source_files_with},
};

use super::error::CliError;

/// Refuses the name of an output that does not have the ending of its format. `what` names the format: "a pack".
pub fn require_ending(path: &Path, ending: &str, what: &str) -> Result<(), CliError> {
    match path.extension().is_some_and(|found| found.eq_ignore_ascii_case(ending)) {
        true => Ok(()),
        false => {
            let path = path.display();
            CliError::refuse(format!("cannot write `{path}`: the name of {what} must end in .{ending}"))
        }
    }
}

/// The use of a file by a command, and the argument that names the file.
struct Role {
    name: String,
    is_read: bool,
}

/// The files recorded so far as used by a command. Two paths that lead to one file count as the same file, even if
/// they are spelled differently or pass through links.
#[derive(Default)]
pub struct FileRoles {
    roles: HashMap<PathBuf, Role>,
    /// Scenes whose meshes and material libraries have not been looked up yet.
    scenes: Vec<(PathBuf, LoadOptions)>,
}

impl FileRoles {
    /// Notes a file that is read.
    pub fn read(&mut self, name: &str, path: &Path) {
        self.roles.insert(key_of(path), Role { name: name.to_owned(), is_read: true });
    }

    /// Notes a scene or mesh file, and all files that it names if it is loaded with `options`.
    pub fn read_scene(&mut self, name: &str, path: &Path, options: LoadOptions) {
        self.read(name, path);
        self.scenes.push((path.to_owned(), options));
    }

    /// Notes an output.
    ///
    /// # Errors
    /// The command reads the file, or writes another output to it.
    pub fn write(&mut self, name: &str, path: &Path) -> Result<(), CliError> {
        // The files that a scene names are found by reading the scene. A file that does not exist cannot be among
        // them.
        if path.exists() {
            self.look_up_scenes();
        }
        let key = key_of(path);
        match self.roles.get(&key) {
            None => {
                self.roles.insert(key, Role { name: name.to_owned(), is_read: false });
                Ok(())
            }
            Some(Role { name: other, is_read: false }) => {
                CliError::refuse(format!("{other} and {name} name the same file, `{}`", path.display()))
            }
            Some(Role { name: other, is_read: true }) => {
                CliError::refuse(format!("{name} would overwrite `{}`, which is read as {other}", path.display()))
            }
        }
    }

    /// Notes the files that the scenes name as read.
    fn look_up_scenes(&mut self) {
        for (scene, options) in std::mem::take(&mut self.scenes) {
            for source in source_files_with(&scene, &options) {
                let role = || Role { name: format!("a part of `{}`", scene.display()), is_read: true };
                self.roles.entry(key_of(&source)).or_insert_with(role);
            }
        }
    }
}

/// Returns a key that is the same for all paths to one regular file. The key of a device or a pipe is its path as
/// spelled.
fn key_of(path: &Path) -> PathBuf {
    regular_file(path).unwrap_or_else(|| path.to_owned())
}
