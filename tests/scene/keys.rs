//! Keys of scene files: meshes, lights and cameras at a time, against closed forms and scenes that do not move.

use std::{fs, path::Path};

use glam::{Quat, Vec3, vec3};
use kdray::{
    accel::kdtree::BuildOptions,
    engine::{AnimatedWorld, LoadRequest, Opened},
    pack::pack,
    scene::{AnimationChoice, Light, LoadOptions, PictureChoices, Scene, animations_of},
    world::{FlatScene, World},
};

use super::{gltf::moving_triangle, materials::load_scene_with, support::arrays::npy};

/// What the files beside a scene file hold: two places of a mesh, and a triangle that moves by (1, 2, 12) in 4 s.
fn beside() -> [(&'static str, Vec<u8>); 2] {
    let place = |x: f32| [1.0, 0.0, 0.0, x, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let places = [place(3.0), place(-3.0)].concat();
    [("places.npy", npy(&[2, 3, 4], npyz::Order::C, &places)), ("moving.glb", moving_triangle())]
}

fn try_at(text: &str, at: Option<f64>, animation: AnimationChoice) -> Result<Scene, String> {
    let options = LoadOptions { at, animation, ..LoadOptions::default() };
    let beside = beside();
    let files: Vec<(&str, &[u8])> =
        [("s.toml", text.as_bytes())].into_iter().chain(beside.iter().map(|it| (it.0, &it.1[..]))).collect();
    let (scene, told) = load_scene_with(&files, &options);
    let without_time = at.is_none() && animations_are_told(&told);
    assert!(told.is_empty() || without_time, "{told:?}");
    scene.map_err(|error| error.to_string())
}

fn animations_are_told(told: &[String]) -> bool {
    told.iter().all(|line| line.contains("animations, which --at SECONDS shows"))
}

/// Returns a scene at a time, without what is known of its animations.
fn at(text: &str, at: Option<f64>) -> Scene {
    let mut scene = try_at(text, at, AnimationChoice::All).unwrap_or_else(|error| panic!("{error}\n{text}"));
    scene.animations.clear();
    scene
}

fn mesh(rest: &str) -> String {
    let camera = "[camera]\neye = [1, 2, 30]\ntarget = [0, 0, 0]\n";
    format!("{camera}[[mesh]]\ngenerator = 'disc'\nradius = 1.5\nsegments = 8\n{rest}\n")
}

fn corners(scene: &Scene) -> Vec<Vec3> {
    FlatScene::new(scene).unwrap().triangles.iter().flat_map(|t| [t.v0, t.v1, t.v2]).collect()
}

/// A scene at a time is the same, bit for bit, as one that does not move.
#[test]
fn meshes_are_where_their_keys_say() {
    let keys = "keys = [{ time = 1, translate = [0, 1, 0.5], scale = 2 }, \
                { time = 3.0, translate = [8, 1, 0.5], scale = [2, 4, 6], rotate = [10, 20, 30] }, \
                { time = 4, translate = [8, 2, 0.1] }]";
    for (time, transform) in [
        (-1e9, "translate = [0, 1, 0.5], scale = 2, rotate = [10, 20, 30]"),
        (1.0, "translate = [0, 1, 0.5], scale = 2, rotate = [10, 20, 30]"),
        (1.5, "translate = [2, 1, 0.5], scale = [2, 2.5, 3], rotate = [10, 20, 30]"),
        (3.0, "translate = [8, 1, 0.5], scale = [2, 4, 6], rotate = [10, 20, 30]"),
        (4.0, "translate = [8, 2, 0.1], scale = [2, 4, 6], rotate = [10, 20, 30]"),
        (1e9, "translate = [8, 2, 0.1], scale = [2, 4, 6], rotate = [10, 20, 30]"),
    ] {
        for more in ["", "instances = 'places.npy'\n"] {
            let stated = mesh(&format!("{more}transform = {{ {transform} }}"));
            let found = at(&mesh(&format!("{more}{keys}")), Some(time));
            assert!(found == at(&stated, None), "{time}: {found:?}");
        }
    }
    // A single key holds at all times. What no key states is that of the table, which counts at rest.
    let one = mesh("transform = { scale = 3, translate = [1, 1, 1] }\nkeys = [{ time = 2, translate = [5, 0, 0] }]");
    let moved = at(&mesh("transform = { scale = 3, translate = [5, 0, 0] }"), None);
    assert!([0.0, 2.0, 9.0].iter().all(|time| at(&one, Some(*time)) == moved));
    assert!(at(&one, None) == at(&mesh("transform = { scale = 3, translate = [1, 1, 1] }"), None));
    assert!(try_at(&one, Some(2.0), AnimationChoice::None).unwrap().instances == at(&one, None).instances);
    // Where the table states nothing, the first key counts at rest.
    assert!(at(&mesh(keys), None) == at(&mesh(keys), Some(0.0)));
}

#[test]
fn rotations_take_the_shorter_turn() {
    for (keys, time, degrees) in [
        ("{ axis = [0, 3, 0], angle = 10 }|{ axis = [0, 1, 0], angle = 130 }", 0.25, 40.0),
        // Quaternions of opposite signs.
        ("{ axis = [0, 1, 0], angle = 10 }|{ axis = [0, 1, 0], angle = 350 }", 0.5, 0.0),
        ("[0, 350, 0]|{ axis = [0, -1, 0], angle = 350 }", 0.75, 5.0),
        ("[0, 70, 0]|{ axis = [0, 1, 0], angle = 430 }", 0.5, 70.0),
    ] {
        let (a, b) = keys.split_once('|').unwrap();
        let scene =
            at(&mesh(&format!("keys = [{{ time = 0, rotate = {a} }}, {{ time = 1, rotate = {b} }}]")), Some(time));
        let turn = Quat::from_rotation_y(f32::to_radians(degrees));
        for (found, still) in corners(&scene).into_iter().zip(corners(&at(&mesh(""), None))) {
            assert!(found.distance(turn * still) < 2e-6, "{keys}: {found}, not {}", turn * still);
        }
    }
}

#[test]
fn lights_change_by_their_keys() {
    let scene = |light: &str| mesh("") + "[[light]]\n" + light;
    let still = |light: &str| at(&scene(light), None).lights[0];
    let point = scene(
        "kind = 'point'\nposition = [0, 5, 0]\nkeys = [{ time = 0, intensity = [8, 8, 8] }, \
         { time = 1, position = [1, 2, 3] }, { time = 2, intensity = [0, 4, 8], position = [3, 2, 1] }]\n",
    );
    for (time, position, intensity) in [
        (None, "[0, 5, 0]", "[8, 8, 8]"),
        (Some(-1.0), "[1, 2, 3]", "[8, 8, 8]"),
        (Some(1.5), "[2, 2, 2]", "[2, 5, 8]"),
        (Some(7.0), "[3, 2, 1]", "[0, 4, 8]"),
    ] {
        let expected = still(&format!("kind = 'point'\nposition = {position}\nintensity = {intensity}\n"));
        assert_eq!(at(&point, time).lights, [expected], "{time:?}");
    }
    let spot = |angle: f64, direction: &str| {
        format!(
            "kind = 'spot'\nposition = [0, 5, 0]\nintensity = [1, 1, 1]\ndirection = {direction}\n\
             inner_angle = {angle}\nouter_angle = 60\n"
        )
    };
    let keys =
        "keys = [{ time = 0, direction = [1, -1, 0] }, { time = 2, direction = [-1, -1, 0], inner_angle = 20 }]\n";
    assert_eq!(at(&scene(&(spot(10.0, "[1, 0, 0]") + keys)), Some(1.0)).lights, [still(&spot(20.0, "[0, -1, 0]"))]);
    let Light::Point { position, .. } = at(&point, Some(1.25)).lights[0] else { panic!("a point light") };
    assert_eq!(position, vec3(1.5, 2.0, 2.5));
}

const DISC: &str = "[[mesh]]\ngenerator = 'disc'\nradius = 1.5\nsegments = 8\n";

/// A camera that keys move, and two named ones, of which they move the second.
fn cameras() -> String {
    "[camera]\ntarget = [0, 0, 1]\nkeys = [{ time = 0, eye = [0, 0, 30], vertical_fov = 20 }, \
     { time = 1, eye = [4, 0, 30] }, { time = 3, eye = [4, 8, 26], target = [0, 2, 1], vertical_fov = 40 }]\n\
     [[cameras]]\nname = 'still'\neye = [1, 2, 3]\ntarget = [0, 0, 0]\n\
     [[cameras]]\nname = 'lift'\neye = [9, 2, 3]\ntarget = [0, 0, 0]\northographic_height = 4\n\
     keys = [{ time = 1, eye = [1, 2, 3] }, { time = 2, eye = [1, 4, 3], orthographic_height = 6 }]\n"
        .to_owned()
        + DISC
}

#[test]
fn cameras_are_where_their_keys_say() {
    let still = |rest: &str| at(&format!("[camera]\n{rest}\n{DISC}"), None).camera;
    for (time, own, lift) in [
        (None, "eye = [0, 0, 30]\ntarget = [0, 0, 1]\nvertical_fov = 20", "eye = [9, 2, 3]\northographic_height = 4"),
        (
            Some(2.0),
            "eye = [4, 4, 28]\ntarget = [0, 2, 1]\nvertical_fov = 33.333333333333336",
            "eye = [1, 4, 3]\northographic_height = 6",
        ),
        (
            Some(1.5),
            "eye = [4, 2, 29]\ntarget = [0, 2, 1]\nvertical_fov = 30",
            "eye = [1, 3, 3]\northographic_height = 6",
        ),
        (
            Some(9.0),
            "eye = [4, 8, 26]\ntarget = [0, 2, 1]\nvertical_fov = 40",
            "eye = [1, 4, 3]\northographic_height = 6",
        ),
    ] {
        let scene = at(&cameras(), time);
        assert_eq!(scene.camera, still(own), "{time:?}");
        let [a, b] = ["eye = [1, 2, 3]", lift].map(|rest| still(&format!("{rest}\ntarget = [0, 0, 0]")));
        assert_eq!(scene.cameras, [("still".to_owned(), a), ("lift".to_owned(), b)], "{time:?}");
    }
    let info = &try_at(&cameras(), None, AnimationChoice::All).unwrap().animations[0];
    assert_eq!((info.begin, info.end, info.n_moved, info.n_changed, info.fps), (0.0, 3.0, 0, 2, Some(1.0)));
}

#[test]
fn wrong_keys_are_named() {
    let light = |keys: &str| {
        mesh("") + &format!("[[light]]\nkind = 'point'\nposition = [0, 0, 0]\nintensity = [1, 1, 1]\n{keys}\n")
    };
    let camera = |keys: &str| format!("[camera]\neye = [1, 2, 30]\ntarget = [0, 0, 0]\n\n{keys}\n") + DISC;
    for (text, expected) in [
        (mesh("keys = [{ time = 1 }, { time = 0.5 }]"), "mesh 1: key 2: its time, 0.5 s, is not after that of the key"),
        (mesh("keys = [{ time = 1 }, { time = 1 }]"), "mesh 1: key 2: its time, 1 s, is not after that of the key"),
        (mesh("keys = [{ time = nan }]"), "mesh 1: key 1: its time, NaN s, is not finite"),
        (mesh("keys = [{ time = -inf }]"), "mesh 1: key 1: its time, -inf s, is not finite"),
        (mesh("keys = [{ time = 1 }, { scale = 2 }]"), "mesh 1: key 2: has no `time`"),
        (mesh("keys = [{ time = 'one' }]"), "mesh 1: key 1: its time is no number"),
        (mesh("keys = [{ time = 1, turn = [0, 0, 1] }]"), "mesh 1: key 1: unknown field `turn`"),
        (mesh("keys = [{ time = 1, translate = [0, nan, 1] }]"), "mesh 1: key 1: translate"),
        (mesh("keys = [{ time = 1 }, { time = 2, scale = [1, 0, 1] }]"), "mesh 1: key 2: scale"),
        (
            mesh("keys = [{ time = 1, scale = 1 }, { time = 2, scale = [1, -1, 1] }]"),
            "key 2: its scale mirrors the mesh",
        ),
        (mesh("keys = 3"), "mesh 1: "),
        (light("keys = [{ time = 1 }, { time = 0 }]"), "light 1: key 2: its time, 0 s, is not after"),
        (light("keys = [{ time = 1, position = [0, nan, 0] }]"), "light 1: key 1: position"),
        (light("keys = [{ time = 1, intensity = [0, -1, 0] }]"), "light 1: key 1: intensity"),
        (light("keys = [{ time = 1, kind = 'spot' }]"), "light 1: key 1: `kind` is neither a number nor numbers"),
        (light("keys = [{ time = 1, colour = [0, 1, 0] }]"), "light 1: unknown field `colour`"),
        (
            light("keys = [{ time = 1, position = [0, 1, 0] }, { time = 2, position = [0, 1] }]"),
            "light 1: key 2: position",
        ),
        (light("keys = [3]"), "light 1: keys: "),
        (camera("keys = [{ time = 1, eye = [0, nan, 0] }]"), "s.toml:1: camera: key 1: eye"),
        (camera("keys = [{ time = 1, eye = [0, 0, 0] }]"), "camera: key 1: eye, target and up span no picture"),
        (camera("keys = [{ time = 1, name = 'b' }]"), "camera: key 1: `name` is neither a number nor numbers"),
        (camera("[[cameras]]\neye = [1, 2, 3]\ntarget = [0, 0, 0]"), "s.toml:5: camera 1: missing field `name`"),
        (camera("[[cameras]]\nname = 3"), "s.toml:5: camera 1: its `name` is no string"),
    ] {
        let error = try_at(&text, Some(0.0), AnimationChoice::All).expect_err(&text);
        assert!(error.contains(expected) && error.contains("s.toml:") && error.lines().count() == 1, "{error}");
    }
}

/// A scene with a mesh and a light that keys move, and with a glTF file whose triangle moves by itself.
fn with_all(keys_of_file: &str) -> String {
    let of_mesh = "instances = 'places.npy'\nkeys = [{ time = 0.5, rotate = [0, 0, 0] }, \
                   { time = 1, translate = [0, 0, 1] }, { time = 2.5, translate = [2, 0, 1], rotate = [0, 90, 0] }]";
    let light = "[[light]]\nkind = 'point'\nintensity = [90, 90, 90]\n\
                 keys = [{ time = 0, position = [0, 9, 0] }, { time = 3, position = [9, 9, 9] }]\n";
    mesh(of_mesh)
        + light
        + &format!(
            "[[mesh]]\nfile = 'moving.glb'\n{keys_of_file}\n[[mesh]]\ngenerator = 'disc'\nradius = 1.5\nsegments = 8\n"
        )
}

#[test]
fn animations_are_known_and_chosen() {
    let text = with_all("transform = { translate = [0, 0, 5] }");
    let scene = try_at(&text, None, AnimationChoice::All).unwrap();
    let known: Vec<_> = scene.animations.iter().map(|it| (&it.name[..], it.begin, it.end)).collect();
    assert_eq!(known, [("keys", 0.0, 3.0), ("slide", 0.0, 4.0)]);
    assert_eq!(
        (scene.animations[0].n_moved, scene.animations[0].n_changed, scene.animations[0].fps),
        (1, 1, Some(2.0))
    );
    let places = |at: Option<f64>, choice: AnimationChoice| {
        let scene = try_at(&text, at, choice).unwrap();
        (scene.instances[0].transform.point(Vec3::ZERO), scene.instances[2].transform.point(Vec3::ZERO))
    };
    let named = |name: &str| AnimationChoice::Named(name.to_owned());
    let [by_keys, first] = [vec3(4.0, 0.0, 1.0), vec3(3.0, 0.0, 1.0)];
    let [by_file, rest] = [vec3(0.5, 1.0, 11.0), vec3(0.0, 0.0, 5.0)];
    assert_eq!(places(Some(1.75), AnimationChoice::All).0, by_keys);
    assert_eq!(places(Some(2.0), AnimationChoice::All).1, by_file);
    assert_eq!(places(Some(2.0), named("slide")), (first, by_file));
    assert_eq!(places(Some(2.0), named("1")), (first, by_file));
    assert_eq!(places(Some(1.75), named("keys")), (by_keys, rest));
    assert_eq!(places(Some(1.75), named("0")), (by_keys, rest));
    assert_eq!(places(Some(2.0), AnimationChoice::None), (first, rest));
    let error = try_at(&text, Some(0.0), named("walk")).unwrap_err();
    assert!(error.contains("there is no animation `walk`, but 0 `keys`, 1 `slide`"), "{error}");
}

/// The worlds of a scene file are those of its scenes, also if it is packed. Where keys alone move meshes, these are
/// kept.
#[test]
fn the_worlds_of_a_scene_file_are_those_of_its_scenes() {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in beside() {
        fs::write(folder.path().join(name), bytes).unwrap();
    }
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        fs::write(&path, text).unwrap();
        path
    };
    let moves_all = with_all("keys = [{ time = 0 }, { time = 3, translate = [0, 1, 0] }]");
    let of_camera = "target = [0, 0, 0]\nkeys = [{ time = 0, eye = [1, 2, 30] }, { time = 3, eye = [4, 2, 30] }]\n";
    let all = write("all.toml", &moves_all.replacen("target = [0, 0, 0]\n", of_camera, 1));
    let lines = with_all("transform = { translate = [0, 0, 5] }");
    let by_keys = write("keys.toml", lines.split("[[mesh]]\nfile").next().unwrap());
    let still_light = write("still.toml", &mesh("keys = [{ time = 0 }, { time = 3, scale = [2, 3, 4] }]"));
    let packed = folder.path().join("p.kdpack");
    pack(&by_keys, None, &LoadOptions::default(), &packed).unwrap();
    for (path, keeps) in [(&all, true), (&by_keys, true), (&by_keys, false), (&still_light, true), (&packed, true)] {
        let shares = keeps && path == &still_light;
        check_worlds(path, keeps, shares);
    }
    let light = "[[light]]\nkind = 'point'\nposition = [0, 9, 0]\nintensity = [90, 90, 90]\n";
    let moving_camera = write("camera.toml", &(cameras() + light));
    for camera in [None, Some("lift".to_owned()), Some("0".to_owned())] {
        let options = LoadOptions { camera, ..LoadOptions::default() };
        check_worlds_with(&moving_camera, &options, true, true);
    }
    let told = |path: &Path| animations_of(path, &LoadOptions::default()).unwrap();
    assert_eq!(told(&packed), told(&by_keys));
    assert_eq!(told(&all).iter().map(|it| it.n_moved).collect::<Vec<_>>(), [2, 1]);
}

/// At a moment, the camera is where it looks. What has moved until then moves with the next moment.
#[test]
fn a_moment_that_cannot_be_shown_is_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("through.toml");
    let moved = mesh("keys = [{ time = 0, translate = [0, 0, 0] }, { time = 1, translate = [0, 0, 3] }]");
    let through = "keys = [{ time = 0, eye = [0, 0, 30] }, { time = 2, eye = [0, 0, -30] }]\n";
    fs::write(&path, moved.replacen("target = [0, 0, 0]\n", &format!("target = [0, 0, 0]\n{through}"), 1)).unwrap();
    let request = |at: f64| {
        let pictures = LoadRequest::pictures(PictureChoices::default());
        LoadRequest { scene: LoadOptions { at: Some(at), ..pictures.scene.clone() }, ..pictures }
    };
    let world_at = |at: f64| {
        let scene = Opened::read(path.as_path(), &request(at)).unwrap().scene;
        (World::of_flat(FlatScene::with_instances(&scene).unwrap(), &BuildOptions::default()).unwrap(), scene)
    };
    let (first, scene) = world_at(0.0);
    let mut animated = AnimatedWorld::new(&path, &request(0.0), scene, &first);
    let error = animated.at(1.0).unwrap_err().to_string();
    assert!(error.contains("camera"), "{error}");
    assert_eq!(animated.at(1.5).unwrap().0.scene().instances, world_at(1.5).0.scene().instances);
}

/// The worlds of a file that plays are those of its scenes, whose instances are kept or not. `shares`: whether nothing
/// moves but instances, so that trees are shared.
pub fn check_worlds(path: &Path, keeps: bool, shares: bool) {
    check_worlds_with(path, &LoadOptions::default(), keeps, shares);
}

fn check_worlds_with(path: &Path, options: &LoadOptions, keeps: bool, shares: bool) {
    let request = |at: f64| {
        let pictures = LoadRequest::pictures(PictureChoices::default());
        let camera = options.camera.clone();
        LoadRequest { scene: LoadOptions { at: Some(at), camera, ..pictures.scene.clone() }, ..pictures }
    };
    let world_at = |at: f64| {
        let scene = Opened::read(path, &request(at)).unwrap().scene;
        let flat = if keeps { FlatScene::with_instances(&scene) } else { FlatScene::new(&scene) };
        (World::of_flat(flat.unwrap(), &BuildOptions::default()).unwrap(), scene)
    };
    let (first, scene) = world_at(1.0);
    let mut animated = AnimatedWorld::new(path, &request(1.0), scene, &first);
    for at in [2.0, 1.0, 2.9, 0.25, 7.0] {
        let ((found, camera), (expected, scene)) = (animated.at(at).unwrap(), world_at(at));
        let expected_scene = FlatScene { camera: found.scene().camera, ..expected.scene().clone() };
        assert!(*found.scene() == expected_scene, "{path:?} at {at}");
        assert!(found.accel() == expected.accel(), "{path:?} at {at}");
        assert_eq!(camera, scene.camera);
        assert!(!shares || found.shares_geometries(&first), "at {at}");
    }
}
