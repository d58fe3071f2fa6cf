//! Morph targets and skins of glTF files.

use glam::{Mat4, Quat, Vec2, Vec3, Vec4};
use serde_json::json;

use super::{F32, U8, agreement, corners, flattened, triangle};

#[test]
fn morph_targets_have_their_default_weights() {
    let mut model = triangle();
    let moved = model.accessor("VEC3", F32, &[0.0_f32, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let turned = model.accessor("VEC3", F32, &[2.0_f32, 0.0, -1.0, 2.0, 0.0, -1.0, 2.0, 0.0, -1.0]);
    let targets = json!([{ "POSITION": moved, "NORMAL": turned }, { "POSITION": 0 }]);
    model.json["meshes"][0]["primitives"][0]["targets"] = targets;
    assert_eq!(corners(&model)[0][1], Vec3::X);
    model.json["meshes"][0]["weights"] = json!([1, 0]);
    assert_eq!(corners(&model)[0], [Vec3::ZERO, Vec3::new(3.0, 0.0, 0.0), Vec3::Y]);
    assert_eq!(model.scene().meshes[0].normals[0][1], Vec3::X);
    // A node's own weights count, and its mesh is another one.
    model.root(json!({ "mesh": 0, "weights": [0, 1] }));
    let scene = model.scene();
    assert_eq!(scene.meshes.len(), 2);
    assert!(scene.meshes.iter().all(|mesh| !mesh.deforms), "nothing moves them");
    assert_eq!(flattened(&scene).triangles[1].v2, 2.0 * Vec3::Y);
}

#[test]
fn skins_place_their_meshes() {
    let mut model = triangle();
    let joints = model.accessor("VEC4", U8, &[0_u8, 1, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0]);
    let weights = model.accessor("VEC4", F32, &[1.0_f32, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    let bind = [Mat4::from_translation(Vec3::Z).to_cols_array(), Mat4::IDENTITY.to_cols_array()].concat();
    let bind = model.accessor("MAT4", F32, &bind);
    let attributes = &mut model.json["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    // The node's own transform has no effect. Joint 1 hangs on joint 0.
    model.json["nodes"][0] = json!({ "mesh": 0, "skin": 0, "translation": [100, 0, 0] });
    model.root(json!({ "translation": [0, 0, 10], "children": [2] }));
    model.push("nodes", json!({ "translation": [0, 0, 10] }));
    model.push("skins", json!({ "joints": [1, 2], "inverseBindMatrices": bind }));
    let heights = corners(&model)[0].map(|corner| corner.z);
    assert_eq!(heights, [11.0, 15.5, 20.0]);
    assert_eq!(corners(&model)[0].map(|corner| corner.x), [0.0, 1.0, 0.0]);
    assert!(agreement(&model) > 0.0);
    assert!(!model.scene().meshes[0].deforms, "nothing moves it");
}

/// Single precision has multiples of 0.03 at 500 km, and the edges are a hundredth long.
#[test]
fn far_skins_keep_the_details_of_their_meshes() {
    let mut model = triangle();
    let joints = model.accessor("VEC4", U8, &[0_u8; 12]);
    let weights = model.accessor("VEC4", F32, &[[1.0_f32, 0.0, 0.0, 0.0]; 3].concat());
    let attributes = &mut model.json["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    model.json["nodes"][0]["skin"] = json!(0);
    model.root(json!({ "translation": [500_000, 0, 0], "scale": [0.01, 0.01, 0.01] }));
    model.push("skins", json!({ "joints": [1] }));
    let scene = model.scene();
    let mesh = &scene.meshes[0];
    let [a, b, c] = mesh.faces[0].map(|ix| mesh.positions[ix as usize]);
    assert!(((b - a) - 0.01 * Vec3::X).length() < 1e-7 && ((c - a) - 0.01 * Vec3::Y).length() < 1e-7, "{a} {b} {c}");
    let placed = scene.instances[0].transform.point(a);
    assert!((placed - Vec3::new(500_000.0, 0.0, 0.0)).length() <= 0.04, "{placed}");
    // A near mesh is not moved.
    model.json["nodes"][1]["translation"] = json!([0.5, 0, 0]);
    assert_eq!(model.scene().meshes[0].positions[0], Vec3::new(0.5, 0.0, 0.0));
}

/// At rest the mesh is 500 km away, from where its joint, which turns, takes it to the origin.
#[test]
fn skins_of_far_meshes_keep_their_details() {
    let mut model = triangle();
    let far = [500_000.0_f32, 0.0, 0.0, 500_001.0, 0.0, 0.0, 500_000.0, 1.0, 0.0];
    let positions = model.accessor("VEC3", F32, &far);
    let joints = model.accessor("VEC4", U8, &[0_u8; 12]);
    let weights = model.accessor("VEC4", F32, &[[1.0_f32, 0.0, 0.0, 0.0]; 3].concat());
    let bind = Mat4::from_translation(Vec3::new(-500_000.0, 0.0, 0.0)).to_cols_array();
    let bind = model.accessor("MAT4", F32, &bind);
    let attributes = &mut model.json["meshes"][0]["primitives"][0]["attributes"];
    attributes["POSITION"] = json!(positions);
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    model.json["nodes"][0]["skin"] = json!(0);
    model.root(json!({ "rotation": Quat::from_rotation_z(0.3).to_array() }));
    model.push("skins", json!({ "joints": [1], "inverseBindMatrices": bind }));
    let expected = [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| Quat::from_rotation_z(0.3) * p);
    for (found, expected) in corners(&model)[0].into_iter().zip(expected) {
        assert!(found.distance(expected) < 1e-6, "{found} in place of {expected}");
    }
}

/// The node of a mesh says which side of its faces is outside, although a skin places the mesh.
#[test]
fn the_node_of_a_skinned_mesh_decides_which_side_is_outside() {
    let mut model = triangle();
    let joints = model.accessor("VEC4", U8, &[0_u8; 12]);
    let weights = model.accessor("VEC4", F32, &[[1.0_f32, 0.0, 0.0, 0.0]; 3].concat());
    let attributes = &mut model.json["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    model.json["nodes"][0]["skin"] = json!(0);
    model.root(json!({ "scale": [1, 1, 1] }));
    model.push("skins", json!({ "joints": [1] }));
    for (node, joint, outside) in [(1, 1, 1.0), (-1, 1, -1.0), (1, -1, -1.0), (-1, -1, 1.0)] {
        model.json["nodes"][0]["scale"] = json!([node, 1, 1]);
        model.json["nodes"][1]["scale"] = json!([joint, 1, 1]);
        let [a, b, c] = corners(&model)[0];
        assert_eq!((b - a).cross(c - a), outside * Vec3::Z, "{node} {joint}");
    }
}

#[test]
fn morph_targets_change_texture_coordinates_and_colours() {
    let mut model = triangle();
    let uvs = model.accessor("VEC2", F32, &[0.0_f32, 0.5, 1.0, 0.5, 0.0, 0.25]);
    let colours = model.accessor("VEC3", F32, &[0.5_f32, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    let moved = model.accessor("VEC2", F32, &[0.5_f32, 0.0, 0.0, 0.25, 0.0, 0.0]);
    let fade = model.accessor("VEC4", F32, &[-1.0_f32, 2.0, 0.25, -0.5, 0.0, -0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let primitive = &mut model.json["meshes"][0]["primitives"][0];
    primitive["attributes"]["TEXCOORD_1"] = json!(uvs);
    primitive["attributes"]["COLOR_0"] = json!(colours);
    primitive["targets"] = json!([{ "TEXCOORD_0": moved }, { "TEXCOORD_1": moved, "COLOR_0": fade }]);
    // A target for an attribute that the primitive lacks has no effect.
    model.json["meshes"][0]["weights"] = json!([1, 1]);
    let mesh = &model.scene().meshes[0];
    assert!(mesh.uvs[0].is_empty());
    assert_eq!(mesh.uvs[1], [[Vec2::new(0.5, 0.5), Vec2::new(1.0, 0.75), Vec2::new(0.0, 0.25)]]);
    let expected = [Vec4::new(0.0, 1.0, 0.25, 0.5), Vec4::new(0.0, 0.5, 0.0, 1.0), Vec4::new(0.0, 0.0, 1.0, 1.0)];
    assert_eq!(mesh.colours, [expected]);
    model.json["meshes"][0]["weights"] = json!([1, 0.5]);
    assert_eq!(model.scene().meshes[0].uvs[1][0][1], Vec2::new(1.0, 0.625));
    for (attribute, what) in [("TEXCOORD_1", "Vec2"), ("COLOR_0", "Vec3")] {
        let mut wrong = model.clone();
        wrong.json["meshes"][0]["primitives"][0]["targets"][1][attribute] = json!(99);
        let warnings = wrong.told().1;
        assert!(warnings.contains(&format!("targets[1].{attribute}: there is no accessors[99]")), "{what}: {warnings}");
    }
}

/// The bitangent is the cross product of normal and tangent times w. A reflection reflects all three.
#[test]
fn a_skin_that_mirrors_keeps_the_side_of_the_bitangent() {
    let mut model = triangle();
    let joints = model.accessor("VEC4", U8, &[0_u8; 12]);
    let weights = model.accessor("VEC4", F32, &[[1.0_f32, 0.0, 0.0, 0.0]; 3].concat());
    let tangents = model.accessor("VEC4", F32, &[[1.0_f32, 0.0, 0.0, 1.0]; 3].concat());
    let attributes = &mut model.json["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    attributes["TANGENT"] = json!(tangents);
    model.json["nodes"][0]["skin"] = json!(0);
    model.root(json!({ "scale": [1, 1, 1] }));
    model.push("skins", json!({ "joints": [1] }));
    for scale in [[1.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [1.0, -2.0, 1.0], [1.0, 1.0, -1.0], [-1.0, -1.0, -1.0_f32]] {
        model.json["nodes"][1]["scale"] = json!(scale);
        let mesh = &model.scene().meshes[0];
        let (normal, tangent) = (mesh.normals[0][0], mesh.tangents[0][0]);
        let bitangent = tangent.w * normal.cross(tangent.truncate());
        let expected = (Vec3::from_array(scale) * Vec3::Y).normalize();
        assert!(bitangent.distance(expected) < 1e-6, "{scale:?}: {bitangent} in place of {expected}");
    }
}
