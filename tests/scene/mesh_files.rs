//! PLY and STL files, held against OBJ files of the same meshes.

use std::fmt::Write;

use glam::{Vec2, Vec3, Vec4};
use kdray::{layout::normal::decode_octahedral, world::FlatScene};

use super::{
    load,
    materials::{load_scene, png},
    support::random::Random,
};

/// The corners of a cube, and its sides as polygons that are counter-clockwise from outside.
pub const CORNERS: [[f32; 3]; 8] = [
    [-1.0, -1.0, -1.0],
    [1.0, -1.0, -1.0],
    [1.0, 1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
    [1.0, -1.0, 1.0],
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
];
pub const SIDES: [[u32; 4]; 6] = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]];

pub fn obj() -> Vec<u8> {
    let mut text: String = CORNERS.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
    text.extend(SIDES.map(|side| format!("f {} {} {} {}\n", side[0] + 1, side[1] + 1, side[2] + 1, side[3] + 1)));
    text.into_bytes()
}

fn ply_header(format: &str) -> String {
    format!(
        "ply\nformat {format} 1.0\ncomment a cube\n\
         element vertex 8\nproperty float x\nproperty float y\nproperty float z\n\
         element face 6\nproperty list uchar int vertex_indices\nend_header\n"
    )
}

fn ply_text() -> Vec<u8> {
    let mut text = ply_header("ascii");
    text.extend(CORNERS.map(|[x, y, z]| format!("{x} {y} {z}\n")));
    text.extend(SIDES.map(|[a, b, c, d]| format!("4 {a} {b} {c} {d}\n")));
    text.into_bytes()
}

fn ply_binary(is_big: bool) -> Vec<u8> {
    let word = |bits: u32| if is_big { bits.to_be_bytes() } else { bits.to_le_bytes() };
    let mut bytes = ply_header(if is_big { "binary_big_endian" } else { "binary_little_endian" }).into_bytes();
    bytes.extend(CORNERS.as_flattened().iter().flat_map(|x| word(x.to_bits())));
    SIDES.iter().for_each(|side| {
        bytes.push(4);
        bytes.extend(side.iter().flat_map(|ix| word(*ix)));
    });
    bytes
}

/// The cube's triangles: fans of its sides.
fn triangles() -> impl Iterator<Item = [[f32; 3]; 3]> {
    let corner = |ix: u32| CORNERS[ix as usize];
    SIDES.into_iter().flat_map(move |[a, b, c, d]| [[a, b, c], [a, c, d]].map(|face| face.map(corner)))
}

fn stl_text(name: &str, triangles: impl Iterator<Item = [[f32; 3]; 3]>) -> String {
    let mut text = format!("solid{name}\n");
    for triangle in triangles {
        text += "  facet normal nan 0 0\n    outer loop\n";
        triangle.iter().for_each(|[x, y, z]| writeln!(text, "      vertex {x:e} {y} {z}").unwrap());
        text += "    endloop\n  endfacet\n";
    }
    text + &format!("endsolid{name}\n")
}

fn stl_binary(comment: &[u8]) -> Vec<u8> {
    let mut bytes = [comment, &[b' '; 80]].concat()[..80].to_vec();
    bytes.extend(12_u32.to_le_bytes());
    for triangle in triangles() {
        let numbers = [0.0; 3].into_iter().chain(triangle.into_iter().flatten());
        bytes.extend(numbers.flat_map(f32::to_le_bytes));
        bytes.extend([0, 0]);
    }
    bytes
}

/// Every way to write the cube, with the ending of its file's name.
fn cubes() -> Vec<(&'static str, Vec<u8>)> {
    let halves = [stl_text(" a", triangles().take(6)), stl_text("", triangles().skip(6))].concat();
    vec![
        ("ply", ply_text()),
        ("ply", ply_binary(false)),
        ("ply", ply_binary(true)),
        ("ply", String::from_utf8(ply_text()).unwrap().replace('\n', "\r\n").into_bytes()),
        ("stl", stl_text(" cube", triangles()).into_bytes()),
        ("stl", [b"solid caf\xe9\n", stl_text("", triangles()).split_at(6).1.as_bytes()].concat()),
        ("stl", halves.into_bytes()),
        ("stl", stl_text(" cube", triangles()).to_uppercase().replace("NAN", "NaN").into_bytes()),
        ("stl", ["\u{feff}\n", &stl_text(" cube", triangles())].concat().into_bytes()),
        ("stl", stl_binary(b"a cube")),
        ("stl", stl_binary(b"solid cube")),
    ]
}

fn load_as(name: &str, content: &[u8]) -> FlatScene {
    load(&[(name, content)]).unwrap_or_else(|e| panic!("{e}\n{}", String::from_utf8_lossy(content)))
}

fn error(name: &str, content: &[u8]) -> String {
    load(&[(name, content)])
        .map(|scene| scene.triangles.len())
        .expect_err(&String::from_utf8_lossy(content))
        .to_string()
}

#[test]
fn a_cube_is_the_same_in_every_format() {
    let expected = load_as("cube.obj", &obj());
    assert_eq!(expected.triangles.len(), 12);
    for (ix, (ending, content)) in cubes().into_iter().enumerate() {
        let found = load_as(&format!("cube.{ending}"), &content);
        assert_eq!(found.triangles, expected.triangles, "cube {ix}");
        assert_eq!(found.materials, expected.materials, "cube {ix}");
        // Up is another axis in STL files.
        assert_eq!(found.camera == expected.camera, ending == "ply", "cube {ix}");
        assert_eq!(found.triangle_materials, expected.triangle_materials, "cube {ix}");
    }
    let moved =
        load_as("cube.ply", &String::from_utf8(ply_text()).unwrap().replacen("-1 -1 -1", "-1 -1 -1.5", 1).into_bytes());
    assert_ne!(moved.triangles, expected.triangles, "a moved corner");
}

#[test]
fn the_content_counts_and_not_the_name() {
    let expected = load_as("cube.obj", &obj());
    for (_, content) in cubes() {
        for name in ["cube.obj", "CUBE.PLY", "cube.Stl"] {
            assert_eq!(load_as(name, &content).triangles, expected.triangles, "{name}");
        }
    }
    assert!(error("cube.txt", &obj()).ends_with("in none of .toml, .gltf, .glb, .obj, .ply, .stl and .kdpack"));
}

#[test]
fn scene_files_place_meshes_of_every_format() {
    let scene =
        b"[[mesh]]\nfile = 'a.ply'\n[[mesh]]\nfile = 'b.stl'\ntransform = { translate = [4, 0, 0] }\nsmooth = false\n";
    let found = load(&[("scene.toml", scene), ("a.ply", &ply_binary(false)), ("b.stl", &stl_binary(b""))]).unwrap();
    assert_eq!(found.triangles.len(), 24);
    assert_eq!(found.triangles[12].v0, found.triangles[0].v0 + Vec3::new(4.0, 0.0, 0.0));
    let missing = error("scene.toml", b"# a comment\n[[mesh]]\nfile = 'none.ply'\n");
    assert!(missing.contains("scene.toml:2") && missing.contains("none.ply"), "{missing}");
}

#[test]
fn ply_is_read_as_people_write_it() {
    // Doubles, integers, properties and elements that are not read, faces before vertices, another name of the list,
    // a polygon of five corners, and faces of fewer than three.
    let text = "ply\nformat ascii 1.0\nobj_info scanned\n\
                element camera 1\nproperty float view_px\nproperty list uchar int ids\n\
                element face 4\nproperty uchar flags\nproperty list ushort uint vertex_index\nelement vertex 5\n\
                property double x\nproperty int y\nproperty uchar red\nproperty float z\nend_header\n\
                0.5 2 7 8\n0 5 0 1 2 3 4\n1 2 0 1\n0 0\n2 3 4 2 0\n\
                0 0 255 0\n2 0 0 0\n3e0 1 9 0\n2 2 0 0\n0.25 2 1 0\n";
    let scene = load_as("x.ply", text.as_bytes());
    let corners: Vec<_> = scene.triangles.iter().map(|t| [t.v0, t.v1, t.v2].map(|v| v.truncate().to_array())).collect();
    let [a, b, c, d, e] = [[0.0, 0.0], [2.0, 0.0], [3.0, 1.0], [2.0, 2.0], [0.25, 2.0]];
    assert_eq!(corners, [[a, b, c], [a, c, d], [a, d, e], [e, c, a]]);
}

#[test]
fn the_normals_of_a_ply_file_count() {
    let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float nx\nproperty float ny\nproperty float nz\n\
                property float x\nproperty float y\nproperty float z\nelement face 1\n\
                property list uchar int vertex_indices\nend_header\n0 3 4 0 0 0\n0 0 2 1 0 0\n0 0 0 0 1 0\n3 0 1 2\n";
    let scene = load_as("x.ply", text.as_bytes());
    let [triangle] = scene.triangles[..] else { panic!("one triangle") };
    assert!(decode_octahedral(triangle.n0).distance(Vec3::new(0.0, 0.6, 0.8)) < 1e-4);
    assert!(decode_octahedral(triangle.n1).distance(Vec3::Z) < 1e-4);
    assert_eq!(triangle.n2, kdray::layout::FLAT_NORMAL, "a zero normal is none");
    let flat = load(&[("s.toml", b"mesh = [{ file = 'x.ply', smooth = false }]"), ("x.ply", text.as_bytes())]).unwrap();
    assert_eq!(flat.triangles[0].n0, kdray::layout::FLAT_NORMAL);
}

#[test]
fn mistakes_are_named() {
    let ply = String::from_utf8(ply_text()).unwrap();
    for (from, to, what) in [
        ("4 0 3 2 1", "4 0 3 2 8", "face 0 (counted from 0) has vertex 8, but there are 8 vertices"),
        ("4 0 3 2 1", "4 0 3 2 -1", "face 0 (counted from 0) has vertex -1, but there are 8 vertices"),
        ("4 0 3 2 1", "4 0 3 2 1.5", "face 0 (counted from 0) has vertex 1.5, but there are 8 vertices"),
        ("4 0 3 2 1", "4 0 3 2", "element `face`: line 19 has fewer numbers than the row"),
        ("4 0 3 2 1", "-4 0 3 2 1", "element `face`: line 19: -4 is no length of a list"),
        ("element face 6", "element face 600", "element `face`: the file ends too early"),
        (
            "element face 6\nproperty list uchar int vertex_indices",
            "element edge 6\nproperty list uchar int vertex_indices",
            "no element `face`: it is a cloud of 8 points",
        ),
        ("element face 6", "element tristrips 7", "element `tristrips`: the file ends too early"),
        ("vertex_indices", "indices", "lacks the list `vertex_indices`"),
        ("property float z", "property float w", "lacks x, y or z"),
        ("element vertex 8", "element corner 8", "no element `vertex`"),
        ("1 -1 -1", "1 x -1", "element `vertex`: line 11: `x` is not a number"),
        ("format ascii 1.0", "format morse 1.0", "is no PLY file"),
    ] {
        let found = error("x.ply", ply.replacen(from, to, 1).as_bytes());
        assert!(found.contains("x.ply: ") && found.contains(what) && found.lines().count() == 1, "{to}: {found}");
    }
    let empty = ply.replace("end_header", "element empty 99999999999999999\nend_header");
    assert!(error("x.ply", empty.as_bytes()).contains("element `empty` has no properties"));
    assert!(error("x.ply", b"v 0 0 0\n").contains("is no PLY file"));
    assert!(
        error("x.ply", ply.replace("element face 6", "element face 99999999999999").as_bytes())
            .contains("element `face`")
    );
    // The header alone is refused, before any row is read.
    for (n, element) in [(99_999_999, "vertex 8"), (usize::MAX, "vertex 8"), (1 << 40, "face 6")] {
        let (name, _) = element.split_once(' ').unwrap();
        for content in [ply.as_bytes(), &ply_binary(false)] {
            let text = String::from_utf8_lossy(content).into_owned();
            let head = text.split_once("end_header\n").unwrap().0.replace(element, &format!("{name} {n}"));
            let body = &content[text.find("end_header").unwrap()..];
            let found = error("x.ply", &[head.as_bytes(), body].concat());
            assert!(found.contains(&format!("element `{name}`: the file ends too early: ")), "{found}");
            assert!(found.ends_with(&format!("bytes do not hold its {n} rows")), "{found}");
        }
    }
    let stl = stl_text("", triangles());
    for (from, to, what) in [
        ("vertex -1e0 -1 -1", "vertex -1e0 -1", "line 4: `vertex` is not a number"),
        ("endfacet", "", "has 6 corners, not 3"),
        ("outer", "inner", "line 3: `inner` is not expected"),
    ] {
        let found = error("x.stl", stl.replacen(from, to, 1).as_bytes());
        assert!(found.contains("x.stl: ") && found.contains(what) && found.lines().count() == 1, "{to}: {found}");
    }
    assert!(error("x.stl", b"solid x\nendsolid x\n").contains("has no triangles"));
    assert!(error("x.stl", b"junk").contains("is no STL file"));
    let binary = stl_binary(b"");
    assert!(error("x.stl", &binary[..200]).contains("ends after 2 of 12 facets"));
}

/// Changes random bytes and cuts files off. Files are loaded or refused, in one line, and nothing else happens.
#[test]
fn spoilt_files_are_no_trouble() {
    let mut random = Random(5);
    let cubes = cubes();
    let mut n_refused = 0;
    for round in 0..3000 {
        let (ending, mut content) = cubes[round % cubes.len()].clone();
        for _ in 0..1 + random.below(4) {
            let at = random.below(content.len());
            content[at] = random.below(256) as u8;
        }
        if random.below(3) == 0 {
            content.truncate(random.below(content.len()));
        }
        if let Err(error) = load(&[(&format!("x.{ending}"), &content)]) {
            n_refused += 1;
            assert_eq!(error.to_string().lines().count(), 1, "{error}");
        }
    }
    assert!((300..3000).contains(&n_refused), "{n_refused} of 3000");
}

fn mesh(text: &[u8]) -> kdray::scene::Mesh {
    let (scene, warnings) = load_scene(&[("x.ply", text)]);
    assert!(warnings.is_empty(), "{warnings:?}");
    scene.unwrap_or_else(|e| panic!("{e}")).meshes.remove(0)
}

/// Returns a PLY file of one triangle. `properties` and `values`: what its vertices have beside x, y and z.
fn painted(format: &str, properties: &str, values: impl Fn(&mut Vec<u8>, usize)) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat {format} 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
         {properties}element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    )
    .into_bytes();
    let is_big = format == "binary_big_endian";
    let word = |bits: u32| if is_big { bits.to_be_bytes() } else { bits.to_le_bytes() };
    let corners: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    for (ix, corner) in corners.iter().enumerate() {
        match format {
            "ascii" => bytes.extend(format!("{} {} {} ", corner[0], corner[1], corner[2]).into_bytes()),
            _ => bytes.extend(corner.iter().flat_map(|x| word(x.to_bits()))),
        }
        values(&mut bytes, ix);
    }
    match format {
        "ascii" => bytes.extend(b"3 0 1 2\n"),
        _ => {
            bytes.push(3);
            bytes.extend([0, 1, 2].into_iter().flat_map(word));
        }
    }
    bytes
}

#[test]
fn ply_colours_and_texture_coordinates_are_read_in_every_encoding() {
    let colours: [[u8; 4]; 3] = [[255, 0, 188, 51], [0, 0, 0, 0], [255; 4]];
    let uvs: [[f32; 2]; 3] = [[0.0, 0.0], [1.0, 0.25], [0.5, 1.0]];
    let check = |mesh: kdray::scene::Mesh, what: &str| {
        // 188 / 255 in sRGB is 0.5029.
        let expected = [Vec4::new(1.0, 0.0, 0.5029, 0.2), Vec4::ZERO, Vec4::ONE];
        for (found, expected) in mesh.colours[0].iter().zip(expected) {
            assert!((*found - expected).length() < 1e-3, "{what}: {found} in place of {expected}");
        }
        assert_eq!(mesh.uvs[0], [[Vec2::new(0.0, 1.0), Vec2::new(1.0, 0.75), Vec2::new(0.5, 0.0)]], "{what}");
    };
    for names in [
        ["red", "green", "blue", "alpha", "s", "t"],
        ["diffuse_red", "diffuse_green", "diffuse_blue", "alpha", "u", "v"],
    ] {
        let bytes_then_floats: String = names
            .iter()
            .enumerate()
            .map(|(ix, name)| format!("property {} {name}\n", if ix < 4 { "uchar" } else { "float" }))
            .collect();
        for format in ["binary_little_endian", "binary_big_endian"] {
            let binary = painted(format, &bytes_then_floats, |bytes, ix| {
                bytes.extend(colours[ix]);
                let is_big = format == "binary_big_endian";
                bytes.extend(uvs[ix].iter().flat_map(|x| if is_big { x.to_be_bytes() } else { x.to_le_bytes() }));
            });
            check(mesh(&binary), format);
        }
        let text = |bytes: &mut Vec<u8>, values: [f32; 4], uv: [f32; 2]| {
            let [r, g, b, a] = values;
            bytes.extend(format!("{r} {g} {b} {a} {} {}\n", uv[0], uv[1]).into_bytes());
        };
        let ascii = painted("ascii", &bytes_then_floats, |bytes, ix| text(bytes, colours[ix].map(f32::from), uvs[ix]));
        check(mesh(&ascii), "text");
        let floats = bytes_then_floats.replace("uchar", "double");
        let ascii =
            painted("ascii", &floats, |bytes, ix| text(bytes, colours[ix].map(|c| f32::from(c) / 255.0), uvs[ix]));
        check(mesh(&ascii), "floats");
    }
    let opaque = painted("ascii", "property uchar red\nproperty uchar green\nproperty uchar blue\n", |bytes, _| {
        bytes.extend(b"0 0 0\n");
    });
    assert_eq!(mesh(&opaque).colours[0][0], Vec4::new(0.0, 0.0, 0.0, 1.0));
}

#[test]
fn meshlabs_textures_are_read() {
    let text = "ply\nformat ascii 1.0\ncomment TextureFile a.png\ncomment TextureFile none.png\nelement vertex 4\n\
                property float x\nproperty float y\nproperty float z\nelement face 3\n\
                property list uchar int vertex_indices\nproperty list uchar float texcoord\nproperty int texnumber\n\
                end_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 6 0 0 1 0 1 0.75 0\n3 0 2 3 0 1\n3 0 1 3 0 -1\n";
    let image = png(|_, _| [1, 2, 3, 255]);
    let (scene, warnings) = load_scene(&[("x.ply", text.as_bytes()), ("a.png", &image)]);
    let scene = scene.unwrap();
    assert!(warnings.len() == 1 && warnings[0].contains("none.png"), "{warnings:?}");
    let names: Vec<&str> = scene.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["a.png", "none.png", "(default)"]);
    assert_eq!((scene.images.len(), scene.materials[0].kd), (1, Vec3::ONE));
    assert_eq!(scene.materials[0].maps.base_colour, Some(kdray::scene::Texture::of_image(0)));
    assert!(scene.materials[1].maps.base_colour.is_none());
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.uvs[0][0], [Vec2::new(0.0, 1.0), Vec2::new(1.0, 1.0), Vec2::new(1.0, 0.25)]);
    assert_eq!((mesh.uvs[0][1], &mesh.slots[..]), ([Vec2::ZERO; 3], &[0, 1, 2][..]));
}

#[test]
fn triangle_strips_and_concave_polygons_are_read() {
    let text = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n\
                element tristrips 1\nproperty list int int vertex_indices\nend_header\n\
                0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n8 0 1 2 3 -1 2 3 4\n";
    assert_eq!(mesh(text.as_bytes()).faces, [[0, 1, 2], [2, 1, 3], [2, 3, 4]]);
    assert!(error("x.ply", text.replace("2 3 4", "2 3 5").as_bytes()).contains("a triangle strip has vertex 5"));
    // An arrow head whose second corner is in front of the first one's view.
    let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                element face 1\nproperty list uchar int vertex_indices\nend_header\n\
                2 -1 0\n0 2 0\n-2 -1 0\n0 0 0\n4 0 1 2 3\n";
    let scene = load_as("x.ply", text.as_bytes());
    let areas: Vec<f32> = scene.triangles.iter().map(|t| super::facet_normal(t).z / 2.0).collect();
    assert!(areas.iter().all(|area| *area > 0.0) && areas.iter().sum::<f32>() == 4.0, "{areas:?}");
}

/// Several PLY and STL files are read at the same time. Each mesh is the one that its file alone gives, and the first
/// table with a bad file decides which error is reported.
#[test]
fn files_that_are_read_together_are_those_that_are_read_alone() {
    let mut files: Vec<(String, Vec<u8>)> =
        cubes().into_iter().enumerate().map(|(ix, (ending, content))| (format!("{ix}.{ending}"), content)).collect();
    // The content counts, and not the name.
    files.insert(3, ("odd.ply".to_owned(), stl_binary(b"")));
    let table = |ix: usize, name: &str| {
        format!(
            "[[mesh]]\nfile = '{name}'\nsmooth = {}\ntransform.translate = [{}, 0, 0]\n",
            ix.is_multiple_of(2),
            4 * ix
        )
    };
    let load_tables = |tables: &str| {
        let named = files.iter().map(|(name, content)| (&name[..], &content[..]));
        load(&[("scene.toml", tables.as_bytes())].into_iter().chain(named).collect::<Vec<_>>())
    };
    let tables: Vec<String> = files.iter().enumerate().map(|(ix, (name, _))| table(ix, name)).collect();
    let together = load_tables(&tables.concat()).unwrap();
    assert_eq!(together.triangles.len(), 12 * files.len());
    for (ix, alone) in tables.iter().enumerate() {
        let alone = load_tables(alone).unwrap();
        assert_eq!(together.triangles[12 * ix..][..12], **alone.triangles, "{}", files[ix].0);
    }
    let [bad, missing] = [table(0, "bad.ply"), table(1, "missing.stl")];
    for (first, second, named) in [(&bad, &missing, "bad.ply"), (&missing, &bad, "missing.stl")] {
        let scene = [&tables[0], first, second].map(String::as_str).concat();
        let all = [("scene.toml", scene.as_bytes()), ("0.ply", &files[0].1), ("bad.ply", b"ply\nno header")];
        let error = load(&all).map(|scene| scene.triangles.len()).unwrap_err().to_string();
        assert!(error.contains(named), "{error}");
    }
}
