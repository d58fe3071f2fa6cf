//! glTF files, written by a small builder.

mod animations;
mod compressed;
mod files;
mod geometry;
mod materials;
mod mistakes;
mod nodes;
mod pointers;
mod poses;

use std::fs;

use base64::{Engine, engine::general_purpose::STANDARD};
use glam::Vec3;
use kdray::{scene::Scene, world::FlatScene};
use serde_json::{Value, json};
use tempfile::TempDir;

use super::{
    facet_normal, flattened, load,
    materials::load_scene,
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

    /// Returns the scene and the warnings, joined.
    pub fn told(&self) -> (Scene, String) {
        let (scene, warnings) = load_scene(&[("model.glb", &self.glb())]);
        (scene.unwrap_or_else(|error| panic!("{error}\n{}", self.json)), warnings.join("\n"))
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

/// Returns a file of a triangle that moves by (1, 2, 12) in 4 seconds.
pub fn moving_triangle() -> Vec<u8> {
    let mut model = triangle();
    let input = model.accessor("SCALAR", F32, &[0.0_f32, 4.0]);
    let output = model.accessor("VEC3", F32, &[0.0_f32, 0.0, 0.0, 1.0, 2.0, 12.0]);
    let channel = json!({ "sampler": 0, "target": { "node": 0, "path": "translation" } });
    let samplers = json!([{ "input": input, "output": output }]);
    model.push("animations", json!({ "name": "slide", "samplers": samplers, "channels": [channel] }));
    model.glb()
}

/// Returns the corners of all triangles.
fn corners(model: &Model) -> Vec<[Vec3; 3]> {
    model.flat().triangles.iter().map(|t| [t.v0, t.v1, t.v2]).collect()
}

/// Returns the cosine between the facet's normal and the shading normal of the first corner.
fn agreement(model: &Model) -> f32 {
    let triangle = model.flat().triangles[0];
    facet_normal(&triangle).normalize().dot(kdray::layout::normal::decode_octahedral(triangle.n0))
}
