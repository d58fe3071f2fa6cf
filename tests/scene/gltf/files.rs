//! The forms of glTF files, and the files that they name.

use std::{fs, path::Path};

use kdray::scene::{LoadOptions, Scene, source_files};
use serde_json::json;
use tempfile::TempDir;

use super::{Model, cube, flattened, load, load_bytes, obj, triangle};

#[test]
fn a_cube_is_the_same_in_every_form() {
    let expected = load(&[("cube.obj", &obj())]).unwrap();
    let model = cube();
    let external = model.with_uri("the%20data.bin");
    let padless = model.embedded().into_iter().filter(|byte| *byte != b'=').collect::<Vec<_>>();
    let with_bom = ["\u{feff}\n".as_bytes(), &model.embedded()].concat();
    for (name, bytes) in [
        ("cube.glb", model.glb()),
        ("cube.gltf", model.glb()),
        ("cube.obj", model.glb()),
        ("cube.gltf", model.embedded()),
        ("cube.stl", model.embedded()),
        ("cube.gltf", padless),
        ("cube.gltf", with_bom),
        ("cube.gltf", external),
    ] {
        let found = load(&[(name, &bytes), ("the data.bin", &model.data)]).unwrap();
        assert_eq!(found.triangles, expected.triangles, "{name}");
        assert_eq!((found.camera, found.lights), (expected.camera, expected.lights.clone()), "{name}");
        assert_eq!((found.ambient, found.background), (expected.ambient, expected.background), "{name}");
    }
    let mut moved = model;
    moved.data[0] ^= 1;
    assert_ne!(moved.flat().triangles, expected.triangles, "a moved corner");
}

#[test]
fn files_are_read_below_the_folder_only() {
    let folder = TempDir::new().unwrap();
    let inside = folder.path().join("inside");
    fs::create_dir_all(inside.join("parts")).unwrap();
    let model = triangle();
    fs::write(folder.path().join("data.bin"), &model.data).unwrap();
    fs::write(inside.join("parts/data.bin"), &model.data).unwrap();
    let path = inside.join("model.gltf");
    let load = |uri: &str| {
        fs::write(&path, model.with_uri(uri)).unwrap();
        Scene::load(&path).map_err(|error| error.to_string())
    };
    load("parts/data.bin").unwrap();
    let absolute = folder.path().join("data.bin");
    for uri in ["../data.bin", "%2e%2e/data.bin", absolute.to_str().unwrap(), "file:///etc/passwd", "https://a/b.bin"] {
        let error = load(uri).unwrap_err();
        assert!(error.contains("model.gltf: buffers[0]: ") && error.contains("not"), "{error}");
    }
    let missing = load("parts/none.bin").unwrap_err();
    assert!(missing.contains("buffers[0]: ") && missing.contains("none.bin: cannot be read"), "{missing}");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("../data.bin", inside.join("link.bin")).unwrap();
        let error = load("link.bin").unwrap_err();
        assert!(error.contains("leads out of the folder"), "{error}");
    }
}

#[test]
fn a_model_names_its_files() {
    let mut model = triangle();
    model.json["images"] =
        json!([{ "uri": "a%20b.png" }, { "uri": "data:image/png;base64,AAAA" }, { "uri": "../c.png" }]);
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("m.gltf"), model.with_uri("m.bin")).unwrap();
    fs::write(path("s.toml"), "[[mesh]]\nfile = 'm.gltf'\n").unwrap();
    let expected = [path("a b.png"), path("m.bin"), path("m.gltf"), path("s.toml")];
    assert_eq!(source_files(&path("s.toml")), expected);
    assert_eq!(source_files(&path("m.gltf")), expected[..3]);
}

#[test]
fn shipped_scenes_are_no_models() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell.toml");
    let error = Scene::load_with(&path, &LoadOptions { scene: Some("0".to_owned()), ..LoadOptions::default() })
        .unwrap_err()
        .to_string();
    assert!(error.contains("only glTF files name scenes"), "{error}");
}

/// Returns a GLB file with chunks of other kinds among its own.
fn with_chunks(model: &Model, [before, after]: [&[u8]; 2], json_padding: &[u8]) -> Vec<u8> {
    let chunk = |kind: &[u8], bytes: &[u8]| [&(bytes.len() as u32).to_le_bytes(), kind, bytes].concat();
    let json = [model.json.to_string().as_bytes(), json_padding].concat();
    let chunks = [chunk(b"JSON", &json), before.to_vec(), chunk(b"BIN\0", &model.data), after.to_vec()].concat();
    [b"glTF\x02\0\0\0", &(12 + chunks.len() as u32).to_le_bytes()[..], &chunks].concat()
}

#[test]
fn other_chunks_and_padding_are_skipped() {
    let model = cube();
    let expected = model.flat().triangles;
    let other: &[u8] = b"\x04\0\0\0XTRAabcd";
    let none: &[u8] = b"";
    for (name, bytes) in [
        ("before", with_chunks(&model, [other, none], b"")),
        ("after", with_chunks(&model, [none, other], b"")),
        ("both", with_chunks(&model, [other, other], b"")),
        ("blanks", with_chunks(&model, [none, none], b"   ")),
        ("zeros", with_chunks(&model, [none, none], b"\0\0\0")),
        ("a tail", with_chunks(&model, [none, b"\0\0\0"], b"")),
        ("bytes behind the stated length", [model.glb(), b"\xff\xff\xff\xffXTRA".to_vec()].concat()),
    ] {
        let found = load_bytes("x.glb", &bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(flattened(&found).triangles, expected, "{name}");
    }
    // A file without the binary chunk can have other chunks.
    let mut bare = model.clone();
    bare.data.clear();
    bare.json["buffers"][0]["uri"] = json!("data.bin");
    let json = bare.json.to_string();
    let length = (12 + 8 + json.len() + other.len()) as u32;
    let head = [b"glTF\x02\0\0\0", &length.to_le_bytes()[..], &(json.len() as u32).to_le_bytes()].concat();
    let bytes = [&head, b"JSON".as_slice(), json.as_bytes(), other].concat();
    assert_eq!(load(&[("x.glb", &bytes), ("data.bin", &model.data)]).unwrap().triangles, expected);
    let cut_off = with_chunks(&model, [&other[..10], none], b"");
    assert!(load_bytes("x.glb", &cut_off).unwrap_err().contains("the chunk "));
}
