//! Compressed buffer views of glTF files.

use glam::{Vec3, Vec4};
use serde_json::{Value, json};

use super::{CORNERS, I8, Random, cube, cube_indices, triangle};

#[test]
fn compressed_views_are_decoded() {
    let expected = cube().flat().triangles;
    let mut model = cube();
    let indices = cube_indices();
    let corners: Vec<[f32; 3]> = CORNERS.to_vec();
    let packed = [
        (meshopt::encode_vertex_buffer(&corners).unwrap(), 12, corners.len(), "ATTRIBUTES"),
        (meshopt::encode_index_buffer(&indices, corners.len()).unwrap(), 4, indices.len(), "TRIANGLES"),
        (meshopt::encode_index_sequence(&indices, corners.len()).unwrap(), 4, indices.len(), "INDICES"),
    ];
    model.data.clear();
    model.push("bufferViews", Value::Null);
    for (ix, (bytes, stride, n, mode)) in packed.into_iter().enumerate() {
        let offset = model.data.len();
        let n_bytes = bytes.len();
        model.data.extend(bytes);
        let extension = json!({
            "buffer": 0, "byteOffset": offset, "byteLength": n_bytes, "byteStride": stride, "count": n, "mode": mode,
        });
        let view = json!({
            "buffer": 1, "byteLength": stride * n, "extensions": { "EXT_meshopt_compression": extension },
        });
        model.json["bufferViews"][ix] = view;
    }
    model.json["buffers"][0]["byteLength"] = json!(model.data.len());
    let fallback = json!({ "EXT_meshopt_compression": { "fallback": true } });
    model.push("buffers", json!({ "byteLength": 1000, "extensions": fallback }));
    model.json["extensionsRequired"] = json!(["EXT_meshopt_compression"]);
    // The codec of triangles may turn their corners.
    let sorted = |triangles: &[kdray::layout::Triangle]| {
        let key = |t: &kdray::layout::Triangle| {
            let mut corners = [t.v0, t.v1, t.v2].map(|v| v.to_array().map(f32::to_bits));
            corners.sort();
            corners
        };
        let mut keys: Vec<_> = triangles.iter().map(key).collect();
        keys.sort();
        keys
    };
    assert_eq!(sorted(&model.flat().triangles), sorted(&expected));
    model.json["accessors"][1]["bufferView"] = json!(2);
    assert_eq!(model.flat().triangles, expected, "a sequence of indices");
    // Spoilt data and sizes are refused.
    for (key, value) in
        [("count", json!(7e12)), ("byteStride", json!(3)), ("byteLength", json!(1)), ("buffer", json!(9))]
    {
        let mut wrong = model.clone();
        wrong.json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"][key] = value;
        let error = wrong.load().unwrap_err();
        assert!(error.contains("bufferViews[0].extensions") || error.contains("the JSON"), "{key}: {error}");
    }
    let mut random = Random(9);
    for _ in 0..500 {
        let mut spoilt = model.clone();
        let at = random.below(spoilt.data.len());
        spoilt.data[at] = random.below(256) as u8;
        let _ = spoilt.load();
    }
}

#[test]
fn octahedral_normals_are_decoded() {
    let mut model = triangle();
    let normal = Vec4::new(0.6, 0.0, 0.8, 0.0).to_array();
    let encoded = meshopt::encode_filter_oct::<i8>(&[normal; 3], 8);
    let bytes = meshopt::encode_vertex_buffer(&encoded).unwrap();
    let source = model.view(&bytes);
    let source = model.json["bufferViews"][source].clone();
    let extension = json!({
        "buffer": 0, "byteOffset": source["byteOffset"], "byteLength": bytes.len(), "byteStride": 4, "count": 3,
        "mode": "ATTRIBUTES", "filter": "OCTAHEDRAL",
    });
    model.json["bufferViews"][1] = json!({
        "buffer": 0, "byteLength": 12, "byteStride": 4, "extensions": { "EXT_meshopt_compression": extension },
    });
    model.json["accessors"][1]["componentType"] = json!(I8);
    model.json["accessors"][1]["normalized"] = json!(true);
    let found = model.scene().meshes[0].normals[0][0];
    assert!(found.distance(Vec3::new(0.6, 0.0, 0.8)) < 0.02, "{found}");
}
