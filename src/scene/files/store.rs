//! The files that a scene is read from: on disk, or in a pack, which is used like a folder. Only this file and
//! pack/mod.rs, which opens the pack, open files.

use std::{
    ffi::OsString,
    fs,
    io::{self, Read},
    path::{Path, PathBuf},
};

use super::pack;
use crate::{scene::model::error::Checked, util::memory::require};

/// Reads a regular file of which `n_copies` are in memory meanwhile. An error is a message for people.
pub fn read(path: &Path, n_copies: u64) -> Checked<Vec<u8>> {
    let unread = |error: io::Error| format!("cannot be read: {error}");
    let check = |n_bytes: u64| require("reading it", n_bytes.saturating_mul(n_copies));
    match pack::entry(path) {
        Some(entry) => {
            let entry = entry.map_err(unread)?;
            check(entry.n_bytes().unwrap_or(0))?;
            entry.read().map_err(unread)
        }
        None => {
            check(regular(path).map_err(unread)?)?;
            fs::read(path).map_err(unread)
        }
    }
}

/// Returns up to `n_most` bytes from the beginning of a regular file, or `None` if it cannot be read.
pub fn head(path: &Path, n_most: usize) -> Option<Vec<u8>> {
    let mut head = Vec::new();
    match pack::entry(path) {
        Some(_) => head.extend(read(path, 1).ok()?.iter().take(n_most)),
        None => {
            regular(path).ok()?;
            fs::File::open(path).ok()?.take(n_most as u64).read_to_end(&mut head).ok()?;
        }
    }
    Some(head)
}

/// Returns the size of a regular file in bytes. Others are refused, since reading a device or a pipe might never end.
fn regular(path: &Path) -> io::Result<u64> {
    match fs::metadata(path)? {
        metadata if metadata.is_file() => Ok(metadata.len()),
        _ => Err(io::Error::new(io::ErrorKind::InvalidInput, "it is not a regular file")),
    }
}

/// Returns the size of a regular file in bytes, or `None` if there is none.
pub fn n_bytes(path: &Path) -> Option<u64> {
    match pack::entry(path) {
        Some(entry) => entry.ok()?.n_bytes(),
        None => regular(path).ok(),
    }
}

/// Whether the path is that of a file or folder.
pub fn exists(path: &Path) -> bool {
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
pub fn names_in(folder: &Path) -> Vec<OsString> {
    match pack::entry(folder) {
        Some(entry) => entry.map_or_else(|_| Vec::new(), |entry| entry.names()),
        None => {
            let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
            fs::read_dir(folder).map_or_else(|_| Vec::new(), |dir| dir.flatten().map(|it| it.file_name()).collect())
        }
    }
}
