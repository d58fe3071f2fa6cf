//! Scene files made from other files show the same, and the keys that they need: overrides, spot lights, cameras.

use std::{f32::consts::PI, fs, path::Path};

use base64::{Engine, engine::general_purpose::STANDARD};
use glam::Vec3;
use kdray::{
    scene::{Alpha, Light, LightChoice, LoadOptions, Look, PathDefaults, RenderDefaults, Scene, scene_file_of},
    world::FlatScene,
};
use serde_json::json;
use tempfile::TempDir;

use super::{
    flattened,
    gltf::Model,
    load, load_toml,
    materials::png,
    mesh_files::{CORNERS, obj},
    support::random::Random,
};

const OBJ: &str = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0.1 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl wood \"1\"\n\
                   f 1/1 2/2 3/3\nusemtl glass\nf 1 2 4\nusemtl plain\nf 2 3 4\n";
const MTL: &str = "newmtl wood \"1\"\nKd 0.1 0.2 0.3\nKs 0.7 0.7 0.7\nNs 12.5\nmap_Kd a.png\nnorm a.png\n\
                   newmtl glass\nKd 0 0 0\nKs 1 1 1\nillum 7\nNi 1.45\nd 0.3\nTf 0.9 1 0.8\n\
                   newmtl plain\nPr 0.3\nPm 1\nmap_d a.png\n";

/// Converts a file, and returns it and the result as scenes. Their names are those of their files, and so they differ.
fn converted(input: &Path, output: &Path, options: &LoadOptions) -> (String, Scene, Scene) {
    let text = scene_file_of(input, output, options).unwrap_or_else(|error| panic!("{error}"));
    fs::write(output, &text).unwrap();
    let mut after = Scene::load(output).unwrap_or_else(|error| panic!("{error}\n{text}"));
    let before = Scene::load_with(input, options).unwrap();
    after.name = before.name.clone();
    (text, before, after)
}

fn assert_same(text: &str, before: &Scene, after: &Scene) {
    let (mut flat, mut read): (FlatScene, FlatScene) = (flattened(before), flattened(after));
    // The file states the options of the scene's own integrator alone.
    for scene in [&mut flat, &mut read] {
        let of_paths = PathDefaults::default();
        scene.defaults = RenderDefaults { of_paths, ..scene.defaults.for_integrator(None) };
    }
    assert_eq!(flat.material_names, read.material_names, "{text}");
    assert_eq!((&flat.lights, &flat.camera), (&read.lights, &read.camera), "{text}");
    assert!(flat == read, "{text}");
    assert_eq!((&before.cameras, &before.materials), (&after.cameras, &after.materials), "{text}");
}

/// Returns a glTF file with transformed instances, an image, three kinds of lights and two cameras.
fn model() -> Model {
    let mut model = Model::new();
    let mut random = Random(7);
    let unit = |random: &mut Random| (0..3).map(|_| random.below(2001) as f32 / 1000.0 - 1.0).collect::<Vec<f32>>();
    let positions = model.accessor("VEC3", 5126, CORNERS.as_flattened());
    let uvs = model.accessor("VEC2", 5126, &[0.25_f32; 16]);
    let uri = format!("data:image/png;base64,{}", STANDARD.encode(png(|x, y| [x as u8 * 9, y as u8, 3, 255])));
    model.push("images", json!({ "uri": uri }));
    model.push("textures", json!({ "source": 0 }));
    let map = json!({ "index": 0 });
    for material in [
        json!({ "name": "Leather \u{202e}\n", "normalTexture": { "index": 0, "scale": 0.5 },
                "pbrMetallicRoughness": { "baseColorTexture": map, "baseColorFactor": [0.1, 0.3, 0.7, 1.0] } }),
        json!({ "name": "leaf", "alphaMode": "MASK", "alphaCutoff": 0.3, "doubleSided": true,
                "pbrMetallicRoughness": { "metallicFactor": 0.2, "roughnessFactor": 0.123456789 } }),
        json!({ "name": "twin", "alphaMode": "BLEND", "pbrMetallicRoughness": { "baseColorFactor": [1, 1, 1, 0.4] } }),
        json!({ "name": "twin", "emissiveFactor": [0.1, 0.2, 0.3] }),
        json!({ "name": "ice", "extensions": { "KHR_materials_transmission": { "transmissionFactor": 0.8 },
                "KHR_materials_volume": { "thicknessFactor": 1, "attenuationDistance": 0.7,
                    "attenuationColor": [0.5, 0.6, 0.7] },
                "KHR_materials_specular": { "specularFactor": 0.5 } } }),
    ] {
        let ix = model.push("materials", material);
        let attributes = json!({ "POSITION": positions, "TEXCOORD_0": uvs });
        let indices = model.accessor("SCALAR", 5125, &[0_u32, 3, 2, 4, 5, 6]);
        let node = model.show(json!({ "attributes": attributes, "indices": indices, "material": ix }));
        model.json["nodes"][node]["translation"] = json!(unit(&mut random));
        model.json["nodes"][node]["rotation"] = json!([0.3, 0.1, -0.2, 0.9]);
        model.json["nodes"][node]["scale"] = json!([1.5, -0.7, 2.0]);
    }
    let lights = json!([
        { "type": "point", "intensity": 70, "color": [0.1, 1, 0.3] },
        { "type": "directional", "intensity": 2 },
        { "type": "spot", "intensity": 90, "spot": { "innerConeAngle": 0.1234567, "outerConeAngle": 0.7654321 } },
        { "type": "spot", "intensity": 90, "spot": { "outerConeAngle": PI / 2.0 } },
    ]);
    model.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": lights } });
    for light in 0..4 {
        let extension = json!({ "KHR_lights_punctual": { "light": light } });
        let (at, turn) = (unit(&mut random), [0.1 * light as f32, 0.2, -0.3, 0.8]);
        model.root(json!({ "translation": at, "rotation": turn, "extensions": extension }));
    }
    for (name, x) in [("left", 0.5), ("right", 0.77), ("plan", 1.3)] {
        let camera = match name {
            "plan" => json!({
                "type": "orthographic", "orthographic": { "xmag": x, "ymag": x, "znear": 0.1, "zfar": 9 },
            }),
            _ => json!({ "type": "perspective", "perspective": { "yfov": x, "znear": 0.1 } }),
        };
        let camera = model.push("cameras", camera);
        model.root(json!({ "name": name, "camera": camera, "translation": [x, 0.3, 7], "rotation": [0.1, 0.2, 0, 1] }));
    }
    model
}

#[test]
fn a_converted_gltf_file_shows_the_same() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::create_dir(path("parts")).unwrap();
    fs::write(path("parts/a model.glb"), model().glb()).unwrap();
    let (text, before, after) = converted(&path("parts/a model.glb"), &path("s.toml"), &LoadOptions::default());
    assert_same(&text, &before, &after);
    assert_eq!((before.lights.len(), before.cameras.len()), (4, 3));
    assert!(text.contains("file = \"parts/a model.glb\"\noverride = true\n"), "{text}");
    assert!(text.contains("\n[materials.\"Leather \\u202e\\u000a\"]\n# base colour: \"images[0]\"\n"), "{text}");
    // Two materials have one name, and so a table cannot stand for both.
    assert!(text.contains("\n# [materials.\"twin\"]\n") && text.contains("\n[materials.\"ice\"]\n"), "{text}");
    for (name, ix) in [("right", 1), ("plan", 2)] {
        let chosen = LoadOptions { camera: Some(name.to_owned()), ..LoadOptions::default() };
        let (text, before, after) = converted(&path("parts/a model.glb"), &path("s.toml"), &chosen);
        assert_same(&text, &before, &after);
        assert_eq!((before.camera, before.camera.is_orthographic()), (before.cameras[ix].1, name == "plan"));
    }
}

/// A scene file says whether the camera sees back faces, and keeps it when it is moved.
#[test]
fn a_converted_file_says_whether_back_faces_are_seen() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("m.glb"), model().glb()).unwrap();
    let off = LoadOptions { look: Look { shows_back_faces: true, ..Look::default() }, ..LoadOptions::default() };
    let are_double_sided = |scene: &Scene| scene.materials.iter().all(|material| material.is_double_sided);
    for (options, is_off) in [(&LoadOptions::default(), false), (&off, true)] {
        let (text, before, after) = converted(&path("m.glb"), &path("s.toml"), options);
        assert_same(&text, &before, &after);
        assert_eq!((text.contains("\ncull = \"off\"\n"), are_double_sided(&after)), (is_off, is_off), "{text}");
    }
    let (_, seen, culled) = converted(&path("m.glb"), &path("s.toml"), &LoadOptions::default());
    assert!(!are_double_sided(&seen) && !are_double_sided(&culled));
    let (text, before, after) = converted(&path("s.toml"), &path("t.toml"), &off);
    assert_same(&text, &before, &after);
    assert!(are_double_sided(&after), "{text}");
    // A preset changes what a surface is made of, not its sides.
    fs::write(path("s.toml"), "replace = ['clay']\n[[mesh]]\nfile = 'm.glb'\n").unwrap();
    let clay = Scene::load(&path("s.toml")).unwrap();
    let sides = |scene: &Scene| scene.materials.iter().map(|it| it.is_double_sided).collect::<Vec<_>>();
    assert_eq!(sides(&clay)[..5], [false, true, false, false, false]);
    fs::write(path("s.toml"), "cull = 'on'\n[[mesh]]\nfile = 'm.glb'\n").unwrap();
    let error = Scene::load(&path("s.toml")).unwrap_err().to_string();
    assert!(error.ends_with("s.toml:1: cull: `on` is not one of auto, off"), "{error}");
}

#[test]
fn a_scene_of_a_gltf_file_is_kept() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    let mut model = model();
    model.push("scenes", json!({ "name": "one", "nodes": [0] }));
    fs::write(path("m.glb"), model.glb()).unwrap();
    let one = LoadOptions { scene: Some("one".to_owned()), ..LoadOptions::default() };
    let (text, before, after) = converted(&path("m.glb"), &path("s.toml"), &one);
    assert_same(&text, &before, &after);
    assert_eq!(after.n_triangles(), 2);
    fs::write(path("s.toml"), "[[mesh]]\nfile = 'a.obj'\nscene = 'one'\n").unwrap();
    fs::write(path("a.obj"), obj()).unwrap();
    let error = Scene::load(&path("s.toml")).unwrap_err().to_string();
    assert!(error.ends_with("s.toml:1: mesh 1: there is no scene `one`: only glTF files name scenes"), "{error}");
}

#[test]
fn converted_mesh_files_show_the_same() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    let ply = "ply\nformat ascii 1.0\ncomment TextureFile a.png\nelement vertex 3\nproperty float x\nproperty float y\n\
               property float z\nproperty float u\nproperty float v\nelement face 1\n\
               property list uchar int vertex_indices\nend_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n";
    let stl = "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n\
               endsolid\n";
    fs::write(path("m.mtl"), MTL).unwrap();
    fs::write(path("a.png"), png(|x, y| [x as u8 * 40, y as u8 * 30, 7, 255])).unwrap();
    for (name, content, table) in [
        ("x.obj", OBJ, "[materials.\"wood \\\"1\\\"\"]\n# base colour: \"a.png\""),
        ("x.ply", ply, "[materials.\"a.png\"]"),
        ("x.stl", stl, "[[mesh]]\nfile = \"x.stl\"\n"),
    ] {
        fs::write(path(name), content).unwrap();
        let (text, before, after) = converted(&path(name), &path("s.toml"), &LoadOptions::default());
        assert_same(&text, &before, &after);
        assert!(text.contains(&format!("\n{table}")), "{text}");
        assert!(text.lines().all(|line| !line.starts_with("# [")), "{text}");
    }
}

#[test]
fn a_converted_scene_file_names_its_files_from_its_new_folder() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::create_dir_all(path("in/parts")).unwrap();
    fs::write(path("in/parts/x.obj"), OBJ.replace("mtllib m.mtl\n", "")).unwrap();
    fs::write(path("in/a.png"), png(|x, _| [x as u8, 1, 2, 255])).unwrap();
    let toml = "# a comment\nambient = [0.1, 0.2, 0.3]\n[materials]\n\
                m = { map_Kd = 'a.png', map_d = { file = 'a.png' } }\n\
                [[cameras]]\nname = 'c'\neye = [0.1, 0.2, 9]\ntarget = [0, 0, 0]\n[[mesh]]\nfile = 'parts/x.obj'\n\
                material = 'm'\n";
    fs::write(path("in/s.toml"), toml).unwrap();
    let (text, before, after) = converted(&path("in/s.toml"), &path("t.toml"), &LoadOptions::default());
    assert_same(&text, &before, &after);
    assert!(text.contains("in/parts/x.obj") && text.matches("in/a.png").count() == 2, "{text}");
    let (text, before, after) = converted(&path("in/s.toml"), &path("in/t.toml"), &LoadOptions::default());
    assert_same(&text, &before, &after);
    assert_eq!(text, toml);
    let named = LoadOptions { camera: Some("0".to_owned()), ..LoadOptions::default() };
    let (text, before, after) = converted(&path("in/s.toml"), &path("in/t.toml"), &named);
    assert_same(&text, &before, &after);
    assert!(text.contains("[camera]\neye"), "{text}");
    let error = scene_file_of(&path("in/s.toml"), &path("in/parts/t.toml"), &LoadOptions::default()).unwrap_err();
    assert!(error.to_string().contains("does not lie below the folder of"), "{error}");
}

#[test]
fn stated_terms_override_those_of_the_file() {
    let image = png(|x, _| [x as u8, 1, 2, 255]);
    let files = |toml: &str| {
        let toml = format!("[materials]\n{toml}\n[[mesh]]\nfile = 'x.obj'\noverride = true\n");
        [("s.toml", toml.into_bytes()), ("x.obj", OBJ.into()), ("m.mtl", MTL.into()), ("a.png", image.clone())]
    };
    let load = |toml: &str| {
        let folder = TempDir::new().unwrap();
        files(toml).iter().for_each(|(name, content)| fs::write(folder.path().join(name), content).unwrap());
        Scene::load(&folder.path().join("s.toml")).map_err(|error| error.to_string())
    };
    let plain = load("unused = {}").unwrap();
    assert_eq!(plain.materials.iter().map(|m| &m.name[..]).collect::<Vec<_>>()[..2], ["unused", "wood \"1\""]);
    let changed = load("'wood \"1\"' = { Kd = [1, 0, 0] }\nplain = { roughness = 0.75, cutoff = 0.25 }").unwrap();
    let [wood, glass, metal, ..] = &changed.materials[..] else { panic!("{:?}", changed.materials) };
    assert_eq!((wood.kd, wood.ka, wood.ns, &wood.maps), (Vec3::X, Vec3::X, 12.5, &plain.materials[1].maps));
    assert_eq!(glass, &plain.materials[2]);
    let microfacet = metal.microfacet.unwrap();
    assert_eq!((microfacet.roughness, microfacet.metallic, metal.alpha), (0.75, 1.0, Alpha::Mask(0.25)));
    // A map brings the tangents that it needs.
    let mapped = load("glass = { metallic = 1, map_normal = 'a.png' }").unwrap();
    assert!(mapped.materials[1].microfacet.is_some() && mapped.materials[1].maps.normal.is_some());
    let layered = load("plain = { clearcoat = 0.5, conductor_eta = [1, 1, 1], conductor_k = [2, 2, 2] }").unwrap();
    let metal = layered.materials.iter().find(|material| material.name == "plain").unwrap();
    assert_eq!((metal.clearcoat.factor, metal.microfacet.unwrap().metallic), (0.5, 1.0));
    assert!(metal.microfacet.unwrap().conductor.is_some());
    let error = load("plain = { Ns = 3 }").unwrap_err();
    let expected = "mesh 1: override of material `plain`: it is a microfacet material, which ignores Ns";
    assert!(error.ends_with(expected), "{error}");
    for (keys, what) in [
        ("generator = 'disc'\nradius = 1\nsegments = 8", "only mesh files have materials of their own"),
        ("file = 'x.obj'\nmaterial = 'm'", "has both `override` and `material`"),
    ] {
        let toml = format!("materials.m = {{}}\n[[mesh]]\noverride = true\n{keys}\n");
        let error = super::load(&[("s.toml", toml.as_bytes())]).unwrap_err().to_string();
        assert!(error.contains(what), "{error}");
    }
}

#[test]
fn scene_files_have_spot_lights() {
    let scene = |keys: &str| {
        format!("[[mesh]]\ngenerator = 'disc'\nradius = 1\nsegments = 8\n[[light]]\nkind = 'spot'\n{keys}")
    };
    let keys =
        "position = [1, 2, 3]\ndirection = [0, 0, -2]\nintensity = [4, 5, 6]\ninner_angle = 0\nouter_angle = 60\n";
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("s.toml"), scene(keys)).unwrap();
    let lights = Scene::load(&folder.path().join("s.toml")).unwrap().lights;
    let (position, intensity) = (Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0));
    let expected = Light::Spot { position, towards: Vec3::NEG_Z, intensity, inner_cos: 1.0, outer_cos: 0.5 };
    assert_eq!(lights, [expected]);
    for (from, to, what) in [
        ("outer_angle = 60", "outer_angle = 90.1", "not in order from 0 to 90"),
        ("inner_angle = 0", "inner_angle = 61", "not in order from 0 to 90"),
        ("inner_angle = 0", "inner_angle = nan", "not in order from 0 to 90"),
        ("[0, 0, -2]", "[0, 0, 0]", "has no direction"),
        ("inner_angle = 0\n", "", "inner_angle"),
    ] {
        let error = load(&[("s.toml", scene(&keys.replace(from, to)).as_bytes())]).unwrap_err().to_string();
        assert!(error.contains(what), "{error}");
    }
}

#[test]
fn scene_files_have_several_cameras() {
    let disc = "[[mesh]]\ngenerator = 'disc'\nradius = 1\nsegments = 8\n";
    let camera = |name: &str, x: u32| format!("[[cameras]]\nname = '{name}'\neye = [{x}, 0, 5]\ntarget = [0, 0, 0]\n");
    let (cameras, own) = (camera("a", 1) + &camera("b", 2), "[camera]\neye = [3, 0, 5]\ntarget = [0, 0, 0]\n");
    assert_eq!(load_toml(&format!("{cameras}{disc}")).camera.eye.x, 1.0);
    assert_eq!(load_toml(&format!("{own}{cameras}{disc}")).camera.eye.x, 3.0);
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("s.toml");
    fs::write(&path, format!("{own}{cameras}{disc}")).unwrap();
    let from = |name: &str| {
        let options = LoadOptions { camera: Some(name.to_owned()), ..LoadOptions::default() };
        Scene::load_with(&path, &options).map(|scene| scene.camera.eye.x).map_err(|error| error.to_string())
    };
    assert_eq!((from("a"), from("b"), from("0"), from("1")), (Ok(1.0), Ok(2.0), Ok(1.0), Ok(2.0)));
    let error = from("c").unwrap_err();
    assert!(error.ends_with("s.toml: there is no camera `c`, but 0 `a`, 1 `b`"), "{error}");
    fs::write(&path, disc).unwrap();
    assert!(from("0").unwrap_err().ends_with("there is no camera `0`: the file names no cameras"));
    let blind = camera("a", 1).replace("[1, 0, 5]", "[0, 0, 0]");
    let error = load(&[("s.toml", format!("{disc}{blind}").as_bytes())]).unwrap_err().to_string();
    assert!(error.contains("s.toml:5: camera 1: eye, target and up"), "{error}");
}

/// A converted sky is the same, and a light of the user's takes the place of its sun.
#[test]
fn converted_skies_are_the_same() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::create_dir(path("in")).unwrap();
    let toml = "[sky]\ndirection = [1, -2, -3]\nturbidity = 5.5\nground_albedo = [0.1, 0.3, 0.2]\nstrength = 0.7\n\
                up = 'z'\n[[mesh]]\ngenerator = 'box'\nsize = [1, 2, 3]\n";
    fs::write(path("in/s.toml"), toml).unwrap();
    let (text, before, after) = converted(&path("in/s.toml"), &path("t.toml"), &LoadOptions::default());
    assert_same(&text, &before, &after);
    let mut options = LoadOptions::default();
    options.look.light = Some(LightChoice::None);
    let (text, before, after) = converted(&path("in/s.toml"), &path("t.toml"), &options);
    assert_same(&text, &before, &after);
    assert!(!after.sky.unwrap().has_sun, "{text}");
}
