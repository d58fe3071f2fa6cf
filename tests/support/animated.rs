//! A glTF file whose animation moves squares and the camera.

use base64::{Engine, engine::general_purpose::STANDARD};
use serde_json::{Value, json};

/// Returns a glTF file: a square that moves to the right by 1 a second for 2 seconds and another one at rest, with a
/// camera that moves upwards, and a light. With `morphs`, the second square grows.
pub fn moving(morphs: bool) -> Value {
    let corners = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let added = corners.map(|[x, y, _]| [x, y, 0.0]);
    let (mut data, mut views, mut accessors) = (Vec::<u8>::new(), Vec::new(), Vec::new());
    let mut accessor = |kind: &str, component: u32, n: usize, bytes: &[u8]| {
        views.push(json!({ "buffer": 0, "byteOffset": data.len(), "byteLength": bytes.len() }));
        data.extend(bytes);
        accessors.push(json!({ "bufferView": views.len() - 1, "componentType": component, "count": n, "type": kind }));
        accessors.len() - 1
    };
    let bytes = |numbers: &[f32]| bytemuck::cast_slice::<f32, u8>(numbers).to_vec();
    let positions = accessor("VEC3", 5126, 4, &bytes(corners.as_flattened()));
    let target = accessor("VEC3", 5126, 4, &bytes(added.as_flattened()));
    let indices = accessor("SCALAR", 5125, 6, bytemuck::cast_slice(&[0_u32, 1, 2, 0, 2, 3]));
    let times = accessor("SCALAR", 5126, 2, &bytes(&[0.0, 2.0]));
    let places = accessor("VEC3", 5126, 2, &bytes(&[-1.0, 0.0, 0.0, 1.0, 0.0, 0.0]));
    let of_camera = accessor("VEC3", 5126, 2, &bytes(&[0.0, 0.0, 6.0, 0.0, 0.5, 6.0]));
    let weights = accessor("SCALAR", 5126, 2, &bytes(&[0.0, 1.0]));
    let primitive = json!({ "attributes": { "POSITION": positions }, "indices": indices });
    let mut growing = primitive.clone();
    growing["targets"] = json!([{ "POSITION": target }]);
    let sampler = |output: usize| json!({ "input": times, "output": output });
    let channel =
        |ix: usize, node: usize, path: &str| json!({ "sampler": ix, "target": { "node": node, "path": path } });
    let mut channels = vec![channel(0, 0, "translation"), channel(1, 2, "translation")];
    channels.extend(morphs.then(|| channel(2, 1, "weights")));
    let uri = format!("data:application/octet-stream;base64,{}", STANDARD.encode(&data));
    json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0, 1, 2, 3] }],
        "nodes": [
            { "mesh": 0 }, { "mesh": if morphs { 1 } else { 0 }, "translation": [0.2, -1.2, 0.5] },
            { "camera": 0 }, { "extensions": { "KHR_lights_punctual": { "light": 0 } } },
        ],
        "meshes": [{ "primitives": [primitive] }, { "primitives": [growing], "weights": [0] }],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1 } }],
        "animations": [{
            "name": "slide", "channels": channels,
            "samplers": [sampler(places), sampler(of_camera), sampler(weights)],
        }],
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "directional", "intensity": 3 }] } },
        "buffers": [{ "byteLength": data.len(), "uri": uri }], "bufferViews": views, "accessors": accessors,
    })
}
