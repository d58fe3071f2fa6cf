//! Entries of a pack: its files and folders, which are read and listed like those on disk.

use std::{collections::BTreeMap, ffi::OsString, io, ops::Bound, path::PathBuf, sync::Arc};

use super::{Pack, PackedFile};

/// A place in a pack. There may be a file, a folder or nothing.
pub struct Entry {
    pub(super) pack: Arc<Pack>,
    /// Its name in the pack; empty for the pack itself, which is the outermost folder.
    pub(super) name: String,
}

impl Entry {
    /// Reads the file, which has to be what the manifest says. The caller has checked that there is memory for it.
    pub fn read(&self) -> io::Result<Vec<u8>> {
        let file = self.pack.file(&self.name);
        let file = file.ok_or_else(|| io::Error::new(io::ErrorKind::NotFound, "the pack does not have it"))?;
        self.read_file(file).inspect_err(|error| self.pack.note_failure(file, error))
    }

    fn read_file(&self, file: &PackedFile) -> io::Result<Vec<u8>> {
        let content = self.pack.archive.content(&file.name, file.n_bytes)?;
        let mut hasher = blake3::Hasher::new();
        let hash = hasher.update_rayon(&content).finalize().to_hex();
        if content.len() as u64 == file.n_bytes && hash.as_str() == file.blake3 {
            Ok(content)
        } else {
            Err(io::Error::new(io::ErrorKind::InvalidData, "it is damaged: it is not what was packed"))
        }
    }

    /// Returns the size of the file in bytes, or `None` if there is no file.
    pub fn n_bytes(&self) -> Option<u64> {
        self.pack.file(&self.name).map(|file| file.n_bytes)
    }

    /// Returns whether there is a file, or a folder with files.
    pub fn exists(&self) -> bool {
        let prefix = self.prefix();
        let has_files = || first_from(&prefix, &self.pack.by_name).is_some_and(|name| name.starts_with(&prefix));
        self.n_bytes().is_some() || has_files()
    }

    /// Returns the absolute path.
    ///
    /// # Errors
    /// There is neither a file nor a folder, or the pack cannot be found any more.
    pub fn canonical(&self) -> io::Result<PathBuf> {
        let pack = self.pack.archive.path.canonicalize()?;
        match self.exists() {
            true => Ok(if self.name.is_empty() { pack } else { pack.join(&self.name) }),
            false => Err(io::ErrorKind::NotFound.into()),
        }
    }

    /// Returns the names of the files and folders that are directly in the folder; none if there is no folder.
    pub fn names(&self) -> Vec<OsString> {
        names_below(&self.prefix(), &self.pack.by_name).into_iter().map(OsString::from).collect()
    }

    /// Returns the prefix that the names of all files in the folder have, whether there is a folder or not.
    fn prefix(&self) -> String {
        if self.name.is_empty() { String::new() } else { format!("{}/", self.name) }
    }
}

/// Returns the names of the files and folders that are directly in a folder. `prefix`: the folder's name and `/`, or
/// empty for the pack itself.
fn names_below<'a>(prefix: &str, files: &'a BTreeMap<String, usize>) -> Vec<&'a str> {
    let (mut names, mut from) = (Vec::new(), prefix.to_owned());
    while let Some(below) = first_from(&from, files).and_then(|name| name.strip_prefix(prefix)) {
        // The files of a folder follow each other, since their names begin with the folder's name and `/`. The next
        // name is not before the folder's name and `0`, the character after `/`.
        let (name, end) = match below.split_once('/') {
            Some((name, _)) => (name, '0'),
            None => (below, '\0'),
        };
        names.push(name);
        from = format!("{prefix}{name}{end}");
    }
    names
}

/// Returns the first name, in alphabetical order, that is not before `from`.
fn first_from<'a>(from: &str, files: &'a BTreeMap<String, usize>) -> Option<&'a str> {
    files.range::<str, _>((Bound::Included(from), Bound::Unbounded)).next().map(|(name, _)| name.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_have_their_own_files_alone() {
        let files = ["a", "a.obj", "a/b/c", "a/b/d", "a/b.png", "a/b0", "a0/e", "f/g"];
        let files: BTreeMap<String, usize> = files.iter().map(|name| (name.to_string(), 0)).collect();
        let names = |prefix: &str| {
            let mut names = names_below(prefix, &files);
            names.sort_unstable();
            names
        };
        assert_eq!(names(""), ["a", "a", "a.obj", "a0", "f"], "a file and a folder may have one name");
        assert_eq!(names("a/"), ["b", "b.png", "b0"]);
        assert_eq!(names("a/b/"), ["c", "d"]);
        assert_eq!(names("none/"), [""; 0]);
        assert_eq!(names_below("", &BTreeMap::new()), [""; 0]);
    }
}
