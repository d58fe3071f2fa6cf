//! Makes a pack: one file with everything that a scene is read from. What a pack is, and how it is read, is in
//! `src/scene/files/pack`.

use std::{
    fs::File,
    io::{self, Read, Write},
    path::{Path, PathBuf},
};

use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

use crate::{
    output::{self, OutputError},
    scene::{
        CameraPath, LoadOptions, Scene, SceneError,
        pack::{MANIFEST, Manifest, PackedFile, name_of, normalized, pack_of},
        source_files_with,
    },
};

/// Endings of the names of files that are compressed already.
const COMPRESSED: [&str; 9] = ["png", "jpg", "jpeg", "webp", "exr", "zip", "gz", "ktx2", "basis"];

/// The message if the scene of the pack is not the scene that was packed.
const OTHER_SCENE: &str = "is another scene when it is read from its pack: a file has changed meanwhile, or one is \
                           named in a way that only this computer knows";

/// What is known of a pack that was made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Packed {
    /// The hash of the pack: packs of the same files have the same hash.
    pub hash: String,
    /// The names of the files in the pack, and their sizes in bytes.
    pub files: Vec<(String, u64)>,
}

/// The reason why a pack cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PackError {
    /// The scene cannot be loaded.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A scene or a file of it cannot be packed.
    #[error("{path}: {message}")]
    Refused {
        /// The scene's file, or the file that cannot be packed.
        path: PathBuf,
        /// What is wrong.
        message: String,
    },
    /// The pack cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// Writes a pack of a scene and, if it is given, of the path along which its camera moves. The pack is read again and
/// has to give the same scene; otherwise no file is left.
///
/// # Errors
/// The scene cannot be loaded, or names files that do not exist; a file has a name that is not UTF-8; the pack cannot
/// be written, or gives another scene.
pub fn pack(
    scene_file: &Path,
    path_file: Option<&Path>,
    options: &LoadOptions,
    output: &Path,
) -> Result<Packed, PackError> {
    let failed = |message: String| PackError::Refused { path: scene_file.to_owned(), message };
    if pack_of(scene_file).is_some() {
        return Err(failed("is in a pack already".to_owned()));
    }
    let path = path_file.map(CameraPath::load).transpose()?;
    let original = Original { scene: Scene::load_with(scene_file, options)?, path, options };
    let mut files = source_files_with(scene_file, options);
    files.extend(path_file.map(Path::to_owned));
    let sources = Sources::new(files).map_err(failed)?;
    let mut manifest = Manifest::new(sources.name(scene_file).map_err(failed)?);
    (manifest.scene_name, manifest.camera) = (options.scene.clone(), options.camera.clone());
    manifest.path = path_file.map(|path| sources.name(path)).transpose().map_err(failed)?;
    manifest.files = sources.described()?;
    let write_as = |manifest: Manifest| {
        let manifest = manifest.sealed();
        let check = |written: &Path| original.check(written, &manifest).map_err(failed);
        output::write_checked::<PackError>(output, |file| write(file, &manifest, &sources), check)?;
        Ok(manifest)
    };
    let written = match write_as(manifest.clone()) {
        // Perhaps files are named by absolute paths. They are found if the manifest states the folder of all files.
        Err(PackError::Refused { .. }) if options.allow_outside => {
            let folder = sources.folder.to_str().ok_or_else(|| failed("its folder's name is not UTF-8".to_owned()))?;
            write_as(Manifest { folder: Some(folder.to_owned()), ..manifest })
        }
        written => written,
    };
    let Manifest { hash, files, .. } = written?;
    Ok(Packed { hash, files: files.into_iter().map(|file| (file.name, file.n_bytes)).collect() })
}

/// What the pack has to give when it is read.
struct Original<'a> {
    scene: Scene,
    path: Option<CameraPath>,
    options: &'a LoadOptions,
}

impl Original<'_> {
    /// Refuses a pack that gives another scene or another path. An error is a message for people.
    fn check(&self, written: &Path, manifest: &Manifest) -> Result<(), String> {
        let unread = |error: SceneError| format!("cannot be read from its pack: {error}");
        let options = LoadOptions { look: self.options.look.clone(), ..LoadOptions::default() };
        let scene = Scene::load_with(written, &options).map_err(unread)?;
        let path = manifest.path.as_ref().map(|name| CameraPath::load(&written.join(name))).transpose();
        let is_same = scene == self.scene && path.map_err(unread)? == self.path;
        if is_same { Ok(()) } else { Err(OTHER_SCENE.to_owned()) }
    }
}

/// The files on disk that become the files of a pack.
struct Sources {
    /// The absolute path of the innermost folder that all of them are below.
    folder: PathBuf,
    /// Names in the pack and paths on disk, sorted by name.
    files: Vec<(String, PathBuf)>,
}

impl Sources {
    /// An error is a message for people.
    fn new(paths: Vec<PathBuf>) -> Result<Self, String> {
        let missing: Vec<_> =
            paths.iter().filter(|path| !path.is_file()).map(|path| path.display().to_string()).collect();
        if !missing.is_empty() {
            return Err(format!("names files that do not exist: {}", missing.join(", ")));
        }
        let absolutes = paths.iter().map(|path| absolute(path)).collect::<Result<Vec<_>, _>>()?;
        let first = absolutes.first().ok_or("has no files")?;
        let holds_all = |folder: &&Path| absolutes.iter().all(|path| path.starts_with(folder) && path != folder);
        let folder = first.ancestors().find(holds_all).ok_or("its files are in no common folder")?.to_owned();
        let mut sources = Self { folder, files: Vec::new() };
        for path in paths {
            sources.files.push((sources.name(&path)?, path));
        }
        sources.files.sort();
        sources.files.dedup_by(|a, b| a.0 == b.0);
        Ok(sources)
    }

    /// Returns the name that a file gets in the pack. An error is a message for people.
    fn name(&self, path: &Path) -> Result<String, String> {
        let absolute = absolute(path)?;
        let below = absolute.strip_prefix(&self.folder).ok();
        let name = below.and_then(name_of).filter(|name| name != MANIFEST);
        name.ok_or_else(|| format!("`{}` is a name that no file of a pack can have", path.display()))
    }

    /// Returns the size and the hash of each file, as the manifest states them.
    fn described(&self) -> Result<Vec<PackedFile>, PackError> {
        let file = |(name, path): &(String, PathBuf)| {
            let unread = |error: io::Error| PackError::Refused { path: path.clone(), message: error.to_string() };
            let mut hasher = blake3::Hasher::new();
            let n_bytes = File::open(path).and_then(|mut file| io::copy(&mut file, &mut hasher)).map_err(unread)?;
            Ok(PackedFile { name: name.clone(), n_bytes, blake3: hasher.finalize().to_hex().to_string() })
        };
        self.files.iter().map(file).collect()
    }
}

/// Returns the absolute path without `.` and `..`. Links are not followed, because files name each other by the names
/// of links, too.
fn absolute(path: &Path) -> Result<PathBuf, String> {
    let absolute = std::path::absolute(path).ok().and_then(|path| normalized(&path));
    absolute.ok_or_else(|| format!("`{}` has no absolute path", path.display()))
}

/// Writes the ZIP archive of a pack.
fn write(file: &mut File, manifest: &Manifest, sources: &Sources) -> io::Result<()> {
    let mut archive = ZipWriter::new(io::BufWriter::new(file));
    // No option sets the time of a file, so it is the earliest one that ZIP knows, and equal files make equal packs.
    let options = |name: &str, n_bytes: u64| {
        let ending = name.rsplit_once('.').map(|(_, ending)| ending.to_ascii_lowercase()).unwrap_or_default();
        // Scripts find the hash in the manifest without decompressing it.
        let is_stored = name == MANIFEST || COMPRESSED.contains(&ending.as_str());
        let method = if is_stored { CompressionMethod::Stored } else { CompressionMethod::Deflated };
        SimpleFileOptions::DEFAULT.compression_method(method).large_file(n_bytes > u64::from(u32::MAX) / 2)
    };
    archive.start_file(MANIFEST, options(MANIFEST, 0))?;
    archive.write_all(&manifest.json())?;
    for ((name, path), file) in sources.files.iter().zip(&manifest.files) {
        archive.start_file(name.as_str(), options(name, file.n_bytes))?;
        io::copy(&mut File::open(path)?.take(file.n_bytes), &mut archive)?;
    }
    archive.finish()?.flush()
}
