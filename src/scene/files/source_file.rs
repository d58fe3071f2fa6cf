//! A file that a scene is read from, and the rule that decides which files it may name: those below its own folder, so
//! that a scene from elsewhere cannot show other files of the computer. Here alone, a name becomes a path, and an error
//! of reading a file is worded.

use std::{
    io,
    path::{Component, Path, PathBuf},
};

use super::{foreign, pack, store, text};
use crate::scene::model::{LoadOptions, SceneError, error::Checked};

/// A file that a scene is read from: the user's, or one that another file names. It may be in a pack, and need not
/// exist.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct SourceFile {
    pub path: PathBuf,
    /// Whether its name on disk differs from the stated one in the case of letters.
    pub is_other_case: bool,
    /// Whether it may name files outside of its folder.
    may_leave: bool,
}

/// Number of bytes at the beginning of a file that tell what it is.
const HEAD_BYTES: usize = 1024;

/// Copies of a text in memory while it is read: the file itself, and what has been read of it.
const TEXT_COPIES: u64 = 2;

/// Reading.
impl SourceFile {
    /// Returns the user's file.
    pub fn new(path: &Path, options: &LoadOptions) -> Self {
        Self::at(path.to_owned(), options.allow_outside)
    }

    fn at(path: PathBuf, may_leave: bool) -> Self {
        Self { path, is_other_case: false, may_leave }
    }

    /// An error that concerns the file as a whole.
    pub fn error(&self, what: impl AsRef<str>) -> SceneError {
        SceneError::file(&self.path, what)
    }

    /// Reads the whole file.
    ///
    /// # Errors
    /// It cannot be read, is no regular file, or is too large for the memory.
    pub fn bytes(&self) -> Result<Vec<u8>, SceneError> {
        self.read(1)
    }

    /// Reads a file that should hold a scene. `is_text`: the bytes are decoded to text, which takes more memory.
    ///
    /// # Errors
    /// Fails as [`SourceFile::bytes`] does, or if the file is known to be of another kind.
    pub fn scene_bytes(&self, is_text: bool) -> Result<Vec<u8>, SceneError> {
        let bytes = self.read(if is_text { TEXT_COPIES } else { 1 })?;
        foreign::what_it_is(&bytes).map_or(Ok(bytes), |what| Err(self.error(what)))
    }

    fn read(&self, n_copies: u64) -> Result<Vec<u8>, SceneError> {
        store::read(&self.path, n_copies).map_err(|what| self.error(what))
    }

    /// Reads text that must be UTF-8.
    pub fn text(&self) -> Result<String, SceneError> {
        text::utf8(self.bytes()?).map_err(|line| SceneError::line(&self.path, line, "is not UTF-8"))
    }

    /// Reads text that need not be UTF-8, as [`text::lossy_text`] does.
    pub fn lossy_text(&self) -> Result<String, SceneError> {
        self.bytes().map(text::lossy_text)
    }

    /// Refuses a file whose name is that of no scene, unless `is_scene` accepts its first bytes, without a byte order
    /// mark.
    pub fn check_content(&self, is_scene: impl Fn(&[u8]) -> bool) -> Result<(), SceneError> {
        let head = store::head(&self.path, HEAD_BYTES).map_or_else(|| b" ".to_vec(), text::without_bom);
        if is_scene(&head) { Ok(()) } else { Err(self.error(foreign::of_other_name(&self.path, &head))) }
    }

    /// Returns its size in bytes, 0 if it cannot be found.
    pub fn n_bytes(&self) -> u64 {
        store::n_bytes(&self.path).unwrap_or(0)
    }

    /// Whether there is a regular file.
    pub fn is_file(&self) -> bool {
        store::n_bytes(&self.path).is_some()
    }

    /// Whether there is a file or folder.
    pub fn exists(&self) -> bool {
        store::exists(&self.path)
    }

    /// Returns the absolute path without links, which is the same for all names of the file. The path of a file that
    /// does not exist is returned as it is.
    pub fn canonical(&self) -> PathBuf {
        store::canonical(&self.path).unwrap_or_else(|_| self.path.clone())
    }
}

/// Naming of further files.
impl SourceFile {
    /// Returns the folder below which the names in the file must stay.
    pub fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// Returns the file as one that may not name files outside of its folder.
    pub fn confined(&self) -> Self {
        Self { may_leave: false, ..self.clone() }
    }

    /// Returns the file whose name is relative to the folder.
    ///
    /// A file that does not exist is returned, too: reading it fails.
    ///
    /// # Errors
    /// The name is empty. The name or a symbolic link leads out of the folder, and that is not allowed.
    pub fn exact(&self, name: &str) -> Checked<Self> {
        if name.is_empty() {
            return Err("the name of a file is empty".to_owned());
        }
        let is_absolute = Path::new(name).is_absolute();
        let path = self.absolute(name).filter(|_| is_absolute).unwrap_or_else(|| self.folder().join(name));
        if !self.may_leave && !stays_below(name) {
            return Err(format!("`{name}` is not below the folder of the file that names it; {HINT}"));
        }
        self.check_links(&path, name)?;
        Ok(Self::at(path, self.may_leave))
    }

    /// Returns the file of a name as [`exact`](Self::exact) does. If there is none, the file that
    /// [`find`](Self::find) finds is taken.
    ///
    /// # Errors
    /// Those of [`exact`](Self::exact).
    pub fn exact_or_alike(&self, name: &str) -> Checked<Self> {
        let exact = self.exact(name)?;
        let alike = if exact.exists() { None } else { self.find(self.folder(), name).ok().filter(Self::is_file) };
        Ok(alike.unwrap_or(exact))
    }

    /// Returns the file of a name that is relative to a folder below that of this file. Backslashes count as
    /// separators, as in files from Windows. Where no file has the name, the only one whose name differs in the case of
    /// letters is taken.
    ///
    /// # Errors
    /// The name or a symbolic link leads out of the folder of this file, and that is not allowed.
    pub fn find(&self, folder: &Path, name: &str) -> Checked<Self> {
        let leaves = || Err(format!("`{name}` leaves the folder of the scene's file: it is not read; {HINT}"));
        let parts = name.replace('\\', "/");
        let is_absolute = parts.starts_with('/') || parts.chars().nth(1) == Some(':');
        if is_absolute && self.may_leave {
            let path = self.absolute(name).unwrap_or_else(|| PathBuf::from(name));
            return Ok(Self::at(path, true));
        }
        if is_absolute {
            return leaves();
        }
        let mut found = Self::at(folder.to_owned(), self.may_leave);
        for part in parts.split('/').filter(|part| !matches!(*part, "" | ".")) {
            if part == ".." && self.may_leave {
                found.path.push(part);
                continue;
            }
            if part == ".." {
                let ends_in_name = matches!(found.path.components().next_back(), Some(Component::Normal(_)));
                if !ends_in_name || !found.path.pop() || !found.path.starts_with(self.folder()) {
                    return leaves();
                }
                continue;
            }
            let exact = found.path.join(part);
            match store::exists(&exact) {
                true => found.path = exact,
                false => {
                    // Not even a list of other folders is read.
                    self.check_links(&found.path, name)?;
                    match only_other_case(&found.path, part) {
                        Some(other) => (found.path, found.is_other_case) = (other, true),
                        None => found.path = exact,
                    }
                }
            }
        }
        self.check_links(&found.path, name)?;
        Ok(found)
    }

    /// Returns the path of an absolute name, if the folder is in a pack.
    fn absolute(&self, name: &str) -> Option<PathBuf> {
        pack::of_absolute(self.folder(), Path::new(name))
    }

    /// Refuses a path that leads out of the folder by symbolic links.
    fn check_links(&self, path: &Path, name: &str) -> Checked<()> {
        if self.may_leave {
            return Ok(());
        }
        let found = match store::canonical(path) {
            Ok(found) => found,
            // A file that does not exist has no links to resolve.
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
            Err(error) => return Err(format!("`{name}` cannot be read: {error}")),
        };
        match store::canonical(self.folder()) {
            Ok(root) if found.starts_with(&root) => Ok(()),
            _ => Err(format!("`{name}` leads out of the folder of the file that names it; {HINT}")),
        }
    }
}

/// How to read such a file.
const HINT: &str = "--allow-outside reads it";

/// Returns whether a name is that of a file below a folder, unless a link leads out of it.
fn stays_below(name: &str) -> bool {
    let is_windows_path = name.starts_with('\\') || name.split('\\').any(|part| part == "..");
    !is_windows_path && pack::name_of(Path::new(name)).is_some()
}

/// Returns the only entry of a folder whose name differs from `name` in the case of letters alone.
fn only_other_case(folder: &Path, name: &str) -> Option<PathBuf> {
    let lower = name.to_lowercase();
    let names = store::names_in(folder).into_iter();
    let mut same = names.filter(|entry| entry.to_str().is_some_and(|entry| entry.to_lowercase() == lower));
    match (same.next(), same.next()) {
        (Some(only), None) => Some(folder.join(only)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use tempfile::TempDir;

    use super::*;

    /// Returns a file that may name those below its folder, and one that may name all.
    fn file_in(folder: &Path) -> (SourceFile, SourceFile) {
        (SourceFile::at(folder.join("file"), false), SourceFile::at(folder.join("file"), true))
    }

    #[test]
    fn only_names_below_the_folder_are_allowed() {
        let directory = TempDir::new().unwrap();
        let folder = directory.path().join("scene");
        fs::create_dir_all(folder.join("parts")).unwrap();
        fs::write(directory.path().join("secret"), "").unwrap();
        fs::write(folder.join("parts/a"), "").unwrap();
        let (confined, free) = file_in(&folder);
        for name in ["parts/a", "./parts/a", "none", "parts/none", "a b.png", "Größe:1", "parts/../parts/a"] {
            assert_eq!(confined.exact(name).unwrap().path, folder.join(name), "{name}");
        }
        let absolute = directory.path().join("secret");
        let absolute = absolute.to_str().unwrap();
        for name in
            ["../secret", "parts/../../secret", "parts/../../scene/parts/a", absolute, "/etc/none", "..\\secret"]
        {
            let refused = confined.exact(name).unwrap_err();
            assert!(refused.contains("is not below") && refused.ends_with("--allow-outside reads it"), "{name}");
            assert_eq!(free.exact(name).unwrap().path, folder.join(name), "{name}");
        }
        assert!(free.exact("").is_err() && confined.exact("").is_err());
    }

    #[cfg(unix)]
    #[test]
    fn links_must_not_lead_out() {
        let directory = TempDir::new().unwrap();
        let folder = directory.path().join("scene");
        fs::create_dir(&folder).unwrap();
        fs::write(directory.path().join("secret"), "").unwrap();
        fs::write(folder.join("a"), "").unwrap();
        std::os::unix::fs::symlink("../secret", folder.join("out")).unwrap();
        std::os::unix::fs::symlink("..", folder.join("up")).unwrap();
        std::os::unix::fs::symlink("a", folder.join("in")).unwrap();
        let (confined, free) = file_in(&folder);
        assert!(confined.exact("in").is_ok());
        for name in ["out", "up/secret"] {
            assert!(confined.exact(name).unwrap_err().contains("leads out"));
            assert!(confined.find(&folder, name).unwrap_err().contains("leads out"));
            assert!(free.exact(name).is_ok() && free.find(&folder, name).is_ok());
        }
    }

    #[test]
    fn names_are_found_below_the_folder() {
        let directory = TempDir::new().unwrap();
        let root = directory.path().join("scene");
        fs::create_dir_all(root.join("Maps")).unwrap();
        fs::create_dir_all(root.join("mtl")).unwrap();
        fs::write(root.join("Maps/a b.PNG"), "").unwrap();
        fs::write(directory.path().join("secret.png"), "").unwrap();
        let (confined, free) = file_in(&root);
        let find = |folder: &str, name: &str| confined.find(&root.join(folder), name);
        let path =
            |name: &str, is_other_case| Ok(SourceFile { is_other_case, ..SourceFile::at(root.join(name), false) });
        assert_eq!(find("", "Maps/a b.PNG"), path("Maps/a b.PNG", false));
        assert_eq!(find("", "maps\\A B.png"), path("Maps/a b.PNG", true));
        assert_eq!(find("mtl", "..\\.\\Maps/a b.PNG"), path("Maps/a b.PNG", false));
        assert_eq!(find("mtl", "none.png"), path("mtl/none.png", false));
        fs::write(root.join("Maps/A B.png"), "").unwrap();
        assert_eq!(find("", "Maps/a b.png"), path("Maps/a b.png", false), "two names differ in case");
        for name in ["../secret.png", "mtl/../../secret.png", "/secret.png", "\\secret.png", "c:\\secret.png"] {
            assert!(find("", name).unwrap_err().contains("leaves the folder"), "{name}");
        }
        let outside = free.find(&root, "../SECRET.png").unwrap();
        assert_eq!((outside.path, outside.is_other_case), (root.join("../secret.png"), true));
    }
}
