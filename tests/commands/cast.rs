//! Tests `kdray cast`: input files, output files, exit codes and one-line errors.

use std::{
    fs::{self, File},
    io::BufReader,
    path::Path,
};

use crate::support::{
    arrays::npy,
    command::{COMPLAINTS, cornell, fail, kdray, names, stderr, stdout, succeed},
};
use npyz::NpyFile;
use serde_json::Value;
use tempfile::TempDir;
use zip::ZipArchive;

/// A square at z = 0 of two triangles that face +z, and above it, at z = 2, a lid of one triangle that faces -z.
const MESH: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 2\nv 0 1 2\nv 1 0 2\n\
                    o square\nf 1 2 3\nf 1 3 4\no lid\nf 5 6 7\n";
const MISS: u32 = u32::MAX;

/// Writes rows of an array of rays in NumPy's format.
fn save<const N: usize>(path: &Path, rays: &[[f32; N]]) {
    save_as(path, &[rays.len() as u64, N as u64], npyz::Order::C, rays.as_flattened());
}

fn save_as<T: npyz::AutoSerialize + npyz::Serialize>(path: &Path, shape: &[u64], order: npyz::Order, numbers: &[T]) {
    fs::write(path, npy(shape, order, numbers)).unwrap();
}

/// Returns the shape and the elements of an array in the archive.
fn load<T: npyz::Deserialize>(path: &Path, name: &str) -> (Vec<u64>, Vec<T>) {
    let mut archive = ZipArchive::new(BufReader::new(File::open(path).unwrap())).unwrap();
    let array = NpyFile::new(archive.by_name(&format!("{name}.npy")).unwrap()).unwrap();
    (array.shape().to_vec(), array.into_vec().unwrap())
}

fn arrays(path: &Path) -> Vec<String> {
    let archive = ZipArchive::new(BufReader::new(File::open(path).unwrap())).unwrap();
    archive.file_names().map(|name| name.unwrap().into_owned()).collect()
}

/// Creates a directory that holds the mesh.
fn with_mesh() -> TempDir {
    let directory = TempDir::new().unwrap();
    fs::write(directory.path().join("mesh.obj"), MESH).unwrap();
    directory
}

/// Rays that point down: from above the lid; from below the lid; from beside the square; with a direction of length
/// 2; with a `t_max` above the square; with a `t_min` below the lid. The last ray is invalid: its direction is 0.
const RAYS: [[f32; 8]; 7] = {
    let inf = f32::INFINITY;
    [
        [0.25, 0.25, 3.0, 0.0, 0.0, -1.0, 0.0, inf],
        [0.25, 0.5, 1.0, 0.0, 0.0, -1.0, 0.0, inf],
        [5.0, 0.5, 1.0, 0.0, 0.0, -1.0, 0.0, inf],
        [0.75, 0.25, 1.0, 0.0, 0.0, -2.0, 0.0, inf],
        [0.75, 0.25, 1.0, 0.0, 0.0, -1.0, 0.0, 0.75],
        [0.25, 0.25, 3.0, 0.0, 0.0, -1.0, 1.5, inf],
        [0.75, 0.25, 1.0, 0.0, 0.0, 0.0, 0.0, inf],
    ]
};

#[test]
fn hits_are_as_open3d_names_them() {
    let directory = with_mesh();
    let path = |name: &str| directory.path().join(name);
    save(&path("rays.npy"), &RAYS);
    let grids = [&["--accel", "grid", "--validate"][..], &["--accel", "grid2", "--cpu"]];
    for device in [&["--validate"][..], &["--cpu"], &["--traversal", "stack"]].into_iter().chain(grids) {
        let output = succeed(directory.path(), &[&["cast", "mesh.obj", "rays.npy", "-o", "hits.npz"], device].concat());
        assert!(stdout(&output).contains("7 rays, 4 hits, 1 invalid\n"), "{}", stdout(&output));
        let expected = [
            "t_hit.npy",
            "instance_ids.npy",
            "geometry_ids.npy",
            "primitive_ids.npy",
            "primitive_uvs.npy",
            "primitive_normals.npy",
        ];
        let mut found = arrays(&path("hits.npz"));
        found.sort_by_key(|name| expected.iter().position(|expected| expected == name));
        assert_eq!(found, expected);
        let inf = f32::INFINITY;
        assert_eq!(load(&path("hits.npz"), "t_hit"), (vec![7], vec![1f32, 1.0, inf, 0.5, inf, 3.0, inf]));
        assert_eq!(load(&path("hits.npz"), "primitive_ids"), (vec![7], vec![2, 1, MISS, 0, MISS, 0, MISS]));
        let uvs = vec![0.25f32, 0.25, 0.25, 0.25, 0.0, 0.0, 0.5, 0.25, 0.0, 0.0, 0.0, 0.25, 0.0, 0.0];
        assert_eq!(load(&path("hits.npz"), "primitive_uvs"), (vec![7, 2], uvs));
        let (shape, normals) = load::<f32>(&path("hits.npz"), "primitive_normals");
        assert_eq!(shape, [7, 3]);
        let z: Vec<_> = normals.chunks(3).map(|normal| normal[2]).collect();
        assert_eq!(z, [-1.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0]);
        assert!(normals.chunks(3).all(|normal| normal[..2] == [0.0, 0.0]));
    }
    assert_eq!(names(directory.path()), ["hits.npz", "mesh.obj", "rays.npy"]);
}

#[test]
fn hits_name_instance_mesh_and_face() {
    let directory = with_mesh();
    let path = |name: &str| directory.path().join(name);
    let moved = |x: f32| RAYS[..4].iter().map(|ray| [&[ray[0] + x], &ray[1..]].concat()).collect::<Vec<_>>();
    let rays: Vec<[f32; 8]> =
        [moved(20.0), moved(0.0), moved(10.0)].concat().iter().map(|ray| ray[..].try_into().expect("8")).collect();
    save(&path("rays.npy"), &rays);
    let placed = |x: u32| format!("[[mesh]]\nfile = 'mesh.obj'\ntransform = {{ translate = [{x}, 0, 0] }}\n");
    std::fs::write(path("scene.toml"), [0, 10, 20].map(placed).concat()).expect("a scene");
    for instances in ["flatten", "keep"] {
        for device in ["--validate", "--cpu"] {
            let args = ["cast", "scene.toml", "rays.npy", "-o", "hits.npz", "-q", device, "--instances", instances];
            succeed(directory.path(), &args);
            let ids = |name: &str| load::<u32>(&path("hits.npz"), name).1;
            assert_eq!(ids("instance_ids"), [2, 2, MISS, 2, 0, 0, MISS, 0, 1, 1, MISS, 1], "{instances} {device}");
            assert_eq!(ids("geometry_ids"), [0, 0, MISS, 0, 0, 0, MISS, 0, 0, 0, MISS, 0], "{instances} {device}");
            assert_eq!(ids("primitive_ids"), [2, 1, MISS, 0, 2, 1, MISS, 0, 2, 1, MISS, 0], "{instances} {device}");
        }
    }
}

#[test]
fn any_says_what_is_occluded() {
    let directory = with_mesh();
    let path = |name: &str| directory.path().join(name);
    save(&path("rays.npy"), &RAYS);
    for device in ["--validate", "--cpu"] {
        succeed(directory.path(), &["cast", "mesh.obj", "rays.npy", "-o", "hits.npz", "--any", "-q", device]);
        assert_eq!(arrays(&path("hits.npz")), ["occluded.npy"]);
        let expected = vec![true, true, false, true, false, true, false];
        assert_eq!(load(&path("hits.npz"), "occluded"), (vec![7], expected));
    }
}

/// The first and the sixth ray go through the edge that the square's triangles share, and so meet both. Kept instances
/// have the lists of flattened ones.
#[test]
fn all_hits_are_counted_and_listed() {
    let directory = with_mesh();
    let path = |name: &str| directory.path().join(name);
    save(&path("rays.npy"), &RAYS);
    let cast = |args: &[&str]| {
        succeed(directory.path(), &[&["cast", "mesh.obj", "rays.npy", "-o", "hits.npz"], args].concat())
    };
    for device in [&["--validate"][..], &["--cpu"], &["--accel", "grid"]] {
        let output = cast(&[&["--count"], device].concat());
        assert!(stdout(&output).contains("7 rays, 7 hits, 1 invalid\n"), "{}", stdout(&output));
        assert_eq!(arrays(&path("hits.npz")), ["hit_counts.npy"]);
        assert_eq!(load(&path("hits.npz"), "hit_counts"), (vec![7], vec![3u32, 1, 0, 1, 0, 2, 0]));
        cast(&[&["--all", "-q"], device].concat());
        assert_eq!(load(&path("hits.npz"), "ray_splits"), (vec![8], vec![0u64, 3, 4, 4, 5, 5, 7, 7]));
        assert_eq!(load(&path("hits.npz"), "t_hit"), (vec![7], vec![1f32, 3.0, 3.0, 1.0, 0.5, 3.0, 3.0]));
        assert_eq!(load(&path("hits.npz"), "primitive_ids"), (vec![7], vec![2u32, 0, 1, 1, 0, 0, 1]));
        assert_eq!(load::<f32>(&path("hits.npz"), "primitive_uvs").0, [7, 2]);
        cast(&[&["--all", "1", "-q"], device].concat());
        assert_eq!(load(&path("hits.npz"), "ray_splits"), (vec![8], vec![0u64, 1, 2, 2, 3, 3, 4, 4]));
        assert_eq!(load(&path("hits.npz"), "primitive_ids"), (vec![4], vec![2u32, 1, 0, 0]));
    }
    let placed = |z: i32| format!("[[mesh]]\nfile = 'mesh.obj'\ntransform = {{ translate = [0, 0, {z}] }}\n");
    fs::write(path("scene.toml"), [0, -4].map(placed).concat()).expect("a scene");
    for (device, instances) in [("--validate", "keep"), ("--cpu", "keep"), ("--cpu", "flatten")] {
        let args =
            ["cast", "scene.toml", "rays.npy", "-o", "hits.npz", "--all", "-q", device, "--instances", instances];
        succeed(directory.path(), &args);
        let ids = |name: &str| load::<u32>(&path("hits.npz"), name).1;
        assert_eq!(load::<u64>(&path("hits.npz"), "ray_splits").1, [0, 6, 9, 9, 12, 12, 17, 17]);
        let t_hit = load::<f32>(&path("hits.npz"), "t_hit").1;
        assert_eq!(t_hit, [1.0, 3.0, 3.0, 5.0, 7.0, 7.0, 1.0, 3.0, 5.0, 0.5, 1.5, 2.5, 3.0, 3.0, 5.0, 7.0, 7.0]);
        assert_eq!(ids("instance_ids"), [0, 0, 0, 1, 1, 1, 0, 1, 1, 0, 1, 1, 0, 0, 1, 1, 1]);
        assert_eq!(ids("primitive_ids"), [2, 0, 1, 2, 0, 1, 1, 2, 1, 0, 2, 0, 0, 1, 2, 0, 1]);
    }
}

/// Six columns mean t from 0 to infinity. The mesh may be a scene file. The file of rays may be empty.
#[test]
fn rays_of_six_columns_and_none() {
    let directory = TempDir::new().unwrap();
    let path = |name: &str| directory.path().join(name);
    let scene = cornell();
    let six: Vec<[f32; 6]> = (0..1000).map(|i| [0.0, 0.1, 0.0, (i as f32).sin(), (i as f32).cos(), 0.3]).collect();
    let eight: Vec<[f32; 8]> = six.iter().map(|&[a, b, c, d, e, f]| [a, b, c, d, e, f, 0.0, f32::INFINITY]).collect();
    save(&path("6.npy"), &six);
    save(&path("8.npy"), &eight);
    save::<8>(&path("0.npy"), &[]);
    for rays in ["6", "8", "0"] {
        let (rays, hits) = (format!("{rays}.npy"), format!("{rays}.npz"));
        let output = succeed(directory.path(), &["cast", &scene, &rays, "-o", &hits, "-q"]);
        assert!(output.stdout.is_empty() && output.stderr.is_empty(), "{}{}", stdout(&output), stderr(&output));
    }
    assert_eq!(fs::read(path("6.npz")).unwrap(), fs::read(path("8.npz")).unwrap());
    assert!(load::<f32>(&path("6.npz"), "t_hit").1.iter().any(|t| t.is_finite()));
    assert_eq!(load::<f32>(&path("0.npz"), "primitive_normals"), (vec![0, 3], vec![]));
}

#[test]
fn the_report_is_json_too() {
    let directory = with_mesh();
    save(&directory.path().join("rays.npy"), &RAYS);
    for device in [&[][..], &["--cpu", "--threads", "1"]] {
        let arguments = ["cast", "mesh.obj", "rays.npy", "-o", "hits.npz", "--repeat", "3", "--json", "x.json"];
        let output = succeed(directory.path(), &[&arguments[..], device].concat());
        let text = stdout(&output);
        assert!(text.contains("Mrays/s") && text.ends_with("wrote hits.npz\n"), "{text}");
        let json: Value = serde_json::from_slice(&fs::read(directory.path().join("x.json")).unwrap()).unwrap();
        let counts = ["n_rays", "n_hits", "n_invalid", "triangles"].map(|key| json[key].as_u64().unwrap());
        assert_eq!(counts, [7, 4, 1, 3]);
        let times = ["min_ms", "median_ms", "max_ms"].map(|key| json["times"][key].as_f64().unwrap());
        assert!(0.0 < times[0] && times.is_sorted(), "{times:?}");
        assert_eq!(json["times"]["n_times"].as_u64(), Some(3));
        assert!(json["times"]["mrays_per_s"].as_f64() > Some(0.0) && json["device"].is_string());
    }
}

/// Points below the lid and above it; beside the square, with and without a greatest distance; and an invalid one.
const POINTS: [[f32; 4]; 5] = {
    let inf = f32::INFINITY;
    [
        [0.25, 0.5, 0.5, inf],
        [0.25, 0.25, 3.0, inf],
        [3.0, 0.0, 0.0, inf],
        [3.0, 0.0, 0.0, 1.5],
        [f32::NAN, 0.0, 0.0, inf],
    ]
};

#[test]
fn closest_points_are_written_as_hits() {
    let directory = with_mesh();
    let path = |name: &str| directory.path().join(name);
    save(&path("points.npy"), &POINTS);
    save(&path("bare.npy"), &POINTS.map(|[x, y, z, _]| [x, y, z]));
    for device in ["--validate", "--cpu"] {
        let arguments = ["cast", "mesh.obj", "points.npy", "-o", "hits.npz", "--closest", "--json", "x.json", device];
        let output = succeed(directory.path(), &arguments);
        assert!(stdout(&output).contains("5 points, 3 hits, 1 invalid\n"), "{}", stdout(&output));
        let json: Value = serde_json::from_slice(&fs::read(path("x.json")).unwrap()).unwrap();
        assert_eq!(json["query"].as_str(), Some("closest_point"));
        let inf = f32::INFINITY;
        assert_eq!(load(&path("hits.npz"), "t_hit"), (vec![5], vec![0.5f32, 1.0, 2.0, inf, inf]));
        assert_eq!(load(&path("hits.npz"), "primitive_ids"), (vec![5], vec![1, 2, 0, MISS, MISS]));
        let uvs = vec![0.25f32, 0.25, 0.25, 0.25, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(load(&path("hits.npz"), "primitive_uvs"), (vec![5, 2], uvs));
        let normals = load::<f32>(&path("hits.npz"), "primitive_normals").1;
        assert_eq!(normals.chunks(3).map(|normal| normal[2]).collect::<Vec<_>>(), [1.0, -1.0, 1.0, 0.0, 0.0]);
        succeed(directory.path(), &["cast", "mesh.obj", "bare.npy", "-o", "hits.npz", "--closest", "-q", device]);
        assert_eq!(load(&path("hits.npz"), "t_hit"), (vec![5], vec![0.5f32, 1.0, 2.0, 2.0, inf]));
    }
    save(&path("rays.npy"), &RAYS);
    let of_rays = ["cast", "mesh.obj", "rays.npy", "-o", "x.npz", "--cpu", "--closest"];
    fail(directory.path(), &of_rays, 3, "points are K x 3 or K x 4");
}

#[test]
fn closest_points_are_found_on_placed_meshes() {
    let directory = with_mesh();
    let path = |name: &str| directory.path().join(name);
    save(&path("points.npy"), &[[10.25f32, 0.5, 0.5], [21.5, 0.0, 0.0], [-1.0, 0.0, 0.0]]);
    let placed = |x: u32| format!("[[mesh]]\nfile = 'mesh.obj'\ntransform = {{ translate = [{x}, 0, 0] }}\n");
    fs::write(path("scene.toml"), [0, 10, 20].map(placed).concat()).expect("a scene");
    for (device, instances) in
        [("--validate", "flatten"), ("--validate", "keep"), ("--cpu", "flatten"), ("--cpu", "keep")]
    {
        let arguments = ["--closest", "-q", device, "--instances", instances];
        succeed(directory.path(), &[&["cast", "scene.toml", "points.npy", "-o", "hits.npz"], &arguments[..]].concat());
        assert_eq!(load::<f32>(&path("hits.npz"), "t_hit").1, [0.5, 0.5, 1.0], "{device}");
        assert_eq!(load::<u32>(&path("hits.npz"), "instance_ids").1, [1, 2, 0], "{device}");
        assert_eq!(load::<u32>(&path("hits.npz"), "primitive_ids").1, [1, 0, 0], "{device}");
    }
}

#[test]
fn usage_mistakes_are_refused() {
    let directory = TempDir::new().unwrap();
    let cases: &[(&[&str], &str)] = &[
        (&["cast"], "MESH"),
        (&["cast", "m.obj"], "RAYS"),
        (&["cast", "m.obj", "r.npy"], "--output"),
        (&["cast", "m.obj", "r.npy", "-o", "x.npy"], ".npz"),
        (&["cast", "m.obj", "r.npy", "-o", "x"], ".npz"),
        (&["cast", "m.obj", "r.npz", "-o", "r.npz"], "--output"),
        (&["cast", "m.obj", "r.npy", "-o", "x.npz", "--json", "r.npy"], "RAYS"),
        (&["cast", "m.obj", "r.npy", "-o", "x.npz", "--json", "m.obj"], "MESH"),
        (&["cast", "m.obj", "r.npy", "-o", "x.npz", "--json", "x.npz"], "same file"),
        (&["cast", "m.obj", "r.npy", "-o", "x.npz", "--repeat", "0"], "--repeat"),
        (&["cast", "m.obj", "r.npy", "-o", "x.npz", "--all", "0"], "--all"),
        (&["cast", "m.obj", "r.npy", "-o", "x.npz", "--all", "--count"], "--count"),
        (&["cast", "m.obj", "r.npy", "-o", "x.npz", "--count", "--repeat", "2"], "--repeat"),
        (&["cast", "m.obj", "r.npy", "-o", "x.npz", "--traversal", "bvh"], "mask"),
        (&["cast", "m.obj", "r.npy", "-o", "x.npz", "--accel", "bvh"], "kdtree, grid, grid2"),
        (&["cast", "m.obj", "r.npy", "-o", "x.npz", "--accel", "grid", "--traversal", "mask"], "--accel grid"),
        (&["cast", "m.obj", "r.npy", "-o", "x.npz", "--accel", "grid2", "--build", "fast"], "--accel grid2"),
        (&["cast", "m.obj", "r.npy", "-o", "x.npz", "--cpu", "--build", "gpu"], "with --cpu, there is none"),
        (&["cast", "m.obj", "r.npy", "-o", "x.npz", "--cpu", "--validate"], "--cpu"),
        (&["cast", "m.obj", "r.npy", "-o", "x.npz", "--closest", "--any"], "--any"),
        (&["cast", "m.obj", "r.npy", "-o", "x.npz", "--closest", "--traversal", "mask"], "--traversal"),
        (&["cast", "m.obj", "r.npy", "-o", "x.npz", "--closest", "--accel", "grid"], "--accel kdtree"),
    ];
    for (arguments, named) in cases {
        fail(directory.path(), arguments, 2, named);
    }
    assert!(names(directory.path()).is_empty());
}

/// Returns a .npy file of a header, as `numpy` writes it, and data.
fn with_header(header: &str, data: &[u8]) -> Vec<u8> {
    let size = (header.len() as u16).to_le_bytes();
    [b"\x93NUMPY\x01\x00", &size[..], header.as_bytes(), data].concat()
}

#[test]
fn rays_that_cannot_be_read_are_named() {
    let directory = with_mesh();
    let path = |name: &str| directory.path().join(name);
    save(&path("good.npy"), &RAYS);
    save(&path("seven.npy"), &[[0.0; 7]; 3]);
    save_as(&path("row.npy"), &[8], npyz::Order::C, &[0f32; 8]);
    save_as(&path("cube.npy"), &[2, 2, 8], npyz::Order::C, &[0f32; 32]);
    save_as(&path("double.npy"), &[1, 8], npyz::Order::C, &[0f64; 8]);
    save_as(&path("integer.npy"), &[1, 8], npyz::Order::C, &[0i32; 8]);
    save_as(&path("fortran.npy"), &[4, 8], npyz::Order::Fortran, &[0f32; 32]);
    let good = fs::read(path("good.npy")).unwrap();
    fs::write(path("cut.npy"), &good[..good.len() - 1]).unwrap();
    fs::write(path("head.npy"), &good[..40]).unwrap();
    fs::write(path("junk.npy"), "these are no rays\n").unwrap();
    fs::write(path("empty.npy"), "").unwrap();
    fs::create_dir(path("folder.npy")).unwrap();
    let huge = "{'descr': '<f4', 'fortran_order': False, 'shape': (1152921504606846976, 8), }\n";
    fs::write(path("huge.npy"), with_header(huge, &[0; 64])).unwrap();
    let many = "{'descr': '<f4', 'fortran_order': False, 'shape': (4611686018427387904, 8), }\n";
    fs::write(path("many.npy"), with_header(many, &[0; 64])).unwrap();
    fs::write(path("deep.npy"), with_header(&"(".repeat(60_000), &[])).unwrap();
    // Parsed, it would take minutes.
    let nested = format!("{{'descr': {}, 'shape': (1, 8)}}\n", "{".repeat(60));
    fs::write(path("nested.npy"), with_header(&nested, &[0; 32])).unwrap();
    fs::write(
        path("record.npy"),
        with_header("{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (1, 8)}\n", &[0; 32]),
    )
    .unwrap();
    fs::write(path("giant.npy"), b"\x93NUMPY\x02\x00\xff\xff\xff\xff").unwrap();
    let kept = names(directory.path());
    for (rays, what) in [
        ("none.npy", "none.npy"),
        ("seven.npy", "[3, 7]"),
        ("row.npy", "[8]"),
        ("cube.npy", "[2, 2, 8]"),
        ("double.npy", "float32"),
        ("integer.npy", "float32"),
        ("record.npy", "float32"),
        ("fortran.npy", "Fortran"),
        ("cut.npy", "6 of 7"),
        ("head.npy", "is no .npy file"),
        ("junk.npy", "is no .npy file"),
        ("empty.npy", "is no .npy file"),
        ("folder.npy", "directory"),
        ("huge.npy", "2 of 1152921504606846976"),
        ("many.npy", "4611686018427387904"),
        ("deep.npy", "header"),
        ("nested.npy", "nested brackets"),
        ("giant.npy", "header"),
    ] {
        fail(directory.path(), &["cast", "mesh.obj", rays, "-o", "x.npz", "--cpu"], 3, what);
        fail(directory.path(), &["cast", "mesh.obj", rays, "-o", "x.npz", "--cpu"], 3, rays);
    }
    fail(directory.path(), &["cast", "none.obj", "good.npy", "-o", "x.npz", "--cpu"], 3, "none.obj");
    fail(directory.path(), &["cast", "mesh.obj", "good.npy", "-o", "x.npz", "--device", "99"], 4, "99");
    fail(directory.path(), &["cast", "mesh.obj", "good.npy", "-o", "none/x.npz"], 5, "none/x.npz");
    assert_eq!(names(directory.path()), kept);
}

#[cfg(unix)]
mod unix {
    use std::process::Command;

    use super::*;

    fn shell(directory: &Path, script: &str) -> std::process::Output {
        let script = format!("set -o pipefail; {script}");
        Command::new("bash").args(["-c", &script, env!("CARGO_BIN_EXE_kdray")]).current_dir(directory).output().unwrap()
    }

    #[test]
    fn a_full_disk_leaves_what_was_there() {
        let directory = with_mesh();
        let rays: Vec<[f32; 6]> = (0..20_000).map(|i| [0.0, 0.1, 1.0, (i as f32).sin(), 0.1, -1.0]).collect();
        save(&directory.path().join("rays.npy"), &rays);
        fs::write(directory.path().join("x.npz"), "old").unwrap();
        for path in ["x.npz", "new.npz"] {
            let output =
                shell(directory.path(), &format!("ulimit -f 8; \"$0\" cast mesh.obj rays.npy --cpu -q -o {path}"));
            let text = stderr(&output);
            assert_eq!(output.status.code(), Some(5), "{text}");
            assert!(text.starts_with("error: ") && text.contains(path) && text.lines().count() == 1, "{text}");
        }
        assert_eq!(names(directory.path()), ["mesh.obj", "rays.npy", "x.npz"]);
        assert_eq!(fs::read(directory.path().join("x.npz")).unwrap(), b"old");
    }

    /// Rays can be read from a pipe, and hits can be written to one.
    #[test]
    fn pipes() {
        let directory = with_mesh();
        save(&directory.path().join("rays.npy"), &RAYS);
        std::os::unix::fs::symlink("/dev/stdout", directory.path().join("out.npz")).unwrap();
        let output = shell(
            directory.path(),
            "cat rays.npy | \"$0\" cast mesh.obj /dev/stdin --cpu -q -o out.npz | cat > piped.npz && \
             \"$0\" cast mesh.obj rays.npy --cpu -q -o whole.npz && cmp piped.npz whole.npz",
        );
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let output = shell(
            directory.path(),
            "(head -c 3 rays.npy; sleep 0.5; tail -c +4 rays.npy) | \
             \"$0\" cast mesh.obj /dev/stdin --cpu -q -o slow.npz && cmp slow.npz whole.npz",
        );
        assert_eq!(output.status.code(), Some(0), "in two parts: {}", stderr(&output));
        let output =
            shell(directory.path(), "head -c 300 rays.npy | \"$0\" cast mesh.obj /dev/stdin --cpu -q -o x.npz");
        assert_eq!(output.status.code(), Some(3));
        assert!(stderr(&output).contains("ends after 5 of 7 rays"), "{}", stderr(&output));
        assert!(!directory.path().join("x.npz").exists());
    }
}

#[test]
fn a_validation_message_fails() {
    let directory = with_mesh();
    save(&directory.path().join("rays.npy"), &RAYS);
    let output = kdray(directory.path(), &["cast", "mesh.obj", "rays.npy", "-o", "x.npz", "--validate", "-q"])
        .env(COMPLAINTS.0, COMPLAINTS.1)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(4), "{}", stderr(&output));
}

#[test]
fn kept_instances_have_the_hits_of_flattened_ones() {
    let directory = with_mesh();
    let path = |name: &str| directory.path().join(name);
    // The mesh, and the mesh turned upside down beside it.
    let places: [f32; 24] = [
        1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, //
        1.0, 0.0, 0.0, 4.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0, -1.0, 2.0,
    ];
    save_as(&path("places.npy"), &[2, 3, 4], npyz::Order::C, &places);
    fs::write(path("scene.toml"), "[[mesh]]\nfile = 'mesh.obj'\ninstances = 'places.npy'\n").unwrap();
    let shifted = RAYS.map(|[x, y, z, u, v, w, t_min, t_max]| [x + 4.0, 1.0 - y, z, u, v, w, t_min, t_max]);
    save(&path("rays.npy"), &[RAYS, shifted].concat());
    for device in [&[][..], &["--cpu"]] {
        for (kind, accel) in [("flatten", "kdtree"), ("keep", "kdtree"), ("keep", "grid"), ("keep", "grid2")] {
            let out = format!("{kind} {accel}.npz");
            let arguments = ["cast", "scene.toml", "rays.npy", "-o", &out, "--instances", kind, "--accel", accel];
            succeed(directory.path(), &[&arguments[..], device].concat());
        }
        let of = |name: &str| {
            let path = path(&format!("{name}.npz"));
            let (normals, uvs) = (load::<f32>(&path, "primitive_normals"), load::<f32>(&path, "primitive_uvs"));
            (load::<f32>(&path, "t_hit"), load::<u32>(&path, "primitive_ids"), normals, uvs)
        };
        for kept in ["keep kdtree", "keep grid", "keep grid2"] {
            assert_eq!(of(kept), of("flatten kdtree"), "{kept}");
            let ids = [kept, "flatten kdtree"].map(|name| load::<u32>(&path(&format!("{name}.npz")), "instance_ids").1);
            assert!(ids[0] == ids[1] && ids[0].contains(&1), "rays hit the second instance");
        }
    }
}
