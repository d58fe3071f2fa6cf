//! Files as other programs write them, whose makers meant something else than the letter of the format says, or whose
//! numbers are broken.

use glam::{Vec3, Vec4};
use kdray::scene::{Material, Mesh, Pixels, Scene, Texture};
use serde_json::json;

use super::materials::{load_scene, png};

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
const UVS: &str = "vt 0 0\nvt 1 0\nvt 0 1\n";

/// Loads files, which must load, and returns the scene and the warnings.
pub(super) fn loaded(files: &[(&str, &[u8])]) -> (Scene, Vec<String>) {
    let (scene, warnings) = load_scene(files);
    (scene.unwrap_or_else(|error| panic!("{error}")), warnings)
}

/// Returns the material of a triangle with texture coordinates, from the statements of an MTL file beside an image
/// `a.png` of one colour.
pub(super) fn material_of(mtl: &str, pixel: [u8; 4]) -> (Material, Vec<String>) {
    let obj = format!("mtllib m.mtl\nusemtl m\n{TRIANGLE}{UVS}f 1/1 2/2 3/3\n");
    let mtl = format!("newmtl m\n{mtl}\n");
    let files = [("m.obj", obj.as_bytes()), ("m.mtl", mtl.as_bytes()), ("a.png", &png(|_, _| pixel))];
    let (mut scene, warnings) = loaded(&files);
    (scene.materials.remove(0), warnings)
}

/// Returns the mesh of an OBJ file, and the warnings.
fn mesh_of(name: &str, text: &str) -> (Mesh, Vec<String>) {
    let (mut scene, warnings) = loaded(&[(name, text.as_bytes())]);
    (scene.meshes.remove(0), warnings)
}

#[test]
fn a_black_term_does_not_hide_its_map() {
    let of = |mtl: &str| material_of(mtl, [9; 4]).0;
    assert_eq!(of("Kd 0 0 0\nmap_Kd a.png").kd, Vec3::ONE);
    assert_eq!(of("Ke 0 0 0\nmap_Ke a.png").ke, Vec3::ONE);
    assert_eq!(of("Kd 0.5 0 0\nmap_Kd a.png").kd, Vec3::new(0.5, 0.0, 0.0));
    assert_eq!(of("Kd 0 0 0\nmap_Kd none.png").kd, Vec3::ZERO);
    // Many programs write a map of the highlight beside a black `Ks` for surfaces without a highlight.
    assert_eq!(of("Ks 0 0 0\nmap_Ks a.png").ks, Vec3::ZERO);
}

#[test]
fn glass_has_no_diffuse_colour_but_a_tint() {
    let of = |mtl: &str| {
        let found = material_of(mtl, [9; 4]).0;
        (found.kd, found.ka, found.tf)
    };
    let tint = Vec3::new(0.5, 1.0, 0.2);
    assert_eq!(of("illum 7\nKd 1 1 1\nKa 0.2 0.2 0.2"), (Vec3::ZERO, Vec3::ZERO, Vec3::ONE));
    let (kd, ka, tf) = of("illum 6\nKd 0.25 1 0.04\nTf 1 1 1\nd 0.5");
    assert!(kd == Vec3::ZERO && ka == Vec3::ZERO && tf.abs_diff_eq(tint, 1e-6), "{tf}");
    // A stated filter counts, and glass without a diffuse colour stays clear.
    assert_eq!(of("illum 7\nKd 0.25 1 0.04\nTf 0.9 1 1").2, Vec3::new(0.9, 1.0, 1.0));
    assert_eq!(of("illum 7").2, Vec3::ONE);
    assert_eq!(of("illum 7\nKd 0 0 0").2, Vec3::ONE);
    // The image would be lost. Microfacets have a tint already.
    assert_eq!(of("illum 7\nKd 0.5\nmap_Kd a.png").0, Vec3::splat(0.5));
    assert_eq!(of("illum 7\nKd 0.5\nPr 0").0, Vec3::splat(0.5));
    assert_eq!(of("illum 2\nKd 0.5\nd 0.5").0, Vec3::splat(0.5));
}

#[test]
fn wrong_statements_of_mtl_files_are_left_out() {
    let (found, warnings) = material_of("Kd 0.1 0.2\nNs -5\nd 1.5\nillum 2.0\nPr nan\nKe 0.5", [9; 4]);
    assert_eq!((found.kd, found.ns, found.d, found.ke), (Vec3::splat(0.8), 32.0, 1.0, Vec3::splat(0.5)));
    assert!(found.lobes.highlight && found.microfacet.is_none());
    let places = ["m.mtl:2: Kd has 2 numbers", "m.mtl:3: Ns = -5 is outside", "m.mtl:4: d = 1.5", "m.mtl:6: Pr `nan`"];
    assert_eq!(warnings.len(), places.len(), "{warnings:?}");
    for (warning, place) in warnings.iter().zip(places) {
        assert!(warning.contains(place) && warning.contains("the statement is left out"), "{warning}");
    }
}

#[test]
fn libraries_of_other_machines_and_names_before_comments_are_found() {
    let of = |mtllib: &str, usemtl: &str| {
        let obj = format!("mtllib {mtllib}\nusemtl {usemtl}\n{TRIANGLE}f 1 2 3\n");
        let mtl = b"newmtl red\nKd 1 0 0\nnewmtl red #2\nKd 0 1 0\n";
        let files = [("m.obj", obj.as_bytes()), ("my part.mtl", &mtl[..]), ("part.mtl", mtl)];
        let (scene, warnings) = loaded(&files);
        let mesh = &scene.meshes[0];
        (scene.materials[mesh.slots[0] as usize].kd, warnings)
    };
    let (red, green) = (Vec3::X, Vec3::Y);
    let of_others = ["C:\\work\\part.mtl", "/home/me/my part.mtl", "../mats/part.mtl part.mtl"];
    let with_comments = ["part.mtl # colours", "part.mtl\t# colours", "none.mtl part.mtl", "none.mtl ../mats/part.mtl"];
    let names = [("red", red), ("red # of paint", red), ("red #2", green), ("red #2 # so", green)];
    let names = names.into_iter().chain([("red # once #3", red), ("red\t# so", red)]);
    for mtllib in ["part.mtl"].into_iter().chain(of_others).chain(with_comments) {
        for (usemtl, colour) in names.clone() {
            let (kd, warnings) = of(mtllib, usemtl);
            assert_eq!(kd, colour, "{mtllib}, {usemtl}: {warnings:?}");
            assert_eq!(warnings.len(), usize::from(mtllib.starts_with("none")), "{warnings:?}");
        }
    }
}

#[test]
fn a_library_of_the_files_own_name_is_taken_where_none_else_is() {
    let mtl = &b"newmtl red\nKd 1 0 0\n"[..];
    let other = &b"newmtl red\nKd 0 1 0\n"[..];
    let of = |statement: &str| {
        let obj = format!("{statement}\n{TRIANGLE}f 1 2 3\n");
        let (scene, warnings) = loaded(&[("m.obj", obj.as_bytes()), ("m.mtl", mtl), ("other.mtl", other)]);
        (scene.materials[scene.meshes[0].slots[0] as usize].kd, warnings.join("\n"))
    };
    let own = "m.mtl, which it does not name";
    let (kd, told) = of("usemtl red");
    assert!(kd == Vec3::X && told.contains(own), "{told}");
    let (kd, told) = of("mtllib none.mtl\nusemtl red");
    assert!(kd == Vec3::X && told.contains("none.mtl does not exist") && told.contains(own), "{told}");
    assert_eq!(of("mtllib other.mtl\nusemtl red"), (Vec3::Y, String::new()));
    assert_eq!(of(""), (Vec3::splat(0.8), String::new()), "no face names a material");
}

#[test]
fn colours_of_a_file_are_albedos() {
    let coloured = "v 0 0 0 1 0.5 0\nv 1 0 0 1 0.5 0\nv 0 1 0 1 0.5 0\nf 1 2 3\n";
    let kd = |files: &[(&str, &[u8])]| {
        let scene = loaded(files).0;
        scene.materials[scene.instances[0].materials[scene.meshes[0].slots[0] as usize] as usize].kd
    };
    let plain = format!("{TRIANGLE}f 1 2 3\n");
    assert_eq!(kd(&[("m.obj", coloured.as_bytes())]), Vec3::ONE);
    assert_eq!(kd(&[("m.obj", plain.as_bytes())]), Vec3::splat(0.8));
    for (file, expected) in [("c.obj", Vec3::ONE), ("p.obj", Vec3::splat(0.8))] {
        let toml = format!("[[mesh]]\nfile = '{file}'\n");
        let files = [("s.toml", toml.as_bytes()), ("c.obj", coloured.as_bytes()), ("p.obj", plain.as_bytes())];
        assert_eq!(kd(&files), expected, "{file}");
    }
}

#[test]
fn a_concave_polygon_that_is_too_large_is_told() {
    let n = 20_000;
    let of = |is_star: bool| {
        let point = |ix: usize| {
            let angle = ix as f64 / n as f64 * std::f64::consts::TAU;
            let radius = if is_star && ix.is_multiple_of(2) { 50.0 } else { 100.0 };
            format!("v {} {} 0\n", radius * angle.cos(), radius * angle.sin())
        };
        let face: String = (1..=n).map(|ix| format!(" {ix}")).collect();
        let obj = (0..n).map(point).collect::<String>() + "f" + &face + "\n";
        mesh_of("m.obj", &obj).1.join("\n")
    };
    assert!(of(true).contains("a concave polygon of 20000 corners"));
    assert_eq!(of(false), "");
}

#[test]
fn names_may_be_in_an_old_encoding() {
    // \xfc is u with two dots in Windows-1252.
    let obj = [b"mtllib K\xfcche.mtl\nusemtl gr\xfcn\n", TRIANGLE.as_bytes(), b"f 1 2 3\n"].concat();
    let (scene, warnings) = loaded(&[("m.obj", &obj), ("Küche.mtl", b"newmtl gr\xfcn\nKd 0.25 0.5 0.25\n")]);
    assert_eq!(warnings, Vec::<String>::new());
    assert_eq!((scene.materials[0].name.as_str(), scene.materials[0].kd.y), ("grün", 0.5));
    // What is UTF-8 stays so, and 0x80 to 0x9f are not control characters.
    let obj = ["mtllib a.mtl\nusemtl é\n".as_bytes(), b"# \x96\n", TRIANGLE.as_bytes(), b"f 1 2 3\n"].concat();
    let (scene, _) = loaded(&[("m.obj", &obj), ("a.mtl", "newmtl é\n".as_bytes())]);
    assert_eq!(scene.materials[0].name, "é");
    let (scene, _) = loaded(&[
        ("m.obj", &[b"usemtl \x80\nmtllib a.mtl\n", TRIANGLE.as_bytes(), b"f 1 2 3"].concat()),
        ("a.mtl", "newmtl €\n".as_bytes()),
    ]);
    assert_eq!(scene.materials[0].name, "€");
}

#[test]
fn names_in_gltf_files_may_differ_in_case() {
    for (uri, n_warnings) in
        [("maps/a.png", 0), ("Maps/A.PNG", 1), ("Maps%5CA.PNG", 1), ("maps%5Ca.png", 0), ("maps/b.png", 1)]
    {
        let gltf = json!({
            "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
            "images": [{ "uri": uri }], "textures": [{ "source": 0 }],
            "materials": [{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "material": 0 }] }],
            "buffers": [{ "uri": "Data.bin", "byteLength": 36 }],
            "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
            "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                "min": [0, 0, 0], "max": [1, 1, 0] }],
        });
        let data: Vec<u8> = [0, 0, 0, 1, 0, 0, 0, 1, 0].iter().flat_map(|x| (*x as f32).to_le_bytes()).collect();
        let text = gltf.to_string();
        let files = [("m.gltf", text.as_bytes()), ("Data.bin", &data), ("maps/a.png", &png(|_, _| [9; 4]))];
        let (scene, warnings) = loaded(&files);
        assert_eq!(scene.images.len(), usize::from(uri != "maps/b.png"), "{uri}");
        assert_eq!(warnings.len(), n_warnings, "{uri}: {warnings:?}");
    }
}

#[test]
fn specular_and_glossiness_are_read() {
    let of = |extension: serde_json::Value, pixel: [u8; 4]| {
        let gltf = json!({
            "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
            "extensionsRequired": ["KHR_materials_pbrSpecularGlossiness"],
            "images": [{ "uri": "a.png" }], "textures": [{ "source": 0 }],
            "materials": [{ "extensions": { "KHR_materials_pbrSpecularGlossiness": extension } }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "material": 0 }] }],
            "buffers": [{ "uri": "data.bin", "byteLength": 36 }],
            "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
            "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                "min": [0, 0, 0], "max": [1, 1, 0] }],
        });
        let data: Vec<u8> = [0, 0, 0, 1, 0, 0, 0, 1, 0].iter().flat_map(|x| (*x as f32).to_le_bytes()).collect();
        let text = gltf.to_string();
        let (scene, warnings) =
            loaded(&[("m.gltf", text.as_bytes()), ("data.bin", &data), ("a.png", &png(|_, _| pixel))]);
        assert_eq!(warnings, Vec::<String>::new());
        scene
    };
    let factors = json!({ "diffuseFactor": [0.1, 0.2, 0.3, 0.4], "specularFactor": [0.5, 0.04, 1],
        "glossinessFactor": 0.75 });
    let scene = of(factors, [0; 4]);
    let (found, terms) = (&scene.materials[0], scene.materials[0].microfacet.unwrap());
    assert_eq!((found.kd, found.d, found.ni), (Vec3::new(0.1, 0.2, 0.3), 0.4, 1.5));
    // Times 0.04, which the index 1.5 stands for, this is the reflectance that the file states.
    assert!(found.ks.abs_diff_eq(Vec3::new(12.5, 1.0, 25.0), 1e-5), "{}", found.ks);
    assert_eq!((terms.metallic, terms.roughness), (0.0, 0.25));
    let mirror = of(json!({ "diffuseFactor": [0, 0, 0, 1] }), [0; 4]);
    assert!(mirror.studio.is_some(), "it reflects all light");
    let textured = json!({ "diffuseTexture": { "index": 0 }, "glossinessFactor": 0.5,
        "specularGlossinessTexture": { "index": 0 } });
    let scene = of(textured, [10, 20, 30, 102]);
    let maps = &scene.materials[0].maps;
    assert_eq!((&maps.base_colour, &maps.specular), (&Some(Texture::of_image(0)), &Some(Texture::of_image(0))));
    let rough = maps.roughness.as_ref().unwrap();
    let Pixels::Bytes(pixels) = &scene.images[rough.image_ix as usize].pixels else { panic!("bytes") };
    assert_eq!((pixels[0], scene.materials[0].microfacet.unwrap().roughness), ([204, 204, 204, 255], 1.0));
}

#[test]
fn broken_numbers_of_obj_files_cost_the_faces_that_name_them() {
    let (plain, _) = mesh_of("m.obj", &format!("{TRIANGLE}f 1 2 3\n"));
    for broken in ["nan nan nan", "0 -nan(ind) 0", "-1.#IND 0 0", "1.#QNAN 0 0", "0 0 inf"] {
        let (mesh, warnings) = mesh_of("m.obj", &format!("{TRIANGLE}v {broken}\nf 1 2 3\nf 1 2 4\nf 1 2 -1\n"));
        assert_eq!(mesh.faces, plain.faces, "{broken}");
        let [warning] = &warnings[..] else { panic!("{broken}: {warnings:?}") };
        assert!(warning.contains("m.obj:6: vertex 4 is not finite; such faces are left out"), "{warning}");
        let (unused, warnings) = mesh_of("m.obj", &format!("{TRIANGLE}v {broken}\nf 1 2 3\n"));
        assert_eq!((unused.faces.len(), warnings.len()), (1, 0), "{broken}");
        let far = "v 6000000.125 0 0\nv 6000001.125 0 0\nv 6000000.125 1 0\n";
        let (far, _) = mesh_of("m.obj", &format!("{far}v {broken}\nf 1 2 3\n"));
        assert_eq!(far.faces.len(), 1, "{broken}");
        for element in ["vn", "vt"] {
            let corner = if element == "vn" { "//" } else { "/" };
            let face = format!("f 1{corner}1 2{corner}1 3{corner}1\n");
            let (mesh, _) = mesh_of("m.obj", &format!("{TRIANGLE}{element} {broken}\n{face}"));
            assert_eq!((mesh.normals.clone(), mesh.uvs[0].len()), (plain.normals.clone(), 0), "{element} {broken}");
        }
    }
    // A comment may have such words.
    assert_eq!(mesh_of("m.obj", &format!("{TRIANGLE}v 1 1 0 # nan inf\nf 1 2 4\n")).0.faces.len(), 1);
}

#[test]
fn broken_numbers_of_ply_and_stl_files_cost_their_faces() {
    let ply = |format: &str, rows: &[u8]| {
        let head = format!(
            "ply\nformat {format} 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
             element face 2\nproperty list uchar int vertex_indices\nend_header\n"
        );
        loaded(&[("m.ply", &[head.as_bytes(), rows].concat())])
    };
    let word = |x: f32| x.to_le_bytes();
    let points = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, f32::NAN, 0.0, 0.0].map(word).concat();
    let face = |last: u32| [&[3][..], &[0, 1, last].map(u32::to_le_bytes).concat()].concat();
    let binary = |faces: [u32; 2]| [points.clone(), face(faces[0]), face(faces[1])].concat();
    for (scene, warnings) in [
        ply("ascii", b"0 0 0\n1 0 0\n0 1 0\nnan 0 0\n3 0 1 2\n3 0 1 3\n"),
        ply("binary_little_endian", &binary([3, 2])),
    ] {
        let mesh = &scene.meshes[0];
        assert_eq!(mesh.faces, [[0, 1, 2]]);
        assert!(mesh.positions.iter().all(|p| p.is_finite()) && mesh.normals[0][0].is_finite());
        assert!(warnings.len() == 1 && warnings[0].contains("1 faces are left out"), "{warnings:?}");
    }
    // A point that no face names is no trouble.
    let (scene, warnings) = ply("binary_little_endian", &binary([2, 2]));
    assert_eq!((scene.meshes[0].faces.len(), warnings), (2, vec![]));
    let facet = |x: &str| {
        format!("facet normal 0 0 1\nouter loop\nvertex {x} 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n")
    };
    let text = format!("solid a\n{}{}{}endsolid a\n", facet("0"), facet("-NaN"), facet("0.5"));
    assert_eq!(loaded(&[("m.stl", text.as_bytes())]).0.meshes[0].faces.len(), 2);
    let facet = |x: f32| {
        let numbers = [0.0, 0.0, 1.0, x, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        [numbers.map(word).as_flattened(), &[0, 0]].concat()
    };
    let facets = [facet(0.0), facet(f32::INFINITY), facet(f32::NAN)].concat();
    let bytes = [&[b' '; 80][..], &3_u32.to_le_bytes(), &facets].concat();
    assert_eq!(loaded(&[("m.stl", &bytes)]).0.meshes[0].faces.len(), 1);
}

#[test]
fn faces_of_two_corners_and_names_that_are_missing_are_passed_over() {
    let (scene, warnings) = loaded(&[
        ("m.obj", format!("mtllib\nmtllib m.mtl\n{TRIANGLE}usemtl m\nf 1 2\nf 1 2 3\nusemtl\nf 3 2 1\n").as_bytes()),
        ("m.mtl", b"newmtl\nKd 1\nnewmtl m\nKd 0.5\n"),
    ]);
    let kd =
        |face: usize| scene.materials[scene.instances[0].materials[scene.meshes[0].slots[face] as usize] as usize].kd.x;
    assert_eq!((scene.meshes[0].faces.len(), kd(0), kd(1)), (2, 0.5, 0.8));
    assert!(warnings.len() == 1 && warnings[0].contains("m.obj:7: a face of 2 corners"), "{warnings:?}");
}

#[test]
fn texts_of_ply_files_are_read_in_double_precision() {
    let rows = "5000000.125 0 0\n5000001.125 0 0\n5000000.125 1 0\n3 0 1 2\n";
    let text = format!(
        "ply\r\nformat ascii 1.0\r\nelement vertex 3\r\nproperty float x\r\nproperty float32 y\r\nproperty float z\r\n\
         element face 1\r\nproperty list uchar int vertex_indices\r\nend_header\r\n{rows}"
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.ply");
    std::fs::write(&path, text).unwrap();
    let options = kdray::scene::LoadOptions { recentre: true, ..Default::default() };
    let scene = Scene::load_with(&path, &options).unwrap();
    let x = |ix: usize| scene.origin.x + f64::from(scene.meshes[0].positions[ix].x);
    assert_eq!([x(0), x(1)], [5_000_000.125, 5_000_001.125]);
}

#[test]
fn colours_of_ply_files_that_are_wholly_transparent_are_opaque() {
    let file = |alphas: [u8; 3]| {
        let row = |(at, alpha): (&str, u8)| format!("{at} 255 255 255 {alpha}\n");
        let rows: String = ["0 0 0", "1 0 0", "0 1 0"].into_iter().zip(alphas).map(row).collect();
        let colour = ["red", "green", "blue", "alpha"].map(|name| format!("property uchar {name}\n")).concat();
        let text = format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n{colour}\
             element face 1\nproperty list uchar int vertex_indices\nend_header\n{rows}3 0 1 2\n"
        );
        let (scene, warnings) = loaded(&[("m.ply", text.as_bytes())]);
        (scene.meshes[0].colours[0], warnings.len())
    };
    assert_eq!(file([0; 3]), ([Vec4::ONE; 3], 1));
    assert_eq!(file([0, 0, 51]), ([Vec3::ONE.extend(0.0), Vec3::ONE.extend(0.0), Vec3::ONE.extend(0.2)], 0));
}

#[test]
fn colours_of_zbrush_are_read() {
    let (mesh, _) = mesh_of("m.obj", &format!("{TRIANGLE}#MRGB ffff0000ff00ff00ff0000ff\nf 1 2 3\n"));
    assert_eq!(mesh.colours, [[Vec3::X.extend(1.0), Vec3::Y.extend(1.0), Vec3::Z.extend(1.0)]]);
}

/// A face that is there once for each side is seen from each side, so its two triangles may not lie in one plane.
#[test]
fn faces_with_a_material_for_each_side_are_moved_apart() {
    let square = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\n";
    let heights = |faces: &str| {
        let obj = format!("mtllib m.mtl\n{square}{faces}");
        let (scene, _) = loaded(&[("m.obj", obj.as_bytes()), ("m.mtl", b"newmtl a\nnewmtl b\n")]);
        let mesh = &scene.meshes[0];
        mesh.faces.iter().map(|face| face.map(|ix| mesh.positions[ix as usize].z)).collect::<Vec<_>>()
    };
    let moved = heights("usemtl a\nf 1 2 3 4\nusemtl b\nf 4 3 2 1\n");
    assert_eq!(moved.len(), 4);
    assert!(moved[..2].as_flattened().iter().all(|z| (1e-6..1e-5).contains(z)), "{moved:?}");
    assert!(moved[2..].as_flattened().iter().all(|z| (1e-6..1e-5).contains(&-z)), "{moved:?}");
    for faces in [
        "usemtl a\nf 1 2 3 4\nf 4 3 2 1\n",
        "usemtl a\nf 1 2 3 4\nusemtl b\nf 2 3 4 1\n",
        "usemtl a\nf 1 2 3\nusemtl b\nf 4 3 1\n",
    ] {
        assert!(heights(faces).as_flattened().iter().all(|z| *z == 0.0), "{faces}");
    }
}

#[test]
fn metals_by_their_maps_are_mirrored_in_a_studio() {
    let of = |mtl: &str, pixel: [u8; 4]| {
        let obj = format!("mtllib m.mtl\nusemtl m\n{TRIANGLE}v 0 0 1\n{UVS}f 1/1 2/2 3/3\nf 1/1 2/2 4/3\n");
        let mtl = format!("newmtl m\n{mtl}\n");
        let image = png(|x, _| if x == 0 { [0; 4] } else { pixel });
        loaded(&[("m.obj", obj.as_bytes()), ("m.mtl", mtl.as_bytes()), ("a.png", &image)]).0.studio.is_some()
    };
    assert!(of("Pr 0.2\nmap_Pm a.png", [255; 4]));
    assert!(!of("Pr 0.2\nmap_Pm a.png", [40, 40, 40, 255]), "it is no metal");
    assert!(!of("Pm 1\nPr 0.9", [255; 4]), "it is rough");
    assert!(of("Pm 1\nPr 1\nmap_Pr a.png", [90, 90, 90, 255]), "it is smooth by the map");
    assert!(!of("Pm 0.4\nPr 0.1\nmap_Pm a.png", [255; 4]));
}

/// A box of edge 10 with a small bright square before it.
#[test]
fn small_lights_on_a_thing_do_not_light_it() {
    let of = |ke: &str, edge: f32| {
        let walls = "v 0 0 0\nv 10 0 0\nv 10 10 0\nv 0 10 0\nusemtl wall\nf 1 2 3 4\n";
        let lamp = format!("v 0 0 5\nv {edge} 0 5\nv {edge} {edge} 5\nv 0 {edge} 5\nusemtl lamp\nf 5 6 7 8\n");
        let mtl = format!("newmtl wall\nnewmtl lamp\nKd 0\nKe {ke}\n");
        let obj = format!("mtllib m.mtl\n{walls}{lamp}");
        let scene = loaded(&[("m.obj", obj.as_bytes()), ("m.mtl", mtl.as_bytes())]).0;
        (scene.lights.len(), scene.defaults.is_metered)
    };
    // A hundredth of the area times 5 is less than a tenth of white, times 50 it is more.
    assert_eq!(of("5 0 0", 1.0), (2, false));
    assert_eq!(of("50 0 0", 1.0), (0, true));
    assert_eq!(of("1 1 1", 10.0), (2, false), "no brighter than paper");
}

#[test]
fn files_that_are_no_scenes_are_called_by_their_names() {
    for (name, content, what) in [
        ("a.obj", &b""[..], "is empty"),
        ("a.glb", b"", "is empty"),
        ("a.obj", b"version https://git-lfs.github.com/spec/v1\noid", "git lfs pull"),
        ("a.stl", b"PK\x03\x04", "ZIP"),
        ("a.ply", b"<!DOCTYPE html>", "web page"),
        ("a.fbx", b"Kaydara FBX Binary  \0", "FBX"),
        ("a.xyz", b"1 2 3", "a cloud of points"),
        ("a.what", b"1 2 3", "ends in none of"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nl 1 2\n", "has 2 points but no triangles"),
        ("a.obj", b"v 0,5 0 0\n", "need a point in place of the comma"),
        ("a.gltf", br#"{ "asset": { "version": "1.0" }, "scenes": {} }"#, "this is glTF 1.0"),
        (
            "a.ply",
            b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
          end_header\n0 0 0\n",
            "a cloud of 1 points",
        ),
    ] {
        let error = load_scene(&[(name, content)]).0.unwrap_err().to_string();
        assert!(error.contains(what) && error.lines().count() == 1, "{name}: {error}");
    }
}
