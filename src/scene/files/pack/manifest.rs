//! The manifest of a pack: its first file, which describes all others.

use std::path::{Component, Path};

use serde::{Deserialize, Serialize};

use crate::{scene::model::error::Checked, util::memory::require};

/// The name of the manifest in the pack.
pub const MANIFEST: &str = "kdpack.json";
/// The number of the format. It changes when older packs can no longer be read.
const FORMAT: u32 = 1;

/// Memory that a manifest takes while it is read, in bytes per byte of its text: at most 7, if it has many files with
/// short names.
const BYTES_PER_TEXT_BYTE: u64 = 8;

/// A manifest. The hash is that of the JSON text of all fields, in this order, with an empty `hash`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// The first half of a BLAKE3 hash, hexadecimal. Since the hashes of all files are hashed, it tells packs apart.
    pub hash: String,
    /// The number of the format of packs.
    pub format: u32,
    /// The version of kdray that has made the pack.
    pub version: String,
    /// The name of the scene's file in the pack.
    pub scene: String,
    /// The scene of a glTF file that is loaded unless the user names another one: its name or index.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub scene_name: Option<String>,
    /// The camera that is taken unless the user names another one: its name or index.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub camera: Option<String>,
    /// The name of the camera path's file in the pack.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub path: Option<String>,
    /// The absolute path that the folder of all files had where the pack was made. Stated only if the files name each
    /// other by absolute paths.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub folder: Option<String>,
    /// All files but the manifest, sorted by name.
    pub files: Vec<PackedFile>,
}

/// The part of a manifest that is read first, since the rest depends on the format.
#[derive(Deserialize)]
struct OfFormat {
    format: u32,
}

/// What the manifest says of a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PackedFile {
    /// The path below the pack, with `/` between folders.
    pub name: String,
    pub n_bytes: u64,
    /// BLAKE3 hash of the content, hexadecimal.
    pub blake3: String,
}

impl Manifest {
    /// Returns the manifest of a scene's file, yet without files and without its hash, which [`Manifest::sealed`]
    /// computes when all else is there.
    pub fn new(scene: String) -> Self {
        Self {
            hash: String::new(),
            format: FORMAT,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            scene,
            scene_name: None,
            camera: None,
            path: None,
            folder: None,
            files: Vec::new(),
        }
    }

    /// Returns the manifest with the hash of the rest.
    pub fn sealed(mut self) -> Self {
        self.hash.clear();
        // The text of a long list of files is hashed in pieces, since the whole of it would take much memory.
        let mut hasher = blake3::Hasher::new();
        serde_json::to_writer(&mut hasher, &self).expect("plain values");
        self.hash = hasher.finalize().to_hex()[..32].to_owned();
        self
    }

    /// Returns the text of the manifest's file.
    pub fn json(&self) -> Vec<u8> {
        serde_json::to_vec_pretty(self).expect("plain values")
    }

    /// Parses and checks the text of the manifest's file. An error is a message for people.
    pub fn of_json(json: &[u8]) -> Checked<Self> {
        let damaged = |what: String| format!("is damaged: {MANIFEST}: {what}");
        let unread = |error: serde_json::Error| damaged(error.to_string());
        let OfFormat { format } = serde_json::from_slice(json).map_err(unread)?;
        if format != FORMAT {
            return Err(format!("is a pack of format {format}, and this version of kdray reads format {FORMAT}"));
        }
        require("reading the manifest of a pack", BYTES_PER_TEXT_BYTE * json.len() as u64)?;
        let mut manifest: Self = serde_json::from_slice(json).map_err(unread)?;
        let stated_hash = manifest.hash.clone();
        manifest = manifest.sealed();
        if manifest.hash != stated_hash {
            return Err(damaged("it does not have the hash that it states".to_owned()));
        }
        if let Some(file) = manifest.files.iter().find(|file| !is_below(&file.name)) {
            return Err(damaged(format!("`{}` is no path below the pack", file.name)));
        }
        if manifest.folder.as_ref().is_some_and(|folder| !Path::new(folder).is_absolute()) {
            return Err(damaged("its folder is no absolute path".to_owned()));
        }
        for name in [Some(&manifest.scene), manifest.path.as_ref()].into_iter().flatten() {
            if !manifest.files.iter().any(|file| file.name == *name) {
                return Err(damaged(format!("there is no file `{name}`")));
            }
        }
        Ok(manifest)
    }
}

/// Returns whether a file in a pack can have this name: a relative path without `.`, `..` and empty parts, which is not
/// that of the manifest.
fn is_below(name: &str) -> bool {
    let is_plain = |part: Component| matches!(part, Component::Normal(_));
    let has_plain_parts = name.split('/').all(|part| !matches!(part, "" | "." | ".."));
    has_plain_parts && name != MANIFEST && Path::new(name).components().all(is_plain)
}
