//! More files as other programs write them: scans with colours and images, Maya's opacity, faces that are there several
//! times, animated cameras, closed rooms.

use glam::{Vec3, Vec4};
use kdray::scene::Mesh;
use serde_json::json;

use super::{
    materials::png,
    strangers::{loaded, material_of},
};

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

/// A scan whose points have colours, sRGB, beside an image of one colour.
#[test]
fn colours_that_an_image_shows_as_well_do_not_darken_it() {
    let of = |colour: [f32; 3], pixel: [u8; 4], ending: &str| {
        let [r, g, b] = colour;
        let point = |at: &str| format!("v {at} {r} {g} {b}\n");
        let points = ["0 0 0", "1 0 0", "0 1 0"].map(point).concat();
        let obj = format!("mtllib a b.mtl\n{points}vt 0.1 0.1\nvt 0.9 0.1\nvt 0.1 0.9\nusemtl m 0\n{ending}");
        let files = [
            ("m.obj", obj.as_bytes()),
            ("a b.mtl", b"newmtl m 0\nKd 1 1 1\nmap_Kd my scan (1).png\n"),
            ("my scan (1).png", &png(|_, _| pixel)),
        ];
        let (scene, warnings) = loaded(&files);
        (scene.meshes[0].colours[0][0].x, scene.meshes[0].colours.last().unwrap()[0].x, warnings.len())
    };
    let (face, bare) = ("f 1/1 2/2 3/3\n", "f 1/1 2/2 3/3\nusemtl none\nf 3 2 1\n");
    assert_eq!(of([0.5, 0.3, 0.1], [130, 70, 30, 255], face), (1.0, 1.0, 1));
    // A face without an image keeps its colours.
    let (with_image, without, _) = of([0.5, 0.3, 0.1], [130, 70, 30, 255], bare);
    assert!(with_image == 1.0 && without < 0.25, "{without}");
    // Shadows that are painted on a bright image are meant, and so is a tint of a white one.
    for (colour, pixel) in [([0.5; 3], [250, 240, 230, 255]), ([1.0, 0.2, 0.2], [255; 4])] {
        let (found, _, n_warnings) = of(colour, pixel, face);
        assert!(n_warnings == 0 && (found < 0.25 || colour[0] == 1.0), "{colour:?}: {found}");
    }
    assert_eq!(of([1.0; 3], [255; 4], face), (1.0, 1.0, 0), "white colours need no warning");
}

#[test]
fn opacity_of_maya_is_its_filter() {
    let of = |mtl: &str| {
        let found = material_of(mtl, [9; 4]).0;
        (found.kd, found.d, found.lobes.refraction)
    };
    let kd = Vec3::new(0.8, 0.2, 0.2);
    assert_eq!(of("illum 4\nKd 0.8 0.2 0.2\nTf 0.25 0.25 0.25\nNi 1.00"), (kd, 0.25, false));
    assert_eq!(of("illum 4\nKd 0.8 0.2 0.2\nTf 1.00 1.00 1.00\nNi 1.00"), (kd, 1.0, false));
    // Glass has an index, and other programs begin with other statements.
    assert!(of("illum 4\nKd 0.8 0.2 0.2\nTf 0.25 0.25 0.25\nNi 1.5").2);
    assert!(of("Kd 0.8 0.2 0.2\nillum 4\nTf 0.25 0.25 0.25\nNi 1.00").2);
    // A black filter is what some programs write where light does not pass, and not a black body.
    assert_eq!(of("Kd 0.8 0.2 0.2\nTf 0 0 0\nillum 4\nNi 1"), (kd, 1.0, false));
    let glass = material_of("Kd 0.25 1 1\nTf 0 0 0\nillum 6\nNi 1.5", [9; 4]).0;
    assert_eq!((glass.lobes.refraction, glass.tf), (true, Vec3::new(0.5, 1.0, 1.0)));
}

/// Of faces that are there several times, only the first one is left: otherwise rounding would decide which one a ray
/// hits, and light would pass all of them.
#[test]
fn the_first_of_several_equal_faces_counts() {
    let square = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nvt 0 0\nvt 1 1\n";
    let of = |faces: &str| {
        let obj = format!("mtllib m.mtl\n{square}{faces}");
        let (scene, _) = loaded(&[("m.obj", obj.as_bytes()), ("m.mtl", b"newmtl a\nnewmtl b\nnewmtl c\n")]);
        scene.meshes[0].clone()
    };
    let mesh = of("usemtl b\nf 1/1 2/1 3/1 4/1\nusemtl a\nf 3/2 4/2 1/2 2/2\nusemtl c\nf 1/2 2/2 3/2\n");
    assert_eq!(mesh.slots, [1, 1, 0, 0, 2]);
    // The last triangle is another face than the squares.
    assert_eq!(with_area(&mesh), [true, true, false, false, true]);
    // Both sides, each twice.
    let mesh = of("usemtl a\nf 1 2 3\nusemtl b\nf 3 2 1\nusemtl c\nf 2 3 1\nf 1 3 2\n");
    assert_eq!(with_area(&mesh), [true, true, false, false]);
    let height = |ix: usize| mesh.positions[mesh.faces[ix][0] as usize].z;
    assert!(height(0) > 0.0 && height(1) < 0.0);
}

/// Returns for each triangle of a mesh whether it has an area.
fn with_area(mesh: &Mesh) -> Vec<bool> {
    mesh.faces.iter().map(|[a, b, c]| a != b && b != c && c != a).collect()
}

/// The camera of a film begins where its first key is, through a node between the animated one and the camera.
#[test]
fn animated_cameras_begin_at_their_first_keys() {
    let of = |interpolation: &str, carries_mesh: bool| {
        let numbers = |numbers: &[f32]| numbers.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
        // A cubic spline has a tangent before each value. (0, 0.7, 0, 0.7) turns by a quarter around +y.
        let points = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let places = [9.0, 9.0, 9.0, 5.0, 1.0, 0.0, 8.0, 8.0, 8.0];
        let turn = 0.5_f32.sqrt();
        let times = [0.5, 1.0];
        let turns = [0.0, turn, 0.0, turn];
        let data = [numbers(&points), numbers(&places), numbers(&turns), numbers(&times)].concat();
        let (first, n) = if interpolation == "CUBICSPLINE" { (36, 3) } else { (48, 2) };
        let gltf = json!({
            "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0, 1] }],
            "nodes": [{ "mesh": 0 }, { "children": if carries_mesh { json!([2, 3]) } else { json!([2]) } },
                { "camera": 0 }, { "mesh": 0 }],
            "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1 } }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
            "buffers": [{ "uri": "data.bin", "byteLength": data.len() }],
            "bufferViews": [{ "buffer": 0, "byteLength": 36 },
                { "buffer": 0, "byteOffset": first, "byteLength": 12 * n },
                { "buffer": 0, "byteOffset": 72, "byteLength": 16 },
                { "buffer": 0, "byteOffset": 88, "byteLength": 8 }],
            "accessors": [
                {
                    "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                    "min": [0, 0, 0], "max": [1, 1, 0]
                },
                { "bufferView": 1, "componentType": 5126, "count": n, "type": "VEC3" },
                { "bufferView": 2, "componentType": 5126, "count": 1, "type": "VEC4" },
                { "bufferView": 3, "componentType": 5126, "count": if n == 2 { 2 } else { 1 }, "type": "SCALAR" },
                { "bufferView": 3, "componentType": 5126, "count": 1, "type": "SCALAR" }],
            "animations": [{
                "samplers": [{ "input": 3, "output": 1, "interpolation": interpolation }, { "input": 4, "output": 2 }],
                "channels": [{ "sampler": 0, "target": { "node": 1, "path": "translation" } },
                    { "sampler": 1, "target": { "node": 1, "path": "rotation" } },
                    { "sampler": 7, "target": { "node": 1, "path": "scale" } },
                    { "sampler": 0, "target": { "node": 99, "path": "scale" } }] }],
        });
        let text = gltf.to_string();
        let (scene, _) = loaded(&[("m.gltf", text.as_bytes()), ("data.bin", &data)]);
        let camera = scene.cameras[0].1;
        (camera.eye, (camera.target - camera.eye).normalize())
    };
    for interpolation in ["LINEAR", "CUBICSPLINE"] {
        let (eye, forward) = of(interpolation, false);
        assert_eq!(eye, Vec3::new(5.0, 1.0, 0.0), "{interpolation}");
        assert!(forward.abs_diff_eq(Vec3::NEG_X, 1e-5), "{interpolation}: {forward}");
    }
    assert_eq!(of("LINEAR", true).0, Vec3::ZERO, "things that move with the camera stay where they are");
}

/// A box from one corner to another, whose sides face outwards. `first`: the number of points before.
fn cuboid(min: Vec3, max: Vec3, first: usize) -> String {
    let corner = |ix: usize| {
        let pick = |axis: usize| if ix >> axis & 1 == 0 { min[axis] } else { max[axis] };
        format!("v {} {} {}\n", pick(0), pick(1), pick(2))
    };
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let face = |side: [usize; 4]| format!("f {}\n", side.map(|ix| (first + ix + 1).to_string()).join(" "));
    (0..8).map(corner).chain(sides.map(face)).collect()
}

/// Nobody would see the furniture of a closed room from outside.
#[test]
fn a_closed_room_with_things_in_it_is_seen_from_inside() {
    let is_inside = |obj: &str| {
        let scene = loaded(&[("m.obj", obj.as_bytes())]).0;
        let eye = scene.camera.eye;
        eye.cmpge(Vec3::ZERO).all() && eye.cmple(Vec3::new(6.0, 2.7, 5.0)).all()
    };
    let room = cuboid(Vec3::ZERO, Vec3::new(6.0, 2.7, 5.0), 0);
    let cupboard = cuboid(Vec3::new(0.1, 0.0, 0.1), Vec3::new(2.0, 2.0, 0.6), 8);
    let sofa = cuboid(Vec3::new(4.6, 0.0, 1.0), Vec3::new(5.8, 0.6, 3.0), 16);
    assert!(is_inside(&format!("{room}{cupboard}{sofa}")));
    assert!(!is_inside(&room), "it is a brick");
    // A solid around the middle, with another one in it, is a body.
    let core = cuboid(Vec3::new(1.0, 0.5, 1.0), Vec3::new(5.0, 2.0, 4.0), 8);
    assert!(!is_inside(&format!("{room}{core}")));
    // The house is no box.
    let chimney = cuboid(Vec3::new(1.0, 2.7, 1.0), Vec3::new(1.5, 3.5, 1.5), 24);
    assert!(!is_inside(&format!("{room}{cupboard}{sofa}{chimney}")));
}

#[test]
fn broken_scans_are_shown() {
    // Neither an image without pixels at the corners' places nor a missing image stops the comparison of colours.
    let obj = format!("mtllib m.mtl\n{}usemtl m\nf 1 2 3\n", TRIANGLE.replace('\n', " 0.5 0.5 0.5\n"));
    let (scene, _) = loaded(&[("m.obj", obj.as_bytes()), ("m.mtl", b"newmtl m\nmap_Kd a.png\n"), ("a.png", b"")]);
    assert!(scene.meshes[0].colours[0][0].abs_diff_eq(Vec4::new(0.214, 0.214, 0.214, 1.0), 1e-3));
}
