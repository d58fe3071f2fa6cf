//! Reports of progress while scenes are loaded and their trees are built.

use std::{
    fmt::Write,
    fs,
    sync::{Arc, Mutex},
};

use ::image::{ImageFormat, RgbImage};
use kdray::{
    accel::{AccelOptions, kdtree::BuildOptions},
    scene::{LoadOptions, Scene},
    util::progress::{Observer, Progress, Work},
    world::World,
};

use super::flattened;

/// Keeps all reports.
#[derive(Default)]
struct Reports(Mutex<Vec<(Work, f32)>>);

impl Observer for Reports {
    fn progress(&self, work: Work, share: f32) {
        self.0.lock().unwrap().push((work, share));
    }
}

impl Reports {
    /// Returns the sorted shares that were reported of some work.
    fn of(&self, work: Work) -> Vec<f32> {
        let reports = self.0.lock().unwrap();
        let mut shares: Vec<f32> =
            reports.iter().filter(|(other, _)| *other == work).map(|(_, share)| *share).collect();
        shares.sort_by(f32::total_cmp);
        shares
    }
}

/// The points and the triangles of a square, cut into n x n squares.
fn grid(n: usize) -> (Vec<[f32; 3]>, Vec<[usize; 3]>) {
    let points =
        (0..(n + 1) * (n + 1)).map(|ix| [(ix % (n + 1)) as f32, ((ix * ix) % 7) as f32, (ix / (n + 1)) as f32]);
    let first = (0..n * n).map(|ix| ix / n * (n + 1) + ix % n);
    let squares = first.flat_map(|ix| [[ix, ix + n + 1, ix + 1], [ix + 1, ix + n + 1, ix + n + 2]]);
    (points.collect(), squares.collect())
}

fn obj(n: usize) -> Vec<u8> {
    let (points, triangles) = grid(n);
    let mut text = String::new();
    points.iter().for_each(|[x, y, z]| writeln!(text, "v {x:.9} {y:.9} {z:.9}").unwrap());
    triangles.iter().for_each(|[a, b, c]| writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1).unwrap());
    text.into_bytes()
}

fn ply(n: usize) -> Vec<u8> {
    let (points, triangles) = grid(n);
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float \
         z\nelement face {}\nproperty list int int vertex_indices\nend_header\n",
        points.len(),
        triangles.len()
    );
    let mut bytes = header.into_bytes();
    bytes.extend(points.as_flattened().iter().flat_map(|number| number.to_le_bytes()));
    for triangle in triangles {
        bytes.extend([3, triangle[0], triangle[1], triangle[2]].iter().flat_map(|ix| (*ix as u32).to_le_bytes()));
    }
    bytes
}

fn stl(n: usize) -> Vec<u8> {
    let (points, triangles) = grid(n);
    let mut bytes = vec![0; 80];
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        let corners = triangle.map(|ix| points[ix]);
        let numbers =
            [[0.0; 3]].iter().chain(&corners).flatten().flat_map(|number| number.to_le_bytes()).collect::<Vec<_>>();
        bytes.extend(numbers);
        bytes.extend([0; 2]);
    }
    bytes
}

/// The same triangles as a text of three solids.
fn stl_text(n: usize) -> Vec<u8> {
    let (points, triangles) = grid(n);
    let facet = |triangle: &[usize; 3]| {
        let corners = triangle.map(|ix| points[ix].map(|number| number.to_string()).join(" "));
        format!("facet normal 0 0 1\nouter loop\nvertex {}\nendloop\nendfacet\n", corners.join("\nvertex "))
    };
    let solid =
        |triangles: &[[usize; 3]]| format!("solid a\n{}endsolid a\n", triangles.iter().map(facet).collect::<String>());
    triangles.chunks(triangles.len().div_ceil(3)).map(solid).collect::<String>().into_bytes()
}

/// A glTF file of four meshes, one of which two nodes show.
fn gltf(n: usize) -> (String, Vec<u8>) {
    let (points, triangles) = grid(n);
    let indices: Vec<u32> = triangles.iter().flatten().map(|ix| *ix as u32).collect();
    let (points, indices) = (bytemuck::cast_slice(&points).to_vec(), bytemuck::cast_slice(&indices).to_vec());
    let (n_points, n_indices): (usize, usize) = (points.len(), indices.len());
    let primitive = serde_json::json!({ "attributes": { "POSITION": 0 }, "indices": 1 });
    let json = serde_json::json!({
        "asset": { "version": "2.0" },
        "nodes": [{ "mesh": 0 }, { "mesh": 1 }, { "mesh": 1 }, { "mesh": 2 }, { "mesh": 3 }],
        "meshes": vec![serde_json::json!({ "primitives": [primitive] }); 4],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": n_points / 12, "type": "VEC3", "min": [0, 0, 0],
              "max": [n, 6, n] },
            { "bufferView": 1, "componentType": 5125, "count": n_indices / 4, "type": "SCALAR" },
        ],
        "bufferViews": [
            { "buffer": 0, "byteLength": n_points }, { "buffer": 0, "byteOffset": n_points, "byteLength": n_indices },
        ],
        "buffers": [{ "uri": "m.bin", "byteLength": n_points + n_indices }],
    });
    (json.to_string(), [points, indices].concat())
}

#[test]
fn loading_and_building_report_their_progress() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("large.obj"), obj(250)).unwrap();
    fs::write(path("large.ply"), ply(250)).unwrap();
    fs::write(path("large.stl"), stl(250)).unwrap();
    fs::write(path("text.stl"), stl_text(250)).unwrap();
    let (json, buffer) = gltf(60);
    fs::write(path("four.gltf"), json).unwrap();
    fs::write(path("m.bin"), buffer).unwrap();
    let mut scene = String::new();
    for ix in 0..5 {
        RgbImage::new(4, 4).save_with_format(path(&format!("{ix}.png")), ImageFormat::Png).unwrap();
        writeln!(scene, "[materials.m{ix}]\nmap_Kd = '{ix}.png'").unwrap();
    }
    scene += "[[mesh]]\nfile = 'large.obj'\nmaterials = ['m0', 'm1', 'm2', 'm3', 'm4']\n";
    fs::write(path("scene.toml"), scene).unwrap();
    let meshes = ["large.obj", "large.ply", "large.stl", "text.stl", "four.gltf"].map(|name| (name, 0));
    for (name, n_images) in meshes.into_iter().chain([("scene.toml", 5)]) {
        let reports = Arc::new(Reports::default());
        let progress = Progress::to(reports.clone());
        let options = LoadOptions { progress: progress.clone(), ..LoadOptions::default() };
        let loaded = Scene::load_with(&path(name), &options).unwrap();
        let read = reports.of(Work::Reading);
        assert!(read.len() >= 3 && read[0] < 0.6 && *read.last().unwrap() == 1.0, "{name}: {read:?}");
        let images: Vec<f32> = (1..=n_images).map(|n| n as f32 / n_images as f32).collect();
        assert_eq!(reports.of(Work::Images), images, "{name}");
        let build = AccelOptions::KdTree(BuildOptions::default());
        World::with_accel_observed(flattened(&loaded), &build, &progress).unwrap();
        let built = reports.of(Work::Building);
        assert!(built.len() >= 10 && built[0] < 0.2 && *built.last().unwrap() > 0.99, "{name}: {built:?}");
        assert!(built.last().unwrap() <= &1.0);
    }
}
