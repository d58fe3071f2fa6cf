//! glTF files that are wrong.

use glam::{Vec2, Vec3, Vec4};
use serde_json::{Value, json};

use super::{CORNERS, F32, Model, Random, U8, U32, cube, load_bytes, triangle};

/// A change that makes a model wrong, and what is said of it.
type Mistake = (&'static str, fn(&mut Value), &'static str);

/// Returns a model of eight triangles, which use all vertices.
fn eight_triangles() -> Model {
    let mut model = Model::new();
    let positions = model.accessor("VEC3", F32, CORNERS.as_flattened());
    let indices =
        model.accessor("SCALAR", U8, &[0_u8, 1, 2, 4, 5, 6, 0, 3, 7, 0, 2, 6, 1, 5, 7, 4, 3, 6, 1, 2, 6, 3, 7, 4]);
    model.show(json!({ "attributes": { "POSITION": positions }, "indices": indices }));
    model
}

#[test]
fn mistakes_that_leave_nothing_are_named() {
    let mistakes: [Mistake; 23] = [
        ("version", |m| m["asset"]["version"] = json!("1.0"), "asset: this is glTF 1.0"),
        ("required", |m| m["extensionsRequired"] = json!(["KHR_x"]), "extensionsRequired: the file needs `KHR_x`"),
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
        ("mesh", |m| m["nodes"][0]["mesh"] = json!(1), "nodes[0].mesh: there is no meshes[1], but only 1"),
        ("node", |m| m["scenes"][0]["nodes"] = json!([5]), "scenes: there is no nodes[5]"),
        ("scale", |m| m["nodes"][0]["scale"] = json!([3e38, 1, 1]), "nodes[0]: a vertex lies at"),
        ("far off", |m| m["nodes"][0]["scale"] = json!([1e12, 1, 1]), "nodes[0]: a vertex lies at"),
        ("empty", |m| m["scenes"][0]["nodes"] = json!([]), "has no triangles"),
    ];
    let model = eight_triangles();
    model.load().unwrap();
    for (name, change, what) in mistakes {
        let mut wrong = model.clone();
        change(&mut wrong.json);
        let error = wrong.load().expect_err(name);
        let is_named = error.contains("model.glb: ") && error.contains(what) && error.lines().count() == 1;
        assert!(is_named, "{name}: {error}");
    }
}

/// As many triangles as before are shown, or those whose vertices there are.
#[test]
fn mistakes_that_leave_something_are_told() {
    let mistakes: [Mistake; 10] = [
        ("asset", |m| drop(m.as_object_mut().unwrap().remove("asset")), "asset.version: is missing (`2.0` is taken)"),
        ("buffer", |m| m["buffers"][0]["byteLength"] = json!(9999), "buffers[0]: has 120 bytes, but byteLength = 9999"),
        ("indices", |m| m["accessors"][0]["count"] = json!(4), "primitives[0].indices: 4, but there are 4"),
        (
            "material",
            |m| m["meshes"][0]["primitives"][0]["material"] = json!(0),
            "primitives[0].material: there is no materials[0]",
        ),
        ("scene", |m| m["scene"] = json!(5), "scene: there is no scenes[5]"),
        ("child", |m| m["nodes"][0]["children"] = json!([5]), "nodes[0].children: there is no nodes[5]"),
        ("cycle", |m| m["nodes"][0]["children"] = json!([0]), "nodes[0].children: leads to nodes[0] a second time"),
        ("twice", |m| m["scenes"][0]["nodes"] = json!([0, 0]), "scenes: leads to nodes[0] a second time"),
        ("skin", |m| m["nodes"][0]["skin"] = json!(0), "nodes[0].skin: meshes[0] has no joints"),
        (
            "flat camera",
            |m| {
                let flat = json!({ "xmag": 1, "ymag": 0, "znear": 0, "zfar": 9 });
                m["cameras"] = json!([{ "type": "orthographic", "orthographic": flat }]);
                m["nodes"][0]["camera"] = json!(0);
            },
            "cameras[0]: orthographic.ymag = 0 is outside",
        ),
    ];
    let model = eight_triangles();
    for (name, change, what) in mistakes {
        let mut wrong = model.clone();
        change(&mut wrong.json);
        let (scene, warnings) = wrong.told();
        assert!(warnings.contains(what) && warnings.lines().count() == 1, "{name}: {warnings}");
        assert_eq!(scene.n_triangles(), if name == "indices" { 1 } else { 8 }, "{name}");
    }
}

#[test]
fn numbers_that_are_not_finite_count_as_not_given() {
    let mut model = eight_triangles();
    model.data[..4].copy_from_slice(&f32::NAN.to_le_bytes());
    let (scene, warnings) = model.told();
    assert!(warnings.contains("meshes[0].primitives[0].attributes.POSITION: element 0 is [NaN, "), "{warnings}");
    // The others do not use the first vertex.
    assert_eq!(scene.n_triangles(), 5);
    assert!(scene.meshes[0].positions.iter().all(|p| p.is_finite()));

    let mut model = triangle();
    let nan = [f32::NAN; 12];
    for (name, kind, n) in [("NORMAL", "VEC3", 9), ("TANGENT", "VEC4", 12), ("TEXCOORD_0", "VEC2", 6)] {
        let accessor = model.accessor(kind, F32, &nan[..n]);
        model.json["meshes"][0]["primitives"][0]["attributes"][name] = json!(accessor);
    }
    let colours = model.accessor("VEC3", F32, &[0.5, 0.25, 0.0, f32::NAN, 0.0, 0.0, 0.5, 0.25, 0.0]);
    model.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(colours);
    let (scene, warnings) = model.told();
    let mesh = &scene.meshes[0];
    assert_eq!((mesh.normals[0], mesh.uvs[0][0]), ([Vec3::ZERO; 3], [Vec2::ZERO; 3]));
    assert_eq!(mesh.colours[0][1], Vec4::ONE);
    assert_eq!(mesh.colours[0][2], Vec4::new(0.5, 0.25, 0.0, 1.0));
    for name in ["NORMAL", "TANGENT", "TEXCOORD_0", "COLOR_0"] {
        assert_eq!(warnings.matches(name).count(), 1, "{name}: {warnings}");
    }
}

/// Other readers load all of these, and each is shown as its maker meant it.
#[test]
fn odd_numbers_and_words_are_read_as_they_are_meant() {
    let with_material = |m: &mut Value| {
        m["materials"] =
            json!([{ "pbrMetallicRoughness": { "baseColorFactor": [0.8, 0.1, 0.1, 1], "metallicFactor": 0 } }]);
        m["meshes"][0]["primitives"][0]["material"] = json!(0);
    };
    let cases: [Mistake; 16] = [
        ("null", |m| m["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] = Value::Null, ""),
        (
            "rough",
            |m| m["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] = json!(50),
            "clamped: materials[0].roughnessFactor = 50 (to 1)",
        ),
        (
            "alpha",
            |m| m["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"][3] = json!(1.00016),
            "materials[0].baseColorFactor[3] = 1.00016 (to 1)",
        ),
        (
            "metal",
            |m| m["materials"][0]["pbrMetallicRoughness"]["metallicFactor"] = json!(-1e-7),
            "materials[0].metallicFactor = -0.0000001 (to 0)",
        ),
        (
            "mode",
            |m| m["materials"][0]["alphaMode"] = json!("mask"),
            "materials[0].alphaMode: `mask` (`MASK` is taken)",
        ),
        ("extras", |m| m["nodes"][0]["extras"] = json!([null, "x"]), ""),
        ("number", |m| m["materials"][0]["extras"] = json!(42), ""),
        (
            "image",
            |m| {
                m["images"] = json!([{ "name": "x" }]);
                m["textures"] = json!([{ "source": 0 }]);
                m["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": 0 });
            },
            "images[0]: has neither uri nor bufferView",
        ),
        (
            "camera",
            |m| {
                m["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 0.7 } }]);
                m["nodes"][0]["camera"] = json!(0);
            },
            "cameras[0].perspective.znear: is missing",
        ),
        (
            "light",
            |m| {
                m["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "area" }] } });
                m["nodes"][0]["extensions"] = json!({ "KHR_lights_punctual": { "light": 0 } });
            },
            "lights[0] at nodes[0]: its type is none of",
        ),
        (
            "animation",
            |m| {
                let channels = json!([{ "sampler": 0, "target": { "path": "pointer" } }]);
                m["animations"] = json!([{ "channels": channels, "samplers": [{ "input": 0, "output": 0 }] }]);
            },
            "animations, which --at SECONDS shows",
        ),
        ("scene", |m| m["scenes"].as_array_mut().unwrap().push(json!({ "name": "empty" })), ""),
        ("parent", |m| m["nodes"].as_array_mut().unwrap().push(json!({ "children": [0] })), ""),
        ("version", |m| m["asset"]["version"] = json!("2"), ""),
        (
            "fallback",
            |m| {
                m["buffers"].as_array_mut().unwrap().push(json!({ "byteLength": 9 }));
                let packed = json!({ "buffer": 0, "byteLength": 9, "byteStride": 4, "count": 1, "mode": "ATTRIBUTES" });
                let view = json!({
                    "buffer": 1, "byteLength": 9, "extensions": { "EXT_meshopt_compression": packed },
                });
                m["bufferViews"].as_array_mut().unwrap().push(view);
            },
            "bufferViews[2].extensions: meshopt_compression",
        ),
        ("whole", |m| m["accessors"][0]["count"] = json!(8.0), ""),
    ];
    let mut model = eight_triangles();
    with_material(&mut model.json);
    for (name, change, what) in cases {
        let mut odd = model.clone();
        change(&mut odd.json);
        let (scene, warnings) = odd.told();
        assert_eq!(scene.n_triangles(), 8, "{name}");
        assert_eq!(scene.materials[0].kd, Vec3::new(0.8, 0.1, 0.1), "{name}");
        match what {
            "" => assert_eq!(warnings, "", "{name}"),
            _ => assert!(warnings.contains(what) && warnings.lines().count() == 1, "{name}: {warnings}"),
        }
    }
}

/// A mesh that cannot be read does not hide the one beside it, and a skin that moves nothing leaves its mesh where its
/// node is, or flattened if the node does that.
#[test]
fn what_can_be_read_is_shown() {
    let mut model = eight_triangles();
    let wrong = model.push("meshes", json!({ "primitives": [{ "attributes": { "POSITION": 77 } }] }));
    model.root(json!({ "mesh": wrong }));
    model.root(json!({ "mesh": 0, "skin": 0, "translation": [5, 0, 0] }));
    model.push("skins", json!({ "joints": [99] }));
    model.root(json!({ "mesh": 0, "skin": 1, "translation": [0, 7, 0] }));
    model.push("skins", json!({ "joints": [0] }));
    model.root(json!({ "mesh": 0, "skin": 1, "scale": [0, 0, 0] }));
    let (scene, warnings) = model.told();
    assert_eq!((scene.instances.len(), scene.n_triangles()), (3, 24));
    let most = CORNERS.iter().flatten().copied().fold(0.0, f32::max);
    assert_eq!(scene.bounds().1, Vec3::new(5.0 + most, 7.0 + most, most));
    for what in ["there is no accessors[77]", "nodes[3].skin: meshes[0] has no joints", "left out: nodes[4]"] {
        assert!(warnings.contains(what), "{what}: {warnings}");
    }
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
    assert!((300..2000).contains(&n_refused), "{n_refused} of 2000");
}
