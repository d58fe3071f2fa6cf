//! More files as programs write them: glowing bodies, colours of facets and faces, faces that are there for each side,
//! instances, cameras that look away, texts of old and foreign computers.

use std::fs;

use glam::{Vec3, Vec4};
use kdray::{
    frame::Integrator,
    scene::{LoadOptions, Scene},
};
use serde_json::{Value, json};

use super::{
    materials::{load_scene, png},
    strangers::loaded,
};

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

/// The six sides of a box of points 1 to 8, which face outwards.
const SIDES: [[usize; 4]; 6] = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];

fn corner(ix: usize) -> Vec3 {
    Vec3::new((ix & 1) as f32, (ix >> 1 & 1) as f32, (ix >> 2) as f32)
}

/// A cube of edge 1 at a place, in an OBJ file that has so many points before.
fn cube(at: Vec3, n_before: usize) -> String {
    let point = |ix: usize| format!("v {} {} {}\n", at.x + corner(ix).x, at.y + corner(ix).y, at.z + corner(ix).z);
    let side = |side: [usize; 4]| format!("f {}\n", side.map(|ix| (n_before + ix + 1).to_string()).join(" "));
    (0..8).map(point).chain(SIDES.map(side)).collect()
}

/// Ten cubes in two rows, of which the ones at some places glow.
fn cubes(glowing: &[usize], mtl: &str, more: &str) -> Scene {
    let one = |ix: usize| {
        let material = if glowing.contains(&ix) { "glow" } else { "plain" };
        let at = Vec3::new(1.3 * (ix % 5) as f32, 0.0, 1.3 * (ix / 5) as f32);
        format!("usemtl {material}\n{}", cube(at, 8 * ix))
    };
    let obj = format!("mtllib m.mtl\n{}{more}", (0..10).map(one).collect::<String>());
    let mtl = format!("newmtl plain\nnewmtl glow\n{mtl}\n");
    loaded(&[("m.obj", obj.as_bytes()), ("m.mtl", mtl.as_bytes())]).0
}

/// The light of bodies that glow would leave most of the picture black.
#[test]
fn what_glows_among_other_things_does_not_light_them() {
    let of = |scene: Scene| (scene.lights.len(), scene.defaults.is_metered, scene.defaults.integrator);
    assert_eq!(of(cubes(&[3, 6], "Kd 0\nKe 5 4 2", "")), (2, false, Integrator::Whitted));
    // A lamp over them lights what the camera sees.
    let lamp = "v -9 8 -9\nv 15 8 -9\nv 15 8 15\nv -9 8 15\nusemtl glow\nf 81 82 83 84\n";
    assert_eq!(of(cubes(&[], "Kd 0\nKe 5 4 2", lamp)).0, 0);
    // A triangle without area gives off nothing.
    let flat = b"mtllib m.mtl\nusemtl glow\nv 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n";
    assert_eq!(loaded(&[("m.obj", flat), ("m.mtl", b"newmtl glow\nKe 5 5 5\n")]).0.lights.len(), 2);
    // Where there is nothing but lamps, they are seen in their own light.
    let all: Vec<usize> = (0..10).collect();
    assert_eq!(of(cubes(&all, "Kd 0\nKe 5 4 2", "")), (0, true, Integrator::Path));
}

/// In a box with one open side, the walls send the light of the smallest lamp everywhere.
#[test]
fn rooms_are_lit_by_their_lamps() {
    let room: String = SIDES
        .iter()
        .enumerate()
        .filter(|(ix, _)| *ix != 1)
        .map(|(_, side)| {
            let [a, b, c, d] = side.map(|ix| ix + 1);
            format!("f {d} {c} {b} {a}\n")
        })
        .collect();
    let points: String = (0..8).map(|ix| format!("v {} {} {}\n", corner(ix).x, corner(ix).y, corner(ix).z)).collect();
    let lamp = "v 0.4 0.99 0.4\nv 0.6 0.99 0.4\nv 0.6 0.99 0.6\nv 0.4 0.99 0.6\nusemtl lamp\nf 9 10 11 12\n";
    let obj = format!("mtllib m.mtl\n{points}{room}{lamp}");
    let lit = |ke: &str| {
        let mtl = format!("newmtl lamp\nKe {ke}\n");
        let (scene, _) = loaded(&[("m.obj", obj.as_bytes()), ("m.mtl", mtl.as_bytes())]);
        (scene.lights.len(), scene.defaults.integrator)
    };
    assert_eq!(lit("20 18 14"), (0, Integrator::Path));
    // That of a Cornell box gives 0.07 of white paper for the area of all walls.
    assert_eq!(lit("9 7 4"), (0, Integrator::Path));
    assert_eq!(lit("1 1 1").1, Integrator::Whitted, "what only glows lights nothing");
}

/// A picture of paths was asked for because of the lamp, so it alone lights the scene.
#[test]
fn the_users_integrator_decides_as_the_files_does() {
    let wall = "v 0 0 0\nv 10 0 0\nv 10 10 0\nv 0 10 0\nf 1 2 3 4\n";
    let lamp = "v 0 0 9\nv 1 0 9\nv 1 1 9\nv 0 1 9\nusemtl lamp\nf 8 7 6 5\n";
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("m.obj"), format!("mtllib m.mtl\n{wall}{lamp}")).unwrap();
    fs::write(folder.path().join("m.mtl"), "newmtl lamp\nKe 5 5 5\n").unwrap();
    let load = |integrator: Option<Integrator>| {
        let options = LoadOptions { integrator, ..LoadOptions::default() };
        Scene::load_with(&folder.path().join("m.obj"), &options).unwrap()
    };
    assert_eq!(load(None).lights.len(), 2);
    assert_eq!(load(Some(Integrator::Whitted)).lights.len(), 2);
    let scene = load(Some(Integrator::Path));
    assert_eq!((scene.lights.len(), scene.ambient, scene.background), (0, Vec3::ZERO, Vec3::ZERO));
}

/// A binary STL file of facets with attributes.
fn stl(header: &[u8], attributes: &[u16]) -> Vec<u8> {
    let mut bytes = header.to_vec();
    bytes.resize(80, b' ');
    bytes.extend((attributes.len() as u32).to_le_bytes());
    for (ix, bits) in attributes.iter().enumerate() {
        let numbers = [0.0, 0.0, 1.0, 0.0, 0.0, ix as f32, 1.0, 0.0, ix as f32, 0.0, 1.0, ix as f32];
        bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
        bytes.extend(bits.to_le_bytes());
    }
    bytes
}

#[test]
fn facets_of_stl_files_have_their_colours() {
    let colours = |header: &[u8], attributes: &[u16]| {
        let (scene, _) = loaded(&[("m.stl", &stl(header, attributes))]);
        scene.meshes[0].colours.iter().map(|colours| colours[1]).collect::<Vec<_>>()
    };
    let (red, blue) = (Vec4::new(1.0, 0.0, 0.0, 1.0), Vec4::new(0.0, 0.0, 1.0, 1.0));
    assert_eq!(colours(b"of VisCAM", &[0x801f, 0xfc00]), [blue, red]);
    assert_eq!(colours(b"COLOR=\x00\x00\xff\xff", &[0x001f, 0x8000]), [red, blue]);
    assert_eq!(colours(b"of another program", &[0, 77, 12, 9999]), []);
}

#[test]
fn stl_files_of_writers_that_do_not_count_are_read() {
    let whole = stl(b"streamed", &[0, 0]);
    for count in [0, u32::MAX] {
        let mut bytes = whole.clone();
        bytes[80..84].copy_from_slice(&count.to_le_bytes());
        assert_eq!(loaded(&[("m.stl", &bytes)]).0.meshes[0].faces.len(), 2, "{count}");
        let error = load_scene(&[("m.stl", &bytes[..170])]).0.unwrap_err().to_string();
        assert!(error.contains("has no triangles") || error.contains("ends after 1 of 4294967295"), "{error}");
    }
    let facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
    assert_eq!(loaded(&[("m.stl", facet.as_bytes())]).0.meshes[0].faces.len(), 1, "the first line is missing");
}

#[test]
fn stl_files_with_bytes_behind_their_facets_are_read() {
    for comment in [&b"made by hand"[..], b"solid of a program that writes binary"] {
        let mut bytes = [stl(comment, &[0, 0]), vec![0]].concat();
        let (scene, warnings) = loaded(&[("m.stl", &bytes)]);
        assert_eq!(scene.meshes[0].faces.len(), 2);
        let warning = "the header states 2 facets: 1 bytes behind them are not read";
        assert!(warnings.len() == 1 && warnings[0].ends_with(warning), "{warnings:?}");
        bytes[80..84].copy_from_slice(&1_u32.to_le_bytes());
        let (scene, warnings) = loaded(&[("m.stl", &bytes)]);
        assert_eq!(scene.meshes[0].faces.len(), 1);
        assert!(warnings[0].ends_with("states 1 facets: 51 bytes behind them are not read"), "{warnings:?}");
    }
}

/// Returns a text PLY file of a square whose two triangles have different colours.
fn coloured_faces(of_vertices: Option<[u8; 4]>) -> String {
    let properties =
        if of_vertices.is_some() { "property uchar red\nproperty uchar green\nproperty uchar blue\n" } else { "" };
    let point = |ix: usize| {
        let colour = of_vertices.map_or(String::new(), |grey| format!(" {0} {0} {0}", grey[ix]));
        format!("{} {} 0{colour}\n", ix % 2, ix / 2)
    };
    let points: String = (0..4).map(point).collect();
    format!(
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n{properties}\
         element face 2\nproperty list uchar int vertex_indices\nproperty uchar red\nproperty uchar green\n\
         property uchar blue\nend_header\n{points}3 0 1 2 255 0 0\n3 1 3 2 0 0 255\n"
    )
}

#[test]
fn faces_of_ply_files_have_their_colours() {
    let of = |text: String| loaded(&[("m.ply", text.as_bytes())]).0.meshes[0].colours.clone();
    let (red, blue) = (Vec4::new(1.0, 0.0, 0.0, 1.0), Vec4::new(0.0, 0.0, 1.0, 1.0));
    assert_eq!(of(coloured_faces(None)), [[red; 3], [blue; 3]]);
    // Programs write one colour for all vertices where the faces have the colours.
    assert_eq!(of(coloured_faces(Some([9; 4]))), [[red; 3], [blue; 3]]);
    let of_vertices = of(coloured_faces(Some([0, 255, 255, 255])));
    assert_eq!((of_vertices[0][0], of_vertices[1][0]), (Vec4::new(0.0, 0.0, 0.0, 1.0), Vec4::ONE));
}

#[test]
fn ply_files_of_old_programs_are_read() {
    let text = coloured_faces(None);
    let n_faces = |bytes: &[u8]| loaded(&[("m.ply", bytes)]).0.meshes[0].faces.len();
    assert_eq!(n_faces(text.replace('\n', "\r").as_bytes()), 2);
    assert_eq!(n_faces(text.replace("end_header\n", "end_header\n\n").replace("3 1 3", " \n3 1 3").as_bytes()), 2);
    assert_eq!(n_faces(text.trim_end().as_bytes()), 2, "the last line does not end");
    let latin = [b"ply\ncomment caf\xe9\n", &text.as_bytes()[4..]].concat();
    assert_eq!(n_faces(&latin), 2);
}

#[test]
fn ply_files_of_careless_programs_are_read() {
    let text = coloured_faces(None);
    let read = |bytes: &[u8]| {
        let (scene, warnings) = loaded(&[("m.ply", bytes)]);
        (scene.meshes[0].faces.clone(), warnings)
    };
    let (faces, none) = read(text.as_bytes());
    assert_eq!((faces.len(), none), (2, Vec::new()));
    let bom = [b"\xef\xbb\xbf", text.as_bytes()].concat();
    assert_eq!(read(&bom), (faces.clone(), Vec::new()), "a byte order mark");
    let floats = text.replace("3 0 1 2", "3.0 0.0 1 2e0").replace("uchar int", "float float");
    assert_eq!(read(floats.as_bytes()), (faces.clone(), Vec::new()), "indices that are written as floats");
    let more = text.replace("1 0 0\n", "1 0 0 7 7\n");
    let warning = "line 14 has more numbers than its row, which are not read";
    let (found, warnings) = read(more.as_bytes());
    assert!(found == faces && warnings.len() == 1 && warnings[0].ends_with(warning), "{warnings:?}");
    let (head, rows) = text.split_once("end_header\n").unwrap();
    let in_one_line = format!("{head}end_header\n{}", rows.replace('\n', " "));
    assert_eq!(read(in_one_line.as_bytes()), (faces.clone(), Vec::new()), "rows that follow each other");
    let (found, warnings) = read(format!("{in_one_line} # end").as_bytes());
    let warning = "what follows the last row is not read: line 13";
    assert!(found == faces && warnings.len() == 1 && warnings[0].ends_with(warning), "{warnings:?}");
    // A scanner's time is no texture coordinate.
    let timed = text.replace("element face", "property float t\nelement face").replace(" 0\n", " 0 9\n");
    let (scene, warnings) = loaded(&[("m.ply", timed.as_bytes())]);
    assert!(scene.meshes[0].uvs[0].is_empty(), "{warnings:?}");
    // The first coordinate begins with the byte of a line feed. In two of the files an element that is not read
    // comes first.
    let point = |x: u32| [x.to_le_bytes(), [0; 4], [0; 4]].concat();
    let points = [point(0x3f80_000a), point(0), [[0; 4], 1f32.to_le_bytes(), [0; 4]].concat()].concat();
    let other = "element tags 2\nproperty list uchar short of\nproperty char more\n";
    let tags = [&[1, 5, 0, 9][..], &[0, 10]].concat();
    for (other, tags) in [("", Vec::new()), (other, tags)] {
        for line_end in ["\n", "\r\n", "\r"] {
            let head = format!(
                "ply\nformat binary_little_endian 1.0\n{other}element vertex 3\nproperty float x\nproperty float y\n\
                 property float z\nelement face 1\nproperty list uchar int vertex_index\nend_header\n"
            );
            let face = [&[3][..], &[0_u32, 1, 2].map(u32::to_le_bytes).concat()].concat();
            let head = head.replace('\n', line_end).into_bytes();
            let bytes = [head, tags.clone(), points.clone(), face].concat();
            assert_eq!(read(&bytes), (vec![[0, 1, 2]], Vec::new()), "{line_end:?}");
            let mesh = &loaded(&[("m.ply", &bytes)]).0.meshes[0];
            assert_eq!(mesh.positions[0].x.to_bits(), 0x3f80_000a, "{line_end:?}");
            let at = bytes.windows(10).rposition(|part| part == b"list uchar").unwrap();
            let mut negative = [&bytes[..at], b"list char", &bytes[at + 10..]].concat();
            let of_face = negative.len() - 13;
            negative[of_face] = 0xff;
            let error = load_scene(&[("m.ply", &negative)]).0.unwrap_err().to_string();
            assert!(error.ends_with("element `face`: the file ends too early, or a list has no length"), "{error}");
            let (_, warnings) = read(&[&bytes[..], &[1, 2, 3]].concat());
            assert!(warnings[0].ends_with("3 bytes behind the last row are not read"), "{warnings:?}");
        }
    }
}

/// Faces that are there once for each side, in formats that are no OBJ.
#[test]
fn faces_for_each_side_are_moved_apart_in_all_formats() {
    let ply = coloured_faces(None).replace("3 1 3 2 0 0 255", "3 2 1 0 0 0 255");
    let of_ply = loaded(&[("m.ply", ply.as_bytes())]).0;
    let mut bytes = stl(b"VisCAM", &[0x801f, 0xfc00]);
    // The second facet is the first one, turned.
    let (first, second) = (84 + 12, 134 + 12);
    for (to, from) in [(0, 0), (12, 24), (24, 12)] {
        bytes.copy_within(first + from..first + from + 12, second + to);
    }
    let of_stl = loaded(&[("m.stl", &bytes)]).0;
    let gltf = |indices: Value| {
        json!([{ "attributes": { "POSITION": 0 }, "material": 0 },
        { "attributes": { "POSITION": 0 }, "indices": indices, "material": 1 }])
    };
    let of_gltf = document(json!({ "meshes": [{ "primitives": gltf(json!(1)) }], "nodes": [{ "mesh": 0 }],
        "materials": [{}, { "emissiveFactor": [0.5, 0, 0] }] }))
    .0;
    for (name, scene) in [("PLY", of_ply), ("STL", of_stl), ("glTF", of_gltf)] {
        let mesh = &scene.meshes[0];
        let height = |ix: usize| mesh.positions[mesh.faces[ix][0] as usize].z;
        assert!(mesh.faces.len() == 2 && height(0) > 0.0 && height(1) < 0.0, "{name}: {} {}", height(0), height(1));
    }
}

/// Loads a glTF file of a triangle, whose corners are accessor 0. Accessor 1 turns it. Accessors 2 and 3 have three
/// vectors (0, 0, 0), (1, 0, 0), (0, 1, 0) and two.
fn document(mut gltf: Value) -> (Scene, Vec<String>) {
    let numbers: Vec<u8> = [0, 0, 0, 1, 0, 0, 0, 1, 0].iter().flat_map(|x| (*x as f32).to_le_bytes()).collect();
    let data = [&numbers[..], &[2, 1, 0]].concat();
    gltf["asset"] = json!({ "version": "2.0" });
    gltf["buffers"] = json!([{ "uri": "data.bin", "byteLength": 39 }]);
    gltf["bufferViews"] = json!([{ "buffer": 0, "byteLength": 36 },
        { "buffer": 0, "byteOffset": 36, "byteLength": 3 }]);
    gltf["accessors"] = json!([
        { "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] },
        { "bufferView": 1, "componentType": 5121, "count": 3, "type": "SCALAR" },
        { "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" },
        { "bufferView": 0, "componentType": 5126, "count": 2, "type": "VEC3" }]);
    let (scene, warnings) =
        load_scene(&[("m.gltf", gltf.to_string().as_bytes()), ("data.bin", &data), ("a.png", &png(|_, _| [9; 4]))]);
    (scene.unwrap_or_else(|error| panic!("{error}")), warnings)
}

fn plain(more: Value) -> Value {
    let mut gltf = json!({ "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "nodes": [{ "mesh": 0 }] });
    more.as_object().unwrap().iter().for_each(|(key, value)| gltf[key] = value.clone());
    gltf
}

#[test]
fn instances_of_gltf_nodes_are_placed() {
    let of = |attributes: Value| {
        let node = json!({ "mesh": 0, "scale": [2, 2, 2],
            "extensions": { "EXT_mesh_gpu_instancing": { "attributes": attributes } } });
        document(plain(json!({ "nodes": [node], "extensionsRequired": ["EXT_mesh_gpu_instancing"] }))).0
    };
    let scene = of(json!({ "TRANSLATION": 2, "_ID": 0 }));
    let origins: Vec<Vec3> = scene.instances.iter().map(|it| it.transform.point(Vec3::ZERO)).collect();
    assert_eq!((origins, scene.meshes.len()), (vec![Vec3::ZERO, 2.0 * Vec3::X, 2.0 * Vec3::Y], 1));
    assert_eq!(of(json!({ "_ID": 2 })).instances.len(), 1);
    let node = json!({ "mesh": 0, "extensions": { "EXT_mesh_gpu_instancing":
        { "attributes": { "TRANSLATION": 2, "SCALE": 3 } } } });
    let (scene, warnings) = document(plain(json!({ "nodes": [node] })));
    assert_eq!(scene.instances.len(), 1);
    assert!(warnings[0].contains("SCALE: has 2 elements, but another attribute has 3"), "{warnings:?}");
}

#[test]
fn cameras_that_see_nothing_are_passed_over() {
    let of = |places: &[f32]| {
        let camera = |z: &f32| json!({ "camera": 0, "translation": [0.3, 0.3, z] });
        let nodes: Vec<Value> = [json!({ "mesh": 0 })].into_iter().chain(places.iter().map(camera)).collect();
        let cameras = json!([{ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1 } }]);
        document(plain(json!({ "nodes": nodes, "cameras": cameras }))).0
    };
    // A camera looks along -z.
    assert_eq!(of(&[5.0]).camera.eye.z, 5.0);
    assert_eq!(of(&[-5.0, 4.0, 5.0]).camera.eye.z, 4.0);
    let chosen = of(&[-5.0]);
    assert!(chosen.camera.eye.z > 0.0 && chosen.cameras.len() == 1, "{:?}", chosen.camera);
}

#[test]
fn lights_without_intensity_are_no_lights() {
    let of = |intensity: f32| {
        let light = json!({ "KHR_lights_punctual": { "lights": [{ "type": "point", "intensity": intensity }] } });
        let node = json!({ "extensions": { "KHR_lights_punctual": { "light": 0 } } });
        document(plain(json!({ "extensions": light, "nodes": [{ "mesh": 0 }, node] }))).0
    };
    assert_eq!((of(0.0).lights.len(), of(0.0).defaults.is_metered), (2, false));
    assert_eq!((of(5.0).lights.len(), of(5.0).defaults.is_metered), (1, true));
}

#[test]
fn extensions_that_are_not_read_name_their_remedies() {
    let textured = |extension: &str| {
        document(plain(json!({ "extensionsRequired": [extension], "extensionsUsed": [extension],
            "textures": [{ "extensions": { "KHR_texture_basisu": { "source": 0 } } }], "images": [{ "uri": "a.ktx2" }],
            "materials": [{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "material": 0 }] }] })))
    };
    let (_, warnings) = textured("KHR_materials_iridescence");
    assert!(warnings.iter().any(|warning| warning.contains("the picture may differ: KHR_materials_iridescence")));
    let (scene, warnings) = textured("KHR_texture_basisu");
    assert!(scene.images.is_empty() && warnings.len() == 1 && warnings[0].contains("a.ktx2"), "{warnings:?}");
}

/// Avatars are GLB files under another name.
#[test]
fn certain_content_is_read_under_any_name() {
    let text = coloured_faces(None);
    for name in ["a.vrm", "a", "a.ply.txt"] {
        assert_eq!(loaded(&[(name, text.as_bytes())]).0.meshes[0].faces.len(), 2, "{name}");
    }
    let error = load_scene(&[("a.vrm", b"glTF\x02\0\0\0")]).0.unwrap_err().to_string();
    assert!(!error.contains("ends in none of"), "{error}");
}

#[test]
fn texts_of_other_computers_are_read() {
    let obj = format!("mtllib é.mtl\nusemtl a\n{TRIANGLE}f 1 2 3\n");
    let utf16 = |big: bool| -> Vec<u8> {
        let bytes = |unit: u16| if big { unit.to_be_bytes() } else { unit.to_le_bytes() };
        std::iter::once(0xfeff).chain(obj.encode_utf16()).flat_map(bytes).collect()
    };
    let cr = obj.replace('\n', "\r").into_bytes();
    for content in [utf16(false), utf16(true), cr] {
        let (scene, warnings) = loaded(&[("m.obj", &content), ("é.mtl", b"newmtl a\rKd 0.25\r")]);
        assert_eq!((scene.meshes[0].faces.len(), scene.materials[0].kd, warnings.len()), (1, Vec3::splat(0.25), 0));
    }
}

/// A byte order mark, as editors of Windows write it, is left out, but where the bytes of a file are no text.
#[test]
fn byte_order_marks_are_left_out() {
    let obj = format!("mtllib m.mtl\nusemtl a\n{TRIANGLE}f 1 2 3\n");
    let facet =
        "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
    let toml = "[[mesh]]\nfile = 'm.obj'\n";
    let ply = coloured_faces(None);
    let files = [("a.toml", toml), ("m.obj", &obj), ("m.stl", facet), ("m.ply", &ply), ("other", &ply)];
    for (name, text) in files {
        let marked = |text: &str| [b"\xef\xbb\xbf", text.as_bytes()].concat();
        let (text, obj, mtl) = (marked(text), marked(&obj), marked("newmtl a\nKd 0.25\n"));
        let (scene, warnings) = loaded(&[(name, &text), ("m.obj", &obj), ("m.mtl", &mtl)]);
        assert!(!scene.meshes[0].faces.is_empty() && warnings.is_empty(), "{name}: {warnings:?}");
    }
    let binary = stl(b"\xef\xbb\xbf is no mark here", &[0, 0]);
    assert_eq!(loaded(&[("m.stl", &binary)]).0.meshes[0].faces.len(), 2);
}

/// The path of the computer on which the file was written ends as one here does.
#[test]
fn images_are_found_by_the_ends_of_their_paths() {
    let of = |name: &str, file: &str| {
        let obj = format!("mtllib m.mtl\nusemtl m\n{TRIANGLE}vt 0 0\nf 1/1 2/1 3/1\n");
        let mtl = format!("newmtl m\nmap_Kd {name}\n");
        let files = [("m.obj", obj.as_bytes()), ("m.mtl", mtl.as_bytes()), (file, &png(|_, _| [9; 4]))];
        let (scene, warnings) = loaded(&files);
        (scene.images.len(), warnings)
    };
    for (name, file) in [
        ("C:\\Users\\me\\my car\\maps\\a b.png", "maps/a b.png"),
        ("C:\\Users\\me\\my car\\maps\\a b.png", "a b.png"),
        ("/home/me/maps/body/a.png", "maps/body/a.png"),
        ("..\\..\\maps\\a.png", "maps/a.png"),
    ] {
        assert_eq!(of(name, file), (1, vec![]), "{name}");
    }
    let (n, warnings) = of("C:\\it's\\a.png", "b.png");
    assert!(n == 0 && warnings[0].contains("`C:\\it's\\a.png` leaves the folder of the scene's file"), "{warnings:?}");
    let (n, warnings) = of("a.<UDIM>.png", "a.png");
    assert!(n == 0 && warnings.len() == 1 && warnings[0].contains("there is no such image"), "{warnings:?}");
    let (_, warnings) = of("a.png\nKd 0,5 0 0", "a.png");
    assert!(warnings[0].contains("need a point in place of the comma"), "{warnings:?}");
}

/// A body whose faces are there once for each side is no room, unless there are things in it.
#[test]
fn bodies_with_a_face_for_each_side_are_seen_from_outside() {
    let scaled = |text: String| -> String {
        let line = |line: &str| match line.strip_prefix("v ") {
            Some(rest) => {
                let numbers = rest.split(' ').map(|x| (5.0 * x.parse::<f32>().unwrap()).to_string());
                format!("v {}\n", numbers.collect::<Vec<_>>().join(" "))
            }
            None => format!("{line}\n"),
        };
        text.lines().map(line).collect()
    };
    let outside = scaled(cube(Vec3::ZERO, 0));
    let inside: String = SIDES.map(|[a, b, c, d]| format!("f {} {} {} {}\n", d + 1, c + 1, b + 1, a + 1)).concat();
    let is_inside = |obj: &str| {
        let eye = loaded(&[("m.obj", obj.as_bytes())]).0.camera.eye;
        eye.cmpge(Vec3::ZERO).all() && eye.cmple(Vec3::splat(5.0)).all()
    };
    assert!(!is_inside(&format!("{outside}{inside}")));
    let things: String =
        (0..4).map(|ix| cube(Vec3::new((ix % 2 * 3) as f32, 1.0, (ix / 2 * 3) as f32), 8 + 8 * ix)).collect();
    assert!(is_inside(&format!("{outside}{inside}{things}")));
}

/// A cube is what people try first. From the height of its top, it would look like a square.
#[test]
fn the_top_of_a_cube_is_seen() {
    for size in [[1.0, 1.0, 1.0], [1.0, 0.8, 1.2], [3.0, 1.0, 1.0]] {
        let points = (0..8).map(|ix| corner(ix) * Vec3::from_array(size));
        let obj: String = points.map(|p| format!("v {} {} {}\n", p.x, p.y, p.z)).collect();
        let faces: String = SIDES.map(|side| format!("f {}\n", side.map(|ix| (ix + 1).to_string()).join(" "))).concat();
        let (scene, _) = loaded(&[("m.obj", format!("{obj}{faces}").as_bytes())]);
        assert!(scene.camera.eye.y > 1.1 * size[1], "{size:?}: {:?}", scene.camera);
    }
}
