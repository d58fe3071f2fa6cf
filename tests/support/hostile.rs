//! Reads files of unknown content as the command does, and checks what a hostile one must not break. The fuzz targets
//! (`fuzz/`) and `tests/corpus.rs` share it.

#[path = "packs.rs"]
mod packs;

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Once,
};

use kdray::{
    cast::RayReader,
    engine::{Engine, LoadRequest, Opened, Work},
    merge::{MergeError, merge},
    scene::{CameraPath, PictureChoices, pack_hash, packed_path, source_files},
};
use packs::PackFile;
use tempfile::TempDir;
use tracing::{
    Event, Metadata,
    field::{Field, Visit},
    span,
};

/// The formats that kdray reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    Obj,
    Mtl,
    Toml,
    Gltf,
    Draco,
    Ply,
    Stl,
    Image,
    Npy,
    Part,
    Pack,
}

impl Format {
    /// All formats with the folder of `tests/corpus` that has files of it.
    pub const ALL: [(Self, &str); 11] = [
        (Self::Obj, "obj"),
        (Self::Mtl, "mtl"),
        (Self::Toml, "toml"),
        (Self::Gltf, "gltf"),
        (Self::Draco, "draco"),
        (Self::Ply, "ply"),
        (Self::Stl, "stl"),
        (Self::Image, "image"),
        (Self::Npy, "npy"),
        (Self::Part, "part"),
        (Self::Pack, "pack"),
    ];

    /// Returns the name under which a file of the format is read. The content says which format an image has, but
    /// for TGA, which has no mark.
    fn file_name(self) -> &'static str {
        match self {
            Self::Obj => "file.obj",
            Self::Mtl => "file.mtl",
            Self::Toml => "file.toml",
            Self::Gltf => "file.gltf",
            Self::Draco => "file.bin",
            Self::Ply => "file.ply",
            Self::Stl => "file.stl",
            Self::Image => "file.tga",
            Self::Npy => "file.npy",
            Self::Part => "file.exr",
            Self::Pack => "file.kdpack",
        }
    }

    /// Returns the scene that uses a file, of `n_bytes`, which is no scene itself.
    fn user(self, n_bytes: usize) -> Option<(&'static str, String)> {
        match self {
            Self::Mtl => Some(("user.obj", USER_OF_MTL.to_owned())),
            Self::Draco => Some(("user.gltf", USER_OF_DRACO.replace("N_BYTES", &n_bytes.to_string()))),
            Self::Image => Some(("user.toml", USER_OF_IMAGE.to_owned())),
            _ => None,
        }
    }
}

/// A mesh of three triangles with the materials `a`, `b` and `c` of `file.mtl`.
const USER_OF_MTL: &str = "mtllib file.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 2 0\nvt 0 1\n\
                           usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 3/3 2/2\nusemtl c\nf 2/2 1/1 3/3\n";

/// A pyramid of four faces with all attributes, whose data is `file.bin`.
const USER_OF_DRACO: &str = r#"{
    "asset": { "version": "2.0" }, "extensionsUsed": ["KHR_draco_mesh_compression"],
    "buffers": [{ "uri": "file.bin", "byteLength": N_BYTES }], "bufferViews": [{ "buffer": 0, "byteLength": N_BYTES }],
    "accessors": [
        { "count": 5, "type": "VEC3", "componentType": 5126 }, { "count": 5, "type": "VEC3", "componentType": 5126 },
        { "count": 5, "type": "VEC2", "componentType": 5126 },
        { "count": 5, "type": "VEC4", "componentType": 5121, "normalized": true },
        { "count": 5, "type": "VEC4", "componentType": 5121 }, { "count": 5, "type": "VEC4", "componentType": 5126 },
        { "count": 12, "type": "SCALAR", "componentType": 5123 }
    ],
    "meshes": [{ "primitives": [{
        "attributes":
            { "POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2, "COLOR_0": 3, "JOINTS_0": 4, "WEIGHTS_0": 5 },
        "indices": 6,
        "extensions": { "KHR_draco_mesh_compression": { "bufferView": 0, "attributes":
            { "POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2, "COLOR_0": 3, "JOINTS_0": 4, "WEIGHTS_0": 5 } } }
    }] }],
    "nodes": [{ "mesh": 0, "skin": 0 }, {}, {}, {}, {}, {}], "skins": [{ "joints": [0, 1, 2, 3, 4, 5] }]
}"#;

/// A scene whose materials use `file.tga` in each of the ways in which pixels are read.
const USER_OF_IMAGE: &str = "materials.a = { map_Kd = 'file.tga', map_d = 'file.tga', map_normal = 'file.tga' }\n\
                             materials.b = { map_Kd = 'file.tga', map_roughness = 'file.tga', cutoff = 0.5 }\n\
                             [[mesh]]\ngenerator = 'plane'\nsize = [2, 2]\nfields = [2, 1]\nmaterials = ['a', 'b']\n";

/// The most triangles and pixels of a scene that is also rendered. Larger ones would take the time of many files.
const MAX_RENDERED_TRIANGLES: usize = 4096;
const MAX_RENDERED_PIXELS: usize = 1 << 14;

/// The largest count that a scene file may state. Generators make up to 2^24 triangles in seconds, as they should.
const MAX_COUNT: i64 = 64;

/// A folder in which files are read, in memory where the system has such a folder.
pub struct Reader {
    folder: TempDir,
}

impl Reader {
    pub fn new() -> Self {
        static SUBSCRIBER: Once = Once::new();
        SUBSCRIBER.call_once(|| tracing::subscriber::set_global_default(LineChecker).expect("the only subscriber"));
        let memory = Path::new("/dev/shm");
        let folder = if memory.is_dir() { TempDir::new_in(memory) } else { TempDir::new() };
        Self { folder: folder.expect("a temporary folder") }
    }

    /// Reads a file. Of a scene that is read, draws a small picture, too. Returns the error, if there is one.
    ///
    /// # Panics
    /// An error or a warning is not one line of printable text, or does not name the file.
    pub fn check(&self, format: Format, content: &[u8]) -> Option<String> {
        match format {
            Format::Toml if asks_for_much(content) => None,
            Format::Pack => self.check_pack(content),
            _ => self.check_file(format, content),
        }
    }

    /// Reads a pack. If it is refused, reads it again with the right hashes: otherwise no changed pack would be read
    /// beyond its manifest.
    fn check_pack(&self, content: &[u8]) -> Option<String> {
        let files = packs::files_of(content);
        if files.iter().filter_map(PackFile::content).any(|content| asks_for_much(&content)) {
            return None;
        }
        self.check_file(Format::Pack, content).and_then(|_| self.check_file(Format::Pack, &packs::resealed(files)))
    }

    fn check_file(&self, format: Format, content: &[u8]) -> Option<String> {
        let path = self.write(format.file_name(), content);
        let scene = match format.user(content.len()) {
            Some((name, content)) => self.write(name, content.as_bytes()),
            None => path.clone(),
        };
        let error = match format {
            Format::Npy => read_rays(&path).err(),
            Format::Part => merge_part(&path).err(),
            Format::Pack => read_scene(&scene).and_then(|()| read_rest_of_pack(&path)).err(),
            _ => read_scene(&scene).err(),
        };
        if let Some(line) = &error {
            check_error(line, &[&path, &scene]);
        }
        error
    }

    fn write(&self, name: &str, content: &[u8]) -> PathBuf {
        let path = self.folder.path().join(name);
        fs::write(&path, content).expect("a file in the temporary folder");
        path
    }
}

/// Checks that an error begins with the name of a file, or of a file in a pack, perhaps with a line, and then says what
/// is wrong.
pub fn check_error(line: &str, files: &[&Path]) {
    check_line(line);
    assert!(line.chars().count() < 800, "too long: {line}");
    let after_name = |file: &&Path| {
        let rest = line.strip_prefix(file.to_str()?)?;
        let in_pack = rest.strip_prefix('/').filter(|_| file.extension().is_some_and(|ending| ending == "kdpack"));
        in_pack.and_then(|rest| Some(rest.split_once(':')?.1)).or_else(|| rest.strip_prefix(':'))
    };
    let rest = files.iter().find_map(after_name);
    let rest = rest.unwrap_or_else(|| panic!("the error names no file: {line}"));
    let what = rest.trim_start_matches(|c: char| c.is_ascii_digit() || c == ':');
    assert!(what.starts_with(' ') && what.len() > 5, "the error says nothing: {line}");
}

/// Loads a scene. If it is small, builds its tree and renders a picture.
fn read_scene(path: &Path) -> Result<(), String> {
    // The viewer watches these files.
    let _ = source_files(path);
    let choices = PictureChoices { size: Some((6, 5)), max_depth: Some(3), ..PictureChoices::default() };
    let opened = Opened::read(path, &LoadRequest::pictures(choices)).map_err(|error| error.to_string())?;
    let n_pixels: usize = opened.scene.images.iter().map(|image| image.pixels.len()).sum();
    if opened.scene.n_triangles() > MAX_RENDERED_TRIANGLES || n_pixels > MAX_RENDERED_PIXELS {
        return Ok(());
    }
    let engine = Engine::on_cpu();
    let (loaded, _) = engine.build(opened, &Work::picture()).expect("a loaded scene has a tree");
    engine.render(&loaded.world, &loaded.options).expect("a loaded scene is rendered");
    Ok(())
}

/// Reads the hash of a pack, and its camera path, if it has one.
fn read_rest_of_pack(pack: &Path) -> Result<(), String> {
    assert!(pack_hash(pack).is_ok_and(|hash| hash.is_some()), "a pack with a scene has a hash");
    let path = packed_path(pack).map_err(|error| error.to_string())?;
    path.map_or(Ok(()), |path| CameraPath::load(&path).map(|_| ()).map_err(|error| error.to_string()))
}

/// Reads all rays of a file, in batches of different sizes.
fn read_rays(path: &Path) -> Result<(), String> {
    let mut reader = RayReader::open(path).map_err(|error| error.to_string())?;
    let mut n_read = 0;
    for most in [1, 7, 1 << 12].into_iter().chain(std::iter::repeat(1 << 16)) {
        let batch = reader.next_batch(most).map_err(|error| error.to_string())?;
        n_read += batch.len() as u64;
        if batch.is_empty() {
            break;
        }
    }
    assert_eq!(n_read, reader.n_rays());
    Ok(())
}

/// Reads a part of a picture, and joins it to a picture if it is a whole one.
fn merge_part(path: &Path) -> Result<(), String> {
    let merged = match merge(&[path]) {
        Err(error @ MergeError::Missing(_)) => {
            check_line(&error.to_string());
            return Ok(());
        }
        merged => merged.map_err(|error| error.to_string())?,
    };
    let n_pixels = merged.picture.width as usize * merged.picture.height as usize;
    assert_eq!((merged.picture.radiance.len(), merged.picture.display.len()), (n_pixels, n_pixels));
    Ok(())
}

/// Returns whether a scene file states a count that only takes time.
fn asks_for_much(content: &[u8]) -> bool {
    fn is_large(value: &toml::Value) -> bool {
        match value {
            toml::Value::Integer(count) => *count > MAX_COUNT,
            toml::Value::Array(values) => values.iter().any(is_large),
            toml::Value::Table(table) => table.values().any(is_large),
            _ => false,
        }
    }
    let table = std::str::from_utf8(content).ok().and_then(|text| text.parse::<toml::Table>().ok());
    table.is_some_and(|table| table.values().any(is_large))
}

/// Checks that a message is one line of printable text.
fn check_line(line: &str) {
    assert!(!line.is_empty(), "an empty message");
    assert!(!line.chars().any(|c| c.is_control() || ('\u{2028}'..='\u{202e}').contains(&c)), "{line:?}");
}

/// Formats every message of the library and checks that it is one line.
struct LineChecker;

impl tracing::Subscriber for LineChecker {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        *metadata.level() <= tracing::Level::WARN
    }

    fn new_span(&self, _: &span::Attributes<'_>) -> span::Id {
        span::Id::from_u64(1)
    }

    fn record(&self, _: &span::Id, _: &span::Record<'_>) {}

    fn record_follows_from(&self, _: &span::Id, _: &span::Id) {}

    fn event(&self, event: &Event<'_>) {
        event.record(&mut LineVisitor);
    }

    fn enter(&self, _: &span::Id) {}

    fn exit(&self, _: &span::Id) {}
}

struct LineVisitor;

impl Visit for LineVisitor {
    fn record_debug(&mut self, _: &Field, value: &dyn std::fmt::Debug) {
        check_line(&format!("{value:?}"));
    }
}
