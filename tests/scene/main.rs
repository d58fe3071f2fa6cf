//! Tests of scenes: the shipped scenes, generators, OBJ files, and errors.

mod convert;
mod errors;
mod exporters;
mod extent;
mod far;
mod generators;
mod gltf;
mod instances;
mod keys;
mod lamps;
mod materials;
mod mesh_files;
mod near;
mod obj;
mod odd_files;
mod path;
mod placed;
mod progress;
mod replaced;
mod rooms;
mod standard;
mod strangers;
#[path = "../support/mod.rs"]
mod support;
mod udim;

use std::{fs, path::Path};

use glam::Vec3;
use kdray::{
    frame::Denoise,
    layout::{
        FLAT_NORMAL, LIGHT_DIRECTIONAL, LIGHT_POINT, MATERIAL_FRESNEL, MATERIAL_REFLECT, MATERIAL_REFRACT,
        MATERIAL_SPECULAR, Triangle,
        normal::{decode_octahedral, encode_octahedral},
    },
    scene::{Ground, Lobes, Projection, Scene, SceneError, Up},
    world::FlatScene,
};

/// Writes files to one folder, loads the first one as a scene and flattens it.
fn load(files: &[(&str, &[u8])]) -> Result<FlatScene, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in files {
        fs::write(folder.path().join(name), content).unwrap();
    }
    Scene::load(&folder.path().join(files[0].0)).map(|scene| flattened(&scene))
}

fn flattened(scene: &Scene) -> FlatScene {
    FlatScene::new(scene).expect("a loaded scene fits together")
}

/// Loads a scene file.
fn load_toml(text: &str) -> FlatScene {
    load(&[("scene.toml", text.as_bytes())]).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// Returns the facet's normal. Its length is twice the area.
fn facet_normal(t: &Triangle) -> Vec3 {
    (t.v1 - t.v0).cross(t.v2 - t.v0)
}

#[test]
fn shipped_scenes_have_the_papers_counts() {
    for (name, n_triangles) in [("cornell", 34), ("paper2", 11_141), ("paper3", 193_598), ("paper4", 872_870)] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).with_extension("toml");
        let scene = flattened(&Scene::load(&path).unwrap());
        assert_eq!((scene.name.as_str(), scene.triangles.len()), (name, n_triangles));
        assert_eq!(scene.triangle_materials.len(), n_triangles);
        assert_eq!(scene.material_names.len(), scene.materials.len());
        assert!(scene.triangle_materials.iter().all(|ix| (*ix as usize) < scene.materials.len()));
        assert!(scene.triangles.iter().all(|t| facet_normal(t).length() > 0.0), "{name}: a triangle without area");
        // Every material of the file is used, and the unnamed default is not.
        for ix in 0..scene.materials.len() as u32 {
            assert!(scene.triangle_materials.contains(&ix), "{name}: `{}` unused", scene.material_names[ix as usize]);
        }
        assert!(!scene.material_names.contains(&"(default)".to_owned()), "{name}");
    }
}

#[test]
fn octahedral_normals_survive() {
    // A Fibonacci spiral covers the sphere evenly.
    let n = 200_000;
    let spiral = (0..n).map(|ix| {
        let y = 1.0 - 2.0 * (ix as f32 + 0.5) / n as f32;
        let (sin, cos) = (ix as f32 * 2.399_963_2).sin_cos();
        Vec3::new(cos, 0.0, sin) * (1.0 - y * y).sqrt() + y * Vec3::Y
    });
    let axes = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
    for normal in spiral.chain(axes) {
        let encoded = encode_octahedral(normal);
        let decoded = decode_octahedral(encoded);
        assert!((decoded - normal).length() < 1e-4, "{normal} came back as {decoded}");
        assert!((decoded.length() - 1.0).abs() < 1e-6);
        assert!(encoded & 0xffff != 0x8000 && encoded >> 16 != 0x8000, "{normal} encodes to {encoded:x}");
    }
    // The layout is that of GLSL's packSnorm2x16.
    let known = [(Vec3::X, 0x0000_7fff), (Vec3::Y, 0x7fff_0000), (Vec3::Z, 0), (Vec3::NEG_X, 0x0000_8001)];
    for (normal, encoded) in known {
        assert_eq!(encode_octahedral(normal), encoded);
    }
    for degenerate in [Vec3::ZERO, Vec3::NAN, Vec3::INFINITY] {
        assert_ne!(encode_octahedral(degenerate), FLAT_NORMAL);
    }
}

#[test]
fn illum_maps_to_flags() {
    let (s, l, r, f) = (MATERIAL_SPECULAR, MATERIAL_REFLECT, MATERIAL_REFRACT, MATERIAL_FRESNEL);
    let expected = [0, 0, s, s | l, s | l | r, s | l | f, s | l | r, s | l | r | f, s | l, s | r, s];
    for (illum, flags) in expected.into_iter().enumerate() {
        let scene = load_toml(&format!(
            "materials.m = {{ illum = {illum} }}\n[[mesh]]\ngenerator = 'disc'\nradius = 1\nsegments = 3\n\
             material = 'm'"
        ));
        assert_eq!(scene.materials[0].flags, flags, "illum {illum}");
    }
    assert_eq!(Lobes::of_illum(11), None);
}

#[test]
fn materials_have_documented_defaults() {
    let scene = load_toml(
        "[materials]\na = {}\nb = { Kd = [0.1, 0.2, 0.3], Ks = [1, 1, 1], Tr = 0.25, Ns = 0, Ni = 0 }\n\
         [[mesh]]\ngenerator = 'plane'\nsize = [1, 1]\nfields = [2, 1]\nmaterials = ['a', 'b']",
    );
    let [a, b] = scene.materials[..] else { panic!("two materials") };
    assert_eq!((a.ka, a.kd, a.ks, a.ke, a.tf), (a.kd, Vec3::splat(0.8), Vec3::ZERO, Vec3::ZERO, Vec3::ONE));
    assert_eq!((a.ns, a.ni, a.d, a.flags), (32.0, 1.5, 1.0, 0));
    assert_eq!((b.ka, b.ns, b.ni, b.d, b.flags), (Vec3::new(0.1, 0.2, 0.3), 1.0, 1.0, 0.75, MATERIAL_SPECULAR));
    assert_eq!(*scene.triangle_materials, [0, 0, 1, 1]);
}

#[test]
fn ambient_light_may_differ_from_above_and_from_below() {
    let disc = "[[mesh]]\ngenerator = 'disc'\nradius = 1\nsegments = 3\n";
    for (key, up) in [("", Up::Y), (", up = 'y'", Up::Y), (", up = 'z'", Up::Z)] {
        let scene = load_toml(&format!("ambient = {{ sky = [0.1, 0.2, 3], ground = [0, 0.5, 1]{key} }}\n{disc}"));
        let ground = Ground { ambient: Vec3::new(0.0, 0.5, 1.0), up };
        assert_eq!((scene.ambient, scene.ground), (Vec3::new(0.1, 0.2, 3.0), Some(ground)));
        assert!(scene.lights.is_empty());
    }
}

#[test]
fn a_scene_file_says_everything() {
    let scene = load_toml(
        r#"
        ambient = [0.1, 0.2, 0.3]
        background = [1, 2, 3]
        render = { width = 320, height = 200, max_depth = 7, exposure = 2, denoise = "paper", denoise_threshold = 1.5 }
        camera = { eye = [0, 0, 5], target = [0, 0, 0], up = [0, 2, 0], vertical_fov = 30 }
        light = [
            { kind = "point", position = [1, 2, 3], intensity = [4, 5, 6] },
            { kind = "directional", direction = [0, -2, 0], irradiance = [1, 1, 1] },
        ]
        mesh = [{ generator = "sphere", radius = 1, segments = 8, rings = 4 }]
        "#,
    );
    assert_eq!((scene.ambient, scene.background), (Vec3::new(0.1, 0.2, 0.3), Vec3::new(1.0, 2.0, 3.0)));
    assert_eq!(scene.ground, None);
    assert_eq!((scene.defaults.width, scene.defaults.height, scene.defaults.max_depth), (320, 200, 7));
    assert_eq!((scene.defaults.exposure, scene.defaults.denoise), (2.0, Denoise::Paper { threshold: 1.5 }));
    let projection = Projection::Perspective { vertical_fov_degrees: 30.0 };
    assert_eq!((scene.camera.up, scene.camera.projection), (Vec3::Y, projection));
    assert_eq!((scene.lights[0].kind, scene.lights[0].position), (LIGHT_POINT, Vec3::new(1.0, 2.0, 3.0)));
    // The direction towards the light is opposite to the direction in which the light travels.
    assert_eq!((scene.lights[1].kind, scene.lights[1].position), (LIGHT_DIRECTIONAL, Vec3::Y));
}

/// Returns a triangle in the plane z = 0 that faces +z, after a transform.
fn transformed(transform: &str) -> Triangle {
    let toml = format!("[[mesh]]\nfile = 't.obj'\ntransform = {{ {transform} }}");
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1";
    load(&[("t.toml", toml.as_bytes()), ("t.obj", obj.as_bytes())]).unwrap().triangles[0]
}

#[test]
fn transforms_scale_then_rotate_then_translate() {
    let close = |a: Vec3, b: Vec3| assert!((a - b).length() < 1e-4, "{a} is not {b}");
    let t = transformed("scale = 2, rotate = [0, 0, 90], translate = [10, 0, 0]");
    close(t.v1, Vec3::new(10.0, 2.0, 0.0));
    let t = transformed("rotate = { axis = [0, 3, 0], angle = 90 }");
    close(t.v1, Vec3::NEG_Z);
    close(decode_octahedral(t.n0), Vec3::X);
    // The rotation about x comes first: it turns +y to +z, and the rotation about y turns +z to +x.
    close(transformed("rotate = [90, 90, 0]").v2, Vec3::X);
    // After a reflection, the outside is still the outside.
    let t = transformed("scale = [-1, 1, 1]");
    close(facet_normal(&t), Vec3::Z);
    close(decode_octahedral(t.n0), Vec3::Z);
    // Normals remain perpendicular to a surface that is squeezed.
    let t = transformed("rotate = [0, 45, 0], scale = [1e-6, 1e-3, 1e-6]");
    close(decode_octahedral(t.n1), facet_normal(&t).normalize());
}
