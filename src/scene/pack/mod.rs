//! Packs: one file with everything that a scene is read from, so that nothing is left behind when it is moved to
//! another computer.
//!
//! A pack is a ZIP archive. Its first file, the manifest, names the scene's file and says what each file has to be. A
//! pack is used like a folder: `film.kdpack/parts/a.obj` is a file of the pack `film.kdpack`, and files of a pack name
//! each other as they do on disk. Nothing that is in a pack can name a file on disk.

mod manifest;

use std::{
    collections::BTreeMap,
    ffi::OsString,
    fs::File,
    io::{self, Read},
    ops::Bound,
    path::{Component, Path, PathBuf},
    sync::{Arc, Mutex, OnceLock, PoisonError, Weak},
    time::SystemTime,
};

use flate2::read::DeflateDecoder;
use zip::{CompressionMethod, ZipArchive};

pub(crate) use self::manifest::{MANIFEST, Manifest, PackedFile};
use super::{
    LoadOptions,
    error::{Checked, SceneError},
};
use crate::util::memory::require;

/// The ending of a pack's name.
pub const ENDING: &str = "kdpack";
/// Size of the largest manifest, bytes: it describes half a million files.
const MOST_MANIFEST_BYTES: u64 = 1 << 26;

/// An open pack.
pub(super) struct Pack {
    archive: Archive,
    manifest: Manifest,
    /// Indices into the manifest's files, by their names.
    by_name: BTreeMap<String, usize>,
    /// Why a file that the pack has could not be read, if there is one. Scenes are shown without images that cannot be
    /// read, but not if a pack is damaged.
    failure: OnceLock<String>,
}

/// The ZIP archive of a pack.
struct Archive {
    path: PathBuf,
    zip: Mutex<ZipArchive<File>>,
}

/// A file or a folder in a pack, which need not exist.
pub(super) struct Entry {
    pack: Arc<Pack>,
    /// Its name in the pack; empty for the pack itself.
    name: String,
}

/// The packs that are open now, with the size and the time of their files. A pack stays open as long as someone has it.
static OPEN: Mutex<Vec<(PathBuf, Stamp, Weak<Pack>)>> = Mutex::new(Vec::new());

/// Tells whether a file is the one that was opened.
type Stamp = (u64, Option<SystemTime>);

/// Returns whether a file's name is that of a pack.
fn is_pack_name(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case(ENDING))
}

/// Returns the pack in a path and the rest of the path, if a part of the path is a pack.
fn split(path: &Path) -> Option<(&Path, &Path)> {
    let ancestors: Vec<&Path> = path.ancestors().collect();
    let pack = ancestors.into_iter().rev().find(|part| is_pack_name(part) && part.is_file())?;
    Some((pack, path.strip_prefix(pack).expect("an ancestor")))
}

/// Returns the pack that a path leads into.
pub(crate) fn pack_of(path: &Path) -> Option<&Path> {
    split(path).map(|(pack, _)| pack)
}

/// Returns the entry of a pack that a path leads to, or `None` for a path that leads into no pack.
pub(super) fn entry(path: &Path) -> Option<io::Result<Entry>> {
    let (pack, rest) = split(path)?;
    Some(Pack::open(pack).map_err(io::Error::other).and_then(|pack| {
        let outside = || io::Error::new(io::ErrorKind::NotFound, "the path leads out of the pack");
        Ok(Entry { name: name_of(rest).ok_or_else(outside)?, pack })
    }))
}

/// Returns the path in the pack of `root` that stands for an absolute path of the computer on which it was packed.
/// `None` if `root` is in no pack.
pub(super) fn absolute(root: &Path, name: &Path) -> Option<PathBuf> {
    let (pack, _) = split(root)?;
    let folder = Pack::open(pack).ok().and_then(|pack| pack.manifest.folder.clone());
    // Joined to the pack, an absolute path would lead out of it.
    let below = folder.and_then(|folder| name_of(normalized(name)?.strip_prefix(folder).ok()?));
    // The manifest is no file of the pack, so it stands for a file that the pack does not have.
    Some(pack.join(below.unwrap_or_else(|| MANIFEST.to_owned())))
}

/// Returns the path without `.` and `..`, or `None` if it leads above its beginning.
pub(crate) fn normalized(path: &Path) -> Option<PathBuf> {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => (),
            Component::ParentDir => {
                let ends_in_name = matches!(plain.components().next_back(), Some(Component::Normal(_)));
                (ends_in_name && plain.pop()).then_some(())?;
            }
            part => plain.push(part),
        }
    }
    Some(plain)
}

/// Returns a relative path as a name in a pack, or `None` if it leads out of the pack, is absolute or is not UTF-8.
pub(crate) fn name_of(path: &Path) -> Option<String> {
    let plain = normalized(path)?;
    let part = |part| match part {
        Component::Normal(name) => name.to_str(),
        _ => None,
    };
    let parts: Option<Vec<&str>> = plain.components().map(part).collect();
    Some(parts?.join("/"))
}

/// A scene in a pack, and what was said about it when it was packed.
pub(super) struct PackedScene {
    pack: Arc<Pack>,
    pub path: PathBuf,
    pub options: LoadOptions,
}

/// Opens the pack that a path leads into, if it does.
pub(super) fn opened(path: &Path) -> Result<Option<Arc<Pack>>, SceneError> {
    let opened = pack_of(path).map(|path| Pack::open(path).map_err(|what| SceneError::file(path, what)));
    opened.transpose()
}

/// Opens a pack. Returns its scene and the options of loading it, to which the user's options are added. `None` if the
/// path is not that of a pack.
pub(super) fn scene_of(path: &Path, options: &LoadOptions) -> Result<Option<PackedScene>, SceneError> {
    if !is_pack_name(path) || path.is_dir() {
        return Ok(None);
    }
    let pack = Pack::open(path).map_err(|what| SceneError::file(path, what))?;
    let mut options = options.clone();
    options.scene = options.scene.or_else(|| pack.manifest.scene_name.clone());
    options.camera = options.camera.or_else(|| pack.manifest.camera.clone());
    // No name in a pack leads out of it.
    options.allow_outside = true;
    Ok(Some(PackedScene { path: path.join(&pack.manifest.scene), pack, options }))
}

/// Returns the file of the camera path that a pack has.
///
/// # Errors
/// The file is no pack, or it is damaged.
pub fn packed_path(path: &Path) -> Result<Option<PathBuf>, SceneError> {
    let Some(PackedScene { pack, .. }) = scene_of(path, &LoadOptions::default())? else { return Ok(None) };
    Ok(pack.manifest.path.as_ref().map(|name| path.join(name)))
}

impl Pack {
    /// Opens a pack, unless it is open already. An error is a message for people.
    fn open(path: &Path) -> Checked<Arc<Self>> {
        let unread = |error: io::Error| format!("cannot be read: {error}");
        let metadata = path.metadata().map_err(unread)?;
        if !metadata.is_file() {
            return Err("is not a regular file".to_owned());
        }
        let stamp = (metadata.len(), metadata.modified().ok());
        let mut open = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
        open.retain(|(_, _, pack)| pack.strong_count() > 0);
        let known = open.iter().find(|(other, time, _)| other == path && *time == stamp);
        if let Some(pack) = known.and_then(|(_, _, pack)| pack.upgrade()) {
            return Ok(pack);
        }
        let pack = Arc::new(Self::read(path.to_owned(), File::open(path).map_err(unread)?)?);
        open.push((path.to_owned(), stamp, Arc::downgrade(&pack)));
        Ok(pack)
    }

    /// Reads the list of files and the manifest.
    fn read(path: PathBuf, file: File) -> Checked<Self> {
        let zip = ZipArchive::new(file).map_err(|error| format!("is no pack: {error}"))?;
        let archive = Archive { path, zip: Mutex::new(zip) };
        let json = archive.content(MANIFEST, MOST_MANIFEST_BYTES).map_err(|error| format!("is no pack: {error}"))?;
        let manifest = Manifest::of_json(&json)?;
        let by_name = manifest.files.iter().enumerate().map(|(ix, file)| (file.name.clone(), ix)).collect();
        Ok(Self { archive, manifest, by_name, failure: OnceLock::new() })
    }

    /// Returns an error if a file could not be read at any time since the pack was opened.
    pub fn check(&self) -> Result<(), SceneError> {
        self.failure.get().map_or(Ok(()), |what| Err(SceneError::file(&self.archive.path, what)))
    }

    fn file(&self, name: &str) -> Option<&PackedFile> {
        self.by_name.get(name).map(|ix| &self.manifest.files[*ix])
    }
}

/// Returns the names of the files and folders in a folder, whose name ends with `/` unless it is the pack itself.
fn names_in<'a>(folder: &str, files: &'a BTreeMap<String, usize>) -> Vec<&'a str> {
    let (mut names, mut from) = (Vec::new(), folder.to_owned());
    while let Some(below) = first_from(&from, files).and_then(|name| name.strip_prefix(folder)) {
        // All files of a folder follow each other, since their names begin with the folder's and `/`. The first name
        // that can follow them has `0` there, which is the next character.
        let (name, end) = match below.split_once('/') {
            Some((name, _)) => (name, '0'),
            None => (below, '\0'),
        };
        names.push(name);
        from = format!("{folder}{name}{end}");
    }
    names
}

/// Returns the first name, in alphabetical order, that is not before `from`.
fn first_from<'a>(from: &str, files: &'a BTreeMap<String, usize>) -> Option<&'a str> {
    files.range::<str, _>((Bound::Included(from), Bound::Unbounded)).next().map(|(name, _)| name.as_str())
}

impl Archive {
    /// Returns the content of a file, which has at most `most` bytes.
    fn content(&self, name: &str, most: u64) -> io::Result<Vec<u8>> {
        let (method, packed) = {
            // Others may decompress their files at the same time.
            let mut zip = self.zip.lock().unwrap_or_else(PoisonError::into_inner);
            let ix = zip.index_for_name(name).ok_or(io::ErrorKind::NotFound)?;
            let mut file = zip.by_index_raw(ix)?;
            // What a file states of its size may be wrong.
            let n_bytes = self.path.metadata()?.len().min(file.compressed_size());
            require("reading a pack", n_bytes).map_err(io::Error::other)?;
            let mut packed = Vec::new();
            file.read_to_end(&mut packed)?;
            (file.compression(), packed)
        };
        let mut content = Vec::new();
        match method {
            CompressionMethod::Stored => content = packed,
            CompressionMethod::Deflated => {
                DeflateDecoder::new(&packed[..]).take(most.saturating_add(1)).read_to_end(&mut content)?;
            }
            method => return Err(io::Error::other(format!("files packed by {method} are not read"))),
        }
        if content.len() as u64 > most { Err(io::Error::other("it is larger than stated")) } else { Ok(content) }
    }
}

impl Entry {
    /// Reads the file, which has to be what the manifest says.
    pub fn read(&self) -> io::Result<Vec<u8>> {
        let file = self.pack.file(&self.name);
        let file = file.ok_or_else(|| io::Error::new(io::ErrorKind::NotFound, "the pack does not have it"))?;
        self.read_file(file).inspect_err(|error| {
            let _ = self.pack.failure.set(format!("{}: {error}", file.name));
        })
    }

    fn read_file(&self, file: &PackedFile) -> io::Result<Vec<u8>> {
        require("reading a file of a pack", file.n_bytes).map_err(io::Error::other)?;
        let content = self.pack.archive.content(&file.name, file.n_bytes)?;
        let mut hasher = blake3::Hasher::new();
        let hash = hasher.update_rayon(&content).finalize().to_hex();
        if content.len() as u64 == file.n_bytes && hash.as_str() == file.blake3 {
            Ok(content)
        } else {
            Err(io::Error::new(io::ErrorKind::InvalidData, "it is damaged: it is not what was packed"))
        }
    }

    /// Returns the size of the file in bytes, or `None` if there is none.
    pub fn n_bytes(&self) -> Option<u64> {
        self.pack.file(&self.name).map(|file| file.n_bytes)
    }

    /// Whether it is a file, or a folder with files.
    pub fn exists(&self) -> bool {
        let folder = self.folder();
        let has_files = || first_from(&folder, &self.pack.by_name).is_some_and(|name| name.starts_with(&folder));
        self.n_bytes().is_some() || has_files()
    }

    /// Returns the absolute path.
    pub fn canonical(&self) -> io::Result<PathBuf> {
        let pack = self.pack.archive.path.canonicalize()?;
        match self.exists() {
            true => Ok(if self.name.is_empty() { pack } else { pack.join(&self.name) }),
            false => Err(io::ErrorKind::NotFound.into()),
        }
    }

    /// Returns the names of the files and folders in a folder.
    pub fn names(&self) -> Vec<OsString> {
        names_in(&self.folder(), &self.pack.by_name).into_iter().map(OsString::from).collect()
    }

    /// Returns how the names of everything in it begin, if it is a folder.
    fn folder(&self) -> String {
        if self.name.is_empty() { String::new() } else { format!("{}/", self.name) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_have_their_own_files_alone() {
        let files = ["a", "a.obj", "a/b/c", "a/b/d", "a/b.png", "a/b0", "a0/e", "f/g"];
        let files: BTreeMap<String, usize> = files.iter().map(|name| (name.to_string(), 0)).collect();
        let names = |folder: &str| {
            let mut names = names_in(folder, &files);
            names.sort_unstable();
            names
        };
        assert_eq!(names(""), ["a", "a", "a.obj", "a0", "f"], "a file and a folder may have one name");
        assert_eq!(names("a/"), ["b", "b.png", "b0"]);
        assert_eq!(names("a/b/"), ["c", "d"]);
        assert_eq!(names("none/"), [""; 0]);
        assert_eq!(names_in("", &BTreeMap::new()), [""; 0]);
    }
}
