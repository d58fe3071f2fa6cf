//! Tests of OBJ and MTL files as exporters and people write them.

use std::fmt::Write;

use glam::{Vec2, Vec3};
use kdray::{
    layout::{
        FLAT_NORMAL, MATERIAL_FRESNEL, MATERIAL_REFLECT, MATERIAL_REFRACT, MATERIAL_SPECULAR, normal::decode_octahedral,
    },
    scene::{Lobes, Material},
    world::FlatScene,
};

use super::{facet_normal, load, materials::load_scene};

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
/// The unit cube's corners and its quads.
const CUBE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n\
    f 1 5 7 3\nf 6 2 4 8\nf 1 2 6 5\nf 7 8 4 3\nf 2 1 3 4\nf 5 6 8 7\n";

fn load_obj(text: &str) -> FlatScene {
    load(&[("mesh.obj", text.as_bytes())]).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn load_with(toml: &str, obj: &str) -> FlatScene {
    load(&[("scene.toml", toml.as_bytes()), ("mesh.obj", obj.as_bytes())]).unwrap_or_else(|e| panic!("{e}"))
}

fn load_mtl(mtl: &str) -> FlatScene {
    let obj = format!("mtllib a b.mtl\n{TRIANGLE}usemtl my own\nf 1 2 3\n");
    load(&[("mesh.obj", obj.as_bytes()), ("a b.mtl", mtl.as_bytes())]).unwrap_or_else(|e| panic!("{e}"))
}

/// Returns the encoded normals of all corners.
fn normals(scene: &FlatScene) -> Vec<u32> {
    scene.triangles.iter().flat_map(|t| [t.n0, t.n1, t.n2]).collect()
}

/// Returns the OBJ text of a sphere of radius 1 without normals, in which each triangle has its own points.
fn triangle_soup_sphere() -> String {
    let scene = load(&[("s.toml", b"mesh = [{ generator = 'geodesic', radius = 1, frequency = 8 }]")]).unwrap();
    let mut obj = String::new();
    for (ix, t) in scene.triangles.iter().enumerate() {
        for v in [t.v0, t.v1, t.v2] {
            writeln!(obj, "v {} {} {}", v.x, v.y, v.z).unwrap();
        }
        writeln!(obj, "f {} {} {}", 3 * ix + 1, 3 * ix + 2, 3 * ix + 3).unwrap();
    }
    obj
}

#[test]
fn files_without_normals_are_smooth_up_to_the_crease() {
    assert!(normals(&load_obj(CUBE)).iter().all(|n| *n == FLAT_NORMAL));
    let scene = load_obj(&triangle_soup_sphere());
    assert_eq!(scene.triangles.len(), 1280);
    for t in &scene.triangles {
        for (corner, normal) in [(t.v0, t.n0), (t.v1, t.n1), (t.v2, t.n2)] {
            assert_ne!(normal, FLAT_NORMAL);
            assert!(decode_octahedral(normal).angle_between(corner) < 0.02);
        }
    }
    let round = load_with("mesh = [{ file = 'mesh.obj', crease = 100 }]", CUBE);
    let expected = Vec3::new(-1.0, -1.0, -1.0).normalize();
    // Since normals are weighted by angle, the diagonals of the quads do not pull a corner's normal to one side.
    assert!(decode_octahedral(round.triangles[0].n0).distance(expected) < 1e-3);
}

#[test]
fn flat_is_flat() {
    let sphere = triangle_soup_sphere();
    assert!(
        normals(&load_with("mesh = [{ file = 'mesh.obj', smooth = false }]", &sphere))
            .iter()
            .all(|n| *n == FLAT_NORMAL)
    );
    for off in ["s off\n", "s 0\n"] {
        assert!(normals(&load_obj(&[off, &sphere].concat())).iter().all(|n| *n == FLAT_NORMAL));
    }
    assert!(normals(&load_obj(&["s 1\n", &sphere].concat())).iter().all(|n| *n != FLAT_NORMAL));
    let generator = "mesh = [{ generator = 'geodesic', radius = 1, frequency = 2, smooth = false }]";
    assert!(normals(&load_with(generator, "")).iter().all(|n| *n == FLAT_NORMAL));
}

#[test]
fn a_fans_hub_takes_no_quadratic_time() {
    let n = 200_000;
    let mut obj = "v 0 0.1 0\n".to_owned();
    for ix in 0..n {
        let (sin, cos) = (ix as f64 / n as f64 * std::f64::consts::TAU).sin_cos();
        writeln!(obj, "v {sin} 0 {cos}\nf 1 {} {}", ix + 2, (ix + 1) % n + 2).unwrap();
    }
    let scene = load_obj(&obj);
    assert!(decode_octahedral(scene.triangles[17].n0).distance(Vec3::Y) < 1e-3);
}

#[test]
fn a_files_own_normals_count() {
    // The second face lacks a normal at one corner, so it counts as a face without normals. A zero normal is none
    // either.
    let obj = format!("{TRIANGLE}v 1 1 0\nvn 0 3 4\nvn 0 0 0\nf 1//1 2//1 3//2\nf 2//1 4 3//1\n");
    let scene = load_obj(&obj);
    let [first, second] = scene.triangles[..] else { panic!("two triangles") };
    assert!(decode_octahedral(first.n0).distance(Vec3::new(0.0, 0.6, 0.8)) < 1e-4);
    assert_eq!([first.n2, second.n0, second.n1, second.n2], [FLAT_NORMAL; 4]);
}

#[test]
fn the_format_is_read_as_people_write_it() {
    let plain = load_obj(&format!("{TRIANGLE}f 1 2 3\n"));
    let latin1 = [b"# caf\xe9\n".as_slice(), TRIANGLE.as_bytes(), b"f 1 2 3"].concat();
    assert_eq!(load(&[("mesh.obj", &latin1)]).unwrap(), plain);
    let same = [
        format!("\u{feff}{TRIANGLE}f 1 2 3\n"),
        format!("{TRIANGLE}f -3 -2 -1 # the lot"),
        format!("{TRIANGLE}f 1 2 3\n").replace('\n', "\r\n"),
        format!("f 1 2 3\n{TRIANGLE}"),
        format!("{TRIANGLE}f 1 \\\n 2 \\\n 3\n"),
        format!("o x\ng y z\n{TRIANGLE}vt 0 0\nf 1/1 2/1 3/1\nl 1 2\np 1\nl 7\n"),
        "v 0 0 0 1\nv 1 0 0 0.5 0.5 0.5\nv\t0\t1 0\nvp 1\nf\t1 2\t3\nfoo bar\n".to_owned(),
    ];
    for text in same {
        // Colours of vertices, and the white beneath them, are all that the plain file lacks.
        let (textures, materials) = (plain.textures.clone(), plain.materials.clone());
        let found = FlatScene { textures, materials, ..load_obj(&text) };
        assert_eq!(found, plain, "{text}");
    }
    let pentagon = load_obj("v 0 0 0\nv 2 0 0\nv 3 2 0\nv 1 3 0\nv -1 2 0\nf 1 2 3 4 5\n");
    assert_eq!(pentagon.triangles.len(), 3);
    assert!(pentagon.triangles.iter().all(|t| facet_normal(t).z > 0.0));
}

#[test]
fn mtl_terms_become_the_kernels() {
    let mtl = "# c\nKd 1\nnewmtl other\nnewmtl my own\nKa 0.5\nKd 0.1 0.2 0.3 # rgb\n Ks 1 1 1\nKe 2 0 0\nNs 10\n\
        Ni 1.3\nTr 0.4\nTf 0.7 0.8 0.9\nillum 7\nmap_Kd x.png\nsharpness 60\n";
    let scene = load_mtl(mtl);
    assert_eq!(scene.material_names, ["other", "my own", "(default)"]);
    let all = MATERIAL_SPECULAR | MATERIAL_REFLECT | MATERIAL_REFRACT | MATERIAL_FRESNEL;
    let m = scene.materials[scene.triangle_materials[0] as usize];
    assert_eq!((m.ka, m.kd, m.ke), (Vec3::splat(0.5), Vec3::new(0.1, 0.2, 0.3), Vec3::new(2.0, 0.0, 0.0)));
    assert_eq!((m.ns, m.ni, m.d, m.tf, m.flags), (10.0, 1.3, 0.6, Vec3::new(0.7, 0.8, 0.9), all));
    // If a file has both d and Tr, d counts.
    assert_eq!(load_mtl("newmtl my own\nTr 1\nd -halo 0.5\n").materials[0].d, 0.5);
}

/// Loads a triangle with a material of an MTL file. Returns the material and the warnings.
fn material_of(mtl: &str) -> (Material, Vec<String>) {
    let obj = format!("mtllib a.mtl\n{TRIANGLE}usemtl m\nf 1 2 3\n");
    let mtl = format!("newmtl m\n{mtl}\n");
    let (scene, warnings) = load_scene(&[("m.obj", obj.as_bytes()), ("a.mtl", mtl.as_bytes())]);
    (scene.unwrap_or_else(|e| panic!("{e}\n{mtl}")).materials.remove(0), warnings)
}

#[test]
fn the_ambient_colours_that_exporters_write_for_everything_are_those_of_kd() {
    let kd = Vec3::new(0.1, 0.2, 0.3);
    for (ka, expected) in [("0 0 0", kd), ("1 1 1", kd), ("0", kd), ("0.1 0 0", Vec3::new(0.1, 0.0, 0.0))] {
        let (material, warnings) = material_of(&format!("Ka {ka}\nKd 0.1 0.2 0.3"));
        assert_eq!((material.ka, warnings), (expected, vec![]), "{ka}");
    }
}

#[test]
fn surfaces_that_opacity_would_hide_whole_are_shown() {
    for hidden in ["d 0", "Tr 1", "d 0\nTr 1", "d 0.0\nTr 0"] {
        let (material, warnings) = material_of(hidden);
        assert_eq!(material.d, 1.0, "{hidden}");
        let [warning] = &warnings[..] else { panic!("{hidden}: {warnings:?}") };
        assert!(warning.contains("material `m` would be invisible"), "{warning}");
    }
    for (shown, d) in [("d 1\nTr 1", 1.0), ("d 0.01", 0.01), ("Tr 0.75", 0.25)] {
        let (material, warnings) = material_of(shown);
        assert_eq!((material.d, warnings), (d, vec![]), "{shown}");
    }
    // One warning counts all materials of a file.
    let (_, warnings) = material_of("d 0\nnewmtl n\nd 0\nnewmtl o\nTr 1");
    assert_eq!(warnings.len(), 1);
    assert!(warnings[0].contains("`m` and 2 more"), "{warnings:?}");
}

#[test]
fn illum_alone_makes_no_glass() {
    for illum in [4, 6, 9] {
        for rest in ["", "Ni 1", "Tf 1 1 1\nNi 1.00", "d 1", "Tr 0", "Ni 0"] {
            let (material, warnings) = material_of(&format!("illum {illum}\n{rest}\nKs 0.5 0.5 0.5"));
            let highlight = Lobes { highlight: true, ..Lobes::default() };
            assert_eq!(material.lobes, highlight, "illum {illum}, {rest}");
            let [warning] = &warnings[..] else { panic!("illum {illum}, {rest}: {warnings:?}") };
            assert!(warning.contains("would be glass"), "{warning}");
        }
        assert_eq!(material_of(&format!("illum {illum}")).0.lobes, Lobes::default(), "illum {illum}");
        for rest in ["Ni 1.5", "Tf 0.9 1 1", "d 0.5", "Tr 0.5", "d 0"] {
            let (material, warnings) = material_of(&format!("illum {illum}\n{rest}"));
            assert!(material.lobes.refraction, "illum {illum}, {rest}");
            assert_eq!(warnings.len(), usize::from(rest == "d 0"), "illum {illum}, {rest}: {warnings:?}");
        }
    }
    assert!(material_of("illum 7").0.lobes.refraction);
}

#[test]
fn faces_without_the_normals_that_they_name_have_computed_ones() {
    let plain = load_obj(&format!("{TRIANGLE}vn 0 0 1\nf 1 2 3\n"));
    for face in
        ["f 1//1 2//1 3//2", "f 1//0 2//1 3//1", "f 1//-2 2//1 3//1", "f 1/1 2/1 3/1", "f 1//6148914691236517206 2 3"]
    {
        let (scene, warnings) = load_scene(&[("m.obj", format!("{TRIANGLE}vn 0 0 1\n{face}\n").as_bytes())]);
        assert_eq!(FlatScene::new(&scene.unwrap()).unwrap().triangles, plain.triangles, "{face}");
        let [warning] = &warnings[..] else { panic!("{face}: {warnings:?}") };
        assert!(warning.contains("m.obj:5: ") && warning.contains("out of range: there are"), "{warning}");
    }
    // The first of several is named.
    let obj = format!("{TRIANGLE}f 1//1 2//1 3//1\nf 3/7 2/7 1/7\n");
    let (scene, warnings) = load_scene(&[("m.obj", obj.as_bytes())]);
    assert_eq!(scene.unwrap().n_triangles(), 2);
    assert!(warnings.len() == 1 && warnings[0].contains("m.obj:4: normal 1 "), "{warnings:?}");
}

#[test]
fn what_no_library_defines_is_the_default() {
    for obj in ["mtllib no.mtl\nusemtl x\n", "usemtl x\n", ""] {
        let scene = load_obj(&format!("{obj}{TRIANGLE}f 1 2 3\n"));
        assert_eq!((scene.material_names, scene.triangle_materials), (vec!["(default)".to_owned()], vec![0].into()));
    }
    // One line names two libraries, and the faces have several materials.
    let faces = "usemtl b\nf 1 2 3\nusemtl a\nf 1 2 4\nusemtl c\nf 3 2 1\nusemtl b\nf 1 2 3";
    let obj = format!("mtllib a.mtl b.mtl\n{TRIANGLE}v 0 0 1\n{faces}");
    let files: [(&str, &[u8]); 3] =
        [("m.obj", obj.as_bytes()), ("a.mtl", b"newmtl a\n"), ("b.mtl", b"newmtl b\nd 0.5")];
    let scene = load(&files).unwrap();
    let names: Vec<&str> =
        scene.triangle_materials.iter().map(|ix| scene.material_names[*ix as usize].as_str()).collect();
    assert_eq!(names, ["b", "a", "(default)", "b"]);
}

#[test]
fn a_bare_obj_is_framed_and_lit() {
    for (scale, offset) in [(1.0, 0.0), (1e-4, 0.0), (1e5, 0.0), (3.0, 1e4)] {
        let mut obj = String::new();
        for (x, y, z) in [(0, 0, 0), (9, 0, 1), (2, 5, 0), (4, 1, 3)] {
            writeln!(obj, "v {} {} {}", x as f64 * scale + offset, y as f64 * scale, z as f64 * scale - offset)
                .unwrap();
        }
        let scene = load_obj(&format!("{obj}f 1 2 3\nf 1 3 4\n"));
        assert_eq!((scene.name.as_str(), scene.lights.len()), ("mesh", 2));
        let (min, max) = scene.bounds();
        let corners: Vec<Vec3> = scene.triangles.iter().flat_map(|t| [t.v0, t.v1, t.v2]).collect();
        let camera = scene.camera;
        let forward = (camera.target - camera.eye).normalize();
        let right = forward.cross(camera.up).normalize();
        for corner in corners {
            let to = corner - camera.eye;
            let edge = camera.height_at(to.dot(forward)) / 2.0;
            assert!(edge > 0.0, "behind the camera");
            let (x, y) = (to.dot(right).abs() / edge, to.dot(right.cross(forward)).abs() / edge);
            assert!(x < 4.0 / 3.0 && y < 1.0, "outside the picture");
        }
        // The box is not too small in the picture.
        assert!((camera.target - camera.eye).length() < 3.5 * (max - min).length());
    }
}

/// Loads an OBJ file and returns its mesh.
fn mesh(text: &str) -> kdray::scene::Mesh {
    let (scene, warnings) = load_scene(&[("m.obj", text.as_bytes())]);
    assert!(warnings.is_empty(), "{warnings:?}");
    scene.unwrap_or_else(|e| panic!("{e}\n{text}")).meshes.remove(0)
}

#[test]
fn texture_coordinates_count_from_the_upper_left_corner() {
    let points = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0.25 9\nvt 0.5\nvn 0 0 1\n";
    let mesh = mesh(&format!("{points}f 1/1 2/2 3/-1 4/1\nf 1//1 2//1 3//1\nf 1/2/1 2/2/1 3/1/1\nf 1/1 2 3/1\n"));
    let [a, b, c] = [Vec2::new(0.0, 1.0), Vec2::new(1.0, 0.75), Vec2::new(0.5, 1.0)];
    let none = [Vec2::ZERO; 3];
    // Faces without coordinates at all their corners have zeros.
    assert_eq!(mesh.uvs[0], [[a, b, c], [a, c, a], none, [b, b, a], none]);
    assert_eq!(mesh.normals[2], [Vec3::Z; 3]);
    assert!(mesh.uvs[1].is_empty() && mesh.colours.is_empty() && mesh.tangents.is_empty());
}

#[test]
fn colours_of_points_are_srgb() {
    let colour = |text: &str| {
        mesh(&format!("v 0 0 0 {text}\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")).colours.first().map(|c| [c[0], c[1]])
    };
    let white = glam::Vec4::ONE;
    // 0.5 in sRGB is ((0.5 + 0.055) / 1.055)^2.4 = 0.21404.
    let close = |found: Option<[glam::Vec4; 2]>, expected: [f32; 3]| {
        let [first, second] = found.unwrap();
        assert!((first - Vec3::from_array(expected).extend(1.0)).length() < 1e-4, "{first}");
        assert_eq!(second, white);
    };
    close(colour("0.5 0 1"), [0.21404, 0.0, 1.0]);
    close(colour("0.5 0 1 0.25"), [0.21404, 0.0, 1.0]);
    assert_eq!(colour("1"), None);
    let bytes = mesh("v 0 0 0 255 0 51\nv 1 0 0 255 255 255\nv 0 1 0 0 0 0\nf 1 2 3\n").colours[0];
    assert_eq!((bytes[1], bytes[0].x), (white, 1.0));
    assert!((bytes[0].z - 0.0331).abs() < 1e-4, "{}", bytes[0]);
    // Points without a colour are white, whatever number stands for 1, and a point that no face has decides, too.
    assert_eq!(mesh("v 0 0 0 255 0 51\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").colours[0][1], white);
    let unused = mesh("v 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0\nv 5 5 5 2 0 0\nf 1 2 3\n").colours[0];
    assert_eq!(unused[1], white);
    assert!(unused[0].x < 0.001, "{}", unused[0]);
}

#[test]
fn concave_polygons_cover_their_area_once() {
    // An L of area 3, tilted, whose first corner does not see all others.
    let obj = "v 2 0 0\nv 2 1 1\nv 1 1 1\nv 1 2 2\nv 0 2 2\nv 0 0 0\nvt 0 0\nvt 1 1\n\
               f 1/1 2/1 3/1 4/1 5/1 6/2\n";
    let scene = load_obj(obj);
    assert_eq!(scene.triangles.len(), 4);
    let area: f32 = scene.triangles.iter().map(|t| facet_normal(t).length() / 2.0).sum();
    assert!((area - 3.0 * 2f32.sqrt()).abs() < 1e-5, "{area}");
    let up = Vec3::new(0.0, -1.0, 1.0).normalize();
    assert!(scene.triangles.iter().all(|t| facet_normal(t).normalize().distance(up) < 1e-5));
    // Corners keep their coordinates: only the last one has (1, 0).
    let mesh = mesh(obj);
    for (face, uvs) in mesh.faces.iter().zip(&mesh.uvs[0]) {
        for (ix, uv) in face.iter().zip(uvs) {
            let is_last = mesh.positions[*ix as usize] == Vec3::ZERO;
            assert_eq!(*uv, if is_last { Vec2::new(1.0, 0.0) } else { Vec2::new(0.0, 1.0) });
        }
    }
}
