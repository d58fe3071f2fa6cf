//! Tests of the cameras and lights that scenes without their own get.

use std::fs;

use glam::{Vec2, Vec3};
use kdray::scene::{Camera, Light, LoadOptions, Scene};

/// Writes files to one folder and loads the first one.
fn load(files: &[(&str, &str)], options: &LoadOptions) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in files {
        fs::write(folder.path().join(name), content).unwrap();
    }
    Scene::load_with(&folder.path().join(files[0].0), options).unwrap()
}

fn load_toml(text: &str) -> Scene {
    load(&[("a.toml", text)], &LoadOptions::default())
}

/// Returns the OBJ text of a box.
fn box_obj(min: Vec3, size: Vec3) -> String {
    let corner = |ix: usize| min + size * Vec3::new((ix & 1) as f32, (ix >> 1 & 1) as f32, (ix >> 2) as f32);
    let corners = (0..8).map(corner).map(|p| format!("v {} {} {}\n", p.x, p.y, p.z)).collect::<String>();
    corners + "f 1 5 7 3\nf 6 2 4 8\nf 1 2 6 5\nf 7 8 4 3\nf 2 1 3 4\nf 5 6 8 7\n"
}

/// Returns the coordinates in the picture, from -1 to 1, of the corners of a scene's bounding box.
fn corners_in_picture(scene: &Scene, aspect: f32) -> Vec<Vec2> {
    let (min, max) = scene.bounds();
    let Camera { eye, target, up, .. } = scene.camera;
    let forward = (target - eye).normalize();
    let right = forward.cross(up).normalize();
    let corner = |n: u32| {
        let side = |axis: usize| if n >> axis & 1 == 0 { min[axis] } else { max[axis] };
        let from_eye = Vec3::new(side(0), side(1), side(2)) - eye;
        let depth = from_eye.dot(forward);
        assert!(depth > 0.0, "a corner is behind the camera");
        let half_height = scene.camera.height_at(depth) / 2.0;
        Vec2::new(from_eye.dot(right) / (half_height * aspect), from_eye.dot(right.cross(forward)) / half_height)
    };
    (0..8).map(corner).collect()
}

/// Returns the area of the convex hull of points.
fn hull_area(points: &[Vec2]) -> f32 {
    // By the support function: the hull is cut by half planes in many directions.
    let n = 720;
    let direction = |ix: usize| Vec2::from_angle(ix as f32 / n as f32 * std::f32::consts::TAU);
    let farthest = |d: Vec2| *points.iter().max_by(|a, b| a.dot(d).total_cmp(&b.dot(d))).unwrap();
    let edge = |ix: usize| farthest(direction(ix)).perp_dot(farthest(direction(ix + 1)));
    (0..n).map(edge).sum::<f32>() / 2.0
}

#[test]
fn boxes_of_all_shapes_fill_pictures_of_all_shapes() {
    let sizes = [
        [1.0, 1.0, 1.0],
        [1.0, 2.0, 1.0],
        [478.0, 2.0, 2.0],
        [2.0, 2.0, 478.0],
        [100.0, 0.0, 100.0],
        [100.0, 2.0, 60.0],
        [0.01, 3.0, 4.0],
        [3.0, 4.0, 0.01],
    ];
    for size in sizes.map(Vec3::from_array) {
        for aspect in [4.0 / 3.0, 0.4, 3.0] {
            for (scale, offset) in [(1.0, Vec3::ZERO), (1e-4, Vec3::ZERO), (1e4, Vec3::new(2e4, 0.0, -1e4))] {
                let obj = box_obj(offset, size * scale);
                let options = LoadOptions { aspect: Some(aspect), ..LoadOptions::default() };
                let scene = load(&[("a.obj", &obj)], &options);
                let corners = corners_in_picture(&scene, aspect);
                let most = corners.iter().map(|p| p.abs()).reduce(Vec2::max).unwrap();
                let what = format!("{size} x {scale}, aspect {aspect}: {:?}", scene.camera);
                assert!(most.max_element() <= 0.955, "{what}: a corner is at {most}");
                assert!(most.max_element() >= 0.94, "{what}: the corners reach only {most}");
                let share = hull_area(&corners) / 4.0;
                assert!(share > 0.1, "{what}: the box covers {share} of the picture");
            }
        }
    }
}

#[test]
fn a_picture_is_framed_for_the_scenes_size_if_no_other_is_stated() {
    let mesh = box_obj(Vec3::ZERO, Vec3::new(5.0, 1.0, 1.0));
    let toml = "[render]\nwidth = 300\nheight = 900\n[[mesh]]\nfile = 'a.obj'\n";
    let scene = load(&[("a.toml", toml), ("a.obj", &mesh)], &LoadOptions::default());
    let most = corners_in_picture(&scene, 1.0 / 3.0).into_iter().map(|p| p.abs()).reduce(Vec2::max).unwrap();
    assert!((0.94..0.955).contains(&most.x), "{most}");
}

#[test]
fn a_scene_file_with_nothing_but_a_mesh_looks_like_the_bare_mesh() {
    let mesh = box_obj(Vec3::ZERO, Vec3::new(3.0, 1.0, 2.0));
    let files = |toml: &str| {
        load(&[("a.toml", &format!("{toml}\n[[mesh]]\nfile = 'a.obj'\n")), ("a.obj", &mesh)], &LoadOptions::default())
    };
    let bare = load(&[("a.obj", &mesh)], &LoadOptions::default());
    assert_eq!(bare.lights.len(), 2);
    assert!(bare.ambient.min_element() > 0.0 && bare.background.min_element() > 0.0);
    let scene = files("");
    assert_eq!((scene.camera, scene.lights), (bare.camera, bare.lights.clone()));
    assert_eq!((scene.ambient, scene.background), (bare.ambient, bare.background));
    // What the file states stays as it is.
    let scene = files("background = [0, 0, 0.5]");
    assert_eq!((scene.lights, scene.background), (bare.lights.clone(), Vec3::new(0.0, 0.0, 0.5)));
    let scene = files("ambient = [0, 0, 0]");
    assert!(scene.lights.is_empty());
    assert_eq!((scene.ambient, scene.background), (Vec3::ZERO, Vec3::ZERO));
    let light = "kind = 'directional'\ndirection = [0, -1, 0]\nirradiance = [1, 1, 1]";
    let scene = files(&format!("[[light]]\n{light}"));
    assert_eq!((scene.lights.len(), scene.ambient, scene.background), (1, Vec3::ZERO, Vec3::ZERO));
    assert_eq!(scene.camera, bare.camera);
    let camera = "[camera]\neye = [0, 0, 9]\ntarget = [0, 0, 0]";
    let scene = files(camera);
    assert_eq!(scene.camera.eye, Vec3::new(0.0, 0.0, 9.0));
    assert_eq!(scene.lights.len(), 2);
}

#[test]
fn the_main_light_comes_over_the_viewers_left_shoulder() {
    for eye in [[0.0, 0.0, 9.0], [9.0, 1.0, 0.0], [-5.0, -3.0, -5.0]] {
        let disc = "[[mesh]]\ngenerator = 'disc'\nradius = 1\nsegments = 8\n";
        let scene = load_toml(&format!("[camera]\neye = {eye:?}\ntarget = [0, 0, 0]\n{disc}"));
        let forward = (scene.camera.target - scene.camera.eye).normalize();
        let right = forward.cross(Vec3::Y).normalize();
        let lights = scene.lights.iter().map(|light| match *light {
            Light::Directional { towards, irradiance } => (towards, irradiance.x),
            _ => panic!("{light:?}"),
        });
        let [(key, much), (fill, little)] = lights.collect::<Vec<_>>()[..] else { panic!("{:?}", scene.lights) };
        assert!(much > 2.0 * little && little > 0.0);
        assert!(key.dot(right) < -0.3 && fill.dot(right) > 0.3, "{key} and {fill}");
        assert!(key.y > 0.5 && fill.y > 0.2, "{key} and {fill}");
    }
}

/// Returns whether a scene's camera is in its bounding box.
fn is_inside(scene: &Scene) -> bool {
    let (min, max) = scene.bounds();
    scene.camera.eye.clamp(min, max) == scene.camera.eye
}

#[test]
fn rooms_are_seen_and_lit_from_inside() {
    let room = "[[mesh]]\ngenerator = 'room'\nsize = [6, 3, 9]\n";
    // The column hides the middle, and bodies hide what is behind them.
    let column = "[[mesh]]\ngenerator = 'box'\nsize = [0.5, 3, 0.5]\n";
    let mirrored = format!("{room}transform = {{ scale = [-1, 1, 1], translate = [100, 2, 0] }}\n");
    let turned = format!("{room}transform = {{ rotate = [0, 90, 0] }}\n");
    for text in [room, &format!("{room}{column}"), &mirrored, &turned] {
        let scene = load_toml(text);
        assert!(is_inside(&scene), "{text}: {:?}", scene.camera);
        let (min, max) = scene.bounds();
        // The view goes along the room.
        let (view, size) = ((scene.camera.target - scene.camera.eye).abs(), max - min);
        let (along, across) = if size.x > size.z { (view.x, view.z) } else { (view.z, view.x) };
        assert!(along > across, "{text}: {:?}", scene.camera);
        // Light from outside would not come in.
        assert!(scene.lights.iter().all(|light| matches!(light, Light::Point { .. })), "{:?}", scene.lights);
    }
    let half = Vec3::new(3.0, 1.5, 4.5);
    for (open, axis) in [("front", Vec3::Z), ("right", Vec3::X), ("back", Vec3::NEG_Z), ("left", Vec3::NEG_X)] {
        let sides: Vec<_> =
            ["left", "right", "bottom", "top", "back", "front"].into_iter().filter(|side| *side != open).collect();
        let scene = load_toml(&format!("{room}sides = {sides:?}\n"));
        let beyond = scene.camera.eye.dot(axis) - (half * axis).abs().max_element();
        assert!(beyond > 0.0, "{open}: the eye is not before the open side: {:?}", scene.camera);
        assert!(corners_in_picture(&scene, 4.0 / 3.0).iter().all(|p| p.abs().max_element() < 0.955), "{open}");
        assert!(scene.lights.iter().all(|light| matches!(light, Light::Point { .. })), "{:?}", scene.lights);
    }
}

#[test]
fn bodies_are_seen_from_outside() {
    let bodies = [
        "generator = 'box'\nsize = [6, 3, 9]\n",
        "generator = 'geodesic'\nradius = 1\nfrequency = 8\n",
        "generator = 'plane'\nsize = [8, 8]\n",
    ];
    for body in bodies {
        let scene = load_toml(&format!("[[mesh]]\n{body}"));
        assert!(!is_inside(&scene), "{body}: {:?}", scene.camera);
        assert!(scene.lights.iter().all(|light| matches!(light, Light::Directional { .. })), "{:?}", scene.lights);
    }
    // A sphere whose faces are reversed by mistake.
    let sphere = load_toml(&format!("[[mesh]]\n{}", bodies[1]));
    let mesh = &sphere.meshes[0];
    let points = mesh.positions.iter().map(|p| format!("v {} {} {}\n", p.x, p.y, p.z));
    let faces = mesh.faces.iter().map(|[a, b, c]| format!("f {} {} {}\n", c + 1, b + 1, a + 1));
    let obj: String = points.chain(faces).collect();
    let scene = load(&[("a.obj", &obj)], &LoadOptions::default());
    assert!(!is_inside(&scene), "{:?}", scene.camera);
}
