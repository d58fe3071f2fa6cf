//! Animations of glTF files at a time, against closed forms.

use glam::{Quat, Vec3};
use kdray::{
    accel::kdtree::BuildOptions,
    engine::{AnimatedWorld, LoadRequest, Opened},
    scene::{AnimationChoice, LoadOptions, PictureChoices, Scene},
    world::{FlatScene, World},
};
use serde_json::{Value, json};

use super::{F32, I16, Model, U8, triangle};
use crate::{flattened, materials::load_scene_with};

/// Adds an animation of one channel, and returns its index. `keys`: times and values.
fn animate<T: bytemuck::Pod>(
    model: &mut Model,
    (node, path): (usize, &str),
    interpolation: &str,
    times: &[f32],
    (kind, component, values): (&str, u32, &[T]),
) -> usize {
    let input = model.accessor("SCALAR", F32, times);
    let output = model.accessor(kind, component, values);
    let sampler = json!({ "input": input, "output": output, "interpolation": interpolation });
    let channel = json!({ "sampler": 0, "target": { "node": node, "path": path } });
    model.push("animations", json!({ "samplers": [sampler], "channels": [channel] }))
}

fn told_at(model: &Model, at: f64, animation: AnimationChoice) -> (Result<Scene, String>, String) {
    let options = LoadOptions { at: Some(at), animation, ..LoadOptions::default() };
    let (scene, told) = load_scene_with(&[("model.glb", &model.glb())], &options);
    (scene.map_err(|error| error.to_string()), told.join("\n"))
}

fn scene_at(model: &Model, at: f64) -> Scene {
    let (scene, told) = told_at(model, at, AnimationChoice::All);
    assert_eq!(told, "", "{}", model.json);
    scene.unwrap_or_else(|error| panic!("{error}\n{}", model.json))
}

/// Returns the corners of the first triangle at a time.
fn corners_at(model: &Model, at: f64) -> [Vec3; 3] {
    let t = flattened(&scene_at(model, at)).triangles[0];
    [t.v0, t.v1, t.v2]
}

fn assert_near(found: Vec3, expected: Vec3, what: &str) {
    assert!((found - expected).length() < 1e-6 * (1.0 + expected.length()), "{what}: {found}, not {expected}");
}

#[test]
fn values_between_keys_are_on_lines_steps_and_splines() {
    let positions = [[1.0_f32, 0.0, 0.0], [3.0, 4.0, 0.0], [3.0, 4.0, 8.0]];
    let times = [0.5, 1.5, 3.5];
    for (at, linear, step) in [
        (-9.0, [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
        (0.0, [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
        (0.5, [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
        (0.75, [1.5, 1.0, 0.0], [1.0, 0.0, 0.0]),
        (1.5, [3.0, 4.0, 0.0], [3.0, 4.0, 0.0]),
        (3.0, [3.0, 4.0, 6.0], [3.0, 4.0, 0.0]),
        (3.5, [3.0, 4.0, 8.0], [3.0, 4.0, 8.0]),
        (99.0, [3.0, 4.0, 8.0], [3.0, 4.0, 8.0]),
    ] {
        for (interpolation, expected) in [("LINEAR", linear), ("STEP", step)] {
            let mut model = triangle();
            let values = ("VEC3", F32, positions.as_flattened());
            animate(&mut model, (0, "translation"), interpolation, &times, values);
            assert_near(corners_at(&model, at)[0], expected.into(), &format!("{interpolation} at {at}"));
        }
    }
    // Without an interpolation, values are on lines. Without a time, the node is where the file has it.
    let mut model = triangle();
    animate(&mut model, (0, "translation"), "LINEAR", &times, ("VEC3", F32, positions.as_flattened()));
    model.json["animations"][0]["samplers"][0].as_object_mut().unwrap().remove("interpolation");
    assert_near(corners_at(&model, 0.75)[0], Vec3::new(1.5, 1.0, 0.0), "default");
    let (scene, told) = model.told();
    assert_eq!(flattened(&scene).triangles[0].v0, Vec3::ZERO);
    assert!(told.contains("animations, which --at SECONDS shows: animations[0]"), "{told}");
}

/// A cubic spline through t^3 - 2 t + 1 and its slope is this polynomial, if tangents are slopes times the time between
/// keys. The keys are unevenly apart.
#[test]
fn cubic_splines_are_polynomials() {
    let value = |t: f32| t * t * t - 2.0 * t + 1.0;
    let slope = |t: f32| 3.0 * t * t - 2.0;
    let times = [0.25_f32, 1.0, 3.0];
    let keys = times.map(|t| [[slope(t); 3], [value(t); 3], [slope(t); 3]]);
    let mut model = triangle();
    let values = ("VEC3", F32, keys.as_flattened().as_flattened());
    animate(&mut model, (0, "translation"), "CUBICSPLINE", &times, values);
    for at in [0.25_f32, 0.4, 0.99, 1.0, 1.7, 2.9, 3.0] {
        assert_near(corners_at(&model, f64::from(at))[0], Vec3::splat(value(at)), &format!("at {at}"));
    }
    assert_near(corners_at(&model, 7.0)[0], Vec3::splat(value(3.0)), "behind the last key");
}

#[test]
fn rotations_take_the_shorter_way_and_have_unit_length() {
    let about_z = |degrees: f32| Quat::from_rotation_z(degrees.to_radians());
    let at = |keys: [Quat; 2], at: f64| {
        let mut model = triangle();
        let values: Vec<f32> = keys.iter().flat_map(|key| key.to_array()).collect();
        animate(&mut model, (0, "rotation"), "LINEAR", &[0.0, 1.0], ("VEC4", F32, &values));
        corners_at(&model, at)[1]
    };
    let expected = |degrees: f32| about_z(degrees) * Vec3::X;
    assert_near(at([about_z(10.0), about_z(130.0)], 0.25), expected(40.0), "a quarter of the way");
    // The same turn, by the quaternion of the opposite sign.
    assert_near(at([about_z(10.0), -about_z(130.0)], 0.25), expected(40.0), "opposite signs");
    assert_near(at([about_z(10.0) * 7.0, about_z(130.0) * 0.01], 0.5), expected(70.0), "no unit lengths");
    // Normalized integers: 90 degrees are 0.7071.
    let mut model = triangle();
    let values = [0_i16, 0, 0, i16::MAX, 0, 0, 23_170, 23_170];
    animate(&mut model, (0, "rotation"), "LINEAR", &[0.0, 2.0], ("VEC4", I16, &values));
    let output = model.json["animations"][0]["samplers"][0]["output"].as_u64().unwrap() as usize;
    model.json["accessors"][output]["normalized"] = json!(true);
    assert_near(corners_at(&model, 1.0)[1], expected(45.0), "integers");
}

#[test]
fn weights_have_a_number_for_each_target() {
    let mut model = triangle();
    let mut target = |v: [f32; 3]| model.accessor("VEC3", F32, &[v; 3].concat());
    let targets = [target([1.0, 0.0, 0.0]), target([0.0, 10.0, 0.0])].map(|it| json!({ "POSITION": it }));
    model.json["meshes"][0]["primitives"][0]["targets"] = json!(targets);
    let weights = [0.0_f32, 1.0, 2.0, 0.0, 2.0, 8.0];
    animate(&mut model, (0, "weights"), "LINEAR", &[0.0, 1.0, 2.0], ("SCALAR", F32, &weights));
    assert_near(corners_at(&model, 0.5)[0], Vec3::new(1.0, 5.0, 0.0), "between the first two");
    assert_near(corners_at(&model, 1.25)[0], Vec3::new(2.0, 20.0, 0.0), "between the last two");
    assert!(model.scene().meshes[0].deforms);
}

/// A chain of two joints, of which the second turns, and a mirrored parent of the mesh, which has no effect on it.
#[test]
fn skins_follow_their_joints() {
    let mut model = triangle();
    let joints = model.accessor("VEC4", U8, &[[1_u8, 0, 0, 0]; 3].concat());
    let weights = model.accessor("VEC4", F32, &[[1.0_f32, 0.0, 0.0, 0.0]; 3].concat());
    let attributes = &mut model.json["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    model.json["nodes"][0] = json!({ "mesh": 0, "skin": 0, "translation": [50, 0, 0] });
    // Joint 0 stands at (0, 0, 10), and joint 1, which is listed before it, at (0, 5, 0) from there.
    model.push("nodes", json!({ "translation": [0, 5, 0] }));
    model.root(json!({ "translation": [0, 0, 10], "children": [1] }));
    model.push("skins", json!({ "joints": [2, 1] }));
    let turn = [Quat::IDENTITY, Quat::from_rotation_z(std::f32::consts::FRAC_PI_2)];
    let values: Vec<f32> = turn.iter().flat_map(|key| key.to_array()).collect();
    animate(&mut model, (1, "rotation"), "LINEAR", &[0.0, 1.0], ("VEC4", F32, &values));
    animate(&mut model, (0, "translation"), "STEP", &[0.0], ("VEC3", F32, &[70.0_f32, 0.0, 0.0]));
    assert!(model.scene().meshes[0].deforms);
    let corners = corners_at(&model, 1.0);
    assert_near(corners[0], Vec3::new(0.0, 5.0, 10.0), "the joint");
    assert_near(corners[1], Vec3::new(0.0, 6.0, 10.0), "x has become y");
    assert_near(corners[2], Vec3::new(-1.0, 5.0, 10.0), "y has become -x");
}

#[test]
fn animations_play_together_and_the_first_counts() {
    let mut model = triangle();
    model.root(json!({ "mesh": 0 }));
    let place = |x: f32| [x, 0.0, 0.0];
    animate(&mut model, (0, "translation"), "STEP", &[0.0], ("VEC3", F32, &place(1.0)));
    animate(&mut model, (1, "translation"), "STEP", &[0.0], ("VEC3", F32, &place(2.0)));
    let later = animate(&mut model, (0, "translation"), "STEP", &[0.0], ("VEC3", F32, &place(3.0)));
    model.json["animations"][later]["name"] = json!("later");
    animate(&mut model, (0, "scale"), "STEP", &[0.0], ("VEC3", F32, &[2.0_f32; 3]));
    let places = |choice: AnimationChoice| {
        let (scene, told) = told_at(&model, 0.0, choice);
        (scene.map(|scene| flattened(&scene).triangles.iter().map(|t| t.v1.x).collect::<Vec<_>>()), told)
    };
    let (all, told) = places(AnimationChoice::All);
    assert_eq!(all, Ok(vec![3.0, 3.0]));
    assert!(told.contains("that an earlier one drives, which counts: translation of nodes[0] in `later`"), "{told}");
    assert_eq!(places(AnimationChoice::Named("later".into())), (Ok(vec![4.0, 1.0]), String::new()));
    assert_eq!(places(AnimationChoice::Named("1".into())), (Ok(vec![1.0, 3.0]), String::new()));
    assert_eq!(places(AnimationChoice::None), (Ok(vec![1.0, 1.0]), String::new()));
    let error = places(AnimationChoice::Named("walk".into())).0.unwrap_err();
    assert!(error.contains("there is no animation `walk`, but 0 `animations[0]`") && error.contains("2 `later`"));
    let infos = scene_at_any(&model).animations;
    assert_eq!((infos.len(), infos[2].name.as_str(), infos[2].n_moved), (4, "later", 1));
}

fn scene_at_any(model: &Model) -> Scene {
    model.told().0
}

#[test]
fn times_of_animations_are_known() {
    let mut model = triangle();
    let times: Vec<f32> = (0..31).map(|ix| 1.0 + ix as f32 / 30.0).collect();
    let values = vec![0.5_f32; 93];
    animate(&mut model, (0, "translation"), "LINEAR", &times, ("VEC3", F32, &values));
    animate(&mut model, (0, "scale"), "LINEAR", &[0.0, 7.5], ("VEC3", F32, &[1.0_f32; 6]));
    let infos = scene_at_any(&model).animations;
    assert_eq!((infos[0].begin, infos[0].end, infos[0].fps), (1.0, 2.0, Some(30.0)));
    assert_eq!((infos[1].begin, infos[1].end, infos[1].fps), (0.0, 7.5, None));
}

/// Moves a matrix apart, whose other parts stay.
#[test]
fn nodes_with_matrices_keep_what_is_not_driven() {
    let mut model = triangle();
    model.json["nodes"][0]["matrix"] = json!([0, 2, 0, 0, -2, 0, 0, 0, 0, 0, 2, 0, 5, 6, 7, 1]);
    animate(&mut model, (0, "translation"), "STEP", &[0.0], ("VEC3", F32, &[1.0_f32, 0.0, 0.0]));
    let corners = corners_at(&model, 0.0);
    assert_near(corners[0], Vec3::X, "the place");
    assert_near(corners[1], Vec3::new(1.0, 2.0, 0.0), "turned and doubled");
}

#[test]
fn channels_that_are_wrong_are_left_out() {
    type Wrong = (&'static str, fn(&mut Model));
    fn sampler(model: &mut Model) -> &mut Value {
        &mut model.json["animations"][0]["samplers"][0]
    }
    let wrong: [Wrong; 9] = [
        ("the time 2 s of a key is not before that of the next, 1 s", |m| {
            let input = m.accessor("SCALAR", F32, &[2.0_f32, 1.0]);
            sampler(m)["input"] = json!(input);
        }),
        ("the time 1 s of a key is not before that of the next, 1 s", |m| {
            let input = m.accessor("SCALAR", F32, &[1.0_f32, 1.0]);
            sampler(m)["input"] = json!(input);
        }),
        ("is [NaN], which is not finite", |m| {
            let input = m.accessor("SCALAR", F32, &[0.0_f32, f32::NAN]);
            sampler(m)["input"] = json!(input);
        }),
        ("has no keys", |m| {
            let input = m.accessor("SCALAR", F32, &[0.0_f32; 0]);
            m.json["accessors"][input]["count"] = json!(0);
            sampler(m)["input"] = json!(input);
        }),
        ("2 keys have 1 values", |m| {
            let output = m.accessor("VEC3", F32, &[0.0_f32; 3]);
            sampler(m)["output"] = json!(output);
        }),
        ("2 keys have 0 values", |m| sampler(m)["interpolation"] = json!("CUBICSPLINE")),
        ("its type must be one of [Vec3]", |m| {
            let output = m.accessor("VEC4", F32, &[0.0_f32; 8]);
            sampler(m)["output"] = json!(output);
        }),
        ("there is no such sampler", |m| m.json["animations"][0]["channels"][0]["sampler"] = json!(4)),
        ("there is no nodes[8]", |m| m.json["animations"][0]["channels"][0]["target"]["node"] = json!(8)),
    ];
    for (expected, change) in wrong {
        let mut model = triangle();
        animate(&mut model, (0, "translation"), "LINEAR", &[0.0, 1.0], ("VEC3", F32, &[9.0_f32; 6]));
        change(&mut model);
        let (scene, told) = told_at(&model, 0.5, AnimationChoice::All);
        assert!(told.contains(expected) && told.contains("animations[0].channels[0]"), "{told}, not {expected}");
        assert_eq!(flattened(&scene.unwrap()).triangles[0].v0, Vec3::ZERO, "{expected}: the rest is shown");
    }
    // A rotation of length 0, in mid-animation.
    let mut model = triangle();
    animate(&mut model, (0, "rotation"), "LINEAR", &[0.0, 1.0], ("VEC4", F32, &[0.0_f32; 8]));
    let told = told_at(&model, 0.5, AnimationChoice::All).1;
    assert!(told.contains("a rotation is [0.0, 0.0, 0.0, 0.0]"), "{told}");
}

/// A skin that bends, a mesh that grows, one that moves, one that vanishes for a moment, a camera and a light that
/// move. The worlds of the file are those of its scenes, in whatever order the moments come; what does not change is
/// shared.
#[test]
fn the_worlds_of_a_file_are_those_of_its_scenes() {
    let mut model = triangle();
    let primitive = model.json["meshes"][0]["primitives"][0].clone();
    let mut target = primitive.clone();
    let added = model.accessor("VEC3", F32, &[[0.0_f32, 0.0, 1.0]; 3].concat());
    target["targets"] = json!([{ "POSITION": added }]);
    let grows = model.show(target);
    model.json["nodes"][grows]["translation"] = json!([-3, 0, 0]);
    let mut skinned = primitive.clone();
    skinned["attributes"]["JOINTS_0"] = json!(model.accessor("VEC4", U8, &[0_u8, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0]));
    skinned["attributes"]["WEIGHTS_0"] = json!(model.accessor("VEC4", F32, &[[1.0_f32, 0.0, 0.0, 0.0]; 3].concat()));
    let bends = model.show(skinned);
    model.json["nodes"][bends]["skin"] = json!(0);
    let joints = [model.root(json!({ "translation": [3, 0, 0] })), model.root(json!({ "translation": [3, 0, 0] }))];
    model.push("skins", json!({ "joints": joints }));
    let vanishes = model.root(json!({ "mesh": 0, "translation": [0, 3, 0] }));
    model.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1 } }));
    let camera = model.root(json!({ "camera": 0, "translation": [0, 0, 12] }));
    model.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    model.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "point", "intensity": 900 }] } });
    let light = model.root(json!({ "extensions": { "KHR_lights_punctual": { "light": 0 } } }));
    let line = [0.0_f32, 1.0, 8.0, 0.0, 2.0, 12.0];
    animate(&mut model, (0, "translation"), "LINEAR", &[0.0, 4.0], ("VEC3", F32, &line));
    let scales = [1.0_f32, 1.0, 1.0, 0.0, 1.0, 0.0, 1.0, 1.0, 1.0];
    animate(&mut model, (vanishes, "scale"), "STEP", &[0.0, 2.5, 3.5], ("VEC3", F32, &scales));
    animate(
        &mut model,
        (camera, "translation"),
        "LINEAR",
        &[0.0, 4.0],
        ("VEC3", F32, &[0.0_f32, 0.0, 12.0, 1.0, 1.0, 9.0]),
    );
    let moves_only = model.clone();
    animate(&mut model, (light, "translation"), "LINEAR", &[0.0, 4.0], ("VEC3", F32, &line));
    animate(&mut model, (grows, "weights"), "LINEAR", &[0.0, 4.0], ("SCALAR", F32, &[0.0_f32, 2.0]));
    let turn = [Quat::IDENTITY, Quat::from_rotation_z(1.0)].map(|key| key.to_array()).concat();
    animate(&mut model, (joints[1], "rotation"), "LINEAR", &[0.0, 4.0], ("VEC4", F32, &turn));
    let folder = tempfile::tempdir().unwrap();
    for (model, keeps, shares) in [(&model, true, false), (&model, false, false), (&moves_only, true, true)] {
        let path = folder.path().join("model.glb");
        std::fs::write(&path, model.glb()).unwrap();
        let request = |at: f64| {
            let mut request = LoadRequest::pictures(PictureChoices::default());
            request.scene.at = Some(at);
            request
        };
        let world_at = |at: f64| {
            let scene = Opened::read(path.as_path(), &request(at)).unwrap().scene;
            let flat = if keeps { FlatScene::with_instances(&scene) } else { FlatScene::new(&scene) };
            (World::of_flat(flat.unwrap(), &BuildOptions::default()).unwrap(), scene)
        };
        let (first, scene) = world_at(1.0);
        let mut animated = AnimatedWorld::new(&path, &request(1.0), scene, &first);
        let mut before = first;
        let mut shown = 1.0;
        for at in [2.0, 1.0, 3.0, 3.9, 3.9, 0.25] {
            let ((found, camera), (expected, scene)) = (animated.at(at).unwrap(), world_at(at));
            assert!(
                *found.scene() == FlatScene { camera: found.scene().camera, ..expected.scene().clone() },
                "at {at}"
            );
            assert!(found.accel() == expected.accel(), "at {at}");
            assert_eq!(camera, scene.camera, "at {at}");
            // At 3 s a mesh has vanished, so the whole world is another one.
            if at != 3.0 {
                let is_same = keeps && at == shown;
                assert_eq!(found.shares_geometries(&before), shares || is_same, "at {at}");
                shown = at;
                before = found;
            }
        }
    }
}

/// A target that cannot be read where it has a weight, and a joint that takes a mesh away from the world for a moment.
/// What is read once for all moments shows what reading the file at each moment shows.
#[test]
fn broken_moments_are_those_of_the_file() {
    let mut model = triangle();
    let added = model.accessor("VEC3", F32, &[[0.0_f32, 0.0, 1.0]; 3].concat());
    let broken = model.accessor("VEC3", F32, &[0.0_f32, 1.0, 0.0, f32::NAN, 0.0, 0.0, 0.0, 2.0, 0.0]);
    let primitive = model.json["meshes"][0]["primitives"][0].clone();
    let mut skinned = primitive.clone();
    skinned["attributes"]["JOINTS_0"] = json!(model.accessor("VEC4", U8, &[0_u8; 12]));
    skinned["attributes"]["WEIGHTS_0"] = json!(model.accessor("VEC4", F32, &[[1.0_f32, 0.0, 0.0, 0.0]; 3].concat()));
    let vanishes = model.show(skinned);
    model.json["nodes"][vanishes]["skin"] = json!(0);
    let joint = model.root(json!({ "translation": [3, 0, 0] }));
    model.push("skins", json!({ "joints": [joint] }));
    model.json["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": added }, { "POSITION": broken }]);
    let weights = [1.0_f32, 0.0, 1.0, 0.0, 0.5, 1.0, 2.0, 0.0];
    animate(&mut model, (0, "weights"), "LINEAR", &[0.0, 1.0, 2.0, 3.0], ("SCALAR", F32, &weights));
    let scales = [1.0_f32, 1.0, 1.0, 1e30, 1e30, 1e30, 1.0, 1.0, 1.0];
    animate(&mut model, (joint, "scale"), "STEP", &[0.0, 1.0, 2.0], ("VEC3", F32, &scales));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.glb");
    std::fs::write(&path, model.glb()).unwrap();
    let world_at = |at: f64| {
        let mut request = LoadRequest::pictures(PictureChoices::default());
        request.scene.at = Some(at);
        let scene = Opened::read(path.as_path(), &request).unwrap().scene;
        let flat = FlatScene::with_instances(&scene).unwrap();
        (World::of_flat(flat, &BuildOptions::default()).unwrap(), scene, request)
    };
    let (first, scene, request) = world_at(0.0);
    let mut animated = AnimatedWorld::new(&path, &request, scene, &first);
    for (at, n_instances) in [(0.5, 2), (1.5, 1), (2.0, 2), (2.5, 2), (0.25, 2)] {
        let (found, expected) = (animated.at(at).unwrap().0, world_at(at).0);
        assert_eq!(expected.scene().instances.as_ref().map(|it| it.list.len()), Some(n_instances), "at {at}");
        assert_eq!(found.scene().instances.as_ref().map(|it| it.list.len()), Some(n_instances), "at {at}");
        assert!(found.scene().triangles == expected.scene().triangles, "at {at}");
    }
}
