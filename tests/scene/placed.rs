//! Mesh files that a scene file places, more than once or with keys that have no effect.

use glam::Vec3;
use kdray::scene::{Pixels, Scene};
use npyz::Order;

use super::{
    gltf::Model,
    materials::{load_scene, png},
    support::arrays::npy,
};

const OBJ: &str = "mtllib m.mtl\nusemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\n\
                   f 1/1 2/2 3/3\nf 1/1 2/2 4/3\n";
const MTL: &[u8] = b"newmtl red\nKd 1 0 0\nmap_Kd a.png\n";

/// Loads a scene file with a mesh, its material and its image beside it. Returns the warnings, too.
fn load(toml: &str) -> (Scene, Vec<String>) {
    let image = png(|_, _| [9, 8, 7, 255]);
    let files: [(&str, &[u8]); 4] =
        [("s.toml", toml.as_bytes()), ("m.obj", OBJ.as_bytes()), ("m.mtl", MTL), ("a.png", &image)];
    let (scene, warnings) = load_scene(&files);
    (scene.unwrap_or_else(|error| panic!("{error}\n{toml}")), warnings)
}

#[test]
fn a_mesh_file_that_is_placed_twice_is_read_once() {
    let (scene, warnings) = load(
        "materials.red = { Kd = [0, 1, 0] }\nmaterials.own = {}\n[[mesh]]\nfile = 'm.obj'\nmaterial = 'own'\n\
         [[mesh]]\nfile = 'm.obj'\n[[mesh]]\nfile = './m.obj'\ntransform.translate = [0, 0, 5]\n\
         [[mesh]]\nfile = 'm.obj'\noverride = true\n",
    );
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!((scene.meshes.len(), scene.images.len()), (1, 1));
    assert!(scene.instances.iter().all(|instance| instance.mesh_ix == 0));
    let colours: Vec<Vec3> = scene.instances.iter().map(|it| scene.materials[it.materials[0] as usize].kd).collect();
    assert_eq!(colours, [Vec3::splat(0.8), Vec3::X, Vec3::X, Vec3::Y]);
    assert_eq!(scene.instances[1].materials, scene.instances[2].materials);
    assert_eq!(scene.instances[2].transform.point(Vec3::ZERO), Vec3::new(0.0, 0.0, 5.0));
    // What changes the mesh makes another one.
    for key in ["smooth = false", "crease = 10", "uv_scale = [2, 2]"] {
        let (scene, _) = load(&format!("[[mesh]]\nfile = 'm.obj'\n[[mesh]]\nfile = 'm.obj'\n{key}\n"));
        assert_eq!((scene.meshes.len(), scene.images.len()), (2, 1), "{key}");
    }
}

#[test]
fn a_model_that_is_placed_twice_is_read_once() {
    let mut model = Model::new();
    let positions = model.accessor("VEC3", 5126, &[0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    model.push("materials", serde_json::json!({ "name": "red" }));
    model.show(serde_json::json!({ "attributes": { "POSITION": positions }, "material": 0 }));
    model.root(serde_json::json!({ "mesh": 0, "translation": [0, 0, 1] }));
    let toml = "materials.own = {}\n[[mesh]]\nfile = 'm.glb'\nmaterial = 'own'\n\
                [[mesh]]\nfile = 'm.glb'\ntransform.scale = 2\n[[mesh]]\nfile = 'm.glb'\n";
    let scene = load_scene(&[("s.toml", toml.as_bytes()), ("m.glb", &model.glb())]).0.unwrap();
    assert_eq!((scene.meshes.len(), scene.instances.len(), scene.materials.len()), (1, 6, 2));
    let names: Vec<&str> =
        scene.instances.iter().map(|it| &scene.materials[it.materials[0] as usize].name[..]).collect();
    assert_eq!(names, ["own", "own", "red", "red", "red", "red"]);
    assert_eq!(scene.instances[3].transform.point(Vec3::ZERO), Vec3::new(0.0, 0.0, 2.0));
}

#[test]
fn images_of_several_libraries_are_decoded_once() {
    let image = png(|_, _| [1, 2, 3, 255]);
    let obj = OBJ.replace("m.mtl", "n.mtl");
    let toml = "materials.own = { map_Kd = 'a.png' }\n[[mesh]]\nfile = 'm.obj'\n[[mesh]]\nfile = 'n.obj'\n\
                [[mesh]]\nfile = 'n.obj'\nmaterial = 'own'\n";
    let (scene, warnings) = load_scene(&[
        ("s.toml", toml.as_bytes()),
        ("m.obj", OBJ.as_bytes()),
        ("n.obj", obj.as_bytes()),
        ("m.mtl", MTL),
        ("n.mtl", b"newmtl red\nmap_Kd a.png\nmap_Tr a.png\nbump -bm 0.5 a.png\n"),
        ("a.png", &image),
    ]);
    let scene = scene.unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    let names: Vec<&str> = scene.images.iter().map(|image| &image.name[..]).collect();
    assert_eq!(names, ["a.png", "a.png", "a.png (normals)"]);
    let Pixels::Bytes(inverted) = &scene.images[1].pixels else { panic!("bytes") };
    assert_eq!(inverted[0], [254, 253, 252, 0]);
    let of_material = |name: &str| {
        let of_name = scene.materials.iter().filter(|material| material.name == name);
        of_name.map(|material| material.maps.base_colour.as_ref().unwrap().image_ix).collect::<Vec<_>>()
    };
    assert_eq!((of_material("own"), of_material("red")), (vec![0], vec![0, 0]));
}

#[test]
fn a_crease_without_effect_is_told() {
    let with_normals = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\n";
    let mixed = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\nf 1 2 3\n";
    let flat = b"v 0 0 0\nv 1 0 0\nv 0 1 0\ns off\nf 1 2 3\n";
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
               property float nx\nproperty float ny\nproperty float nz\nelement face 1\n\
               property list uchar int vertex_indices\nend_header\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n3 0 1 2\n";
    let bare = ply.replace("property float nx\nproperty float ny\nproperty float nz\n", "").replace(" 0 0 1\n", "\n");
    for (name, content, key, is_told) in [
        ("m.obj", &with_normals[..], "crease = 10", true),
        ("m.obj", mixed, "crease = 10", false),
        ("m.obj", flat, "crease = 10", true),
        ("m.obj", OBJ.as_bytes(), "crease = 10\nsmooth = false", true),
        ("m.obj", with_normals, "", false),
        ("m.ply", ply.as_bytes(), "crease = 10", true),
        ("m.ply", bare.as_bytes(), "crease = 10", false),
    ] {
        let toml = format!("# a comment\n[[mesh]]\nfile = '{name}'\n{key}\n");
        let (scene, warnings) = load_scene(&[("s.toml", toml.as_bytes()), (name, content), ("m.mtl", b"newmtl red\n")]);
        scene.unwrap();
        let told: Vec<_> = warnings.iter().filter(|warning| warning.contains("s.toml:2: mesh 1: `crease`")).collect();
        assert_eq!((told.len(), warnings.len()), (usize::from(is_told), usize::from(is_told)), "{name}: {warnings:?}");
    }
}

#[test]
fn overrides_that_match_nothing_are_told() {
    let warnings = |materials: &str, keys: &str| load(&format!("{materials}\n[[mesh]]\nfile = 'm.obj'\n{keys}")).1;
    assert!(warnings("materials.red = {}", "override = true").is_empty());
    assert!(warnings("materials.reed = {}", "").is_empty(), "nothing is overridden");
    let worn = "override = true\n[[mesh]]\nfile = 'm.obj'\nmaterial = 'other'";
    assert!(warnings("materials.other = {}", worn).is_empty());
    let told = warnings("materials.red = {}\nmaterials.Reed = {}\nmaterials.sky = {}", "override = true");
    assert_eq!(told.len(), 2, "{told:?}");
    assert!(told[0].contains("s.toml:2: material `Reed` overrides no material of a mesh file"), "{told:?}");
    assert!(told[0].ends_with("is `red` meant?") && !told[1].contains("meant"), "{told:?}");
}

/// Several files are read at the same time. The scene, the warnings and their order, and the error that is reported are
/// those of files that are read one after another.
#[test]
fn files_that_are_read_together_are_as_read_one_by_one() {
    let points: Vec<u8> =
        [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.5_f32].iter().flat_map(|x| x.to_le_bytes()).collect();
    let gltf = |name: &str| {
        let json = serde_json::json!({
            "asset": { "version": "2.0" },
            "nodes": [{ "mesh": 0 }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "material": 0 }] }],
            "materials": [{ "name": name, "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }],
            "textures": [{ "source": 0 }],
            "images": [{ "uri": format!("{name}.png") }],
            "animations": [{ "name": name, "channels": [], "samplers": [] }],
            "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0],
                            "max": [1, 1, 0.5] }],
            "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
            "buffers": [{ "uri": "m.bin", "byteLength": 36 }],
        });
        json.to_string()
    };
    let obj =
        |name: &str| format!("what {name}\nmtllib {name}.mtl\nusemtl {name}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let names = ["a.gltf", "b.obj", "c.gltf", "d.obj", "e.gltf", "f.obj"];
    let stem = |name: &'static str| &name[..1];
    let mut files: Vec<(String, Vec<u8>)> = vec![("m.bin".to_owned(), points)];
    for name in names {
        let text = if name.ends_with("gltf") { gltf(stem(name)) } else { obj(stem(name)) };
        files.push((name.to_owned(), text.into_bytes()));
    }
    let table = |name: &&str| format!("[[mesh]]\nfile = '{name}'\n");
    let load = |names: &[&str], more: &[(&str, &[u8])]| {
        let toml: String = names.iter().map(table).collect();
        let mut all: Vec<(&str, &[u8])> = vec![("s.toml", toml.as_bytes())];
        all.extend(files.iter().map(|(name, content)| (name.as_str(), content.as_slice())));
        all.extend(more);
        let (scene, warnings) = load_scene(&all);
        // Each folder has another name.
        let without_folder =
            |line: &String| line.replace(&line[line.find('/').unwrap_or(0)..=line.rfind("/").unwrap_or(0)], "");
        (scene, warnings.iter().map(without_folder).collect::<Vec<_>>())
    };
    let (together, warnings) = load(&names, &[]);
    let together = together.unwrap();
    let one_by_one: Vec<_> = names.iter().map(|name| load(&[name], &[])).collect();
    let expected: Vec<String> = one_by_one.iter().flat_map(|(_, warnings)| warnings.clone()).collect();
    assert!(expected.len() >= 12, "{expected:#?}");
    assert_eq!(warnings, expected);
    for (mesh, (scene, _)) in together.meshes.iter().zip(&one_by_one) {
        assert_eq!(*mesh, scene.as_ref().unwrap().meshes[0]);
    }
    let of_materials: Vec<&str> = together.materials.iter().map(|material| material.name.as_str()).collect();
    assert_eq!(of_materials, ["a", "(default)", "c", "e"]);
    // The first table with an error decides, whichever file is read first.
    let broken: [(&str, &[u8]); 2] =
        [("b.obj", b"v 0 0 x\nf 1 1 1\n"), ("a.gltf", b"{ \"asset\": { \"version\": \"1.0\" } }")];
    for order in [["c.gltf", "a.gltf", "b.obj"], ["c.gltf", "b.obj", "a.gltf"]] {
        let error = load(&order, &broken).0.unwrap_err().to_string();
        assert!(error.contains(order[1]), "{error}");
    }
}

/// The rows of matrices that place a mesh at three places: moved; turned and moved; mirrored and sheared.
const PLACES: [[f64; 12]; 3] = [
    [1.0, 0.0, 0.0, 5.0, 0.0, 1.0, 0.0, 6.0, 0.0, 0.0, 1.0, 7.0],
    [0.0, -1.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.25],
    [-1.0, 0.5, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
];

const IDENTITY: [f32; 12] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// Loads a scene file with a mesh and an array of transforms beside it.
fn load_placed(toml: &str, array: &[u8]) -> Result<Scene, String> {
    let obj = OBJ.replace("mtllib m.mtl\nusemtl red\n", "");
    let (scene, warnings) =
        load_scene(&[("s.toml", toml.as_bytes()), ("m.obj", obj.as_bytes()), ("places.npy", array)]);
    assert!(warnings.is_empty(), "{warnings:?}");
    scene.map_err(|error| error.to_string())
}

#[test]
fn an_array_places_a_mesh_many_times() {
    let numbers = PLACES.as_flattened();
    let single: Vec<f32> = numbers.iter().map(|x| *x as f32).collect();
    let with_last_rows: Vec<f64> = PLACES.iter().flat_map(|rows| [&rows[..], &[0.0, 0.0, 0.0, 1.0]].concat()).collect();
    let arrays = [
        npy(&[3, 3, 4], Order::C, numbers),
        npy(&[3, 3, 4], Order::C, &single),
        npy(&[3, 4, 4], Order::C, &with_last_rows),
    ];
    let (p, scaled) = (Vec3::new(1.0, 2.0, 3.0), Vec3::new(2.0, 4.0, 6.0));
    let expected = |p: Vec3| {
        let row = |rows: &[f64; 12], y: usize| (0..3).map(|x| rows[4 * y + x] as f32 * p[x]).sum::<f32>();
        PLACES.map(|rows| Vec3::from_array([0, 1, 2].map(|y| row(&rows, y) + rows[4 * y + 3] as f32)))
    };
    for array in arrays {
        for source in ["file = 'm.obj'", "generator = 'box'\nsize = [1, 1, 1]"] {
            let placed = |more: &str| {
                let toml = format!("[[mesh]]\n{source}\ninstances = 'places.npy'\n{more}");
                let scene = load_placed(&toml, &array).unwrap();
                assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 3));
                assert_eq!(scene.n_triangles(), 3 * scene.meshes[0].faces.len());
                let points: Vec<Vec3> = scene.instances.iter().map(|it| it.transform.point(p)).collect();
                points
            };
            assert_eq!(placed(""), expected(p));
            // The table's own transform comes first.
            assert_eq!(placed("transform.scale = 2\n"), expected(scaled));
        }
    }
    let nowhere = npy::<f32>(&[0, 3, 4], Order::C, &[]);
    let toml = "[[mesh]]\nfile = 'm.obj'\ninstances = 'places.npy'\n[[mesh]]\nfile = 'm.obj'\n";
    assert_eq!(load_placed(toml, &nowhere).unwrap().instances.len(), 1);
}

#[test]
fn arrays_that_place_nothing_are_refused_with_their_reason() {
    let toml = "[[mesh]]\nfile = 'm.obj'\ninstances = 'places.npy'\n";
    let flat = PLACES.map(|rows| rows.map(|x| if x == 2.0 { 0.0 } else { x }));
    let broken = PLACES.map(|rows| rows.map(|x| if x == 0.25 { f64::NAN } else { x }));
    let far = PLACES.map(|rows| rows.map(|x| if x == 6.0 { 1e30 } else { x }));
    let whole = npy(&[3, 3, 4], Order::C, PLACES.as_flattened());
    let mut endless = npy(&[11, 3, 4], Order::C, &[1.0_f32; 132]);
    let at = endless.windows(4).position(|word| word == b"(11,").unwrap();
    let spaces = endless[at..].windows(20).position(|word| word == [b' '; 20]).unwrap();
    endless.drain(at + spaces..at + spaces + 17);
    endless.splice(at + 1..at + 3, *b"4611686018427387904");
    let cases: [(&[u8], &str); 10] = [
        (&endless, "has the shape 4611686018427387904 x 3 x 4, too many numbers for a file"),
        (&npy(&[3, 3, 4], Order::C, flat.as_flattened()), "instance 2: the transform flattens the mesh"),
        (&npy(&[3, 3, 4], Order::C, broken.as_flattened()), "instance 1: the transform has a number that is not"),
        (&npy(&[3, 3, 4], Order::C, far.as_flattened()), "instance 0: "),
        (&npy(&[3, 12], Order::C, PLACES.as_flattened()), "has the shape [3, 12]: instances are N x 3 x 4 numbers"),
        (&npy(&[3, 3, 4], Order::Fortran, PLACES.as_flattened()), "is in Fortran order"),
        (&npy(&[1, 3, 4], Order::C, &[1_i32; 12]), "not float32 or float64"),
        (&npy(&[1, 4, 4], Order::C, &[1.0_f32; 16]), "instance 0: the last row of its matrix is not 0 0 0 1"),
        (&whole[..whole.len() - 8], "ends after 2 of 3 instances"),
        (b"no array", "is no .npy file"),
    ];
    for (array, what) in cases {
        let error = load_placed(toml, array).unwrap_err();
        assert!(error.contains("s.toml") && error.contains(what) && error.contains("mesh 1"), "{error}");
    }
    // Too many triangles are refused before they are placed.
    let many = npy(&[1 << 18, 3, 4], Order::C, &IDENTITY.repeat(1 << 18));
    let toml = "[[mesh]]\ngenerator = 'geodesic'\nradius = 1\nfrequency = 64\ninstances = 'places.npy'\n";
    let error = load_placed(toml, &many).unwrap_err();
    assert!(error.contains("a scene of 21474836480 triangles: there may be 2147483648"), "{error}");
}
