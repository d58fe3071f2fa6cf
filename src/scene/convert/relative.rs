//! Names of files relative to the folder of a file that is to be written.

use std::{
    fs, io,
    path::{Component, Path, PathBuf},
};

use crate::scene::SceneError;

/// The folder of a file that is to be written.
pub(super) struct Places {
    output: PathBuf,
    /// The folder of the output, without links.
    folder: PathBuf,
}

impl Places {
    pub fn new(output: &Path) -> Result<Self, SceneError> {
        let folder = folder_of(output).map_err(|error| SceneError::file(output, format!("its folder: {error}")))?;
        Ok(Self { output: output.to_owned(), folder })
    }

    /// Returns whether a folder is the output's.
    pub fn is_here(&self, folder: &Path) -> bool {
        canonical(folder).is_ok_and(|folder| folder == self.folder)
    }

    /// Returns the name of a file relative to the output's folder, with `/` between its parts.
    pub fn name_of(&self, file: &Path) -> Result<String, SceneError> {
        let failed = |what: String| SceneError::file(file, what);
        // A link to the file stays one, since what the file names is looked up beside the link.
        let folder = folder_of(file).map_err(|error| failed(format!("its folder: {error}")))?;
        let file_name = file.file_name().ok_or_else(|| failed("has no name".to_owned()))?;
        let Ok(below) = folder.strip_prefix(&self.folder) else {
            let output = self.output.display();
            return Err(failed(format!("does not lie below the folder of `{output}`, which has to name it")));
        };
        let path = below.join(file_name);
        let parts = path.components().map(|part| match part {
            Component::Normal(part) => part.to_str().ok_or_else(|| failed("its path is not UTF-8".to_owned())),
            _ => Err(failed("has no relative path".to_owned())),
        });
        Ok(parts.collect::<Result<Vec<_>, _>>()?.join("/"))
    }
}

/// Returns the folder of a file without links. The file need not exist.
fn folder_of(file: &Path) -> io::Result<PathBuf> {
    canonical(file.parent().unwrap_or(Path::new("")))
}

fn canonical(folder: &Path) -> io::Result<PathBuf> {
    fs::canonicalize(if folder.as_os_str().is_empty() { Path::new(".") } else { folder })
}
