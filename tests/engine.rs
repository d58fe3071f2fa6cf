//! Tests what the engine draws and casts with its own choices, on a device and on the CPU.

mod support;

use std::{fs, path::PathBuf};

use glam::{DVec3, Vec3};
use kdray::{
    accel::{
        Query,
        kdtree::{BuildOptions, Traversal},
    },
    cast::{CpuCaster, NO_TRIANGLE, Ray},
    engine::{Engine, LoadRequest, Loaded},
    frame::RenderOptions,
    gpu::ContextOptions,
    scene::{LoadOptions, Look, Mesh, PictureChoices, Scene},
};
use support::{scenes, world_of};
use tempfile::TempDir;

#[test]
fn an_engine_renders_and_casts_alike_on_device_and_cpu() {
    let scene = scenes::mixed();
    let options = RenderOptions { width: 40, height: 30, max_depth: 3, ..RenderOptions::default() };
    let device = Engine::open(&ContextOptions::new(None, true)).expect("a device with validation");
    let engines = [device.clone(), Engine::on_cpu()];
    let rendered = engines.map(|engine| {
        let world = world_of(&scene);
        let picture = engine.render(&world, &options).expect("a picture").picture;
        let eye = scene.camera.eye;
        let ray = |i: u32| Ray {
            origin: eye,
            t_min: 0.0,
            direction: scene.camera.target - eye + 0.01 * Vec3::splat(i as f32),
            t_max: f32::INFINITY,
        };
        let rays: Vec<_> = (0..50).map(ray).collect();
        let hits = engine.cast(&world, &rays, Query::Closest).expect("hits");
        assert_eq!(hits.len(), rays.len());
        (picture, hits)
    });
    let [(on_device, device_hits), (on_cpu, cpu_hits)] = rendered;
    let differing = on_device.display.iter().zip(&on_cpu.display).filter(|(a, b)| a != b).count();
    assert!(differing < 40 * 30 / 20, "{differing} pixels differ");
    assert!(on_device.display.iter().any(|pixel| pixel != &on_device.display[0]), "the picture shows something");
    assert!(device_hits.iter().zip(&cpu_hits).all(|(a, b)| a.triangle_ix == b.triangle_ix));
    assert!(cpu_hits.iter().any(|hit| hit.triangle_ix != NO_TRIANGLE));
    let device = device.device().expect("a device");
    assert_eq!(device.validation_messages(), Vec::<String>::new());
}

/// The engine's choice of tree changes no hit.
#[test]
fn trees_of_either_kind_give_the_same_hits() {
    let scene = scenes::mixed();
    let ray = Ray {
        origin: scene.camera.eye,
        t_min: 0.0,
        direction: scene.camera.target - scene.camera.eye,
        t_max: f32::INFINITY,
    };
    let hits = [BuildOptions::fast(), BuildOptions::default()].map(|options| {
        let world = support::world_by(&scene, &options);
        CpuCaster::new(world.geometry(), Traversal::Stack).cast(&[ray], Query::Closest)
    });
    assert_eq!(hits[0], hits[1]);
}

/// Writes a glTF file of one triangle, 2 wide and high, in the light of a sun of 1000 lux. Returns its path.
fn sunlit(folder: &TempDir) -> PathBuf {
    let corners: [f32; 9] = [-1.0, -1.0, 0.0, 1.0, -1.0, 0.0, 0.0, 1.0, 0.0];
    fs::write(folder.path().join("t.bin"), bytemuck::cast_slice(&corners)).unwrap();
    let gltf = r#"{"asset": {"version": "2.0"}, "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "directional", "intensity": 1000}]}},
        "scene": 0, "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0}, {"extensions": {"KHR_lights_punctual": {"light": 0}}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
            "min": [-1, -1, 0], "max": [1, 1, 0]}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"uri": "t.bin", "byteLength": 36}]}"#;
    let path = folder.path().join("t.gltf");
    fs::write(&path, gltf).unwrap();
    path
}

/// A program that loads a file of physical light gets the picture that the command draws, and no white one.
#[test]
fn physical_light_is_metered() {
    let (folder, engine) = (TempDir::new().unwrap(), Engine::on_cpu());
    let path = sunlit(&folder);
    let middle = |exposure| {
        let choices = PictureChoices { size: Some((32, 32)), exposure, ..PictureChoices::default() };
        let loaded = engine.load(&path, &LoadRequest::pictures(choices)).unwrap();
        let picture = engine.render(&loaded.world, &loaded.options).unwrap().picture;
        (loaded, picture.display[16 * 32 + 16])
    };
    let (Loaded { options, notes, .. }, [r, g, b, _]) = middle(None);
    assert!(options.exposure < 0.01, "{}", options.exposure);
    assert_eq!(notes, [format!("exposure {0}, measured in the first view; --exposure {0} pins it", options.exposure)]);
    assert!([r, g, b].iter().all(|channel| (60..200).contains(channel)), "{r} {g} {b}");
    let (Loaded { options, notes, .. }, white) = middle(Some(1.0));
    assert_eq!((options.exposure, notes.len(), white), (1.0, 0, [255; 4]));
}

/// The lights of the file count, also those of which only paths know: more rays are worth a better tree.
#[test]
fn the_work_counts_lights_with_an_area() {
    let text = r#"
        [[mesh]]
        generator = "plane"
        size = [1.0, 1.0]
        [[light]]
        kind = "rectangle"
        position = [0.0, 3.0, 0.0]
        direction = [0.0, -1.0, 0.0]
        up = [0.0, 0.0, -1.0]
        width = 1.0
        height = 1.0
        radiance = [1.0, 1.0, 1.0]
    "#;
    let scene = Scene::of_text("lamp.toml", text);
    let scene = scene.unwrap();
    assert_eq!(scene.lights.len(), 1);
    let loaded = Engine::on_cpu().load(scene, &LoadRequest::default()).unwrap();
    let RenderOptions { width, height, max_depth, .. } = loaded.options;
    assert_eq!(loaded.workload.n_rays, u64::from(width) * u64::from(height) * u64::from(max_depth.min(2)) * 2);
}

/// Triangles alone get a camera that sees them, and lights.
#[test]
fn a_mesh_of_a_program_is_shown() {
    let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
    let tetrahedron = Mesh::of_triangles(corners, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]);
    let engine = Engine::on_cpu();
    let choices = PictureChoices { size: Some((32, 32)), ..PictureChoices::default() };
    let loaded = engine.load(tetrahedron.clone(), &LoadRequest::pictures(choices)).unwrap();
    let picture = engine.render(&loaded.world, &loaded.options).unwrap().picture;
    let [middle, corner] = [16 * 32 + 16, 0].map(|ix| picture.display[ix]);
    assert!(middle != corner && middle[..3] != [0; 3], "{middle:?} before {corner:?}");
    let odd = [
        (Mesh { faces: vec![[0, 1, 4]; 4], ..tetrahedron.clone() }, "mesh: it has a face with vertex 4 of 4"),
        (Mesh { slots: Vec::new(), ..tetrahedron }, "mesh: it has 4 faces, 4 normals, 0 slots"),
        (Mesh::default(), "mesh: has no triangles"),
    ];
    for (mesh, expected) in odd {
        assert_eq!(engine.load(mesh, &LoadRequest::default()).unwrap_err().to_string(), expected);
    }
}

/// Twenty panes that nobody sees hide nothing, nor do ten of glass that is nearly clear.
#[test]
fn what_is_behind_many_see_through_surfaces_is_seen() {
    let folder = TempDir::new().unwrap();
    let engine = Engine::on_cpu();
    let shown = |n_panes: u32, opacity: f32| {
        let box_of = |ix: u32| format!("v -9 -9 {ix}\nv 9 -9 {ix}\nv 9 9 {ix}\nv -9 9 {ix}\nf -4 -3 -2 -1\n");
        let panes: String = (1..=n_panes).map(box_of).collect();
        let obj = format!("mtllib m.mtl\nusemtl red\n{}usemtl pane\n{panes}", box_of(0));
        fs::write(folder.path().join("m.obj"), obj).unwrap();
        let mtl = format!("newmtl red\nKd 0.8 0.1 0.1\nnewmtl pane\nKd 0 0 0\nd {opacity}\n");
        fs::write(folder.path().join("m.mtl"), mtl).unwrap();
        let look = Look { eye: Some(DVec3::new(0.0, 0.0, 40.0)), target: Some(DVec3::ZERO), ..Look::default() };
        let scene = LoadOptions { look, ..LoadOptions::default() };
        let choices = PictureChoices { size: Some((16, 12)), ..PictureChoices::default() };
        let request = LoadRequest { scene, ..LoadRequest::pictures(choices) };
        let loaded = engine.load(&folder.path().join("m.obj"), &request).unwrap();
        engine.render(&loaded.world, &loaded.options).unwrap().picture.display[6 * 16 + 8].map(i32::from)
    };
    let [r, g, _, _] = shown(0, 1.0);
    assert!(r > 150 && g < 120, "the bare surface is red: {r} {g}");
    let behind = shown(20, 0.001);
    assert!((behind[0] - r).abs() <= 2 && (behind[1] - g).abs() <= 2, "{behind:?} for {r} {g}");
    // 0.95 to the tenth is 0.6 of the light, in the shadow of the panes.
    let behind = shown(10, 0.05);
    assert!((70..r).contains(&behind[0]), "{behind:?}");
    assert!(shown(20, 1.0)[0] < 60, "opaque panes hide it");
}
