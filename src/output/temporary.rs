//! Temporary files beside their targets. None of them outlives a process that ends by itself, or by a signal whose
//! handler calls [`remove_temporaries`].
//!
//! Every temporary file with a name is registered while it has that name. A signal handler's thread calls
//! [`remove_temporaries`] before it ends the process. One lock covers the registry and the files themselves: only the
//! thread that holds the lock gives a file its temporary name or takes it away.

#[cfg(unix)]
use std::os::unix::fs::PermissionsExt;
use std::{
    collections::BTreeSet,
    ffi::OsStr,
    fs::{self, File},
    io, mem,
    path::{Path, PathBuf},
    sync::{Mutex, MutexGuard, PoisonError},
};

use tempfile::NamedTempFile;

/// Paths of all temporary files that exist now.
static REGISTRY: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn registry() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    REGISTRY.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes every temporary file of this process, and lets no thread create or rename another one.
///
/// A process that is about to end calls this, on a thread other than those that write. A thread that then begins or
/// finishes an output waits until the process has ended. So each target is either as it was before or complete.
pub fn remove_temporaries() {
    let paths = registry();
    for path in paths.iter() {
        // A file that cannot be removed stays: the process is ending and reports nothing more.
        let _ = fs::remove_file(path);
    }
    // The lock is never released, so that no other thread can create or rename a file.
    mem::forget(paths);
}

/// A temporary file that can be renamed to any name in its directory. If it is dropped before that, it is removed.
pub struct Temporary {
    /// `None` once the file has its final name.
    file: Option<NamedTempFile>,
}

impl Temporary {
    /// Creates a file in a directory, with the permissions that the umask leaves.
    pub fn create_in(directory: &Path) -> io::Result<Self> {
        Self::create_named(directory, OsStr::new(""))
    }

    /// Creates a file in a directory whose name ends in `suffix`.
    pub fn create_named(directory: &Path, suffix: &OsStr) -> io::Result<Self> {
        let mut builder = tempfile::Builder::new();
        builder.prefix(".kdray-").suffix(suffix);
        #[cfg(unix)]
        builder.permissions(PermissionsExt::from_mode(0o666)); // less the umask
        let mut paths = registry();
        // The library's own message names the temporary file, whose name means nothing to the user.
        let file = builder.tempfile_in(directory).map_err(|error| io::Error::from(error.kind()))?;
        paths.insert(file.path().to_owned());
        Ok(Self { file: Some(file) })
    }

    /// Returns the open file.
    pub fn as_file_mut(&mut self) -> &mut File {
        self.file.as_mut().expect("only `persist` takes the file").as_file_mut()
    }

    /// Returns the file's path.
    pub fn path(&self) -> &Path {
        self.file.as_ref().expect("only `persist` takes the file").path()
    }

    /// Gives the file its final name. It replaces any file that had this name.
    pub fn persist(mut self, target: &Path) -> io::Result<()> {
        let mut paths = registry();
        let file = self.file.take().expect("only `persist` takes the file");
        paths.remove(file.path());
        // On failure the error holds the file, which is removed while the lock is still held.
        file.persist(target).map(|_: File| ()).map_err(|failed| failed.error)
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if let Some(file) = self.file.take() {
            let mut paths = registry();
            paths.remove(file.path());
            drop(file);
        }
    }
}
