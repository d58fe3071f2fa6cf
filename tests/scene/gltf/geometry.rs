//! Triangles of glTF files and their attributes.

use glam::{Vec2, Vec3, Vec4};
use serde_json::json;

use super::{CORNERS, F32, I8, I16, Model, U8, U16, U32, corners, cube, cube_indices, flattened, triangle};

#[test]
fn indices_of_every_size_and_none_are_the_same() {
    let expected = cube().flat().triangles;
    let indices = cube_indices();
    for component in [U8, U16, U32, 0] {
        let mut model = Model::new();
        if component == 0 {
            let positions: Vec<f32> = indices.iter().flat_map(|ix| CORNERS[*ix as usize]).collect();
            let positions = model.accessor("VEC3", F32, &positions);
            model.show(json!({ "attributes": { "POSITION": positions } }));
        } else {
            let positions = model.accessor("VEC3", F32, CORNERS.as_flattened());
            let indices = match component {
                U8 => model.accessor("SCALAR", U8, &indices.iter().map(|ix| *ix as u8).collect::<Vec<_>>()),
                U16 => model.accessor("SCALAR", U16, &indices.iter().map(|ix| *ix as u16).collect::<Vec<_>>()),
                _ => model.accessor("SCALAR", U32, &indices),
            };
            model.show(json!({ "attributes": { "POSITION": positions }, "indices": indices }));
        }
        assert_eq!(model.flat().triangles, expected, "{component}");
    }
}

#[test]
fn strips_and_fans_become_triangles() {
    let points = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 2.0, 0.0]];
    let point = |ix: usize| Vec3::from_array(points[ix]);
    let faces_of = |mode: u32, indices: &[u8]| {
        let mut model = Model::new();
        let positions = model.accessor("VEC3", F32, points.as_flattened());
        let indices = model.accessor("SCALAR", U8, indices);
        let attributes = json!({ "POSITION": positions });
        model.show(json!({ "attributes": attributes, "indices": indices, "mode": mode }));
        corners(&model)
    };
    let faces = |faces: &[[usize; 3]]| faces.iter().map(|face| face.map(point)).collect::<Vec<_>>();
    assert_eq!(faces_of(5, &[0, 1, 2, 3, 4]), faces(&[[0, 1, 2], [1, 3, 2], [2, 3, 4]]));
    // Faces without area join two strips, and the order of corners goes on.
    assert_eq!(faces_of(5, &[0, 1, 2, 2, 1, 1, 3, 4]), faces(&[[0, 1, 2], [1, 4, 3]]));
    assert_eq!(faces_of(6, &[0, 1, 3, 4]), faces(&[[1, 3, 0], [3, 4, 0]]));
    assert_eq!(faces_of(4, &[0, 1, 2, 1, 3]), faces(&[[0, 1, 2]]));
}

#[test]
fn sparse_accessors_replace_elements() {
    let mut model = triangle();
    let values = model.view(&[5.0_f32, 6.0, 7.0]);
    let indices = model.view(&[1_u16]);
    let sparse = json!({
        "count": 1, "indices": { "bufferView": indices, "componentType": U16 }, "values": { "bufferView": values },
    });
    model.json["accessors"][0]["sparse"] = sparse.clone();
    assert_eq!(corners(&model), [[Vec3::ZERO, Vec3::new(5.0, 6.0, 7.0), Vec3::Y]]);
    // Without a view, the other elements are 0.
    model.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    assert_eq!(corners(&model), [[Vec3::ZERO, Vec3::new(5.0, 6.0, 7.0), Vec3::ZERO]]);
}

#[test]
fn quantized_attributes_are_read() {
    let quantized = |component: u32, is_normalized: bool, bytes: &[u8], stride: usize| {
        let mut model = triangle();
        let view = model.view(bytes);
        model.json["bufferViews"][view]["byteStride"] = json!(stride);
        model.json["accessors"][0]["bufferView"] = json!(view);
        model.json["accessors"][0]["componentType"] = json!(component);
        model.json["accessors"][0]["normalized"] = json!(is_normalized);
        model.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
        corners(&model)[0]
    };
    let bytes = |values: [i8; 12]| values.map(|x| x as u8);
    let whole = [Vec3::ZERO, Vec3::new(127.0, 1.0, -2.0), Vec3::new(0.0, -127.0, 3.0)];
    let signed = bytes([0, 0, 0, 9, 127, 1, -2, 9, 0, -127, 3, 9]);
    assert_eq!(quantized(I8, false, &signed, 4), whole);
    assert_eq!(quantized(I8, true, &signed, 4), whole.map(|v| v / 127.0));
    // The smallest integer stands for -1, too.
    let smallest = bytes([0, 0, 0, 9, 127, 1, -2, 9, 0, -128, 3, 9]);
    assert_eq!(quantized(I8, true, &smallest, 4)[2].y, -1.0);
    let unsigned = [Vec3::ZERO, Vec3::new(127.0, 1.0, 254.0), Vec3::new(0.0, 129.0, 3.0)];
    assert_eq!(quantized(U8, false, &signed, 4), unsigned);
    assert_eq!(quantized(U8, true, &signed, 4), unsigned.map(|v| v / 255.0));
    let words: Vec<u8> =
        [0, 0, 0, 9, 32767, 1, -2, 9, 0, -32767, 3, 9_i16].iter().flat_map(|x| x.to_le_bytes()).collect();
    let whole = [Vec3::ZERO, Vec3::new(32767.0, 1.0, -2.0), Vec3::new(0.0, -32767.0, 3.0)];
    assert_eq!(quantized(I16, false, &words, 8), whole);
    assert_eq!(quantized(I16, true, &words, 8), whole.map(|v| v / 32767.0));
    assert_eq!(quantized(U16, false, &words, 8)[1], Vec3::new(32767.0, 1.0, 65534.0));
}

#[test]
fn attributes_become_corners() {
    let mut model = triangle();
    let uvs = model.accessor("VEC2", F32, &[0.0_f32, 0.5, 1.0, 0.5, 0.0, 0.25]);
    let more = model.accessor("VEC2", U8, &[0_u8, 255, 51, 0, 0, 0]);
    model.json["accessors"][more]["normalized"] = json!(true);
    let colours = model.accessor("VEC3", F32, &[0.5_f32, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0]);
    let tangents = model.accessor("VEC4", F32, &[2.0_f32, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 1.0]);
    let attributes = &mut model.json["meshes"][0]["primitives"][0]["attributes"];
    attributes["TEXCOORD_0"] = json!(uvs);
    attributes["TEXCOORD_1"] = json!(more);
    attributes["COLOR_0"] = json!(colours);
    attributes["TANGENT"] = json!(tangents);
    attributes["_OWN"] = json!(0);
    let scene = model.scene();
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.normals, [[Vec3::Z; 3]]);
    assert_eq!(mesh.uvs[0], [[Vec2::new(0.0, 0.5), Vec2::new(1.0, 0.5), Vec2::new(0.0, 0.25)]]);
    assert_eq!(mesh.uvs[1], [[Vec2::new(0.0, 1.0), Vec2::new(0.2, 0.0), Vec2::ZERO]]);
    let colours = [Vec4::new(0.5, 0.0, 0.0, 1.0), Vec4::new(0.0, 1.0, 0.0, 1.0), Vec4::new(0.0, 0.0, 2.0, 1.0)];
    assert_eq!(mesh.colours, [colours]);
    let tangents = [Vec4::new(1.0, 0.0, 0.0, 1.0), Vec4::new(1.0, 0.0, 0.0, -1.0), Vec4::new(0.0, 1.0, 0.0, 1.0)];
    assert_eq!(mesh.tangents, [tangents]);
    // Bytes and a fourth component.
    let colours = model.accessor("VEC4", U8, &[255_u8, 0, 0, 51, 0, 0, 0, 0, 0, 0, 0, 255]);
    model.json["accessors"][colours]["normalized"] = json!(true);
    model.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(colours);
    assert_eq!(model.scene().meshes[0].colours[0][0], Vec4::new(1.0, 0.0, 0.0, 0.2));
}

#[test]
fn unused_vertices_are_left_out() {
    let mut model = triangle();
    let indices = model.accessor("SCALAR", U8, &[2_u8, 1, 2]);
    model.json["meshes"][0]["primitives"][0]["indices"] = json!(indices);
    let mesh = &model.scene().meshes[0];
    assert_eq!((mesh.positions.as_slice(), mesh.faces.as_slice()), (&[Vec3::X, Vec3::Y][..], &[[1, 0, 1]][..]));
}

#[test]
fn primitives_are_slots_and_nodes_are_instances() {
    let mut model = triangle();
    let red = model.push("materials", json!({ "name": "red" }));
    let mut primitive = model.json["meshes"][0]["primitives"][0].clone();
    primitive["material"] = json!(red);
    // The same triangle would become a copy of the first one.
    primitive["indices"] = json!(model.accessor("SCALAR", U8, &[0_u8, 1, 1]));
    let mut points = primitive.clone();
    points["mode"] = json!(0);
    model.json["meshes"][0]["primitives"].as_array_mut().unwrap().extend([points, primitive]);
    model.root(json!({ "mesh": 0, "translation": [0, 0, 1] }));
    let scene = model.scene();
    assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 2));
    assert_eq!(scene.meshes[0].slots, [0, 1]);
    let names: Vec<_> = scene.instances[1].materials.iter().map(|ix| &scene.materials[*ix as usize].name[..]).collect();
    assert_eq!(names, ["(default of glTF)", "red"]);
    assert_eq!(flattened(&scene).triangles[2].v0, Vec3::Z);
}
