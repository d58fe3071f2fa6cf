//! Data of Draco's own encoder (1.5.7), decoded as its own decoder decodes it, then cut off and spoilt.

use std::path::Path;

use serde_json::{Value, json};

use super::*;
use crate::scene::{LoadOptions, files::SourceFile};

/// A box of 2 x 4 x 6: EdgeBreaker at the lowest speed, only positions.
const CUBE: &str = "\
    RFJBQ08CAgEBAAAACAwACwEAA68+CgEBEAH/AAEBAAkDAAACAQEBAA8DARgBCCsBIAQAig6CquqqGgCAqSoAEAAAAGBVAYBUFQAIAAAAAAAA\
    /z8AAAAAgL8AAADAAABAwAAAwEAO\
";

/// A pyramid without its base, with all attributes: EdgeBreaker.
const FAN: &str = "\
    RFJBQ08CAgEBAAAABQQFBAAAAm8B/wER/wJEQP8CRED/AkRA/wJEQP8CREAG/wAAAAAAAQAAAgAAAwAABAAAAQAJAwAAAgEBCQMAAQMBAwkC\
    AAICAQICBAADAQEEAgQABAEBBAkEAAUCAQEBAA83AUABAP//////AwD////v/wMA/3////8DAAHA/9//AwAAAAD/PwAAAACAvwAAAAAAAIC/\
    AAAAQA4AAwEACx+ZGc0MnRkDQ0ew/wH8//8H+A8wwAAA/wMAAP8BAAAKAQEBAA0DzQwnNTMD8t+C////////AYD//z8AAAAAAAD/DwAAAAAA\
    AAAAAAAAAIA/DAEBAQAJA80ME80MaSYDZnCeSSAYzAEFBdMEBgHRFBAQ0QAAAAD/AAAAAQEBAAQHmRlpJgNoY4cIDy3AAhwAAAAAAAUAAAAB\
    AQEADQOZGc0MI50ZA0jhsGGgqqkKAACQqqoKAAAAAAAAAP8PAAAAAIA+AAAAAAAAAAAAAAAAAABAPww=\
";

/// The same pyramid without a change of the order of its vertices.
const SEQUENTIAL: &str = "\
    RFJBQ08CAgEAAAAEBQEAAQIAAgMAAwQABAEBBgAJAwAAAQkDAAEDCQIAAgICBAADBAIEAAQECQQABQIDAgEBAgABAQAPNwFAAQD///////v/\
    /z8A0P8DAP7//w8A9P//PwDw/wMAAAAA/z8AAAADAQALH80MmRmdGQODlLD/AQAE4D/AAAMA8A//AwAA/wEAAAABAQANA80MmRkjnRkDWGqx\
    /////v//CgIAAAAA/w8AAAABAQAIA80MEzUzAwTggikIANoAQWAsgUDGj8VhDAAAAAD/AAAAAAEBAAQHNTPNDAO6vIIICgoqYAAAAAAABQAA\
    AAABAQANA80MzQwjaSYDGFCdwaqrCgAAoKqpCgAAoKqpCgAAYAAAAAAA/w8AAAAAgL8AAAAAAACAvwAAAEAOCgAAAAAAAAAAAACAPwwAAIA+\
    AAAAAAAAAAAAAAAAAABAPww=\
";

/// Types of an accessor's components.
const U8: u32 = 5121;
const U16: u32 = 5123;
const F32: u32 = 5126;

/// Returns a document of a primitive with attributes: names, types, componentTypes. The numbers of the attributes in
/// the data are in their order.
fn file(data: &str, (n_faces, n_points): (u32, u32), attributes: &[(&str, &str, u32)]) -> Value {
    let accessor = |(_, type_, kind): &(&str, &str, u32)| {
        let is_normalized = *kind == U8;
        json!({ "count": n_points, "type": type_, "componentType": kind, "normalized": is_normalized })
    };
    let mut accessors: Vec<_> = attributes.iter().map(accessor).collect();
    accessors.push(json!({ "count": 3 * n_faces, "type": "SCALAR", "componentType": U16 }));
    let ids: serde_json::Map<_, _> =
        attributes.iter().enumerate().map(|(ix, (name, ..))| ((*name).to_owned(), json!(ix))).collect();
    let n_bytes = base64_of(data).len();
    json!({
        "asset": { "version": "2.0" }, "extensionsUsed": [NAME], "extensionsRequired": [NAME],
        "accessors": accessors, "bufferViews": [{ "buffer": 0, "byteLength": n_bytes }],
        "buffers": [{ "byteLength": n_bytes, "uri": format!("data:application/octet-stream;base64,{data}") }],
        "meshes": [{ "primitives": [{ "attributes": ids, "indices": attributes.len(),
            "extensions": { NAME: { "bufferView": 0, "attributes": ids } } }] }],
        "nodes": [{ "mesh": 0 }]
    })
}

fn base64_of(data: &str) -> Vec<u8> {
    use base64::prelude::{BASE64_STANDARD, Engine};
    BASE64_STANDARD.decode(data).unwrap()
}

const PYRAMID: [(&str, &str, u32); 6] = [
    ("POSITION", "VEC3", F32),
    ("NORMAL", "VEC3", F32),
    ("TEXCOORD_0", "VEC2", F32),
    ("COLOR_0", "VEC4", U8),
    ("JOINTS_0", "VEC4", U8),
    ("WEIGHTS_0", "VEC4", F32),
];

/// JSON path of the first primitive.
const FIRST: &str = "meshes[0].primitives[0]";

fn read(file: &Value) -> Checked<Document> {
    let source = SourceFile::new(Path::new("m.gltf"), &LoadOptions::default());
    Document::read(source, file.to_string().into_bytes())
}

fn elements<'a>(document: &'a Document, name: &str, kind: ComponentType) -> &'a [u8] {
    document.draco.attribute((&document.root.meshes[0].primitives[0], FIRST), name, kind).unwrap()
}

fn floats(document: &Document, name: &str) -> Vec<f32> {
    elements(document, name, ComponentType::F32).as_chunks().0.iter().map(|it| f32::from_le_bytes(*it)).collect()
}

fn indices(document: &Document) -> Vec<u16> {
    let primitive = (&document.root.meshes[0].primitives[0], FIRST);
    let bytes = document.draco.indices(primitive, ComponentType::U16).unwrap();
    bytes.as_chunks().0.iter().map(|it| u16::from_le_bytes(*it)).collect()
}

#[test]
fn a_box_is_that_of_the_decoder_of_draco() {
    let document = read(&file(CUBE, (12, 8), &PYRAMID[..1])).unwrap();
    let faces = [
        [0, 1, 2, 2, 1, 3, 1, 0, 3, 3, 0, 4, 5, 4, 7, 4, 0, 7],
        [0, 2, 7, 7, 2, 6, 2, 3, 6, 3, 4, 6, 4, 5, 6, 7, 6, 5],
    ];
    assert_eq!(indices(&document), faces.concat());
    let positions = [
        [-1.0, 2.0, 3.0, 1.0, 2.0, 3.0, 1.0, 2.0, -3.0, 1.0, -2.0, 3.0],
        [-1.0, -2.0, 3.0, -1.0, -2.0, -3.0, 1.0, -2.0, -3.0, -1.0, 2.0, -3.0],
    ];
    assert_eq!(floats(&document, "POSITION"), positions.concat());
}

#[test]
fn all_attributes_are_those_of_the_decoder_of_draco() {
    let document = read(&file(FAN, (4, 5), &PYRAMID)).unwrap();
    // Positions have 14 bits: this is 0 in the middle of -1 to 1.
    let z = 0.000_061_035_156;
    let (a, b) = (0.708_489_2, 0.705_721_6);
    assert_eq!(indices(&document), [0, 1, 2, 2, 1, 3, 3, 1, 4, 1, 0, 4]);
    assert_eq!(floats(&document, "POSITION"), [1., 0., z, z, 1. + z, z, z, 0., -1., -1., 0., z, z, 0., 1.]);
    assert_eq!(floats(&document, "NORMAL"), [a, b, 0., 0., 1., 0., 0., a, -b, -b, a, 0., 0., a, b]);
    assert_eq!(floats(&document, "TEXCOORD_0"), [1., 0., 0.500_122_13, 0.500_122_13, 0., 0., 0., 1., 1., 1.]);
    let colours = [[0, 255, 0, 200], [255, 0, 0, 255], [1, 2, 3, 50], [9, 8, 7, 100], [0, 0, 255, 150]];
    assert_eq!(elements(&document, "COLOR_0", ComponentType::U8), colours.as_flattened());
    let joints = [[1, 2, 0, 0], [0, 1, 0, 0], [4, 5, 0, 0], [3, 0, 0, 0], [2, 3, 0, 0]];
    assert_eq!(elements(&document, "JOINTS_0", ComponentType::U8), joints.as_flattened());
    let weights = [[0.5, 0.5], [1.0, 0.0], [0.25, 0.75], [1.0, 0.0], [0.75, 0.25]];
    assert_eq!(floats(&document, "WEIGHTS_0"), weights.map(|[a, b]| [a, b, 0.0, 0.0]).concat());
    let document = read(&file(SEQUENTIAL, (4, 5), &PYRAMID)).unwrap();
    assert_eq!(indices(&document), [0, 1, 2, 0, 2, 3, 0, 3, 4, 0, 4, 1]);
    assert_eq!(floats(&document, "POSITION"), [z, 1. + z, z, 1., 0., z, z, 0., 1., -1., 0., z, z, 0., -1.]);
}

/// Returns why a file's data is not read.
fn left_out(file: &Value) -> String {
    read(file).unwrap().first_left_out().unwrap()
}

#[test]
fn data_that_is_cut_off_is_left_out() {
    for data in [CUBE, FAN, SEQUENTIAL] {
        let n_attributes = if data == CUBE { 1 } else { PYRAMID.len() };
        let whole = file(data, if data == CUBE { (12, 8) } else { (4, 5) }, &PYRAMID[..n_attributes]);
        for n in 0..base64_of(data).len() {
            let mut cut = whole.clone();
            cut["bufferViews"][0]["byteLength"] = json!(n);
            let error = left_out(&cut);
            assert!(error.starts_with("meshes[0].primitives[0].extensions.KHR_draco_mesh_compression: "), "{error}");
        }
    }
}

#[test]
fn accessors_rule() {
    let file = file(FAN, (4, 5), &PYRAMID);
    let refused = |pointer: &str, value: Value| {
        let mut file = file.clone();
        *file.pointer_mut(pointer).unwrap() = value;
        left_out(&file)
    };
    assert!(refused("/accessors/6/count", json!(9)).contains("ceiling of 3"));
    assert!(refused("/accessors/6/count", json!(15)).contains("count = 15, but the data has 4 faces"));
    let more = refused("/accessors/1/count", json!(6));
    assert!(more.contains("attributes.NORMAL: accessors[1] has 6 elements of 3 numbers, but the data has 5 of 3"));
    assert!(refused("/accessors/2/type", json!("VEC3")).contains("elements of 3 numbers, but the data has 5 of 2"));
    assert!(
        refused("/accessors/2/componentType", json!(U8)).contains("does not fit into the accessor's componentType")
    );
    assert!(refused("/accessors/0/count", json!(1 << 30)).contains("are more than"));
    let extension = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression";
    assert!(refused(&format!("{extension}/attributes/NORMAL"), json!(9)).contains("the data has no attribute 9"));
    assert!(refused(&format!("{extension}/bufferView"), json!(9)).contains("bufferView"));
    assert!(refused(&format!("{extension}/bufferView"), json!(-1)).contains("bufferView is no index"));
}

/// The second primitive states other counts for the same data.
#[test]
fn a_primitive_takes_nothing_of_its_sibling() {
    let mut file = file(FAN, (4, 5), &PYRAMID);
    let (mut accessor, mut second) = (file["accessors"][0].clone(), file["meshes"][0]["primitives"][0].clone());
    let new_ix = file["accessors"].as_array().unwrap().len();
    accessor["count"] = json!(4);
    second["attributes"]["POSITION"] = json!(new_ix);
    file["accessors"].as_array_mut().unwrap().push(accessor);
    file["meshes"][0]["primitives"].as_array_mut().unwrap().push(second);
    let document = read(&file).unwrap();
    let [first, second] = &document.root.meshes[0].primitives[..] else { panic!("two primitives") };
    let positions = |primitive| document.draco.attribute(primitive, "POSITION", ComponentType::F32);
    assert!(positions((first, FIRST)).is_some() && positions((second, "meshes[0].primitives[1]")).is_none());
    assert!(document.first_left_out().unwrap().contains("primitives[1]"));
}

#[test]
fn strips_name_a_remedy() {
    let mut file = file(CUBE, (12, 8), &PYRAMID[..1]);
    file["meshes"][0]["primitives"][0]["mode"] = json!(5);
    assert!(left_out(&file).contains("Blender"));
    // Points are not shown, and not decoded.
    file["meshes"][0]["primitives"][0]["mode"] = json!(0);
    assert!(read(&file).unwrap().draco.elements.is_empty());
}

#[test]
fn primitives_share_the_data_of_a_view() {
    let mut file = file(FAN, (4, 5), &PYRAMID);
    let mut other = file["meshes"][0]["primitives"][0].clone();
    // Its joints are wider than the data has them.
    other["attributes"]["JOINTS_0"] = json!(7);
    file["accessors"].as_array_mut().unwrap().push(json!({ "count": 5, "type": "VEC4", "componentType": U16 }));
    file["meshes"][0]["primitives"].as_array_mut().unwrap().push(other);
    let document = read(&file).unwrap();
    // Six attributes, the indices, and the joints once more.
    assert_eq!(document.draco.elements.len(), 8);
    assert_eq!(elements(&document, "JOINTS_0", ComponentType::U16)[..4], [1, 0, 2, 0]);
}
