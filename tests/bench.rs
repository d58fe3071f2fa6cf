//! Tests the rays that `kdray bench` casts, the checks that it makes and the files that it writes.

mod support;

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
};

use glam::Vec3;
use kdray::{
    accel::{
        Search,
        kdtree::{BuildOptions, KdTree, Traversal},
    },
    bench::{
        difference::Difference,
        rays::{RaySet, RaySetKind, ray_sets},
        stage::Stage,
        traversal::Tracers,
    },
    layout::{Hit, NO_TRIANGLE, PathRay},
    reference::traverser::{Tracer, Traverser},
    world::{FlatScene, World},
};
use serde_json::Value;
use support::{animated::moving, device, meshes::torus, scenes};
use tempfile::TempDir;

const SIZE: (u32, u32) = (33, 23);
const N_PIXELS: usize = 33 * 23;

/// Writes a torus as an OBJ file.
fn write_mesh(directory: &Path) -> PathBuf {
    let triangles = torus(24, 12);
    let corners = triangles.iter().flat_map(|t| [t.v0, t.v1, t.v2]);
    let mut obj: String = corners.map(|v| format!("v {} {} {}\n", v.x, v.y, v.z)).collect();
    obj.extend((0..triangles.len()).map(|i| format!("f {} {} {}\n", 3 * i + 1, 3 * i + 2, 3 * i + 3)));
    let path = directory.join("torus.obj");
    fs::write(&path, obj).unwrap();
    path
}

fn mesh() -> FlatScene {
    let directory = TempDir::new().unwrap();
    scenes::load(&write_mesh(directory.path()))
}

fn closest_hits(stage: &Stage, rays: &[PathRay]) -> Vec<Hit> {
    let mut traverser = Traverser::new(&stage.inputs(), Traversal::Mask);
    rays.iter().map(|ray| traverser.traverse::<false>(&stage.inputs(), &ray.into())).collect()
}

fn rays(sets: &[RaySet; 4], kind: RaySetKind) -> &[PathRay] {
    &sets.iter().find(|set| set.kind == kind).unwrap().rays
}

#[test]
fn in_a_room_every_ray_but_the_lit_shadow_rays_hits() {
    let stage = Stage::in_room(mesh(), SIZE, &BuildOptions::default());
    let sets = ray_sets(&stage);
    for set in &sets {
        assert_eq!(set.rays.len(), N_PIXELS, "{}", set.kind.name());
        assert!(set.rays.iter().all(|ray| (ray.direction.length() - 1.0).abs() < 1e-5), "{}", set.kind.name());
        let hits = closest_hits(&stage, &set.rays);
        let n_hits = hits.iter().filter(|hit| hit.triangle_ix != NO_TRIANGLE).count();
        if set.kind == RaySetKind::Shadow {
            assert!((N_PIXELS / 20..N_PIXELS * 19 / 20).contains(&n_hits), "{n_hits} of {N_PIXELS} in shadow");
        } else {
            assert_eq!(n_hits, N_PIXELS, "{}", set.kind.name());
        }
    }
    let on_mesh = |hit: &Hit| hit.triangle_ix < stage.scene().triangles.len() as u32 - 12;
    let n_on_mesh = closest_hits(&stage, rays(&sets, RaySetKind::Primary)).iter().filter(|hit| on_mesh(hit)).count();
    assert!((N_PIXELS / 20..N_PIXELS).contains(&n_on_mesh), "{n_on_mesh} of {N_PIXELS} see the mesh");
}

#[test]
fn without_a_room_only_primary_hits_have_further_rays() {
    let stage = Stage::open(mesh(), SIZE, &BuildOptions::default());
    let sets = ray_sets(&stage);
    let primary = rays(&sets, RaySetKind::Primary);
    let hits = closest_hits(&stage, primary);
    let pixels: Vec<_> = primary
        .iter()
        .zip(&hits)
        .filter(|(_, hit)| hit.triangle_ix != NO_TRIANGLE)
        .map(|(ray, _)| ray.pixel_ix)
        .collect();
    assert!((1..N_PIXELS).contains(&pixels.len()));
    for kind in [RaySetKind::Shadow, RaySetKind::Mirror, RaySetKind::Diffuse] {
        assert!(rays(&sets, kind).iter().map(|ray| ray.pixel_ix).eq(pixels.iter().copied()), "{}", kind.name());
    }
}

/// Brute force tests 20,000 triangles for a ray where the kd-tree leads to a few.
#[test]
fn a_slow_variant_warms_up_with_fewer_casts_than_a_fast_one() {
    let triangles = torus(100, 100);
    let scene =
        FlatScene { triangle_materials: vec![0; triangles.len()].into(), triangles: triangles.into(), ..mesh() };
    let stage = Stage::in_room(scene, SIZE, &BuildOptions::default());
    let context = device();
    let variants = [Traversal::Mask, Traversal::Brute].map(Search::KdTree);
    let mut tracers = Tracers::new(Some(&context.into()), &stage, &variants).unwrap();
    let [primary, ..] = ray_sets(&stage);
    // Other work on the machine may delay the cast from which the numbers are estimated.
    let attempts: Vec<_> = (0..5).map(|_| tracers.n_warm_up(&primary).unwrap()).collect();
    assert!(attempts.iter().any(|n_casts| n_casts[0] > 4 * n_casts[1]), "{attempts:?} untimed casts");
}

#[test]
fn primary_rays_go_square_by_square() {
    let sets = ray_sets(&Stage::in_room(mesh(), SIZE, &BuildOptions::default()));
    let pixels: Vec<_> = rays(&sets, RaySetKind::Primary).iter().map(|ray| ray.pixel_ix).collect();
    let mut first_square = pixels[..64].to_vec();
    first_square.sort_unstable();
    // The first square is in the middle one of three bands.
    let first = 8 * SIZE.0;
    assert!(first_square.into_iter().eq((0..8).flat_map(|y| (0..8).map(move |x| first + y * SIZE.0 + x))));
    // Pixels within the square follow a Z-order curve.
    let [right, down] = [1, SIZE.0];
    assert_eq!(pixels[..8], [0, 1, down, right + down, 2, 3, 2 + down, 3 + down].map(|pixel| first + pixel));
}

#[test]
fn rays_leave_the_hits_of_the_primary_rays() {
    let stage = Stage::in_room(mesh(), SIZE, &BuildOptions::default());
    let sets = ray_sets(&stage);
    let primary = rays(&sets, RaySetKind::Primary);
    let hits = closest_hits(&stage, primary);
    for (ray_ix, (came, hit)) in primary.iter().zip(&hits).enumerate() {
        let point = came.origin + hit.t * came.direction;
        let t = stage.scene().triangles[hit.triangle_ix as usize];
        let normal = (t.v1 - t.v0).cross(t.v2 - t.v0).normalize();
        let side = |direction: Vec3| direction.dot(normal) * came.direction.dot(normal);
        let leaving = |kind| rays(&sets, kind)[ray_ix];
        for kind in [RaySetKind::Shadow, RaySetKind::Mirror, RaySetKind::Diffuse] {
            assert!((leaving(kind).origin - point).length() < 1e-3, "{}", kind.name());
        }
        assert!(
            side(leaving(RaySetKind::Mirror).direction) < 0.0 && side(leaving(RaySetKind::Diffuse).direction) <= 1e-6
        );
        let shadow = leaving(RaySetKind::Shadow);
        assert!((shadow.origin + shadow.t_max * shadow.direction - stage.light.position).length() < 1e-3);
        if hit.triangle_ix as usize >= stage.scene().triangles.len() - 12 {
            let mirrored = came.direction - 2.0 * came.direction.dot(normal) * normal;
            assert!((leaving(RaySetKind::Mirror).direction - mirrored).length() < 1e-5);
        }
    }
}

#[test]
fn rays_are_the_same_each_time() {
    let sets = || ray_sets(&Stage::in_room(mesh(), SIZE, &BuildOptions::default()));
    assert_eq!(sets(), sets());
}

#[test]
fn a_deliberately_wrong_hit_is_counted() {
    let stage = Stage::in_room(mesh(), SIZE, &BuildOptions::default());
    let sets = ray_sets(&stage);
    let set = &sets[0];
    let right = closest_hits(&stage, &set.rays);
    assert_eq!(Difference::of(set.kind, &right, &right), Difference::default());
    let mut wrong = right.clone();
    wrong[7].t *= 1.01;
    wrong[9] = Hit { t: f32::INFINITY, triangle_ix: NO_TRIANGLE, u: 0.0, v: 0.0 };
    assert_eq!(Difference::of(set.kind, &right, &wrong), Difference { n_differing: 2, n_grazing: 0 });
}

#[test]
fn a_wrong_tree_is_noticed() {
    let mut stage = Stage::in_room(mesh(), SIZE, &BuildOptions::default());
    let sets = ray_sets(&stage);
    let measured = |stage: &Stage| {
        Tracers::new(None, stage, &[Search::KdTree(Traversal::Stack)]).unwrap().measure(&sets[0], 1).unwrap()
    };
    let right = measured(&stage);
    assert!(right.n_hits == N_PIXELS && right.variants[0].difference == Difference::default());
    let seen = closest_hits(&stage, &sets[0].rays)[N_PIXELS / 2].triangle_ix;
    // The build of a tree skips triangles that are not finite.
    let mut without = stage.scene().triangles.clone();
    without[seen as usize].v0 = Vec3::NAN;
    let options = BuildOptions::default();
    let tree = KdTree::build(&without, &options);
    stage.world = World::with_tree(stage.scene().clone(), tree, &options).expect("a world");
    assert_ne!(measured(&stage).n_hits, 0);
    let found = closest_hits(&stage, &sets[0].rays);
    let right = closest_hits(&Stage::in_room(mesh(), SIZE, &BuildOptions::default()), &sets[0].rays);
    assert!(Difference::of(RaySetKind::Primary, &right, &found).n_differing > 0);
}

fn kdray(directory: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_kdray"));
    command.current_dir(directory).arg("bench").args(arguments).stdin(Stdio::null()).output().unwrap()
}

/// Runs a suite. Returns its table, JSON and SVG.
fn measure(directory: &Path, arguments: &[&str]) -> (String, Value, String) {
    let output = kdray(directory, &[arguments, &["--json", "x.json", "--svg", "x.svg"]].concat());
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    let json = serde_json::from_slice(&fs::read(directory.join("x.json")).unwrap()).unwrap();
    let svg = fs::read_to_string(directory.join("x.svg")).unwrap();
    (String::from_utf8(output.stdout).unwrap(), json, svg)
}

/// Fails unless every element is closed in the right order, and no text has a bare `&` or `<`.
fn check_xml(svg: &str) {
    let mut open = Vec::new();
    for tag in svg.split('<').skip(1) {
        let (tag, text) = tag.split_once('>').expect("a tag ends");
        let name = tag.trim_start_matches('/').split([' ', '/', '\n']).next().unwrap();
        match (tag.starts_with('/'), tag.ends_with('/')) {
            (true, _) => assert_eq!(open.pop(), Some(name)),
            (false, false) => open.push(name),
            (false, true) => {}
        }
        let is_entity = |rest: &str| ["amp;", "lt;", "gt;", "quot;", "apos;"].iter().any(|name| rest.starts_with(name));
        assert!(text.split('&').skip(1).all(is_entity), "{text}");
    }
    assert!(open.is_empty() && svg.starts_with("<svg"));
}

#[test]
fn traversal_measures_every_variant_on_every_set() {
    let directory = TempDir::new().unwrap();
    write_mesh(directory.path());
    for more in [&[][..], &["--cpu"], &["--no-room"], &["--variants", "stack,brute,stack"]] {
        let suite = ["traversal", "torus.obj", "--size", "32x24", "--repeat", "2"];
        let (text, json, svg) = measure(directory.path(), &[&suite[..], more].concat());
        check_xml(&svg);
        assert_eq!((json["suite"].as_str(), json["scene"].as_str()), (Some("traversal"), Some("torus")));
        assert_eq!(json["n_times"], 2);
        assert_eq!(json["room"], !more.contains(&"--no-room"));
        let sets = json["sets"].as_array().unwrap();
        let names: Vec<_> = sets.iter().map(|set| set["rays"].as_str().unwrap()).collect();
        assert_eq!(names, ["primary", "shadow", "mirror", "diffuse"]);
        for set in sets {
            let variants = set["variants"].as_array().unwrap();
            let all = Search::all(more.contains(&"--cpu")).len();
            assert_eq!(variants.len(), if more.contains(&"--variants") { 2 } else { all });
            for variant in variants {
                let name = variant["traversal"].as_str().unwrap();
                assert!(text.contains(name) && svg.contains(name), "{name}");
                assert_eq!(variant["n_differing"], 0, "{variant}");
                let rate = |key: &str| variant["mrays_per_s"][key].as_f64().unwrap();
                assert!(rate("min") <= rate("median") && rate("median") <= rate("max") && rate("min") > 0.0);
                let steps = &variant["steps_a_ray"];
                if name == "wide" {
                    assert!(steps.is_null(), "{steps}");
                    continue;
                }
                // A ray that misses the box of a grid reads no cell.
                let fewest = if name.starts_with("grid") { 0.5 } else { 1.0 };
                assert_eq!(steps["nodes"].as_f64() >= Some(fewest), name != "brute", "{name}: {steps}");
                assert!(steps["triangles"].as_f64() > Some(0.0), "{name}: {steps}");
                // `mask` stores only the newest pending cells. This mesh is so small that no ray has more of them, so
                // that no links are read.
                let has_links = ["mask-boxes", "backtrack", "ropes"].contains(&name);
                assert_eq!(steps["links"].as_f64() > Some(0.0), has_links, "{name}: {steps}");
                let has_boxes = ["mask-boxes", "backtrack"].contains(&name);
                assert_eq!(steps["boxes"].as_f64() > Some(0.0), has_boxes, "{name}: {steps}");
            }
        }
    }
}

#[test]
fn traversal_measures_instances_beside_the_flattened_scene() {
    let directory = TempDir::new().unwrap();
    write_mesh(directory.path());
    let place =
        |x: f32| format!("[[mesh]]\nfile = \"torus.obj\"\ntransform = {{ translate = [{x:.1}, 0.0, 0.0] }}\n\n");
    fs::write(directory.path().join("row.toml"), [-4.0, 0.0, 4.0].map(place).concat()).unwrap();
    for more in [&[][..], &["--cpu"]] {
        let suite = ["traversal", "row.toml", "--no-room", "--instances", "--size", "48x24", "--repeat", "2"];
        let (text, json, _) = measure(directory.path(), &[&suite[..], more].concat());
        let n_triangles = torus(24, 12).len();
        let kept = &json["instances"];
        assert_eq!((kept["n_instances"].as_u64(), kept["n_stored"].as_u64()), (Some(3), Some(n_triangles as u64)));
        assert_eq!(json["n_triangles"].as_u64(), Some(3 * n_triangles as u64));
        assert!(kept["bytes"].as_u64() < json["tree"]["bytes"].as_u64() && kept["move_ms"]["median"].is_f64());
        for set in json["sets"].as_array().unwrap() {
            let variants = set["variants"].as_array().unwrap();
            let names: Vec<_> = variants.iter().map(|variant| variant["traversal"].as_str().unwrap()).collect();
            // All traversals of the kd-tree but brute force.
            assert_eq!(names.iter().filter(|name| name.ends_with(", instances")).count(), Traversal::ALL.len() - 1);
            assert!(set["n_hits"].as_u64() > Some(0) && names.iter().all(|name| text.contains(name)));
            assert!(variants.iter().all(|variant| variant["n_differing"] == 0), "{set}");
        }
    }
}

#[test]
fn paper_measures_the_four_scenes_beside_the_papers_times() {
    let directory = TempDir::new().unwrap();
    let scene = "[[mesh]]\ngenerator = \"box\"\nsize = [1.0, 1.0, 1.0]\n\n[render]\nmax_depth = 2\n";
    for name in ["cornell", "paper2", "paper3", "paper4"] {
        fs::write(directory.path().join(name).with_extension("toml"), scene).unwrap();
    }
    let suite = ["paper", "--scenes", ".", "--repeat", "2", "--size", "640x480,32x24", "--cpu-repeat", "2"];
    let (text, json, svg) = measure(directory.path(), &suite);
    check_xml(&svg);
    let rows = json["rows"].as_array().unwrap();
    assert_eq!((json["suite"].as_str(), rows.len()), (Some("paper"), 8));
    for row in rows {
        let name = row["scene"].as_str().unwrap();
        assert!(text.contains(name) && svg.contains(name), "{name}");
        let n_pixels = row["width"].as_u64().unwrap() * row["height"].as_u64().unwrap();
        assert_eq!(row["n_primary_rays"].as_u64(), Some(n_pixels));
        assert!(row["gpu_ms"]["median"].is_f64() && row["cpu_ms"]["max"].is_f64() && row["speedup"].is_f64());
        assert_eq!(row["paper"].is_null(), n_pixels != 640 * 480, "{row}");
    }
    assert_eq!(rows[2]["paper"]["gpu_ms"], 82.0);
    let (_, json, _) =
        measure(directory.path(), &["paper", "--scenes", ".", "--repeat", "1", "--size", "8x8", "--no-cpu"]);
    assert!(json["rows"][0]["cpu_ms"].is_null() && json["rows"][0]["speedup"].is_null());
}

#[test]
fn motion_measures_the_parts_of_frames() {
    let directory = TempDir::new().unwrap();
    fs::write(directory.path().join("moving.gltf"), moving(true).to_string()).unwrap();
    for more in [&[][..], &["--cpu"], &["--instances", "flatten"]] {
        let suite = ["motion", "moving.gltf", "--size", "32x24", "--frames", "5", "--fps", "2"];
        let (text, json, svg) = measure(directory.path(), &[&suite[..], more].concat());
        check_xml(&svg);
        assert_eq!((json["suite"].as_str(), json["n_frames"].as_u64()), (Some("motion"), Some(5)));
        assert_eq!(json["keeps_instances"], !more.contains(&"flatten"));
        assert_eq!((&json["n_moved"], &json["n_deformed"]), (&Value::from(1), &Value::from(1)), "{json}");
        let median = |part: &Value| part["ms"]["median"].as_f64().unwrap();
        let parts = json["parts"].as_array().unwrap();
        let names: Vec<_> = parts.iter().map(|part| part["name"].as_str().unwrap()).collect();
        assert_eq!(names, ["pose", "build", "upload", "passes"]);
        assert!(parts.iter().all(|part| median(part) > 0.0), "{json}");
        let passes = json["passes"].as_array().unwrap();
        assert!(passes.iter().any(|pass| pass["name"] == "shade" && median(pass) > 0.0), "{json}");
        // A frame takes as long as its parts one after the other, and nothing of it is forgotten.
        let least: f64 = parts.iter().map(|part| part["ms"]["min"].as_f64().unwrap()).sum();
        let wall = |key: &str| json["wall_ms"][key].as_f64().unwrap();
        assert!(least <= wall("min"), "{json}");
        let rate = json["frames_per_s"].as_f64().unwrap();
        assert!(1e3 / wall("max") <= rate && rate <= 1e3 / wall("min"), "{json}");
        assert!(text.contains("wall clock") && text.contains("frames a second"), "{text}");
    }
}

#[test]
fn mistakes_are_told_in_one_line_before_anything_is_measured() {
    let directory = TempDir::new().unwrap();
    write_mesh(directory.path());
    let cases: [(&[&str], i32, &str); 13] = [
        (&[], 2, "paper"),
        (&["pilot"], 2, "pilot"),
        (&["traversal"], 2, "MESH"),
        (&["traversal", "torus.obj", "--variants", "mask,rope"], 2, "`rope`"),
        (&["traversal", "torus.obj", "--cpu", "--device", "0"], 2, "--device"),
        (&["traversal", "torus.obj", "--instances"], 2, "--no-room"),
        (&["traversal", "torus.obj", "--json", "x", "--svg", "x"], 2, "same file"),
        (&["paper", "--no-cpu", "--cpu-repeat", "2"], 2, "--cpu-repeat"),
        (&["motion", "torus.obj", "--cpu"], 2, "nothing moves"),
        (&["traversal", "none.obj"], 3, "none.obj"),
        (&["paper", "--scenes", "none"], 3, "cornell.toml"),
        (&["traversal", "torus.obj", "--device", "abacus"], 4, "abacus"),
        (&["traversal", "torus.obj", "--svg", "none/x.svg"], 5, "none/x.svg"),
    ];
    for (arguments, code, named) in cases {
        let output = kdray(directory.path(), arguments);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {text}");
        let errors: Vec<_> = text.lines().filter(|line| line.starts_with("error: ")).collect();
        assert!(errors.len() == 1 && errors[0].contains(named), "{arguments:?}: {text}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
    }
    assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
}
