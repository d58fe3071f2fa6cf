//! glTF files that are wrong.

use serde_json::{Value, json};

use super::{CORNERS, F32, Model, Random, U8, U32, cube, cube_indices, load_bytes, triangle};

/// A change that makes a model wrong, and what the error says.
type Mistake = (&'static str, fn(&mut Value), &'static str);

#[test]
fn mistakes_are_named() {
    let mistakes: [Mistake; 33] = [
        ("version", |m| m["asset"]["version"] = json!("1.0"), "asset: this is glTF 1.0"),
        ("asset", |m| drop(m.as_object_mut().unwrap().remove("asset")), "the JSON: missing field `asset`"),
        ("required", |m| m["extensionsRequired"] = json!(["KHR_x"]), "extensionsRequired: the file needs `KHR_x`"),
        ("buffer", |m| m["buffers"][0]["byteLength"] = json!(9999), "buffers[0]: has 120 bytes, but byteLength = 9999"),
        ("buffers", |m| m["buffers"] = json!([]), "bufferViews[0]: there is no buffers[0], but only 0"),
        ("uri", |m| m["buffers"][0]["uri"] = json!("data:;base64,*"), "buffers[0]: a data URI is not base64"),
        ("comma", |m| m["buffers"][0]["uri"] = json!("data:"), "buffers[0]: a data URI lacks its comma"),
        ("view", |m| m["bufferViews"][0]["byteLength"] = json!(9999), "bufferViews[0]: 9999 bytes from byte 0 on"),
        ("offset", |m| m["bufferViews"][0]["byteOffset"] = json!(u64::MAX), "bufferViews[0]: 96 bytes from byte"),
        ("stride", |m| m["bufferViews"][0]["byteStride"] = json!(4), "accessors[0]: its view has byteStride = 4"),
        ("count", |m| m["accessors"][0]["count"] = json!(9), "POSITION: accessors[0]: 9 elements from byte 0 on"),
        ("large", |m| m["accessors"][0]["count"] = json!(u64::MAX), "accessors[0]: count = 18446744073709551615"),
        ("far", |m| m["accessors"][0]["byteOffset"] = json!(u64::MAX), "accessors[0]: 8 elements from byte"),
        (
            "type",
            |m| m["accessors"][0]["type"] = json!("VEC2"),
            "POSITION: accessors[0]: its type must be one of [Vec3]",
        ),
        ("component", |m| m["accessors"][0]["componentType"] = json!(U32), "its componentType, U32, is not allowed"),
        ("unknown", |m| m["accessors"][0]["componentType"] = json!(7), "its componentType is unknown"),
        (
            "floats",
            |m| m["accessors"][1]["componentType"] = json!(F32),
            "indices: accessors[1]: its componentType, F32",
        ),
        (
            "indices",
            |m| m["accessors"][0]["count"] = json!(4),
            "primitives[0].indices: element 3 is 4, but there are 4",
        ),
        (
            "accessor",
            |m| m["meshes"][0]["primitives"][0]["indices"] = json!(9),
            "primitives[0].indices: there is no accessors[9]",
        ),
        (
            "bare",
            |m| m["meshes"][0]["primitives"][0]["attributes"] = json!({}),
            "primitives[0].attributes: there is no POSITION",
        ),
        ("mode", |m| m["meshes"][0]["primitives"][0]["mode"] = json!(7), "primitives[0]: its mode is none of 0 to 6"),
        (
            "material",
            |m| m["meshes"][0]["primitives"][0]["material"] = json!(0),
            "primitives[0].material: there is no materials[0]",
        ),
        ("mesh", |m| m["nodes"][0]["mesh"] = json!(1), "nodes[0].mesh: there is no meshes[1], but only 1"),
        ("node", |m| m["scenes"][0]["nodes"] = json!([5]), "scenes: there is no nodes[5]"),
        ("scene", |m| m["scene"] = json!(5), "scene: there is no scenes[5]"),
        ("child", |m| m["nodes"][0]["children"] = json!([5]), "nodes[0].children: there is no nodes[5]"),
        ("cycle", |m| m["nodes"][0]["children"] = json!([0]), "nodes[0].children: leads to nodes[0] a second time"),
        ("twice", |m| m["scenes"][0]["nodes"] = json!([0, 0]), "scenes: leads to nodes[0] a second time"),
        ("scale", |m| m["nodes"][0]["scale"] = json!([3e38, 1, 1]), "nodes[0]: a vertex lies at"),
        ("far off", |m| m["nodes"][0]["scale"] = json!([1e12, 1, 1]), "nodes[0]: a vertex lies at"),
        ("skin", |m| m["nodes"][0]["skin"] = json!(0), "nodes[0].skin: there is no skins[0]"),
        (
            "flat camera",
            |m| {
                let flat = json!({ "xmag": 1, "ymag": 0, "znear": 0, "zfar": 9 });
                m["cameras"] = json!([{ "type": "orthographic", "orthographic": flat }]);
                m["nodes"][0]["camera"] = json!(0);
            },
            "cameras[0]: orthographic.ymag = 0 is outside",
        ),
        ("empty", |m| m["scenes"][0]["nodes"] = json!([]), "has no triangles"),
    ];
    let mut model = cube();
    let indices = model.accessor("SCALAR", U8, &cube_indices().iter().map(|ix| *ix as u8).collect::<Vec<_>>());
    assert_eq!(indices, 2);
    let mut model = Model::new();
    let positions = model.accessor("VEC3", F32, CORNERS.as_flattened());
    let indices =
        model.accessor("SCALAR", U8, &[0_u8, 1, 2, 4, 5, 6, 0, 3, 7, 0, 2, 6, 1, 5, 7, 4, 3, 6, 1, 2, 6, 3, 7, 4]);
    model.show(json!({ "attributes": { "POSITION": positions }, "indices": indices }));
    model.load().unwrap();
    for (name, change, what) in mistakes {
        let mut wrong = model.clone();
        change(&mut wrong.json);
        let error = wrong.load().expect_err(name);
        let is_named = error.contains("model.glb: ") && error.contains(what) && error.lines().count() == 1;
        assert!(is_named, "{name}: {error}");
    }
    let mut nan = model;
    nan.data[..4].copy_from_slice(&f32::NAN.to_le_bytes());
    let error = nan.load().unwrap_err();
    assert!(error.contains("meshes[0].primitives[0].attributes.POSITION: element 0 is [NaN, "), "{error}");
}

#[test]
fn broken_containers_are_named() {
    let glb = cube().glb();
    let changed = |at: usize, byte: u8| {
        let mut bytes = glb.clone();
        bytes[at] = byte;
        bytes
    };
    for (bytes, what) in [
        (glb[..6].to_vec(), "the header ends too early"),
        (glb[..14].to_vec(), "the header of the chunk JSON ends too early"),
        (glb[..100].to_vec(), "the chunk JSON: "),
        (glb[..glb.len() - 8].to_vec(), "the chunk BIN: "),
        (changed(4, 1), "is a GLB file of version 1"),
        (changed(16, b'j'), "there is no chunk JSON at byte 12"),
        (changed(20, b'['), "the JSON: "),
        (b"{ \"asset\": 1".to_vec(), "the JSON: "),
    ] {
        let error = load_bytes("x.glb", &bytes).unwrap_err();
        assert!(error.contains("x.glb: ") && error.contains(what) && error.lines().count() == 1, "{what}: {error}");
    }
    let deep = format!("{{ \"asset\": {{ \"version\": \"2.0\" }}, \"extensions\": {{ \"x\": {}", "[".repeat(100_000));
    assert!(load_bytes("x.gltf", deep.as_bytes()).unwrap_err().contains("recursion limit"));
}

/// A model with a bit of everything.
fn everything() -> Model {
    let mut model = triangle();
    let uvs = model.accessor("VEC2", F32, &[0.0_f32, 0.5, 1.0, 0.5, 0.0, 0.25]);
    let indices = model.accessor("SCALAR", U8, &[0_u8, 1, 2, 1]);
    let joints = model.accessor("VEC4", U8, &[0_u8; 12]);
    let weights = model.accessor("VEC4", U8, &[255_u8, 0, 0, 0, 255, 0, 0, 0, 255, 0, 0, 0]);
    let sparse = json!({
        "count": 1, "indices": { "bufferView": 3, "componentType": U8 }, "values": { "bufferView": 0 },
    });
    model.json["accessors"][0]["sparse"] = sparse;
    let primitive = &mut model.json["meshes"][0]["primitives"][0];
    primitive["attributes"]["TEXCOORD_0"] = json!(uvs);
    primitive["attributes"]["JOINTS_0"] = json!(joints);
    primitive["attributes"]["WEIGHTS_0"] = json!(weights);
    primitive["indices"] = json!(indices);
    primitive["mode"] = json!(5);
    primitive["material"] = json!(0);
    primitive["targets"] = json!([{ "POSITION": 0 }]);
    model.json["meshes"][0]["weights"] = json!([0.5]);
    model.push("textures", json!({ "source": 0, "sampler": 0 }));
    model.push("samplers", json!({ "wrapS": 33071, "magFilter": 9728 }));
    model.push("images", json!({ "bufferView": 0, "mimeType": "image/png" }));
    model.push("materials", json!({ "normalTexture": { "index": 0 }, "alphaMode": "MASK" }));
    model.push("skins", json!({ "joints": [1] }));
    model.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": 1, "znear": 0.1 } }));
    model.json["nodes"][0]["skin"] = json!(0);
    model.json["nodes"][0]["children"] = json!([1]);
    model.push("nodes", json!({ "camera": 0, "scale": [1, 2, 3] }));
    model.root(json!({ "mesh": 0, "rotation": [0.6, 0, 0, 0.8] }));
    model
}

/// Changes random bytes and cuts files off. Files are loaded or refused, in one line, and nothing else happens.
#[test]
fn spoilt_files_are_no_trouble() {
    let mut random = Random(7);
    let glb = everything().glb();
    load_bytes("x.glb", &glb).unwrap();
    let mut n_refused = 0;
    for _ in 0..2000 {
        let mut content = glb.clone();
        for _ in 0..1 + random.below(3) {
            let at = random.below(content.len());
            // Digits keep the JSON whole, so that the numbers in it are tried.
            let is_digit = content[at].is_ascii_digit();
            content[at] = if is_digit { b'0' + random.below(10) as u8 } else { random.below(256) as u8 };
        }
        if random.below(8) == 0 {
            content.truncate(random.below(content.len()));
        }
        if let Err(error) = load_bytes("x.glb", &content) {
            n_refused += 1;
            assert_eq!(error.lines().count(), 1, "{error}");
        }
    }
    assert!((200..2000).contains(&n_refused), "{n_refused} of 2000");
}

/// Changes numbers of the JSON alone, to small and to extreme ones.
#[test]
fn wrong_numbers_are_no_trouble() {
    let mut random = Random(8);
    let model = everything();
    let extreme =
        ["0", "1", "2", "3", "7", "-1", "255", "65536", "4294967295", "4294967296", "18446744073709551615", "1e300"];
    let text = model.json.to_string();
    let is_number_at = |at: &usize| text.as_bytes()[*at].is_ascii_digit() && b"[:,".contains(&text.as_bytes()[*at - 1]);
    let starts: Vec<_> = (1..text.len()).filter(is_number_at).collect();
    let mut n_refused = 0;
    for _ in 0..2000 {
        let mut changed = text.clone();
        let start = *random.of(&starts);
        let n_digits = changed[start..].bytes().take_while(|byte| byte.is_ascii_digit() || *byte == b'.').count();
        changed.replace_range(start..start + n_digits, extreme[random.below(extreme.len())]);
        let Ok(json) = serde_json::from_str(&changed) else { continue };
        let changed = Model { json, data: model.data.clone() };
        n_refused += usize::from(changed.load().is_err_and(|error| error.lines().count() == 1));
    }
    assert!((500..2000).contains(&n_refused), "{n_refused} of 2000");
}
