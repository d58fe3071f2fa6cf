//! Packs: one file with everything that a scene is read from, so that nothing is left behind when it is moved to
//! another computer.
//!
//! A pack is a ZIP archive. Its first file, the manifest, names the scene's file, and states the size and the hash of
//! each file. A pack is used like a folder: `film.kdpack/parts/a.obj` is a file of the pack `film.kdpack`, and files of
//! a pack name each other as they do on disk. Nothing that is in a pack can name a file on disk.
//!
//! ```text
//! names      names of packs, and of files in them
//! manifest   the manifest as JSON, and what makes it valid
//! archive    the ZIP archive, from which files are decompressed
//! entry      files and folders in a pack, which are read and listed like those on disk
//! ```

mod archive;
mod entry;
mod manifest;
mod names;

use std::{
    collections::BTreeMap,
    fs::File,
    io,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, OnceLock, PoisonError, Weak},
    time::SystemTime,
};

pub use self::names::ENDING;
use self::{
    archive::Archive,
    entry::Entry,
    names::{is_pack_name, split},
};
pub(crate) use self::{
    manifest::{MANIFEST, Manifest, PackedFile},
    names::{name_of, normalized, pack_of},
};
use super::SourceFile;
use crate::scene::model::{LoadOptions, SceneError, error::Checked};

/// Size of the largest manifest, bytes: it describes half a million files.
const MOST_MANIFEST_BYTES: u64 = 1 << 26;

/// An open pack.
pub(crate) struct Pack {
    archive: Archive,
    manifest: Manifest,
    /// Indices into the manifest's files, by their names.
    by_name: BTreeMap<String, usize>,
    /// The first error of reading a file of the pack. A scene is shown without the images that cannot be read, but a
    /// damaged pack is refused.
    failure: OnceLock<String>,
}

/// The packs that are open now: a pack stays open as long as someone has it.
static OPEN: Mutex<Vec<(PathBuf, Stamp, Weak<Pack>)>> = Mutex::new(Vec::new());

/// Size and time of a file. If a file has another stamp than when it was opened, it has been replaced.
type Stamp = (u64, Option<SystemTime>);

/// Returns the entry of a pack that a path leads to, or `None` for a path that leads into no pack.
pub(crate) fn entry(path: &Path) -> Option<io::Result<Entry>> {
    let (pack, rest) = split(path)?;
    Some(Pack::open(pack).map_err(io::Error::other).and_then(|pack| {
        let outside = || io::Error::new(io::ErrorKind::NotFound, "the path leads out of the pack");
        Ok(Entry { name: name_of(rest).ok_or_else(outside)?, pack })
    }))
}

/// Returns where a file is that another file of the pack names by its absolute path on the computer where the pack was
/// made. `from`: a path into the pack. If the pack does not have the file, the result is a path at which there is none.
/// `None` if `from` leads into no pack.
pub(crate) fn of_absolute(from: &Path, name: &Path) -> Option<PathBuf> {
    let (pack, _) = split(from)?;
    let folder = Pack::open(pack).ok().and_then(|pack| pack.manifest.folder.clone());
    // Joined to the pack, an absolute path would lead out of it.
    let below = folder.and_then(|folder| name_of(normalized(name)?.strip_prefix(folder).ok()?));
    // No file of a pack has the name of the manifest.
    Some(pack.join(below.unwrap_or_else(|| MANIFEST.to_owned())))
}

/// The file of a scene, and how it is loaded.
pub(crate) struct OpenScene {
    /// The user's file or, if that is a pack, the scene's file in it.
    pub file: SourceFile,
    pub options: LoadOptions,
    /// The pack that the file is in. It stays open as long as files are read.
    pack: Option<Arc<Pack>>,
}

impl OpenScene {
    /// Opens the pack that a path leads into, if it does. Where the user's options name no scene of the file and no
    /// camera, those apply that were named when the pack was made.
    pub fn new(path: &Path, options: &LoadOptions) -> Result<Self, SceneError> {
        let (file, options) = (SourceFile::new(path, options), options.clone());
        let Some(pack) = of_name(path)? else { return Ok(Self { file, options, pack: opened(path)? }) };
        let Manifest { scene, scene_name, camera, .. } = &pack.manifest;
        let (scene_name, camera) = (scene_name.clone(), camera.clone());
        // No name in a pack leads out of it.
        let options = LoadOptions {
            scene: options.scene.or(scene_name),
            camera: options.camera.or(camera),
            allow_outside: true,
            ..options
        };
        Ok(Self { file: SourceFile::new(&path.join(scene), &options), options, pack: Some(pack) })
    }

    /// Returns an error if a file of the pack could not be read at any time since it was opened.
    pub fn check(&self) -> Result<(), SceneError> {
        let failure = |pack: &Arc<Pack>| Some(SceneError::file(&pack.archive.path, pack.failure.get()?));
        self.pack.as_ref().and_then(failure).map_or(Ok(()), Err)
    }
}

fn open(path: &Path) -> Result<Arc<Pack>, SceneError> {
    Pack::open(path).map_err(|what| SceneError::file(path, what))
}

/// Opens the pack that a path leads into, if it does.
fn opened(path: &Path) -> Result<Option<Arc<Pack>>, SceneError> {
    pack_of(path).map(open).transpose()
}

/// Opens the pack of a path that has the name of one.
fn of_name(path: &Path) -> Result<Option<Arc<Pack>>, SceneError> {
    (is_pack_name(path) && !path.is_dir()).then(|| open(path)).transpose()
}

/// Returns the file of the camera path that a pack has, as a path into the pack. `None` if it has none, or if `path` is
/// not that of a pack.
///
/// # Errors
/// The file is no pack, or it is damaged.
pub fn packed_path(path: &Path) -> Result<Option<PathBuf>, SceneError> {
    let name = of_name(path)?.and_then(|pack| pack.manifest.path.clone());
    Ok(name.map(|name| path.join(name)))
}

/// Returns the hash of the pack that a path leads into: the one that `kdray pack` prints. `None` if the path leads into
/// no pack.
///
/// # Errors
/// The file is no pack, or it is damaged.
pub fn pack_hash(path: &Path) -> Result<Option<String>, SceneError> {
    Ok(opened(path)?.map(|pack| pack.manifest.hash.clone()))
}

impl Pack {
    /// Returns the pack at a path, which is opened unless it is open already. An error is a message for people.
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

    /// Reads the archive's list of files, and the manifest.
    fn read(path: PathBuf, file: File) -> Checked<Self> {
        let archive = Archive::new(path, file)?;
        let json = archive.content(MANIFEST, MOST_MANIFEST_BYTES).map_err(|error| format!("is no pack: {error}"))?;
        let manifest = Manifest::of_json(&json)?;
        let by_name = manifest.files.iter().enumerate().map(|(ix, file)| (file.name.clone(), ix)).collect();
        Ok(Self { archive, manifest, by_name, failure: OnceLock::new() })
    }

    /// Returns what the manifest says of a file, or `None` if the pack does not have the file.
    fn file(&self, name: &str) -> Option<&PackedFile> {
        self.by_name.get(name).map(|ix| &self.manifest.files[*ix])
    }

    /// Notes that a file of the pack could not be read.
    fn note_failure(&self, file: &PackedFile, error: &io::Error) {
        let _ = self.failure.set(format!("{}: {error}", file.name));
    }
}
