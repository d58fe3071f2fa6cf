//! glTF files, written by a small builder: meshes, nodes, lights, cameras, and files that are wrong.

use std::{f32::consts::PI, fs, path::Path};

use base64::{Engine, engine::general_purpose::STANDARD};
use glam::{Mat4, Quat, Vec2, Vec3, Vec4};
use kdray::{
    scene::{Camera, Light, LoadOptions, Projection, Scene, source_files},
    world::FlatScene,
};
use serde_json::{Value, json};
use tempfile::TempDir;

use super::{
    flattened, load,
    mesh_files::{CORNERS, SIDES, obj},
    support::random::Random,
};

const U8: u32 = 5121;
const I8: u32 = 5120;
const I16: u32 = 5122;
const U16: u32 = 5123;
const U32: u32 = 5125;
const F32: u32 = 5126;

/// A glTF file in the making: its JSON, and the content of its only buffer.
#[derive(Clone)]
pub struct Model {
    pub json: Value,
    pub data: Vec<u8>,
}

impl Model {
    pub fn new() -> Self {
        let json = json!({
            "asset": { "version": "2.0", "extras": { "made": ["by", "a test"] } },
            "buffers": [{ "byteLength": 0 }], "bufferViews": [], "accessors": [],
            "meshes": [], "nodes": [], "scenes": [{ "nodes": [] }], "scene": 0,
        });
        Self { json, data: Vec::new() }
    }

    /// Adds an object to a list of the JSON and returns its index.
    pub fn push(&mut self, list: &str, value: Value) -> usize {
        if self.json.get(list).is_none() {
            self.json[list] = json!([]);
        }
        let list = self.json[list].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    /// Adds a buffer view.
    pub fn view<T: bytemuck::Pod>(&mut self, values: &[T]) -> usize {
        self.data.resize(self.data.len().next_multiple_of(4), 0);
        let (start, bytes) = (self.data.len(), bytemuck::cast_slice::<T, u8>(values));
        self.data.extend(bytes);
        self.json["buffers"][0]["byteLength"] = json!(self.data.len());
        self.push("bufferViews", json!({ "buffer": 0, "byteOffset": start, "byteLength": bytes.len() }))
    }

    /// Adds an accessor of all `values`, each of which is one component.
    pub fn accessor<T: bytemuck::Pod>(&mut self, kind: &str, component: u32, values: &[T]) -> usize {
        let n_components = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let (view, n) = (self.view(values), values.len() / n_components);
        self.push("accessors", json!({ "bufferView": view, "componentType": component, "count": n, "type": kind }))
    }

    /// Adds a mesh of one primitive, and a node that shows it. Returns the node's index.
    pub fn show(&mut self, primitive: Value) -> usize {
        let mesh = self.push("meshes", json!({ "primitives": [primitive] }));
        self.root(json!({ "mesh": mesh }))
    }

    /// Adds a node to the scene.
    pub fn root(&mut self, node: Value) -> usize {
        let ix = self.push("nodes", node);
        self.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(ix));
        ix
    }

    pub fn glb(&self) -> Vec<u8> {
        let padded = |bytes: &[u8], with: u8| {
            let mut bytes = bytes.to_vec();
            bytes.resize(bytes.len().next_multiple_of(4), with);
            bytes
        };
        let (json, data) = (padded(self.json.to_string().as_bytes(), b' '), padded(&self.data, 0));
        let chunk = |kind: &[u8], bytes: &[u8]| [&(bytes.len() as u32).to_le_bytes(), kind, bytes].concat();
        let chunks = [chunk(b"JSON", &json), chunk(b"BIN\0", &data)].concat();
        [b"glTF\x02\0\0\0", &(12 + chunks.len() as u32).to_le_bytes()[..], &chunks].concat()
    }

    /// Returns the file as JSON whose buffer has the given URI.
    pub fn with_uri(&self, uri: &str) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"][0]["uri"] = json!(uri);
        json.to_string().into_bytes()
    }

    pub fn embedded(&self) -> Vec<u8> {
        self.with_uri(&format!("data:application/octet-stream;base64,{}", STANDARD.encode(&self.data)))
    }

    pub fn load(&self) -> Result<Scene, String> {
        load_bytes("model.glb", &self.glb())
    }

    pub fn scene(&self) -> Scene {
        self.load().unwrap_or_else(|error| panic!("{error}\n{}", self.json))
    }

    pub fn flat(&self) -> FlatScene {
        flattened(&self.scene())
    }
}

fn load_bytes(name: &str, bytes: &[u8]) -> Result<Scene, String> {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    Scene::load(&path).map_err(|error| error.to_string())
}

fn cube_indices() -> Vec<u32> {
    SIDES.into_iter().flat_map(|[a, b, c, d]| [a, b, c, a, c, d]).collect()
}

/// The cube of the other mesh formats' tests.
fn cube() -> Model {
    let mut model = Model::new();
    let positions = model.accessor("VEC3", F32, CORNERS.as_flattened());
    let indices = model.accessor("SCALAR", U32, &cube_indices());
    model.show(json!({ "attributes": { "POSITION": positions }, "indices": indices }));
    model
}

/// A triangle in the plane z = 0 that faces +z, with normals.
fn triangle() -> Model {
    let mut model = Model::new();
    let positions = model.accessor("VEC3", F32, &[0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    let normals = model.accessor("VEC3", F32, &[0.0_f32, 0.0, 2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    model.show(json!({ "attributes": { "POSITION": positions, "NORMAL": normals } }));
    model
}

/// Returns the corners of all triangles.
fn corners(model: &Model) -> Vec<[Vec3; 3]> {
    model.flat().triangles.iter().map(|t| [t.v0, t.v1, t.v2]).collect()
}

#[test]
fn a_cube_is_the_same_in_every_form() {
    let expected = load(&[("cube.obj", &obj())]).unwrap();
    let model = cube();
    let external = model.with_uri("the%20data.bin");
    let padless = model.embedded().into_iter().filter(|byte| *byte != b'=').collect::<Vec<_>>();
    let with_bom = ["\u{feff}\n".as_bytes(), &model.embedded()].concat();
    for (name, bytes) in [
        ("cube.glb", model.glb()),
        ("cube.gltf", model.glb()),
        ("cube.obj", model.glb()),
        ("cube.gltf", model.embedded()),
        ("cube.stl", model.embedded()),
        ("cube.gltf", padless),
        ("cube.gltf", with_bom),
        ("cube.gltf", external),
    ] {
        let found = load(&[(name, &bytes), ("the data.bin", &model.data)]).unwrap();
        assert_eq!(found.triangles, expected.triangles, "{name}");
        assert_eq!((found.camera, found.lights), (expected.camera, expected.lights.clone()), "{name}");
        assert_eq!((found.ambient, found.background), (expected.ambient, expected.background), "{name}");
    }
    let mut moved = model;
    moved.data[0] ^= 1;
    assert_ne!(moved.flat().triangles, expected.triangles, "a moved corner");
}

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

#[test]
fn nodes_nest() {
    let mut model = triangle();
    let turn = Quat::from_rotation_z(0.5 * PI);
    model.json["nodes"] = json!([
        { "translation": [10, 0, 0], "children": [1] },
        { "rotation": turn.to_array(), "scale": [2, 3, 4], "children": [2] },
        { "matrix": Mat4::from_translation(Vec3::X).to_cols_array(), "mesh": 0 },
    ]);
    model.json["scenes"][0]["nodes"] = json!([0]);
    let [a, b, c] = corners(&model)[0];
    for (found, expected) in [(a, [10.0, 2.0, 0.0]), (b, [10.0, 4.0, 0.0]), (c, [7.0, 2.0, 0.0])] {
        assert!(found.distance(Vec3::from_array(expected)) < 1e-5, "{found} is not {expected:?}");
    }
}

/// Returns the cosine between the facet's normal and the shading normal of the first corner.
fn agreement(model: &Model) -> f32 {
    let triangle = model.flat().triangles[0];
    super::facet_normal(&triangle).normalize().dot(kdray::layout::normal::decode_octahedral(triangle.n0))
}

#[test]
fn mirrored_and_sheared_meshes_keep_their_outside() {
    for transform in [
        json!({ "scale": [-1, 1, 1] }),
        json!({ "scale": [2, 3, -4] }),
        json!({ "scale": [-1, -1, -1] }),
        json!({ "scale": [1e-12, -1e-10, 1e-11] }),
        json!({ "matrix": [1, 0, 0, 0, 0.5, 1, 0, 0, 0.3, 3, 1, 0, 0, 0, 0, 1] }),
        json!({ "matrix": [1, 0, 2, 0, 0.5, 1, 7, 0, 0.3, 3, -1, 0, 0, 0, 0, 1] }),
    ] {
        let mut model = triangle();
        model.json["nodes"][0] = transform.clone();
        model.json["nodes"][0]["mesh"] = json!(0);
        // A second triangle keeps the scene large enough.
        model.root(json!({ "mesh": 0 }));
        assert!(agreement(&model) > 0.9999, "{transform}");
    }
}

#[test]
fn flattened_meshes_are_left_out() {
    let mut model = triangle();
    model.root(json!({ "mesh": 0, "scale": [1, 0, 1], "rotation": [0.6, 0, 0, 0.8] }));
    assert_eq!(model.scene().instances.len(), 1);
    model.json["nodes"][0]["scale"] = json!([0, 0, 0]);
    assert!(model.load().unwrap_err().contains("has no triangles"));
}

#[test]
fn a_scene_can_be_chosen() {
    let mut model = triangle();
    model.push("nodes", json!({ "mesh": 0, "translation": [5, 0, 0] }));
    model.push("scenes", json!({ "name": "second", "nodes": [1] }));
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("model.glb");
    fs::write(&path, model.glb()).unwrap();
    let load = |name: Option<&str>| {
        Scene::load_with(&path, &LoadOptions { scene: name.map(str::to_owned), ..LoadOptions::default() })
    };
    let x = |name| load(name).unwrap().bounds().0.x;
    assert_eq!([x(None), x(Some("0")), x(Some("1")), x(Some("second"))], [0.0, 0.0, 5.0, 5.0]);
    let error = load(Some("third")).unwrap_err().to_string();
    assert!(error.contains("there is no scene `third`, but 0, 1 `second`"), "{error}");
    model.json["scene"] = json!(1);
    assert_eq!(model.scene().bounds().0.x, 5.0);
    model.json.as_object_mut().unwrap().remove("scene");
    assert_eq!(model.scene().bounds().0.x, 0.0, "the first scene");
    model.json.as_object_mut().unwrap().remove("scenes");
    assert_eq!(model.scene().instances.len(), 2, "all nodes");
}

#[test]
fn punctual_lights_have_kdrays_units() {
    let mut model = triangle();
    let lights = json!([
        { "type": "point", "color": [1, 0.5, 0], "intensity": PI, "range": 3 },
        { "type": "directional", "intensity": 2.0 * PI },
        { "type": "spot", "intensity": PI, "spot": { "innerConeAngle": 0.25, "outerConeAngle": 0.5 } },
        { "type": "spot", "spot": {} },
    ]);
    model.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": lights } });
    model.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    for ix in 0..4 {
        let light = json!({ "KHR_lights_punctual": { "light": ix } });
        // The node turns -z to -x. Its scale changes nothing.
        let rotation = Quat::from_rotation_y(0.5 * PI).to_array();
        let node = json!({ "extensions": light, "translation": [1, 2, 3], "rotation": rotation, "scale": [3, 3, 3] });
        model.root(node);
    }
    let scene = model.scene();
    assert_eq!((scene.ambient, scene.background), (Vec3::ZERO, Vec3::ZERO));
    assert!(scene.defaults.is_metered, "the lights have physical units");
    let at = Vec3::new(1.0, 2.0, 3.0);
    let close = |a: Vec3, b: Vec3| assert!(a.distance(b) < 1e-6, "{a} is not {b}");
    let [
        Light::Point { position, intensity },
        Light::Directional { towards, irradiance },
        Light::Spot { position: spot_at, towards: axis, intensity: spot, inner_cos, outer_cos },
        Light::Spot { intensity: default, inner_cos: default_inner, outer_cos: default_outer, .. },
    ] = scene.lights[..]
    else {
        panic!("{:?}", scene.lights)
    };
    close(position, at);
    close(intensity, Vec3::new(1.0, 0.5, 0.0));
    close(towards, Vec3::X);
    close(irradiance, Vec3::splat(2.0));
    close(spot_at, at);
    close(axis, Vec3::NEG_X);
    close(spot, Vec3::ONE);
    assert_eq!((inner_cos, outer_cos), (0.25_f32.cos(), 0.5_f32.cos()));
    close(default, Vec3::splat(1.0 / PI));
    assert_eq!((default_inner, default_outer), (1.0, (0.25 * PI).cos()));
}

#[test]
fn a_file_without_lights_is_lit_even_if_a_surface_glows() {
    let mut model = triangle();
    let bare = model.scene();
    assert_eq!((bare.lights.len(), bare.defaults.is_metered), (1, false));
    model.push("materials", json!({ "emissiveFactor": [1, 1, 1] }));
    model.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    let scene = model.scene();
    assert_eq!((scene.lights, scene.ambient, scene.background), (bare.lights, bare.ambient, bare.background));
}

#[test]
fn cameras_look_at_the_scene() {
    let mut model = triangle();
    let perspective = json!({ "type": "perspective", "perspective": { "yfov": 0.5 * PI, "znear": 0.1 } });
    let parallel = json!({
        "name": "flat", "type": "orthographic",
        "orthographic": { "xmag": 2, "ymag": 4, "znear": 0, "zfar": 9 },
    });
    model.push("cameras", perspective);
    model.push("cameras", parallel);
    let frontal = model.scene().camera;
    assert!(model.scene().cameras.is_empty());
    model.root(json!({ "camera": 0, "translation": [0.5, 0.5, 4], "name": "front" }));
    model.root(json!({ "camera": 1, "translation": [0.5, 0.5, 4] }));
    let away = Quat::from_rotation_y(PI).to_array();
    model.root(json!({ "camera": 0, "translation": [0.5, 0.5, 4], "rotation": away }));
    model.root(json!({ "camera": 0, "scale": [0, 0, 0] }));
    let scene = model.scene();
    let names: Vec<_> = scene.cameras.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["front", "flat", "camera 3"]);
    let Camera { eye, target, up, projection } = scene.camera;
    assert_ne!(scene.camera, frontal);
    assert_eq!(scene.camera, scene.cameras[0].1);
    assert_eq!((eye, target, up), (Vec3::new(0.5, 0.5, 4.0), Vec3::new(0.5, 0.5, 0.0), Vec3::Y));
    let Projection::Perspective { vertical_fov_degrees } = projection else { panic!("{projection:?}") };
    assert!((vertical_fov_degrees - 90.0).abs() < 1e-4);
    // `ymag` is half of the height.
    assert_eq!(scene.cameras[1].1, Camera { projection: Projection::Orthographic { height: 8.0 }, ..scene.camera });
    assert!(scene.cameras[2].1.target.z > 4.1);
}

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
    // A skeleton that mirrors keeps the outside outside.
    model.json["nodes"][1]["scale"] = json!([-1, 1, 1]);
    model.json["nodes"][2]["translation"] = json!([0, 0, 0]);
    model.json["accessors"][bind].as_object_mut().unwrap().remove("bufferView");
    let identity = model.accessor("MAT4", F32, &[Mat4::IDENTITY.to_cols_array(); 2].concat());
    model.json["skins"][0]["inverseBindMatrices"] = json!(identity);
    assert!(agreement(&model) > 0.9999);
}

#[test]
fn scene_files_place_whole_models() {
    let mut model = triangle();
    model.push("materials", json!({ "name": "red", "pbrMetallicRoughness": { "baseColorFactor": [1, 0, 0, 1] } }));
    model.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    model.root(json!({ "mesh": 0, "translation": [0, 0, 1] }));
    let toml = "[materials]\nown = {}\n[[mesh]]\nfile = 'm.glb'\ntransform = { translate = [5, 0, 0], scale = 2 }\n\
                [[mesh]]\nfile = 'm.glb'\nmaterial = 'own'\nsmooth = false\n";
    let found = load(&[("s.toml", toml.as_bytes()), ("m.glb", &model.glb())]).unwrap();
    assert_eq!(found.material_names, ["own", "red"]);
    assert_eq!(found.triangle_materials, [1, 1, 0, 0]);
    assert_eq!(found.triangles[1].v1, Vec3::new(7.0, 0.0, 2.0));
    assert_ne!(found.triangles[1].n1, kdray::layout::FLAT_NORMAL);
    assert_eq!(found.triangles[3].n1, kdray::layout::FLAT_NORMAL);
    assert!(found.lights.is_empty());
    let missing = load(&[("s.toml", b"[[mesh]]\nfile = 'm.glb'\n"), ("m.glb", b"glTF\x02\0\0\0")]).unwrap_err();
    assert!(missing.to_string().contains("m.glb: "), "{missing}");
}

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

#[test]
fn files_are_read_below_the_folder_only() {
    let folder = TempDir::new().unwrap();
    let inside = folder.path().join("inside");
    fs::create_dir_all(inside.join("parts")).unwrap();
    let model = triangle();
    fs::write(folder.path().join("data.bin"), &model.data).unwrap();
    fs::write(inside.join("parts/data.bin"), &model.data).unwrap();
    let path = inside.join("model.gltf");
    let load = |uri: &str| {
        fs::write(&path, model.with_uri(uri)).unwrap();
        Scene::load(&path).map_err(|error| error.to_string())
    };
    load("parts/data.bin").unwrap();
    let absolute = folder.path().join("data.bin");
    for uri in ["../data.bin", "%2e%2e/data.bin", absolute.to_str().unwrap(), "file:///etc/passwd", "https://a/b.bin"] {
        let error = load(uri).unwrap_err();
        assert!(error.contains("model.gltf: buffers[0]: ") && error.contains("not"), "{error}");
    }
    let missing = load("parts/none.bin").unwrap_err();
    assert!(missing.contains("buffers[0]: ") && missing.contains("none.bin: cannot be read"), "{missing}");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("../data.bin", inside.join("link.bin")).unwrap();
        let error = load("link.bin").unwrap_err();
        assert!(error.contains("leads out of the folder"), "{error}");
    }
}

#[test]
fn a_model_names_its_files() {
    let mut model = triangle();
    model.json["images"] =
        json!([{ "uri": "a%20b.png" }, { "uri": "data:image/png;base64,AAAA" }, { "uri": "../c.png" }]);
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("m.gltf"), model.with_uri("m.bin")).unwrap();
    fs::write(path("s.toml"), "[[mesh]]\nfile = 'm.gltf'\n").unwrap();
    let expected = [path("a b.png"), path("m.bin"), path("m.gltf"), path("s.toml")];
    assert_eq!(source_files(&path("s.toml")), expected);
    assert_eq!(source_files(&path("m.gltf")), expected[..3]);
}

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
        ("empty", |m| m["scenes"][0]["nodes"] = json!([]), "has no triangles"),
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

#[test]
fn shipped_scenes_are_no_models() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell.toml");
    let error = Scene::load_with(&path, &LoadOptions { scene: Some("0".to_owned()), ..LoadOptions::default() })
        .unwrap_err()
        .to_string();
    assert!(error.contains("only glTF files name scenes"), "{error}");
}
