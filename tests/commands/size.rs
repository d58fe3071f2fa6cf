//! Tests `kdray bench size`: the mesh that it generates, its measurements, and the arguments that it refuses.

use std::{collections::HashMap, fs};

use crate::support::command::{fail, kdray, names, stderr, stdout, succeed};
use kdray::{bench::size::knot, layout::BRUTE_MAX_TRIANGLES, world::FlatScene};
use serde_json::Value;
use tempfile::TempDir;

#[test]
fn knots_of_all_sizes_are_closed_and_alike() {
    let size = |n_triangles| {
        let triangles = FlatScene::new(&knot(n_triangles)).expect("a knot").triangles;
        assert_eq!(triangles.len(), n_triangles as usize & !1);
        let mut edges = HashMap::new();
        for t in &triangles {
            let corners = [t.v0, t.v1, t.v2].map(|v| v.to_array().map(f32::to_bits));
            for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                *edges.entry((corners[a], corners[b])).or_insert(0) += 1;
                *edges.entry((corners[b], corners[a])).or_insert(0) -= 1;
            }
        }
        assert!(edges.values().all(|n| *n == 0), "{n_triangles}: an edge has one side");
        let points = || triangles.iter().map(|t| t.v0);
        points().reduce(|a, b| a.max(b)).unwrap() - points().reduce(|a, b| a.min(b)).unwrap()
    };
    let fine = size(100_000);
    for n_triangles in [1001, 10_000] {
        assert!((size(n_triangles) / fine - 1.0).abs().max_element() < 0.1, "{n_triangles}");
    }
}

#[test]
fn each_size_has_its_row() {
    let directory = TempDir::new().unwrap();
    for more in [&[][..], &["--cpu", "--traversal", "stack"]] {
        let suite = ["bench", "size", "--triangles", "4000,1000,4000", "--size", "32x24", "--repeat", "2"];
        let suite = [&suite[..], &["--json", "x.json", "--svg", "x.svg"], more].concat();
        let text = stdout(&succeed(directory.path(), &suite));
        let json: Value = serde_json::from_slice(&fs::read(directory.path().join("x.json")).unwrap()).unwrap();
        let svg = fs::read_to_string(directory.path().join("x.svg")).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("4000") && svg.contains("diffuse"));
        assert!(text.contains("log N grows 1.20 times") && json["suite"] == "size", "{text}");
        let rows = json["rows"].as_array().unwrap();
        assert_eq!(rows.iter().map(|row| row["n_triangles"].as_u64().unwrap()).collect::<Vec<_>>(), [1000, 4000]);
        assert!(rows[0]["tree"]["n_nodes"].as_u64() < rows[1]["tree"]["n_nodes"].as_u64());
        for row in rows {
            assert!(row["build_ms"].as_f64() > Some(0.0) && row["generate_ms"].as_f64() > Some(0.0));
            for cost in row["rays"].as_array().unwrap() {
                assert_eq!((&cost["n_rays"], &cost["n_differing"]), (&(32 * 24).into(), &0.into()));
                let ns = 1e6 * cost["ms"]["median"].as_f64().unwrap() / f64::from(32 * 24);
                assert!((cost["ns_a_ray"]["median"].as_f64().unwrap() / ns - 1.0).abs() < 1e-9);
            }
        }
    }
}

#[test]
fn a_size_beyond_the_device_leaves_the_smaller_ones_results() {
    let directory = TempDir::new().unwrap();
    let too_many = (BRUTE_MAX_TRIANGLES + 1000).to_string();
    let sizes = format!("{too_many},1000");
    let suite = ["bench", "size", "--traversal", "brute", "--triangles", &sizes, "--size", "8x8", "--repeat", "1"];
    let output = kdray(directory.path(), &[&suite[..], &["--json", "x.json"]].concat()).output().unwrap();
    assert_eq!(output.status.code(), Some(4));
    assert!(stderr(&output).contains("beyond this device's limit of 65000"), "{}", stderr(&output));
    assert!(stdout(&output).contains("\n1000 ") && !stdout(&output).contains(&too_many));
    assert_eq!(names(directory.path()), ["x.json"]);
}

#[test]
fn mistakes_are_told_first() {
    let directory = TempDir::new().unwrap();
    let cases: [(&[&str], i32, &str); 5] = [
        (&["--triangles", "999"], 2, "999"),
        (&["--triangles", "16777217"], 2, "16777217"),
        (&["--triangles", "1e6"], 2, "1e6"),
        (&["--cpu", "--device", "0"], 2, "--device"),
        (&["--svg", "none/x.svg"], 5, "none/x.svg"),
    ];
    for (more, code, named) in cases {
        fail(directory.path(), &[&["bench", "size"], more].concat(), code, named);
    }
}
