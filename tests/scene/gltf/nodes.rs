//! Nodes of glTF files, with their lights and cameras, and models in scene files.

use std::{f32::consts::PI, fs};

use glam::{Mat4, Quat, Vec3};
use kdray::scene::{Camera, Light, LoadOptions, Projection, Scene};
use serde_json::json;
use tempfile::TempDir;

use super::{agreement, corners, load, triangle};

#[test]
fn nodes_nest() {
    let mut model = triangle();
    let turn = Quat::from_rotation_z(0.5 * PI);
    model.json["nodes"] = json!([
        { "translation": [10, 0, 0], "children": [1] },
        { "rotation": turn.to_array(), "scale": [2, 3, 4], "children": [2] },
        { "matrix": Mat4::from_translation(Vec3::X).to_cols_array(), "mesh": 0 },
    ]);
    model.json["scenes"][0]["nodes"] = json!([0]);
    let [a, b, c] = corners(&model)[0];
    for (found, expected) in [(a, [10.0, 2.0, 0.0]), (b, [10.0, 4.0, 0.0]), (c, [7.0, 2.0, 0.0])] {
        assert!(found.distance(Vec3::from_array(expected)) < 1e-5, "{found} is not {expected:?}");
    }
}

#[test]
fn mirrored_and_sheared_meshes_keep_their_outside() {
    for transform in [
        json!({ "scale": [-1, 1, 1] }),
        json!({ "scale": [2, 3, -4] }),
        json!({ "scale": [-1, -1, -1] }),
        json!({ "scale": [1e-12, -1e-10, 1e-11] }),
        json!({ "matrix": [1, 0, 0, 0, 0.5, 1, 0, 0, 0.3, 3, 1, 0, 0, 0, 0, 1] }),
        json!({ "matrix": [1, 0, 2, 0, 0.5, 1, 7, 0, 0.3, 3, -1, 0, 0, 0, 0, 1] }),
    ] {
        let mut model = triangle();
        model.json["nodes"][0] = transform.clone();
        model.json["nodes"][0]["mesh"] = json!(0);
        // A second triangle keeps the scene large enough.
        model.root(json!({ "mesh": 0 }));
        assert!(agreement(&model) > 0.9999, "{transform}");
    }
}

#[test]
fn flattened_meshes_are_left_out() {
    let mut model = triangle();
    model.root(json!({ "mesh": 0, "scale": [1, 0, 1], "rotation": [0.6, 0, 0, 0.8] }));
    assert_eq!(model.scene().instances.len(), 1);
    model.json["nodes"][0]["scale"] = json!([0, 0, 0]);
    assert!(model.load().unwrap_err().contains("has no triangles"));
}

#[test]
fn a_scene_can_be_chosen() {
    let mut model = triangle();
    model.push("nodes", json!({ "mesh": 0, "translation": [5, 0, 0] }));
    model.push("scenes", json!({ "name": "second", "nodes": [1] }));
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("model.glb");
    fs::write(&path, model.glb()).unwrap();
    let load = |name: Option<&str>| {
        Scene::load_with(&path, &LoadOptions { scene: name.map(str::to_owned), ..LoadOptions::default() })
    };
    let x = |name| load(name).unwrap().bounds().0.x;
    assert_eq!([x(None), x(Some("0")), x(Some("1")), x(Some("second"))], [0.0, 0.0, 5.0, 5.0]);
    let error = load(Some("third")).unwrap_err().to_string();
    assert!(error.contains("there is no scene `third`, but 0, 1 `second`"), "{error}");
    model.json["scene"] = json!(1);
    assert_eq!(model.scene().bounds().0.x, 5.0);
    model.json.as_object_mut().unwrap().remove("scene");
    assert_eq!(model.scene().bounds().0.x, 0.0, "the first scene");
    model.json.as_object_mut().unwrap().remove("scenes");
    assert_eq!(model.scene().instances.len(), 2, "all nodes");
}

#[test]
fn scene_files_place_whole_models() {
    let mut model = triangle();
    model.push("materials", json!({ "name": "red", "pbrMetallicRoughness": { "baseColorFactor": [1, 0, 0, 1] } }));
    model.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    model.root(json!({ "mesh": 0, "translation": [0, 0, 1] }));
    let toml = "ambient = [0, 0, 0]\n[materials]\nown = {}\n[[mesh]]\nfile = 'm.glb'\n\
                transform = { translate = [5, 0, 0], scale = 2 }\n\
                [[mesh]]\nfile = 'm.glb'\nmaterial = 'own'\nsmooth = false\n";
    let found = load(&[("s.toml", toml.as_bytes()), ("m.glb", &model.glb())]).unwrap();
    assert_eq!(found.material_names, ["own", "red"]);
    assert_eq!(*found.triangle_materials, [1, 1, 0, 0]);
    assert_eq!(found.triangles[1].v1, Vec3::new(7.0, 0.0, 2.0));
    assert_ne!(found.triangles[1].n1, kdray::layout::FLAT_NORMAL);
    assert_eq!(found.triangles[3].n1, kdray::layout::FLAT_NORMAL);
    assert!(found.lights.is_empty());
    let missing = load(&[("s.toml", b"[[mesh]]\nfile = 'm.glb'\n"), ("m.glb", b"glTF\x02\0\0\0")]).unwrap_err();
    assert!(missing.to_string().contains("m.glb: "), "{missing}");
}

#[test]
fn punctual_lights_have_kdrays_units() {
    let mut model = triangle();
    let lights = json!([
        { "type": "point", "color": [1, 0.5, 0], "intensity": PI, "range": 3 },
        { "type": "directional", "intensity": 2.0 * PI },
        { "type": "spot", "intensity": PI, "spot": { "innerConeAngle": 0.25, "outerConeAngle": 0.5 } },
        { "type": "spot", "spot": {} },
    ]);
    model.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": lights } });
    model.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    for ix in 0..4 {
        let light = json!({ "KHR_lights_punctual": { "light": ix } });
        // The node turns -z to -x. Its scale changes nothing.
        let rotation = Quat::from_rotation_y(0.5 * PI).to_array();
        let node = json!({ "extensions": light, "translation": [1, 2, 3], "rotation": rotation, "scale": [3, 3, 3] });
        model.root(node);
    }
    let scene = model.scene();
    assert_eq!((scene.ambient, scene.background), (Vec3::ZERO, Vec3::ZERO));
    assert!(scene.defaults.is_metered, "the lights have physical units");
    let at = Vec3::new(1.0, 2.0, 3.0);
    let close = |a: Vec3, b: Vec3| assert!(a.distance(b) < 1e-6, "{a} is not {b}");
    let [
        Light::Point { position, intensity },
        Light::Directional { towards, irradiance },
        Light::Spot { position: spot_at, towards: axis, intensity: spot, inner_cos, outer_cos },
        Light::Spot { intensity: default, inner_cos: default_inner, outer_cos: default_outer, .. },
    ] = scene.lights[..]
    else {
        panic!("{:?}", scene.lights)
    };
    close(position, at);
    close(intensity, Vec3::new(1.0, 0.5, 0.0));
    close(towards, Vec3::X);
    close(irradiance, Vec3::splat(2.0));
    close(spot_at, at);
    close(axis, Vec3::NEG_X);
    close(spot, Vec3::ONE);
    assert_eq!((inner_cos, outer_cos), (0.25_f32.cos(), 0.5_f32.cos()));
    close(default, Vec3::splat(1.0 / PI));
    assert_eq!((default_inner, default_outer), (1.0, (0.25 * PI).cos()));
}

#[test]
fn a_file_without_lights_is_lit_even_if_a_surface_glows() {
    let mut model = triangle();
    let bare = model.scene();
    assert_eq!((bare.lights.len(), bare.defaults.is_metered), (2, false));
    model.push("materials", json!({ "emissiveFactor": [1, 1, 1] }));
    model.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    let scene = model.scene();
    assert_eq!((scene.lights, scene.ambient, scene.background), (bare.lights, bare.ambient, bare.background));
}

#[test]
fn cameras_look_at_the_scene() {
    let mut model = triangle();
    let perspective = json!({ "type": "perspective", "perspective": { "yfov": 0.5 * PI, "znear": 0.1 } });
    let parallel = json!({
        "name": "flat", "type": "orthographic",
        "orthographic": { "xmag": 2, "ymag": 4, "znear": 0, "zfar": 9 },
    });
    model.push("cameras", perspective);
    model.push("cameras", parallel);
    let frontal = model.scene().camera;
    assert!(model.scene().cameras.is_empty());
    model.root(json!({ "camera": 0, "translation": [0.5, 0.5, 4], "name": "front" }));
    model.root(json!({ "camera": 1, "translation": [0.5, 0.5, 4] }));
    let away = Quat::from_rotation_y(PI).to_array();
    model.root(json!({ "camera": 0, "translation": [0.5, 0.5, 4], "rotation": away }));
    model.root(json!({ "camera": 0, "scale": [0, 0, 0] }));
    let scene = model.scene();
    let names: Vec<_> = scene.cameras.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["front", "flat", "camera 3"]);
    let Camera { eye, target, up, projection } = scene.camera;
    assert_ne!(scene.camera, frontal);
    assert_eq!(scene.camera, scene.cameras[0].1);
    assert_eq!((eye, target, up), (Vec3::new(0.5, 0.5, 4.0), Vec3::new(0.5, 0.5, 0.0), Vec3::Y));
    let Projection::Perspective { vertical_fov_degrees } = projection else { panic!("{projection:?}") };
    assert!((vertical_fov_degrees - 90.0).abs() < 1e-4);
    // `ymag` is half of the height.
    assert_eq!(scene.cameras[1].1, Camera { projection: Projection::Orthographic { height: 8.0 }, ..scene.camera });
    assert!(scene.cameras[2].1.target.z > 4.1);
}
