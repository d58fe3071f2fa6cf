//! Tests of refused scene files. The error is one line that names the file, and the line or the object.

use std::{fs, path::Path};

use kdray::scene::Scene;

use super::{flattened, load};

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
const DISC: &str = "[[mesh]]\ngenerator = 'disc'\nradius = 1\nsegments = 3\n";

/// Returns the error of loading a file. An MTL file is loaded through an OBJ file that uses it.
fn error(name: &str, content: &[u8]) -> String {
    let mtl = content.split(|byte| *byte == b'\n').next() == Some(b"newmtl m");
    let obj = format!("mtllib {name}\n{TRIANGLE}usemtl m\nf 1 2 3\n");
    let files: &[(&str, &[u8])] =
        if mtl { &[("user.obj", obj.as_bytes()), (name, content)] } else { &[(name, content)] };
    let line = load(files).expect_err(&String::from_utf8_lossy(content)).to_string();
    assert_eq!(line.lines().count(), 1, "{line}");
    assert!(!line.chars().any(char::is_control) && line.len() < 800, "{line}");
    line
}

/// Asserts that each error names `place` right after the folder, and contains `what`.
fn assert_errors(cases: &[(&str, String, &str, &str)]) {
    for (name, content, place, what) in cases {
        let line = error(name, content.as_bytes());
        let at_place = line.split_once(&format!("/{place}: "));
        let said = at_place.is_some_and(|(_, said)| said.contains(what));
        assert!(said, "{content}\ngave    {line}\nwithout {place}: {what}");
    }
}

#[test]
fn bad_objs_are_refused() {
    let after = |tail: &str| format!("{TRIANGLE}{tail}\n");
    let cases = [
        ("", "a.obj", "is empty"),
        (TRIANGLE, "a.obj", "no triangles"),
        ("l 1 2\n", "a.obj", "no triangles"),
        ("v 0 0\n", "a.obj:1", "2 numbers"),
        ("v 0 0 zero\n", "a.obj:1", "`zero` is not a number"),
        ("v 0 1e39 0\n", "a.obj:1", "not a finite number"),
        ("vn 0 0\n", "a.obj:1", "2 numbers"),
        (&after("f 1 2 4"), "a.obj:4", "vertex 4 is out of range: there are 3"),
        (&after("f 1 2 0"), "a.obj:4", "vertex 0 is out of range"),
        (&after("f 1 2 -4"), "a.obj:4", "vertex -4 is out of range"),
        (&after("f 1 2 -9223372036854775808"), "a.obj:4", "out of range"),
        (&after("f 1 2 99999999999999999999"), "a.obj:4", "not the index of a vertex"),
        (&after("f 1//x 2 3"), "a.obj:4", "`x` is not the index of a normal"),
        (&after("f 1/2/3/4 2 3"), "a.obj:4", "more than three indices"),
        (&after("f / 2 3"), "a.obj:4", "not the index of a vertex"),
        (&after("f a b c"), "a.obj:4", "`a` is not the index"),
        ("\u{1}\0\0\0\u{2}", "a.obj:1", "no text file"),
        ("v 2e9 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3", "a.obj", "beyond 1e9"),
    ];
    assert_errors(&cases.map(|(content, place, what)| ("a.obj", content.to_owned(), place, what)));
}

#[test]
fn bad_scene_files_are_refused() {
    let mesh = |rest: &str| format!("\n[[mesh]]\n{rest}\n");
    let disc = |rest: &str| format!("{rest}\n{DISC}");
    let orthographic =
        |height: &str| format!("camera = {{ eye = [1, 1, 2], target = [1, 3, 1], orthographic_height = {height} }}");
    let cases = [
        (String::new(), "a.toml", "no triangles"),
        ("[camera\n".to_owned(), "a.toml:1", ""),
        (disc("ambience = 1"), "a.toml:1", "unknown field `ambience`"),
        (disc("\nambient = [1, 1]"), "a.toml:2", ""),
        (disc("ambient = [nan, 0, 0]"), "a.toml:1", "ambient"),
        (disc("ambient = { sky = [1, 1, 1] }"), "a.toml:1", "a table of `sky`, `ground`"),
        (disc("ambient = { sky = [1, 1, 1], ground = [1, 1, 1], side = [1, 1, 1] }"), "a.toml:1", "a table of `sky`"),
        (disc("ambient = { sky = [1, -1, 1], ground = [1, 1, 1] }"), "a.toml:1", "ambient: sky"),
        (disc("ambient = { sky = [1, 1, 1], ground = [1, nan, 1] }"), "a.toml:1", "ambient: ground"),
        (disc("ambient = { sky = [1, 1, 1], ground = [1, 1, 1], up = 'x' }"), "a.toml:1", "up: `x` is not one of y, z"),
        (disc("background = [-1, 0, 0]"), "a.toml:1", "background"),
        (disc("\nmaterials.m = { kd = [1, 1, 1] }"), "a.toml:2", "unknown field `kd`"),
        (disc("\nmaterials.m = { Kd = [1, 1, -1] }"), "a.toml:2", "material `m`: Kd"),
        (disc("\nmaterials.m = { illum = 12 }"), "a.toml:2", "material `m`: illum 12"),
        (disc("\nmaterials.m = { d = 1, Tr = 0 }"), "a.toml:2", "material `m`: has both d and Tr"),
        (disc("\nmaterials.m = { Ni = inf }"), "a.toml:2", "material `m`: Ni"),
        (disc("light = [{ kind = 'laser' }]"), "a.toml:1", "unknown variant `laser`"),
        (disc("light = [{ kind = 'point', position = [0, 0, 0] }]"), "a.toml:1", "missing field `intensity`"),
        (
            disc("light = [{ kind = 'point', position = [0, nan, 0], intensity = [1, 1, 1] }]"),
            "a.toml:1",
            "light 1: position",
        ),
        (
            disc("light = [{ kind = 'point', position = [0, 2e9, 0], intensity = [1, 1, 1] }]"),
            "a.toml:1",
            "light 1: position",
        ),
        (
            disc("light = [{ kind = 'directional', direction = [0, 0, 0], irradiance = [1, 1, 1] }]"),
            "a.toml:1",
            "no direction",
        ),
        (disc("\ncamera = { eye = [0, 0, 0] }"), "a.toml:2", "missing field `target`"),
        (disc("\ncamera = { eye = [1, 1, 1], target = [1, 1, 1] }"), "a.toml:2", "camera: eye, target and up"),
        (disc("\ncamera = { eye = [1, 1, 1], target = [1, 3, 1] }"), "a.toml:2", "camera: eye, target and up"),
        (disc("camera = { eye = [1, 1, inf], target = [1, 3, 1] }"), "a.toml:1", "camera: eye"),
        (disc("camera = { eye = [1, 1, 2], target = [1, 3, 1], vertical_fov = 180 }"), "a.toml:1", "vertical_fov"),
        (disc(&orthographic("0")), "a.toml:1", "camera: orthographic_height = 0 is outside 0.00000001 to"),
        (disc(&orthographic("-2")), "a.toml:1", "camera: orthographic_height = -2 is outside"),
        (disc(&orthographic("nan")), "a.toml:1", "camera: orthographic_height = NaN is outside"),
        (disc(&orthographic("inf")), "a.toml:1", "camera: orthographic_height = inf is outside"),
        (
            disc(&format!("\n{}", orthographic("2, vertical_fov = 45"))),
            "a.toml:2",
            "camera: has both `vertical_fov` and `orthographic_height`",
        ),
        (disc("\nsky = {}"), "a.toml:2", "sky: needs `elevation` or `direction`"),
        (disc("sky = { elevation = -1 }"), "a.toml:1", "sky: elevation = -1 is outside 0 to 90"),
        (disc("sky = { elevation = 9, azimuth = inf }"), "a.toml:1", "sky: azimuth = inf is outside"),
        (disc("sky = { elevation = 9, direction = [0, -1, 0] }"), "a.toml:1", "sky: has `direction` beside"),
        (disc("sky = { azimuth = 9, direction = [0, -1, 0] }"), "a.toml:1", "sky: has `direction` beside"),
        (disc("sky = { direction = [0, 1, 1] }"), "a.toml:1", "sky: the sun is 45.0 degrees below the horizon"),
        (disc("sky = { direction = [0, 0, 0] }"), "a.toml:1", "sky: direction = [0.0, 0.0, 0.0] has no direction"),
        (disc("sky = { elevation = 9, turbidity = 1.5 }"), "a.toml:1", "sky: turbidity = 1.5 is outside 2 to 10"),
        (disc("sky = { elevation = 9, turbidity = 12 }"), "a.toml:1", "sky: turbidity = 12 is outside 2 to 10"),
        (disc("sky = { elevation = 9, ground_albedo = [1, 2, 0] }"), "a.toml:1", "reflects more than all light"),
        (disc("sky = { elevation = 9, strength = -1 }"), "a.toml:1", "sky: strength = -1 is outside"),
        (disc("sky = { elevation = 9, up = 'x' }"), "a.toml:1", "sky: up: `x` is not one of y, z"),
        (disc("sky = { elevation = 9, clouds = 3 }"), "a.toml:1", "unknown field `clouds`"),
        (disc("render = { width = 0 }"), "a.toml:1", "render: width = 0"),
        (disc("render = { height = 20000 }"), "a.toml:1", "render: height = 20000"),
        (disc("render = { max_depth = 0 }"), "a.toml:1", "render: max_depth = 0"),
        (disc("render = { exposure = -1 }"), "a.toml:1", "render: exposure = -1"),
        (disc("render = { denoise = 'much' }"), "a.toml:1", "unknown variant `much`"),
        (disc("render = { denoise = 'edge', integrator = 'whitted' }"), "a.toml:1", "needs integrator = \"path\""),
        (disc("render = { denoise_threshold = 5 }"), "a.toml:1", "render: denoise_threshold = 5"),
        (mesh(""), "a.toml:2", "mesh 1: has neither `file` nor `generator`"),
        (mesh("file = 'x.obj'\ngenerator = 'disc'"), "a.toml:2", "mesh 1: has both"),
        (mesh("file = 'x.obj'"), "a.toml:2", "/x.obj: cannot be read"),
        (format!("{DISC}{}", mesh("file = '.'")), "a.toml:6", "/.: cannot be read: it is not a regular file"),
        (mesh("file = 'x.obj'\nradius = 1"), "a.toml:2", "mesh 1: unknown field `radius`"),
        (mesh("file = 'x.obj'\ncrease = 200"), "a.toml:2", "mesh 1: crease = 200"),
        (mesh("generator = 'cone'"), "a.toml:2", "mesh 1: unknown variant `cone`"),
        (mesh("generator = 'disc'\nradius = 1\nsegments = 3\ncrease = 2"), "a.toml:2", "unknown field `crease`"),
        (mesh("generator = 'disc'\nradius = 1"), "a.toml:2", "missing field `segments`"),
        (mesh("generator = 'disc'\nradius = 0\nsegments = 3"), "a.toml:2", "mesh 1: radius = 0"),
        (mesh("generator = 'disc'\nradius = nan\nsegments = 3"), "a.toml:2", "mesh 1: radius = NaN"),
        (mesh("generator = 'disc'\nradius = 1\nsegments = 2"), "a.toml:2", "mesh 1: segments = 2"),
        (mesh("generator = 'sphere'\nradius = 1\ntriangles = 11"), "a.toml:2", "mesh 1: triangles = 11 is odd"),
        (mesh("generator = 'sphere'\nradius = 1\ntriangles = 4"), "a.toml:2", "too few"),
        (mesh("generator = 'sphere'\nradius = 1\ntriangles = 4000000000"), "a.toml:2", "makes 4000000000 triangles"),
        (mesh("generator = 'sphere'\nradius = 1\nsegments = 65536\nrings = 65536"), "a.toml:2", "triangles: more than"),
        (mesh("generator = 'sphere'\nradius = 1\nrings = 6"), "a.toml:2", "needs either"),
        (mesh("generator = 'geodesic'\nradius = 1\nfrequency = 65536"), "a.toml:2", "triangles: more than"),
        (mesh("generator = 'lathe'\nsegments = 9\nprofile = [[1, 1]]"), "a.toml:2", "begins and ends nothing"),
        (mesh("generator = 'lathe'\nsegments = 9\nprofile = []"), "a.toml:2", "mesh 1: "),
        (mesh("generator = 'lathe'\nsegments = 9\nprofile = [[1, 1], [0, 1], [1, 0]]"), "a.toml:2", "touches the axis"),
        (mesh("generator = 'lathe'\nsegments = 9\nprofile = [[-1, 1], [1, 0]]"), "a.toml:2", "distance from the axis"),
        (
            mesh("generator = 'superellipsoid'\nsize = [1, 1, 1]\nexponents = [3, 1]\ntriangles = 90"),
            "a.toml:2",
            "exponents = 3",
        ),
        (
            mesh("generator = 'torus_knot'\np = 2\nq = 4\nradius = 1\nswing = 1\ntube = 1\nsegments = 9\nsides = 3"),
            "a.toml:2",
            "common factor",
        ),
        (format!("{DISC}transform.scale = 0"), "a.toml:1", "mesh 1: scale"),
        (format!("{DISC}transform.scale = [1, nan, 1]"), "a.toml:1", "mesh 1: scale"),
        (format!("{DISC}transform.translate = [1, inf, 1]"), "a.toml:1", "mesh 1: translate"),
        (format!("{DISC}transform.translate = [1, 1e10, 1]"), "a.toml:1", "mesh 1: a vertex lies at"),
        (format!("{DISC}transform.rotate = [1, 1]"), "a.toml:1", "mesh 1: expected [x, y, z] in degrees or"),
        (format!("{DISC}transform.rotate = {{ axis = [0, 0, 0], angle = 1 }}"), "a.toml:1", "no direction"),
        (format!("{DISC}transform.shear = 1"), "a.toml:1", "unknown field `shear`"),
        (format!("{DISC}{DISC}material = 'm'"), "a.toml:5", "mesh 2: there is no material `m`"),
        (format!("{DISC}material = 'm'\nmaterials = ['m']"), "a.toml:1", "both `material` and `materials`"),
        (format!("a = {}1{}", "[".repeat(10_000), "]".repeat(10_000)), "a.toml:1", ""),
    ];
    assert_errors(&cases.map(|(content, place, what)| ("a.toml", content, place, what)));
}

#[test]
fn files_that_are_no_scenes_are_refused() {
    assert!(error("a.toml", b"\n\xff").ends_with("a.toml:2: is not UTF-8"));
    assert!(error("a.fbx", b"x").ends_with("in none of .toml, .gltf, .glb, .obj, .ply, .stl and .kdpack"));
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("x.obj")).unwrap();
    assert!(
        Scene::load(&folder.path().join("x.obj"))
            .unwrap_err()
            .to_string()
            .ends_with("x.obj: cannot be read: it is not a regular file")
    );
    let missing = Scene::load(Path::new("no\nsuch\u{7}.toml")).unwrap_err().to_string();
    assert!(missing.starts_with("no such\\u{7}.toml: cannot be read"), "{missing}");
}

/// Files of 1 TiB, all zeros, are refused before they are read, whoever names them.
#[test]
fn files_that_do_not_fit_in_memory_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    for name in ["big.toml", "big.obj", "big.ply", "big.png", "big.npy", "big.bin"] {
        fs::File::create(path(name)).unwrap().set_len(1 << 40).unwrap();
    }
    let mesh = |keys: &str| format!("[[mesh]]\ngenerator = 'disc'\nradius = 1\nsegments = 3\n{keys}");
    fs::write(path("map.toml"), format!("materials.m = {{ map_Kd = 'big.png' }}\n{}", mesh("material = 'm'"))).unwrap();
    fs::write(path("sky.toml"), format!("environment = {{ file = 'big.png' }}\n{}", mesh(""))).unwrap();
    fs::write(path("many.toml"), mesh("instances = 'big.npy'")).unwrap();
    let gltf = r#"{ "asset": { "version": "2.0" }, "buffers": [{ "uri": "big.bin", "byteLength": 4 }] }"#;
    fs::write(path("m.gltf"), gltf).unwrap();
    for (name, big) in [
        ("big.toml", "big.toml"),
        ("big.obj", "big.obj"),
        ("big.ply", "big.ply"),
        ("map.toml", "big.png"),
        ("sky.toml", "big.png"),
        ("many.toml", "big.npy"),
        ("m.gltf", "big.bin"),
    ] {
        let error = Scene::load(&path(name)).unwrap_err().to_string();
        let is_text = name == "big.obj";
        let what = format!("{big}: reading it needs some {}.0 GiB of memory", if is_text { 2048 } else { 1024 });
        assert!(error.contains(&what), "{name}: {error}");
    }
}

/// Valid scenes. The first file of each row is the one that is mutated.
const SEEDS: [&[(&str, &str)]; 4] = [
    &[(
        "m.obj",
        "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0.5\nvt 0 0\nvn 0 0 1\nusemtl m\ns 1\n\
         f 1/1/1 2//1 3//1\nf 2 4 3\ns off\nf -1 -2 -3 -4\nv 1 1 1 0.5 0.5 0.5\nvt 1 0.5\nvt 0.5 1\n\
         f 1/1 2/2 5/3 4/-1 3/-2\n",
    )],
    &[("m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")],
    &[
        (
            "m.mtl",
            "newmtl m\nKa 0.1 0.1 0.1\nKd 0.5\nKs 1 1 1\nNs 10\nNi 1.5\nd 0.5\nTr 0.5\nTf 1 1 1\nillum 7\n\
             map_Kd a.png\nbump b.png\nmap_d -s 2 2 -o 0.5 -imfchan m -bm 2 -clamp on c d.png\nPr 0.5\nPm 1\n",
        ),
        ("user.obj", "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n"),
    ],
    &[(
        "m.toml",
        "ambient = [0.1, 0.1, 0.1]\n[camera]\neye = [0, 1, 5]\ntarget = [0, 0, 0]\n[[light]]\nkind = 'point'\n\
         position = [1, 2, 3]\nintensity = [1, 1, 1]\n[materials.m]\nKd = [1, 1, 1]\nillum = 3\n[[mesh]]\n\
         generator = 'sphere'\nradius = 1.5\nsegments = 8\nrings = 3\nmaterial = 'm'\n\
         transform = { rotate = [0, 45, 0], scale = 2 }\n[[mesh]]\ngenerator = 'lathe'\nsegments = 5\nsteps = 2\n\
         profile = [[0, 1], [1, 1], [1, 0], [0, 0]]\n[render]\nwidth = 64\n",
    )],
];

/// Returns the next number of Knuth's MMIX generator, 31 bits.
fn random(state: &mut u64) -> usize {
    *state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    (*state >> 33) as usize
}

/// Makes up to three edits: it changes, removes or repeats bytes, or replaces bytes or a digit by nasty text.
fn mutate(bytes: &mut Vec<u8>, state: &mut u64) {
    const NASTY: [&str; 12] =
        ["nan", "-inf", "1e39", "-1", "0", "9223372036854775807", "1e-45", "", "\u{feff}", "\\\n", "/", "-0.0"];
    for _ in 0..1 + random(state) % 3 {
        let at = random(state) % bytes.len().max(1);
        let end = (at + random(state) % 12).min(bytes.len());
        match random(state) % 5 {
            0 if !bytes.is_empty() => bytes[at] = random(state) as u8,
            1 => drop(bytes.drain(at.min(end)..end)),
            2 => bytes.extend_from_within(at.min(end)..end),
            3 => drop(bytes.splice(at.min(end)..end, NASTY[random(state) % NASTY.len()].bytes())),
            _ => {
                let digit = bytes.iter().skip(at).position(u8::is_ascii_digit);
                if let Some(digit) = digit {
                    bytes.splice(at + digit..=at + digit, NASTY[random(state) % NASTY.len()].bytes());
                }
            }
        }
    }
}

#[test]
fn mutated_files_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let mut state = 1;
    let (mut n_good, mut n_bad) = (0, 0);
    for seed in SEEDS {
        for (name, content) in seed {
            fs::write(folder.path().join(name), content).unwrap();
        }
        let (name, content) = seed[0];
        let scene = if name.ends_with("mtl") { "user.obj" } else { name };
        Scene::load(&folder.path().join(scene)).unwrap();
        for _ in 0..1500 {
            let mut bytes = content.as_bytes().to_vec();
            mutate(&mut bytes, &mut state);
            fs::write(folder.path().join(name), &bytes).unwrap();
            match Scene::load(&folder.path().join(scene)) {
                Ok(scene) => {
                    let scene = flattened(&scene);
                    n_good += 1;
                    assert!(scene.triangles.iter().all(|t| t.v0.is_finite() && t.v1.is_finite() && t.v2.is_finite()));
                    assert!(scene.triangle_materials.iter().all(|ix| (*ix as usize) < scene.materials.len()));
                }
                Err(e) => {
                    n_bad += 1;
                    assert_eq!(e.to_string().lines().count(), 1, "{e}");
                }
            }
        }
    }
    // Many mutations leave the file valid, and many do not.
    assert!(n_good > 500 && n_bad > 500, "{n_good} good, {n_bad} bad");
}
