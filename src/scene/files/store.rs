//! The files that a scene is read from: on disk, or in a pack, which is used like a folder. Here alone, files are
//! opened.

use std::{
    ffi::OsString,
    fs,
    io::{self, Cursor, Read},
    path::{Path, PathBuf},
};

use super::pack;
use crate::{scene::model::error::Checked, util::memory::require};

/// Copies of a text file in memory while it is read: the file itself, and what has been read of it.
const TEXT_COPIES: u64 = 2;

/// Reads a regular file.
pub(crate) fn read(path: &Path) -> io::Result<Vec<u8>> {
    match pack::entry(path) {
        Some(entry) => entry?.read(),
        None => regular(path).and_then(|()| fs::read(path)),
    }
}

/// Opens a regular file, of which only the beginning may be needed.
pub(crate) fn open(path: &Path) -> io::Result<Box<dyn Read>> {
    match pack::entry(path) {
        Some(entry) => Ok(Box::new(Cursor::new(entry?.read()?))),
        None => regular(path).and_then(|()| Ok(Box::new(fs::File::open(path)?) as Box<dyn Read>)),
    }
}

/// Reads up to `n_bytes` from the beginning of a regular file.
pub(crate) fn head(path: &Path, n_bytes: usize) -> io::Result<Vec<u8>> {
    let mut head = Vec::new();
    open(path)?.take(n_bytes as u64).read_to_end(&mut head)?;
    Ok(head)
}

/// Refuses what is no regular file. Reading a device or a pipe might never end.
fn regular(path: &Path) -> io::Result<()> {
    match fs::metadata(path)?.is_file() {
        true => Ok(()),
        false => Err(io::Error::new(io::ErrorKind::InvalidInput, "it is not a regular file")),
    }
}

/// Returns the size of a file in bytes, 0 if it cannot be found.
pub(crate) fn n_bytes(path: &Path) -> u64 {
    match pack::entry(path) {
        Some(entry) => entry.ok().and_then(|entry| entry.n_bytes()).unwrap_or(0),
        None => fs::metadata(path).map_or(0, |metadata| metadata.len()),
    }
}

/// Whether the path is that of a regular file.
pub(crate) fn is_file(path: &Path) -> bool {
    match pack::entry(path) {
        Some(entry) => entry.is_ok_and(|entry| entry.n_bytes().is_some()),
        None => path.is_file(),
    }
}

/// Whether the path is that of a file or folder.
pub(crate) fn exists(path: &Path) -> bool {
    match pack::entry(path) {
        Some(entry) => entry.is_ok_and(|entry| entry.exists()),
        None => path.exists(),
    }
}

/// Returns the absolute path of a file or folder without links. The empty path is that of the working directory.
pub(crate) fn canonical(path: &Path) -> io::Result<PathBuf> {
    match pack::entry(path) {
        Some(entry) => entry?.canonical(),
        None => fs::canonicalize(if path.as_os_str().is_empty() { Path::new(".") } else { path }),
    }
}

/// Returns the names of what a folder has, none if it cannot be listed. The empty path is that of the working
/// directory.
pub(crate) fn names_in(folder: &Path) -> Vec<OsString> {
    match pack::entry(folder) {
        Some(entry) => entry.map_or_else(|_| Vec::new(), |entry| entry.names()),
        None => {
            let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
            fs::read_dir(folder).map_or_else(|_| Vec::new(), |dir| dir.flatten().map(|it| it.file_name()).collect())
        }
    }
}

/// Refuses a text file that is too large for the memory. Accepts a file that cannot be read; reading it then fails.
pub(crate) fn require_for_text(path: &Path) -> Checked<()> {
    require_for_copies(path, TEXT_COPIES)
}

/// Refuses a file of rows or facets that is too large for the memory, as [`require_for_text`] does for text.
pub(crate) fn require_for_bytes(path: &Path) -> Checked<()> {
    require_for_copies(path, 1)
}

fn require_for_copies(path: &Path, n_copies: u64) -> Checked<()> {
    require("reading it", n_bytes(path).saturating_mul(n_copies)).map_err(|error| error.to_string())
}
