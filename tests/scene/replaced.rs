//! Tests of materials that the user puts in place of a scene's own.

use std::fs;

use glam::Vec3;
use kdray::scene::{LoadOptions, Look, MaterialChoice, Preset, Scene, SceneError, scene_file_of};

use super::materials::load_scene;

/// Two triangles of the materials `a` and `b`, with colours of points.
const OBJ: &str = "mtllib m.mtl\nv 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nvt 0 0\nvt 1 0\nvt 0 1\n\
                   usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 3/3 2/2\n";

fn choices(words: &[&str]) -> LoadOptions {
    let materials: Vec<MaterialChoice> = words.iter().map(|word| word.parse().unwrap()).collect();
    LoadOptions { look: Look { materials, ..Look::default() }, ..LoadOptions::default() }
}

/// Loads the mesh with an MTL file whose images do not exist.
fn load(words: &[&str]) -> Result<Scene, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.obj"), OBJ).unwrap();
    fs::write(folder.path().join("m.mtl"), "newmtl a\nmap_Kd a.png\nKd 1 0 0\nnewmtl b\nmap_Kd b.png\n").unwrap();
    Scene::load_with(&folder.path().join("a.obj"), &choices(words))
}

#[test]
fn all_materials_or_those_of_a_name_are_replaced() {
    let scene = load(&["chrome"]).unwrap();
    for material in &scene.materials {
        assert_eq!(*material, Preset::Chrome.material(&material.name));
    }
    assert!(scene.meshes[0].colours.is_empty());
    let scene = load(&["clay", "b=gold"]).unwrap();
    let kinds: Vec<_> = scene.materials.iter().map(|material| (&material.name[..], material.kd)).collect();
    let (clay, gold) = (Vec3::splat(0.6), Vec3::new(1.0, 0.782, 0.344));
    assert_eq!(kinds, [("a", clay), ("b", gold), ("(default)", clay)]);
    // The last choice counts.
    assert_eq!(load(&["b=gold", "clay"]).unwrap(), load(&["clay"]).unwrap());
    // Colours of points remain where the material does.
    let scene = load(&["b=gold"]).unwrap();
    assert_eq!(scene.materials[0].kd, Vec3::X);
    let colours: Vec<Vec3> = scene.meshes[0].colours.iter().map(|corners| corners[0].truncate()).collect();
    assert_eq!(colours, [Vec3::X, Vec3::ONE]);
    let error = load(&["c=gold"]).unwrap_err().to_string();
    assert!(error.ends_with("a.obj: there is no material `c`, but `a`, `b`, `(default)`"), "{error}");
}

/// An image that is neither there nor readable is an error or a warning, unless nothing needs it.
#[test]
fn images_of_replaced_materials_are_not_read() {
    let mtl = "newmtl a\nmap_Kd a.png\nnewmtl b\nmap_Kd b.png\n";
    let toml = |key: &str| {
        format!(
            "{key}\nmaterials.m = {{ map_Kd = 'none.png' }}\n[[mesh]]\nfile = 'a.obj'\n[[mesh]]\n\
             generator = 'disc'\nradius = 1\nsegments = 3\nmaterial = 'm'\n"
        )
    };
    let load = |key: &str| {
        let (text, broken) = (toml(key), &b"broken"[..]);
        let files =
            [("a.toml", text.as_bytes()), ("a.obj", OBJ.as_bytes()), ("m.mtl", mtl.as_bytes()), ("b.png", broken)];
        load_scene(&files)
    };
    assert!(load("").0.unwrap_err().to_string().contains("none.png"));
    let (scene, warnings) = load("replace = ['clay']");
    assert!(warnings.is_empty() && scene.unwrap().images.is_empty(), "{warnings:?}");
    let (scene, warnings) = load("replace = ['m=glass', 'a=clay']");
    assert!(scene.is_ok() && warnings.len() == 1 && warnings[0].contains("b.png"), "{warnings:?}");
    let error = load("replace = ['m=glass', 'x=clay']").0.unwrap_err().to_string();
    assert!(error.contains("a.toml:1: replace: there is no material `x`"), "{error}");
    let error = load("replace = ['wood']").0.unwrap_err().to_string();
    assert!(error.contains("a.toml:1: replace: `wood` is not one of clay"), "{error}");
}

#[test]
fn converted_files_have_the_replaced_materials() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("a.obj"), OBJ).unwrap();
    fs::write(path("m.mtl"), "newmtl a\nKd 1 0 0\nnewmtl b\nKd 0 1 0\n").unwrap();
    fs::write(path("b.toml"), "replace = ['b=water']\n[[mesh]]\nfile = 'a.obj'\n").unwrap();
    for input in ["a.obj", "b.toml"] {
        for words in [&["clay"][..], &["a=gold"], &["copper", "(default)=glass"]] {
            let options = choices(words);
            let text = scene_file_of(&path(input), &path("c.toml"), &options).unwrap();
            fs::write(path("c.toml"), &text).unwrap();
            let before = Scene::load_with(&path(input), &options).unwrap();
            let after = Scene::load(&path("c.toml")).unwrap();
            assert_eq!(before.materials, after.materials, "{text}");
            assert_eq!(before.meshes, after.meshes, "{text}");
        }
    }
}
