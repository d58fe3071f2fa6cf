//! Tests of scenes whose coordinates are so large that single precision loses details, and that are moved to the
//! origin.

use std::fs;

use glam::{DVec3, Vec3, dvec3, vec3};
use kdray::{
    scene::{CameraPath, Light, LoadOptions, Look, Scene, scene_file_of},
    world::FlatScene,
};
use serde_json::json;
use tempfile::TempDir;

/// A place half a million away from 0. Single precision has multiples of 0.25 at 4.1 million.
const FAR: DVec3 = dvec3(500_000.0, 4_100_000.0, -8.0);
/// The corners of a triangle, as seen from there.
const POINTS: [DVec3; 3] = [dvec3(0.125, 0.0, 0.0), dvec3(9.0, 0.0625, 0.0), dvec3(0.0, 7.0, 2.5)];

fn words(p: DVec3) -> String {
    format!("{} {} {}", p.x, p.y, p.z)
}

fn obj(points: [DVec3; 3]) -> String {
    points.map(|p| format!("v {}\n", words(p))).concat() + "f 1 2 3\n"
}

fn ply(points: [DVec3; 3]) -> String {
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\nproperty double z\n\
     element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        .to_owned()
        + &points.map(|p| words(p) + "\n").concat()
        + "3 0 1 2\n"
}

fn stl(points: [DVec3; 3]) -> String {
    let corners = points.map(|p| format!("vertex {}\n", words(p))).concat();
    format!("solid a\nfacet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\nendsolid a\n")
}

/// A glTF file whose mesh is at its own origin, and whose nodes are far away: the mesh, a lamp and a camera.
fn gltf() -> String {
    let at = |p: DVec3| (FAR + p).to_array();
    let nodes = json!([
        { "mesh": 0, "translation": at(DVec3::ZERO) },
        { "translation": at(dvec3(1.0, 2.0, 3.0)), "extensions": { "KHR_lights_punctual": { "light": 0 } } },
        { "camera": 0, "translation": at(dvec3(0.0, 1.0, 20.0)) },
    ]);
    let view = json!({ "buffer": 0, "byteLength": 36 });
    let accessor = json!({
        "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [9, 7, 2.5],
    });
    json!({
        "asset": { "version": "2.0" },
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "point" }] } },
        "nodes": nodes,
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1 } }],
        "accessors": [accessor], "bufferViews": [view], "buffers": [{ "uri": "m.bin", "byteLength": 36 }],
    })
    .to_string()
}

struct Files(TempDir);

impl Files {
    fn new(files: &[(&str, &str)]) -> Self {
        let folder = TempDir::new().unwrap();
        files.iter().for_each(|(name, content)| fs::write(folder.path().join(name), content).unwrap());
        let points = POINTS.map(|p| p.as_vec3().to_array());
        fs::write(folder.path().join("m.bin"), bytemuck::cast_slice(points.as_flattened())).unwrap();
        Self(folder)
    }

    fn load(&self, name: &str, options: &LoadOptions) -> Scene {
        Scene::load_with(&self.0.path().join(name), options).unwrap_or_else(|error| panic!("{error}"))
    }
}

fn recentred() -> LoadOptions {
    LoadOptions { recentre: true, ..LoadOptions::default() }
}

/// Returns the corners of a scene's triangles in the coordinates of its file.
fn corners(scene: &Scene) -> Vec<[DVec3; 3]> {
    let flat = FlatScene::new(scene).unwrap();
    flat.triangles.iter().map(|t| [t.v0, t.v1, t.v2].map(|v| v.as_dvec3() + scene.origin)).collect()
}

#[test]
fn bare_files_keep_their_details() {
    let far = POINTS.map(|p| FAR + p);
    let of_gltf = gltf();
    let texts = [("a.obj", obj(far)), ("a.ply", ply(far)), ("a.gltf", of_gltf)];
    for (name, text) in &texts {
        let files = Files::new(&[(name, text)]);
        let scene = files.load(name, &recentred());
        assert!((scene.origin - FAR).abs().max_element() < 10.0, "{name}: {}", scene.origin);
        assert_eq!(corners(&scene), [far], "{name}");
        assert!(scene.camera.eye.length() < 50.0, "{name}: {:?}", scene.camera);
        let plain = files.load(name, &LoadOptions::default());
        assert_eq!(plain.origin, DVec3::ZERO);
        assert_ne!(corners(&plain), [far], "{name}: the details are not too small");
    }
    // The numbers of an STL file are of single precision; these are exact.
    let coarse = [dvec3(0.25, 0.0, 0.0), dvec3(9.0, 0.5, 0.0), dvec3(0.0, 7.0, 2.5)].map(|p| FAR + p);
    let scene = Files::new(&[("a.stl", &stl(coarse))]).load("a.stl", &recentred());
    assert!(scene.origin != DVec3::ZERO);
    assert_eq!(corners(&scene), [coarse]);
}

/// A point at 0 in the file of a map is not to cost the map its details, whether a face names it or not.
#[test]
fn stray_points_cost_no_details() {
    let corner = |ix: usize| FAR + dvec3((ix % 10) as f64, 0.0625, (ix / 10) as f64 + 0.125);
    let points: String = (0..100).map(|ix| format!("v {}\n", words(corner(ix)))).collect();
    let faces: String = (0..89).map(|ix| format!("f {} {} {}\n", ix + 1, ix + 2, ix + 11)).collect();
    let stray = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\n";
    for more in ["", "f 101 102 103\n"] {
        // A weight, which only curves use, changes nothing.
        for points in [points.clone(), points.replacen(&words(corner(0)), &format!("{} 1", words(corner(0))), 1)] {
            let files = Files::new(&[("a.obj", &format!("{points}{stray}{faces}{more}"))]);
            let scene = files.load("a.obj", &recentred());
            assert!((scene.origin - FAR).abs().max_element() < 20.0, "{more}: {}", scene.origin);
            assert_eq!(corners(&scene)[0], [0, 1, 10].map(corner), "{more}");
            assert!(scene.camera.eye.length() < 100.0, "{more}: {:?}", scene.camera);
        }
    }
}

#[test]
fn other_files_stay_where_they_are() {
    for points in [POINTS, POINTS.map(|p| 1000.0 * p + dvec3(0.0, 5000.0, 0.0))] {
        let files = Files::new(&[("a.obj", &obj(points)), ("a.toml", "[[mesh]]\nfile = 'a.obj'\n")]);
        for name in ["a.obj", "a.toml"] {
            assert_eq!(files.load(name, &recentred()), files.load(name, &LoadOptions::default()), "{name}");
        }
    }
    // The scene as a whole is large: its middle is no better origin than 0.
    let toml = "[[mesh]]\nfile = 'a.obj'\n[[mesh]]\ngenerator = 'box'\nsize = [1, 1, 1]\n";
    let files = Files::new(&[("a.toml", toml), ("a.obj", &obj(POINTS.map(|p| FAR + p)))]);
    let scene = files.load("a.toml", &recentred());
    assert_eq!(scene.origin, DVec3::ZERO);
    assert_eq!(scene.bounds().1.y, 4_100_007.0);
}

/// All meshes of a scene file count from one origin, and so do its lights and cameras.
#[test]
fn meshes_lights_and_cameras_of_a_scene_file_move_together() {
    let point = |p: DVec3| format!("{:?}", (FAR + p).to_array());
    let toml = format!(
        "[camera]\neye = {eye}\ntarget = {target}\n[[cameras]]\nname = 'b'\neye = {target}\ntarget = {eye}\n\
         [[light]]\nkind = 'point'\nposition = {light}\nintensity = [1, 1, 1]\n\
         [[light]]\nkind = 'sphere'\nposition = {light}\nradius = 1\nradiance = [1, 1, 1]\n\
         [[mesh]]\nfile = 'a.obj'\n[[mesh]]\nfile = 'b.ply'\n[[mesh]]\nfile = 'a.gltf'\n\
         [[mesh]]\nfile = 'c.obj'\ntransform = {{ scale = 2, translate = {far} }}\n",
        eye = point(dvec3(1.0, 2.0, 30.5)),
        target = point(dvec3(1.0, 2.0, 0.0625)),
        light = point(dvec3(0.0, 9.125, 0.0)),
        far = point(DVec3::ZERO),
    );
    let (a, b) = (POINTS.map(|p| FAR + p), POINTS.map(|p| FAR + p + dvec3(0.0, 0.0, 20.0)));
    let (gltf, text_of_a, text_of_b, near) = (gltf(), obj(a), ply(b), obj(POINTS));
    let texts = [("a.toml", &*toml), ("a.obj", &text_of_a), ("b.ply", &text_of_b), ("c.obj", &near), ("a.gltf", &gltf)];
    let files = Files::new(&texts);
    let scene = files.load("a.toml", &recentred());
    assert_eq!(corners(&scene), [a, b, a, POINTS.map(|p| FAR + 2.0 * p)]);
    let in_file = |p: Vec3| p.as_dvec3() + scene.origin - FAR;
    assert_eq!(in_file(scene.camera.eye), dvec3(1.0, 2.0, 30.5));
    assert_eq!(in_file(scene.camera.target), dvec3(1.0, 2.0, 0.0625));
    assert_eq!(scene.cameras[0].1.eye, scene.camera.target);
    let [Light::Point { position, .. }, Light::Sphere { position: sphere, .. }] = scene.lights[..] else {
        panic!("{:?}", scene.lights)
    };
    assert_eq!([position, sphere].map(in_file), [dvec3(0.0, 9.125, 0.0); 2]);
}

#[test]
fn lights_and_cameras_of_a_gltf_file_move_with_its_meshes() {
    let scene = Files::new(&[("a.gltf", &gltf())]).load("a.gltf", &recentred());
    let in_file = |p: Vec3| p.as_dvec3() + scene.origin - FAR;
    let [Light::Point { position, .. }] = scene.lights[..] else { panic!("{:?}", scene.lights) };
    assert_eq!(in_file(position), dvec3(1.0, 2.0, 3.0));
    assert_eq!(in_file(scene.cameras[0].1.eye), dvec3(0.0, 1.0, 20.0));
}

#[test]
fn the_users_cameras_are_in_the_coordinates_of_the_file() {
    let files = Files::new(&[("a.obj", &obj(POINTS.map(|p| FAR + p)))]);
    let (eye, target) = (FAR + dvec3(0.0, 3.0, 40.25), FAR + dvec3(1.0, 2.0, 0.125));
    let look = Look { eye: Some(eye), target: Some(target), ..Look::default() };
    let scene = files.load("a.obj", &LoadOptions { look, ..recentred() });
    assert_eq!([scene.camera.eye, scene.camera.target].map(|p| p.as_dvec3() + scene.origin), [eye, target]);
    let key = |frame: u32, eye: DVec3| {
        let (eye, target) = (eye.to_array(), target.to_array());
        format!("[[keyframe]]\nframe = {frame}\neye = {eye:?}\ntarget = {target:?}\n")
    };
    let file = files.0.path().join("path.toml");
    fs::write(&file, key(0, eye) + &key(8, eye + dvec3(1.0, 0.0, 0.0))).unwrap();
    let path = CameraPath::load(&file).unwrap().from_origin(scene.origin);
    let moved = path.camera_at(4.0).unwrap();
    assert_eq!(moved.eye, (eye - scene.origin).as_vec3() + vec3(0.5, 0.0, 0.0));
    assert_eq!(moved.target, scene.camera.target);
}

/// A scene file that is made of a far file shows the same scene, whether it is moved to the origin or not.
#[test]
fn scene_files_of_far_files_state_the_origin() {
    let far = POINTS.map(|p| FAR + p);
    for (name, text) in [("a.obj", obj(far)), ("a.ply", ply(far)), ("a.stl", stl(far)), ("a.gltf", gltf())] {
        let files = Files::new(&[(name, &text)]);
        let [input, output] = [name, "out.toml"].map(|name| files.0.path().join(name));
        let toml = scene_file_of(&input, &output, &recentred()).unwrap();
        fs::write(&output, &toml).unwrap();
        let expected = FlatScene::new(&files.load(name, &recentred())).unwrap();
        for options in [recentred(), LoadOptions::default()] {
            let found = FlatScene::new(&files.load("out.toml", &options)).unwrap();
            assert_eq!(
                (found.triangles, found.lights),
                (expected.triangles.clone(), expected.lights.clone()),
                "{toml}"
            );
            assert_eq!((found.camera, found.origin), (expected.camera, DVec3::ZERO), "{toml}");
        }
    }
}
