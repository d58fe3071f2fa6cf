//! The manifest of a pack: its first file, which says what the others are.

use std::path::{Component, Path};

use serde::{Deserialize, Serialize};

use crate::scene::error::Checked;

/// The name of the manifest in the pack.
pub const MANIFEST: &str = "kdpack.json";
/// The number of the format. It changes when older packs can no longer be read.
const FORMAT: u32 = 1;

/// What a pack has.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// The hash of all the rest, and so of the whole pack.
    pub hash: String,
    pub format: u32,
    /// The version of kdray that has made the pack.
    pub version: String,
    /// The name of the scene's file in the pack.
    pub scene: String,
    /// The scene of a glTF file that is loaded unless the user names another one.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub scene_name: Option<String>,
    /// The camera that is taken unless the user names another one.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub camera: Option<String>,
    /// The name of the camera path's file in the pack.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub path: Option<String>,
    /// The absolute path of the folder whose files the pack has, if they name each other by absolute paths.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub folder: Option<String>,
    /// All files, by their names in the pack.
    pub files: Vec<PackedFile>,
}

/// What is read first: the rest depends on the format.
#[derive(Deserialize)]
struct OfFormat {
    format: u32,
}

/// A file of a pack.
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
    /// Returns the manifest of a scene's file alone. The hash is computed last, by [`Manifest::sealed`].
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

    /// Returns the manifest with its hash.
    pub fn sealed(self) -> Self {
        Self { hash: self.own_hash(), ..self }
    }

    /// Returns the first half of the BLAKE3 hash of all but the hash, hexadecimal.
    fn own_hash(&self) -> String {
        let rest = Self { hash: String::new(), ..self.clone() };
        let json = serde_json::to_vec(&rest).expect("plain values");
        blake3::hash(&json).to_hex()[..32].to_owned()
    }

    /// Returns the text of the manifest's file.
    pub fn json(&self) -> Vec<u8> {
        serde_json::to_vec_pretty(self).expect("plain values")
    }

    /// Returns the manifest that a text states. An error is a message for people.
    pub fn of_json(json: &[u8]) -> Checked<Self> {
        let damaged = |what: String| format!("is damaged: {MANIFEST}: {what}");
        let unread = |error: serde_json::Error| damaged(error.to_string());
        let OfFormat { format } = serde_json::from_slice(json).map_err(unread)?;
        if format != FORMAT {
            return Err(format!("is a pack of format {format}, and this version of kdray reads format {FORMAT}"));
        }
        let manifest: Self = serde_json::from_slice(json).map_err(unread)?;
        if manifest.hash != manifest.own_hash() {
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

/// Whether a name is that of a file below a folder, spelled in the one way that the manifest has.
fn is_below(name: &str) -> bool {
    let is_plain = |part: Component| matches!(part, Component::Normal(_));
    let has_plain_parts = name.split('/').all(|part| !matches!(part, "" | "." | ".."));
    has_plain_parts && name != MANIFEST && Path::new(name).components().all(is_plain)
}
