//! Names of files relative to the folder of a file that is to be written.

use std::{
    ffi::OsStr,
    io,
    path::{Component, Path, PathBuf},
};

use crate::scene::{
    files::canonical,
    model::{LoadOptions, SceneError},
};

/// The folder of a scene file that is to be written.
pub(super) struct OutputFolder {
    output: PathBuf,
    /// The folder of the output, without links.
    folder: PathBuf,
    allow_outside: bool,
}

impl OutputFolder {
    pub fn new(output: &Path, options: &LoadOptions) -> Result<Self, SceneError> {
        let folder = folder_of(output).map_err(|error| SceneError::file(output, format!("its folder: {error}")))?;
        Ok(Self { output: output.to_owned(), folder, allow_outside: options.allow_outside })
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
        let is_common = |(a, b): &(Component, Component)| a == b;
        let n_common = folder.components().zip(self.folder.components()).take_while(is_common).count();
        let n_up = self.folder.components().count() - n_common;
        if n_up > 0 && !self.allow_outside {
            let output = self.output.display();
            let what = format!("does not lie below the folder of `{output}`, which has to name it");
            return Err(failed(what + "; --allow-outside lets it"));
        }
        let below = folder.components().skip(n_common).map(Component::as_os_str).chain([file_name]);
        let parts = std::iter::repeat_n(OsStr::new(".."), n_up).chain(below);
        let parts = parts.map(|part| part.to_str().ok_or_else(|| failed("its path is not UTF-8".to_owned())));
        Ok(parts.collect::<Result<Vec<_>, _>>()?.join("/"))
    }
}

/// Returns the folder of a file without links. The file need not exist.
fn folder_of(file: &Path) -> io::Result<PathBuf> {
    canonical(file.parent().unwrap_or(Path::new("")))
}
