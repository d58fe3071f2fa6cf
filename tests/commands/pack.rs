//! Tests of `kdray pack`, and of packs as scenes.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::support::{
    arrays::npy,
    command::{fail, names, stderr, stdout, succeed},
};
use kdray::{
    pack::pack,
    scene::{LoadOptions, Scene},
};
use tempfile::TempDir;

const SCENE: &str = "\
background = [0.2, 0.3, 0.4]
ambient = [0.3, 0.3, 0.3]

[camera]
eye = [0, 0, 3]
target = [0, 0, 0]

[[mesh]]
file = 'parts/panel.obj'

[[mesh]]
generator = 'plane'
size = [4, 4]
material = 'floor'
instances = 'floors.npy'

[materials.floor]
map_Kd = 'floor.png'

[[light]]
kind = 'point'
position = [0, 2, 2]
intensity = [9, 9, 9]
";
const OBJ: &str =
    "mtllib Panel.MTL\nusemtl painted\nv -1 -1 0\nv 1 -1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";
const MTL: &str = "newmtl painted\nKd 1 1 1\nmap_Kd ../shared/paint.png\n";
const PATH: &str = "[[keyframe]]\nframe = 0\neye = [0, 0, 3]\ntarget = [0, 0, 0]\n\
                    [[keyframe]]\nframe = 4\neye = [1, 0, 3]\ntarget = [0, 0, 0]\n";

/// Writes a scene of several files into `folder`. Returns the scene's file.
fn write_scene(folder: &Path) -> PathBuf {
    for name in ["parts", "shared"] {
        fs::create_dir_all(folder.join(name)).unwrap();
    }
    for (name, text) in [("s.toml", SCENE), ("parts/panel.obj", OBJ), ("parts/panel.mtl", MTL), ("path.toml", PATH)] {
        fs::write(folder.join(name), text).unwrap();
    }
    let identity = [1.0_f32, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    fs::write(folder.join("floors.npy"), npy(&[1, 3, 4], npyz::Order::C, &identity)).unwrap();
    write_image(&folder.join("floor.png"), [90, 60, 30]);
    write_image(&folder.join("shared/paint.png"), [200, 10, 10]);
    folder.join("s.toml")
}

fn write_image(path: &Path, colour: [u8; 3]) {
    image::RgbImage::from_fn(4, 4, |x, y| image::Rgb(colour.map(|c| c + (x + 4 * y) as u8))).save(path).unwrap();
}

/// Files of a mesh file may lie beside its folder only with this option.
fn outside() -> LoadOptions {
    LoadOptions { allow_outside: true, ..LoadOptions::default() }
}

#[test]
fn a_pack_is_the_scene_and_needs_no_other_file() {
    let directory = TempDir::new().unwrap();
    let scene_file = write_scene(directory.path());
    let output = directory.path().join("s.kdpack");
    let packed = pack(&scene_file, None, &outside(), &output).unwrap();
    let names: Vec<_> = packed.files.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["floor.png", "floors.npy", "parts/panel.mtl", "parts/panel.obj", "s.toml", "shared/paint.png"]);
    let scene = Scene::load_with(&scene_file, &outside()).unwrap();
    assert_eq!(scene.images.len(), 2, "the scene shows both images");
    let elsewhere = TempDir::new().unwrap();
    let moved = elsewhere.path().join("other.kdpack");
    fs::rename(&output, &moved).unwrap();
    drop(directory);
    assert_eq!(Scene::load(&moved).unwrap(), scene);
    // A file of a pack can be named as that of a folder.
    let panel = Scene::load(&moved.join("parts/panel.obj")).unwrap();
    assert_eq!(panel.n_triangles(), 1);
}

#[test]
fn equal_scenes_make_equal_packs() {
    let directories = [TempDir::new().unwrap(), TempDir::new().unwrap()];
    let packs = directories.each_ref().map(|directory| {
        let scene_file = write_scene(directory.path());
        let output = directory.path().join("s.kdpack");
        let path = directory.path().join("path.toml");
        (pack(&scene_file, Some(&path), &outside(), &output).unwrap(), fs::read(output).unwrap())
    });
    assert!(packs[0] == packs[1]);
    let scene_file = write_scene(directories[0].path());
    write_image(&directories[0].path().join("floor.png"), [90, 60, 31]);
    let other = pack(&scene_file, None, &outside(), &directories[0].path().join("s.kdpack")).unwrap();
    assert_ne!(packs[0].0.hash, other.hash);
}

#[test]
fn a_file_that_is_missing_is_found_when_packing() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    write_scene(path);
    fs::remove_file(path.join("shared/paint.png")).unwrap();
    let arguments = ["pack", "s.toml", "--allow-outside"];
    fail(path, &arguments, 3, "s.toml: names files that do not exist: parts/../shared/paint.png");
    assert!(!path.join("s.kdpack").exists());
    write_scene(path);
    fs::remove_file(path.join("parts/panel.obj")).unwrap();
    fail(path, &arguments, 3, "panel.obj");
}

/// No damage gives another scene: it is refused, or it is in a part of the archive that says nothing.
#[test]
fn damage_is_noticed() {
    let directory = TempDir::new().unwrap();
    let output = directory.path().join("s.kdpack");
    pack(&write_scene(directory.path()), None, &outside(), &output).unwrap();
    let (scene, bytes) = (Scene::load(&output).unwrap(), fs::read(&output).unwrap());
    let (mut n_refused, step) = (0, 3);
    for at in (0..bytes.len()).step_by(step) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 1 << (at % 8);
        fs::write(&output, &damaged).unwrap();
        match Scene::load(&output) {
            Ok(other) => assert!(other == scene, "byte {at} changes the scene"),
            Err(error) => {
                n_refused += 1;
                assert_eq!(error.to_string().lines().count(), 1, "{error}");
            }
        }
    }
    assert!(n_refused > bytes.len() / step / 2, "{n_refused} of {} changes are refused", bytes.len() / step);
    for length in (0..bytes.len()).step_by(step) {
        fs::write(&output, &bytes[..length]).unwrap();
        assert!(Scene::load(&output).is_err(), "the first {length} bytes are no pack");
    }
}

/// A folder with a pack, and a mesh beside the pack that is in no pack.
struct Beside {
    directory: TempDir,
    /// The scene of the pack.
    scene_file: PathBuf,
    pack: PathBuf,
    secret: PathBuf,
}

impl Beside {
    fn new() -> Self {
        let directory = TempDir::new().unwrap();
        let path = directory.path().to_owned();
        fs::create_dir(path.join("scene")).unwrap();
        let scene_file = write_scene(&path.join("scene"));
        let (output, secret) = (path.join("s.kdpack"), path.join("secret.obj"));
        pack(&scene_file, None, &outside(), &output).unwrap();
        fs::write(&secret, OBJ).unwrap();
        Self { directory, scene_file, pack: output, secret }
    }

    /// Makes a pack whose scene names this mesh. Read from disk, the name is that of a file. Returns the error of
    /// loading it.
    fn error_of(&self, mesh: &str, change: impl FnOnce(&mut serde_json::Value)) -> String {
        fs::write(&self.scene_file, SCENE.replace("parts/panel.obj", mesh)).unwrap();
        let on_disk = Scene::load_with(&self.scene_file, &outside());
        assert!(on_disk.is_ok(), "{on_disk:?}");
        let hostile = self.directory.path().join("t.kdpack");
        rewrite_with(&self.pack, &hostile, &self.scene_file, change);
        assert!(Scene::load_with(&hostile, &outside()).is_err());
        Scene::load(&hostile).unwrap_err().to_string()
    }
}

#[test]
fn a_pack_reads_no_file_on_disk() {
    let beside = Beside::new();
    for name in ["../secret.obj", &beside.secret.display().to_string()] {
        let error = beside.error_of(name, |_| ());
        assert!(error.contains("the pack"), "{error}");
    }
}

/// A manifest cannot make names of files on disk of those in its pack, whatever it says of its folder.
#[test]
fn the_folder_of_a_manifest_leads_nowhere() {
    let beside = Beside::new();
    for folder in ["", ".", "/", "..", &beside.directory.path().display().to_string()] {
        let error =
            beside.error_of(&beside.secret.display().to_string(), |manifest| manifest["folder"] = folder.into());
        let is_refused =
            error.contains("its folder is no absolute path") || error.contains("the pack does not have it");
        assert!(is_refused, "folder `{folder}`: {error}");
    }
}

/// Copies a pack with another scene file and another manifest, with the hashes of both.
fn rewrite_with(from: &Path, to: &Path, scene_file: &Path, change: impl FnOnce(&mut serde_json::Value)) {
    use std::io::{Read, Write};
    let mut archive = zip::ZipArchive::new(fs::File::open(from).unwrap()).unwrap();
    let mut files: Vec<(String, Vec<u8>)> = Vec::new();
    for ix in 0..archive.len() {
        let mut file = archive.by_index(ix).unwrap();
        let mut content = Vec::new();
        file.read_to_end(&mut content).unwrap();
        files.push((file.name().unwrap().into_owned(), content));
    }
    let scene = fs::read(scene_file).unwrap();
    let mut manifest: serde_json::Value = serde_json::from_slice(&files[0].1).unwrap();
    for file in manifest["files"].as_array_mut().unwrap() {
        if file["name"] == "s.toml" {
            file["n_bytes"] = scene.len().into();
            file["blake3"] = blake3::hash(&scene).to_hex().to_string().into();
        }
    }
    files.iter_mut().find(|(name, _)| name == "s.toml").unwrap().1 = scene;
    change(&mut manifest);
    files[0].1 = sealed(manifest);
    let mut archive = zip::ZipWriter::new(fs::File::create(to).unwrap());
    for (name, content) in files {
        archive.start_file(name, zip::write::SimpleFileOptions::DEFAULT).unwrap();
        archive.write_all(&content).unwrap();
    }
    archive.finish().unwrap();
}

/// Returns the text of a manifest with the hash of its other properties, which are in the order of the format.
fn sealed(mut manifest: serde_json::Value) -> Vec<u8> {
    let order = ["hash", "format", "version", "scene", "scene_name", "camera", "path", "folder", "files"];
    let text = |manifest: &serde_json::Value| {
        let file = |file: &serde_json::Value| {
            format!(r#"{{"name":{},"n_bytes":{},"blake3":{}}}"#, file["name"], file["n_bytes"], file["blake3"])
        };
        let value = |name: &str| match (name, manifest.get(name)?) {
            ("files", files) => {
                let files = files.as_array().unwrap().iter().map(file).collect::<Vec<_>>().join(",");
                Some(format!(r#""files":[{files}]"#))
            }
            (_, value) => Some(format!(r#""{name}":{value}"#)),
        };
        format!("{{{}}}", order.into_iter().filter_map(value).collect::<Vec<_>>().join(","))
    };
    manifest["hash"] = "".into();
    manifest["hash"] = blake3::hash(text(&manifest).as_bytes()).to_hex()[..32].to_owned().into();
    text(&manifest).into_bytes()
}

/// Names that hold on one computer only are mapped, so that files may be named by absolute paths.
#[test]
fn absolute_names_are_found_in_the_pack() {
    let directory = TempDir::new().unwrap();
    let scene_file = write_scene(directory.path());
    let absolute = directory.path().join("parts/panel.obj").display().to_string();
    fs::write(&scene_file, SCENE.replace("parts/panel.obj", &absolute)).unwrap();
    let elsewhere = TempDir::new().unwrap();
    let output = elsewhere.path().join("s.kdpack");
    pack(&scene_file, None, &outside(), &output).unwrap();
    let scene = Scene::load_with(&scene_file, &outside()).unwrap();
    drop(directory);
    assert_eq!(Scene::load(&output).unwrap(), scene);
    assert!(fs::read(&output).unwrap().windows(8).any(|text| text == b"\"folder\""));
}

#[test]
fn pictures_and_films_from_packs_have_the_same_bytes() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    write_scene(path);
    let common = ["--cpu", "--size", "24x18", "-q", "--allow-outside"];
    let report = stdout(&succeed(path, &["pack", "s.toml", "--allow-outside", "--path", "path.toml"]));
    assert!(report.contains("bytes in 7 files\nhash ") && report.ends_with("\nwrote s.kdpack\n"), "{report}");
    succeed(path, &[&["render", "s.toml", "-o", "a.exr"], &common[..]].concat());
    succeed(path, &[&["render", "s.kdpack", "-o", "b.exr"], &common[..]].concat());
    let same = |a: &str, b: &str| fs::read(path.join(a)).unwrap() == fs::read(path.join(b)).unwrap();
    assert!(same("a.exr", "b.exr"));
    let film = ["render", "s.toml", "--path", "path.toml", "--frames", "0-4x2", "-o", "f#.png"];
    succeed(path, &[&film, &common[..]].concat());
    succeed(path, &[&["render", "s.kdpack", "--frames", "0-4x2", "-o", "g#.png"], &common[..]].concat());
    assert!(["0", "2", "4"].iter().all(|frame| same(&format!("f{frame}.png"), &format!("g{frame}.png"))));
    assert!(!same("f0.png", "f4.png"));
    let listed = names(path);
    assert!(!listed.iter().any(|name| name.starts_with(".kdray")), "{listed:?}");
}

/// A small pack can have a list of files that takes much memory. It is refused if there is less.
#[test]
fn a_vast_manifest_is_refused() {
    use std::io::Write;
    let directory = TempDir::new().unwrap();
    let file = |ix: usize| format!(r#"{{"name":"{ix:x}","n_bytes":0,"blake3":""}},"#);
    let files: String = (0..1_500_000).map(file).collect();
    let manifest =
        format!(r#"{{"hash":"","format":1,"version":"","scene":"0","files":[{}]}}"#, files.trim_end_matches(','));
    let mut archive = zip::ZipWriter::new(fs::File::create(directory.path().join("vast.kdpack")).unwrap());
    archive.start_file("kdpack.json", zip::write::SimpleFileOptions::DEFAULT).unwrap();
    archive.write_all(manifest.as_bytes()).unwrap();
    archive.finish().unwrap();
    let output = std::process::Command::new("sh")
        .args(["-c", "ulimit -v 300000; exec \"$0\" inspect vast.kdpack", env!("CARGO_BIN_EXE_kdray")])
        .current_dir(directory.path())
        .output()
        .unwrap();
    let error = stderr(&output);
    assert_eq!(output.status.code(), Some(3), "{error}");
    assert!(error.contains("vast.kdpack: reading the manifest of a pack needs some "), "{error}");
}

#[test]
fn what_is_no_pack_is_refused() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    write_scene(path);
    fs::write(path.join("text.kdpack"), "no archive").unwrap();
    fail(path, &["render", "text.kdpack"], 3, "text.kdpack: is no pack");
    fail(path, &["render", "none.kdpack"], 3, "none.kdpack: cannot be read");
    fail(path, &["pack", "s.toml", "--allow-outside", "-o", "s.zip"], 2, ".kdpack");
    fail(path, &["pack", "s.toml", "--allow-outside", "--path", "s.toml", "-o", "x.kdpack"], 3, "s.toml");
    succeed(path, &["pack", "s.toml", "--allow-outside"]);
    fail(path, &["pack", "s.kdpack", "-o", "t.kdpack"], 3, "is in a pack already");
    fail(path, &["pack", "s.kdpack"], 2, "s.kdpack");
    fail(path, &["render", "s.kdpack", "--frames", "0-1"], 2, "nothing moves, so --frames needs --path FILE");
    fail(path, &["render", "s.kdpack", "-o", "s.kdpack/a.png"], 5, "s.kdpack");
    fail(path, &["convert", "s.kdpack", "c.toml"], 3, "s.kdpack");
}
