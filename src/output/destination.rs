//! Destinations of outputs: the regular file, device or pipe that a path leads to.

use std::{
    fs::{self, OpenOptions},
    path::{Path, PathBuf},
};

use super::OutputError;

/// Number of symbolic links, one after another, that Linux follows before it gives up.
const MAX_LINKS: usize = 40;

/// What a path leads to, once its symbolic links are followed.
pub enum Destination {
    /// A device or a pipe, which cannot be replaced.
    Stream,
    /// A regular file, which may not exist yet, in an existing directory.
    File { directory: PathBuf, file: PathBuf },
}

impl Destination {
    /// Follows the path's links and checks that a file can be written at their end.
    pub fn at(path: &Path) -> Result<Self, OutputError> {
        let failed = |source| OutputError::Write { path: path.to_owned(), source };
        let file = match fs::metadata(path) {
            Ok(metadata) if metadata.is_dir() => return Err(OutputError::IsDirectory { path: path.to_owned() }),
            Ok(metadata) if !metadata.is_file() => return Ok(Self::Stream),
            Ok(_) => {
                // Renaming ignores the permissions of the file that it replaces. So write-protected files are refused
                // here.
                OpenOptions::new().write(true).open(path).map_err(failed)?;
                fs::canonicalize(path).map_err(failed)?
            }
            Err(error) => end_of_links(path).ok_or_else(|| failed(error))?,
        };
        let directory = parent_of(&file);
        if !directory.is_dir() {
            return Err(OutputError::NoDirectory { path: path.to_owned(), directory });
        }
        Ok(Self::File { directory, file })
    }
}

/// Returns the absolute path, without links, of the regular file that `path` leads to. The file need not exist, but
/// its directory must. `None` for a directory, a device or a pipe.
pub fn regular_file(path: &Path) -> Option<PathBuf> {
    match fs::metadata(path) {
        Ok(metadata) if metadata.is_file() => fs::canonicalize(path).ok(),
        Ok(_) => None,
        Err(_) => {
            let file = end_of_links(path)?;
            let name = file.file_name()?;
            fs::canonicalize(parent_of(&file)).ok().map(|directory| directory.join(name))
        }
    }
}

/// Returns the path that the last link of a chain of symbolic links names. Nothing need exist at that path. If `path`
/// is no link, it is returned itself. `None` for a circle of links, or for a chain of [`MAX_LINKS`] links or more.
fn end_of_links(path: &Path) -> Option<PathBuf> {
    let mut file = path.to_owned();
    for _ in 0..MAX_LINKS {
        match fs::read_link(&file) {
            Ok(named) => file = parent_of(&file).join(named),
            Err(_) => return Some(file),
        }
    }
    None
}

fn parent_of(file: &Path) -> PathBuf {
    match file.parent() {
        Some(parent) if parent != Path::new("") => parent.to_owned(),
        _ => PathBuf::from("."),
    }
}
