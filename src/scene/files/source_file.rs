//! The rule that decides which files a scene's files may name: those below their own folder, so that a scene from
//! elsewhere cannot show other files of the computer. Here alone, a name becomes a path.

use std::{
    io,
    path::{Component, Path, PathBuf},
};

use super::{pack, store};
use crate::scene::model::{LoadOptions, error::Checked};

/// Whether the files of a scene may name files outside of their folders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Access {
    is_anywhere: bool,
}

impl Access {
    /// Returns the access that the options of loading allow.
    pub fn of(options: &LoadOptions) -> Self {
        Self { is_anywhere: options.allow_outside }
    }

    /// Returns whether files may name any file.
    pub fn is_anywhere(self) -> bool {
        self.is_anywhere
    }

    /// Returns the folder below which the names in a file must stay.
    pub fn beside(self, file: &Path) -> Reach<'_> {
        Reach { root: file.parent().unwrap_or(Path::new("")), access: self }
    }
}

/// A folder, and whether files outside of it may be named, too.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach<'a> {
    /// The folder of the file that names others.
    pub root: &'a Path,
    access: Access,
}

/// A file that another one names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct NamedFile {
    /// Its path, whether it exists or not.
    pub path: PathBuf,
    /// Whether its name on disk differs from the stated one in the case of letters.
    pub is_other_case: bool,
}

impl<'a> Reach<'a> {
    /// Returns the reach without files outside of the folder.
    pub fn within(self) -> Self {
        Self { access: Access::default(), ..self }
    }

    /// Returns the path of a file whose name is relative to the folder.
    ///
    /// The path of a file that does not exist is returned, too: reading it fails.
    ///
    /// # Errors
    /// The name is empty. The name or a symbolic link leads out of the folder, and that is not allowed.
    pub fn exact(self, name: &str) -> Checked<PathBuf> {
        if name.is_empty() {
            return Err("the name of a file is empty".to_owned());
        }
        let is_absolute = Path::new(name).is_absolute();
        let path = self.absolute(name).filter(|_| is_absolute).unwrap_or_else(|| self.root.join(name));
        if !self.access.is_anywhere && !stays_below(name) {
            return Err(format!("`{name}` is not below the folder of the file that names it; {HINT}"));
        }
        self.check_links(&path, name)?;
        Ok(path)
    }

    /// Returns the file of a name as [`exact`](Self::exact) does. If there is none, the file that
    /// [`find`](Self::find) finds is taken.
    ///
    /// # Errors
    /// Those of [`exact`](Self::exact).
    pub fn exact_or_alike(self, name: &str) -> Checked<NamedFile> {
        let path = self.exact(name)?;
        let alike = if store::exists(&path) { None } else { self.find(self.root, name).ok() };
        let alike = alike.filter(|found| store::is_file(&found.path));
        Ok(alike.unwrap_or(NamedFile { path, is_other_case: false }))
    }

    /// Returns the file of a name that is relative to `folder`, which lies in the reach. Backslashes count as
    /// separators, as in files from Windows. Where no file has the name, the only one whose name differs in the case of
    /// letters is taken.
    ///
    /// # Errors
    /// The name or a symbolic link leads out of the reach's folder, and that is not allowed.
    pub fn find(self, folder: &Path, name: &str) -> Checked<NamedFile> {
        let leaves = || Err(format!("`{name}` leaves the folder of the scene's file: it is not read; {HINT}"));
        let parts = name.replace('\\', "/");
        let is_absolute = parts.starts_with('/') || parts.chars().nth(1) == Some(':');
        if is_absolute && self.access.is_anywhere {
            let path = self.absolute(name).unwrap_or_else(|| PathBuf::from(name));
            return Ok(NamedFile { path, is_other_case: false });
        }
        if is_absolute {
            return leaves();
        }
        let mut found = NamedFile { path: folder.to_owned(), is_other_case: false };
        for part in parts.split('/').filter(|part| !matches!(*part, "" | ".")) {
            if part == ".." && self.access.is_anywhere {
                found.path.push(part);
                continue;
            }
            if part == ".." {
                let ends_in_name = matches!(found.path.components().next_back(), Some(Component::Normal(_)));
                if !ends_in_name || !found.path.pop() || !found.path.starts_with(self.root) {
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
                        Some(other) => found = NamedFile { path: other, is_other_case: true },
                        None => found.path = exact,
                    }
                }
            }
        }
        self.check_links(&found.path, name)?;
        Ok(found)
    }

    /// Returns the path of an absolute name, if the folder is in a pack.
    fn absolute(self, name: &str) -> Option<PathBuf> {
        pack::of_absolute(self.root, Path::new(name))
    }

    /// Refuses a path that leads out of the folder by symbolic links.
    fn check_links(self, path: &Path, name: &str) -> Checked<()> {
        if self.access.is_anywhere {
            return Ok(());
        }
        let found = match store::canonical(path) {
            Ok(found) => found,
            // A file that does not exist has no links to resolve.
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
            Err(error) => return Err(format!("`{name}` cannot be read: {error}")),
        };
        match store::canonical(self.root) {
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
    let depth = Path::new(name).components().try_fold(0_u32, |depth, part| match part {
        Component::Normal(_) => Some(depth + 1),
        Component::CurDir => Some(depth),
        Component::ParentDir => depth.checked_sub(1),
        Component::RootDir | Component::Prefix(_) => None,
    });
    depth.is_some() && !is_windows_path
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

    const CONFINED: Access = Access { is_anywhere: false };
    const ANYWHERE: Access = Access { is_anywhere: true };

    #[test]
    fn only_names_below_the_folder_are_allowed() {
        let directory = TempDir::new().unwrap();
        let folder = directory.path().join("scene");
        fs::create_dir_all(folder.join("parts")).unwrap();
        fs::write(directory.path().join("secret"), "").unwrap();
        fs::write(folder.join("parts/a"), "").unwrap();
        let file = folder.join("file");
        for name in ["parts/a", "./parts/a", "none", "parts/none", "a b.png", "Größe:1", "parts/../parts/a"] {
            assert_eq!(CONFINED.beside(&file).exact(name).unwrap(), folder.join(name), "{name}");
        }
        let absolute = directory.path().join("secret");
        let absolute = absolute.to_str().unwrap();
        for name in
            ["../secret", "parts/../../secret", "parts/../../scene/parts/a", absolute, "/etc/none", "..\\secret"]
        {
            let refused = CONFINED.beside(&file).exact(name).unwrap_err();
            assert!(refused.contains("is not below") && refused.ends_with("--allow-outside reads it"), "{name}");
            assert_eq!(ANYWHERE.beside(&file).exact(name).unwrap(), folder.join(name), "{name}");
        }
        assert!(ANYWHERE.beside(&file).exact("").is_err() && CONFINED.beside(&file).exact("").is_err());
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
        let file = folder.join("file");
        assert!(CONFINED.beside(&file).exact("in").is_ok());
        for name in ["out", "up/secret"] {
            assert!(CONFINED.beside(&file).exact(name).unwrap_err().contains("leads out"));
            assert!(CONFINED.beside(&file).find(&folder, name).unwrap_err().contains("leads out"));
            assert!(ANYWHERE.beside(&file).exact(name).is_ok() && ANYWHERE.beside(&file).find(&folder, name).is_ok());
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
        let file = root.join("file");
        let find = |folder: &str, name: &str| CONFINED.beside(&file).find(&root.join(folder), name);
        let path = |name: &str, is_other_case| Ok(NamedFile { path: root.join(name), is_other_case });
        assert_eq!(find("", "Maps/a b.PNG"), path("Maps/a b.PNG", false));
        assert_eq!(find("", "maps\\A B.png"), path("Maps/a b.PNG", true));
        assert_eq!(find("mtl", "..\\.\\Maps/a b.PNG"), path("Maps/a b.PNG", false));
        assert_eq!(find("mtl", "none.png"), path("mtl/none.png", false));
        fs::write(root.join("Maps/A B.png"), "").unwrap();
        assert_eq!(find("", "Maps/a b.png"), path("Maps/a b.png", false), "two names differ in case");
        for name in ["../secret.png", "mtl/../../secret.png", "/secret.png", "\\secret.png", "c:\\secret.png"] {
            assert!(find("", name).unwrap_err().contains("leaves the folder"), "{name}");
        }
        let outside = ANYWHERE.beside(&file).find(&root, "../SECRET.png").unwrap();
        assert_eq!((outside.path, outside.is_other_case), (root.join("../secret.png"), true));
    }
}
