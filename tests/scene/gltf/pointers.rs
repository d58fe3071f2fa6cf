//! Animations of cameras, lights and materials (KHR_animation_pointer), against closed forms.

use std::f32::consts::PI;

use glam::{Vec3, vec3};
use kdray::scene::{AnimationChoice, Camera, Light, LoadOptions, Projection, Scene};
use serde_json::{Value, json};

use super::{F32, Model, triangle};
use crate::{keys::check_worlds, materials::load_scene_with};

/// Lets the first animation drive what a pointer names, from 0 to 2 s.
fn drive(model: &mut Model, pointer: &str, kind: &str, values: &[f32]) {
    let input = model.accessor("SCALAR", F32, &[0.0_f32, 2.0]);
    let output = model.accessor(kind, F32, values);
    if model.json.get("animations").is_none() {
        model.push("animations", json!({ "name": "glow", "samplers": [], "channels": [] }));
    }
    let animation = &mut model.json["animations"][0];
    let list = |value: &mut Value, element: Value| {
        value.as_array_mut().unwrap().push(element);
        value.as_array().unwrap().len() - 1
    };
    let sampler = list(&mut animation["samplers"], json!({ "input": input, "output": output }));
    let target = json!({ "path": "pointer", "extensions": { "KHR_animation_pointer": { "pointer": pointer } } });
    list(&mut animation["channels"], json!({ "sampler": sampler, "target": target }));
}

/// A triangle with a material that shines, a perspective and an orthographic camera, a spot and a point light.
fn model() -> Model {
    let mut model = triangle();
    let strength = json!({ "KHR_materials_emissive_strength": { "emissiveStrength": 5 } });
    model.push("materials", json!({ "alphaMode": "BLEND", "emissiveFactor": [1, 1, 1], "extensions": strength }));
    model.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    model.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": 0.5, "znear": 0.1 } }));
    let orthographic = json!({ "xmag": 2, "ymag": 3, "znear": 0.1, "zfar": 9 });
    model.push("cameras", json!({ "type": "orthographic", "orthographic": orthographic }));
    let spot = json!({ "innerConeAngle": 0.1, "outerConeAngle": 0.9 });
    let lights = json!([{ "type": "spot", "intensity": PI, "spot": spot }, { "type": "point", "intensity": PI }]);
    model.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": lights } });
    for ix in 0..2 {
        model.root(json!({ "camera": ix, "translation": [0, 0, 5] }));
        let light = json!({ "KHR_lights_punctual": { "light": ix } });
        model.root(json!({ "translation": [0, 0, 2 + ix], "extensions": light }));
    }
    let used = ["KHR_animation_pointer", "KHR_lights_punctual", "KHR_materials_emissive_strength"];
    (model.json["extensionsUsed"], model.json["extensionsRequired"]) = (json!(used), json!(["KHR_animation_pointer"]));
    model
}

fn drive_cameras_and_lights(model: &mut Model) {
    drive(model, "/cameras/0/perspective/yfov", "SCALAR", &[0.4, 1.2]);
    drive(model, "/cameras/1/orthographic/ymag", "SCALAR", &[3.0, 4.0]);
    let light = |ix: usize, member: &str| format!("/extensions/KHR_lights_punctual/lights/{ix}/{member}");
    drive(model, &light(0, "color"), "VEC3", &[1.0, 0.0, 0.5, 0.0, 1.0, 0.5]);
    drive(model, &light(0, "spot/innerConeAngle"), "SCALAR", &[0.0, 0.8]);
    drive(model, &light(0, "spot/outerConeAngle"), "SCALAR", &[0.8, 1.2]);
    drive(model, &light(1, "intensity"), "SCALAR", &[0.0, 4.0 * PI]);
}

fn told_at(model: &Model, at: Option<f64>) -> (Scene, String) {
    let options = LoadOptions { at, animation: AnimationChoice::All, ..LoadOptions::default() };
    let (scene, told) = load_scene_with(&[("model.glb", &model.glb())], &options);
    (scene.unwrap_or_else(|error| panic!("{error}\n{}", model.json)), told.join("\n"))
}

fn is_near(a: f32, b: f32) -> bool {
    (a - b).abs() < 1e-5 * (1.0 + b.abs())
}

#[test]
fn cameras_lights_and_materials_are_driven() {
    let mut model = model();
    drive_cameras_and_lights(&mut model);
    drive(
        &mut model,
        "/materials/0/pbrMetallicRoughness/baseColorFactor",
        "VEC4",
        &[0.0, 0.2, 1.0, 0.5, 1.0, 0.2, 0.0, 1.0],
    );
    drive(&mut model, "/materials/0/emissiveFactor", "VEC3", &[0.0, 0.5, 1.0, 1.0, 0.5, 0.0]);
    let strength = "/materials/0/extensions/KHR_materials_emissive_strength/emissiveStrength";
    drive(&mut model, strength, "SCALAR", &[2.0, 10.0]);
    for (at, share) in [(-1.0, 0.0_f32), (0.0, 0.0), (0.5, 0.25), (1.5, 0.75), (2.0, 1.0), (9.0, 1.0)] {
        let (scene, told) = told_at(&model, Some(at));
        assert_eq!(told, "", "{at}");
        let projections = [0, 1].map(|ix| scene.cameras[ix].1.projection);
        let Projection::Perspective { vertical_fov_degrees } = projections[0] else { panic!("a perspective") };
        assert!(is_near(vertical_fov_degrees, (0.4 + 0.8 * share).to_degrees()), "{at}: {vertical_fov_degrees}");
        let Projection::Orthographic { height } = projections[1] else { panic!("no perspective") };
        assert!(is_near(height, 2.0 * (3.0 + share)), "{at}: {height}");
        let Light::Spot { intensity, inner_cos, outer_cos, .. } = scene.lights[0] else { panic!("a spot light") };
        assert!(intensity.distance(vec3(1.0 - share, share, 0.5)) < 1e-5, "{at}: {intensity}");
        assert!(is_near(inner_cos, (0.8 * share).cos()) && is_near(outer_cos, (0.8 + 0.4 * share).cos()), "{at}");
        let Light::Point { intensity, .. } = scene.lights[1] else { panic!("a point light") };
        assert!(intensity.distance(Vec3::splat(4.0 * share)) < 1e-5, "{at}: {intensity}");
        let material = &scene.materials[0];
        assert!(material.kd.distance(vec3(share, 0.2, 1.0 - share)) < 1e-5, "{at}: {}", material.kd);
        assert!(is_near(material.d, 0.5 + 0.5 * share), "{at}: {}", material.d);
        let ke = (2.0 + 8.0 * share) * vec3(share, 0.5, 1.0 - share);
        assert!(material.ke.distance(ke) < 1e-4, "{at}: {}", material.ke);
    }
    let (rest, told) = told_at(&model, None);
    assert!(told.contains("animations, which --at SECONDS shows: glow"), "{told}");
    assert_eq!(rest.materials[0].ke, Vec3::splat(5.0));
    let info = &rest.animations[0];
    assert_eq!((info.begin, info.end, info.n_moved, info.n_changed), (0.0, 2.0, 0, 5));
}

#[test]
fn pointers_to_nodes_are_channels_of_nodes() {
    let mut model = model();
    drive(&mut model, "/nodes/0/translation", "VEC3", &[0.0, 0.0, 0.0, 4.0, 2.0, 0.0]);
    let (scene, told) = told_at(&model, Some(0.5));
    assert_eq!((scene.instances[0].transform.point(Vec3::ZERO), told.as_str()), (vec3(1.0, 0.5, 0.0), ""));
}

/// One warning names all that is not shown. What is wrong is left out.
#[test]
fn other_pointers_and_wrong_ones_are_told() {
    let mut other = model();
    drive_cameras_and_lights(&mut other);
    drive(&mut other, "/materials/0/pbrMetallicRoughness/roughnessFactor", "SCALAR", &[0.0, 1.0]);
    for ix in 0..9 {
        drive(&mut other, &format!("/nodes/{ix}/extensions/KHR_node_visibility/visible"), "SCALAR", &[0.0, 1.0]);
    }
    let (_, told) = told_at(&other, Some(1.0));
    assert!(
        told.contains("stay as the file has them at rest: /materials/0/pbrMetallicRoughness/roughnessFactor, /nodes/0")
    );
    assert!(told.contains("KHR_node_visibility/visible and 2 more") && told.lines().count() == 1, "{told}");

    for (pointer, values, expected) in [
        ("/cameras/7/perspective/yfov", &[1.0, 1.0][..], "there is no cameras[7]"),
        ("/cameras/1/perspective/yfov", &[1.0, 1.0], "missing field"),
        ("/materials/3/emissiveFactor", &[1.0; 6], "there is no materials[3]"),
        ("/extensions/KHR_lights_punctual/lights/9/intensity", &[1.0; 2], "there is no lights[9]"),
        ("/cameras/0/perspective/yfov", &[1.0], "2 keys have 1 values"),
        ("/cameras/0/perspective/yfov", &[9.0, 9.0], "perspective.yfov"),
    ] {
        let mut model = model();
        drive(&mut model, pointer, if values.len() == 6 { "VEC3" } else { "SCALAR" }, values);
        let (scene, told) = told_at(&model, Some(1.0));
        assert!(told.contains(expected) && told.lines().count() == 1, "{pointer}: {told}");
        assert!(!scene.cameras.is_empty());
    }
    let mut twice = model();
    drive(&mut twice, "/cameras/0/perspective/yfov", "SCALAR", &[1.0, 1.0]);
    drive(&mut twice, "/cameras/0/perspective/yfov", "SCALAR", &[0.5, 0.5]);
    let (scene, told) = told_at(&twice, Some(1.0));
    let Camera { projection: Projection::Perspective { vertical_fov_degrees }, .. } = scene.cameras[0].1 else {
        panic!("a perspective")
    };
    assert!(told.contains("that an earlier one drives, which counts: /cameras/0/perspective/yfov in `glow`"), "{told}");
    assert!(is_near(vertical_fov_degrees, 1.0_f32.to_degrees()));
}

/// In a film, the file is posed, or read again if materials change.
#[test]
fn the_worlds_of_pointers_are_those_of_scenes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.glb");
    let mut model = model();
    drive_cameras_and_lights(&mut model);
    std::fs::write(&path, model.glb()).unwrap();
    check_worlds(&path, true, false);
    drive(&mut model, "/materials/0/emissiveFactor", "VEC3", &[0.0, 0.5, 1.0, 1.0, 0.5, 0.0]);
    std::fs::write(&path, model.glb()).unwrap();
    check_worlds(&path, true, false);
}
