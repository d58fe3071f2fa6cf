//! Tests of scenes that a program describes: meshes with several instances, and scenes whose parts do not fit
//! together.

use glam::{DQuat, DVec3, Vec3, vec3};
use kdray::{
    accel::kdtree::BuildOptions,
    layout::{FLAT_NORMAL, normal::encode_octahedral},
    scene::{Camera, Instance, Light, Material, Mesh, Projection, RenderDefaults, Scene, Transform},
    world::{FlatScene, Mismatch, World},
};

use super::load_toml;

/// Returns a unit square in the plane z = 0 of two faces, of which the second one has shading normals.
fn square() -> Mesh {
    Mesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::ONE.with_z(0.0), Vec3::Y],
        faces: vec![[0, 1, 2], [0, 2, 3]],
        normals: vec![[Vec3::ZERO; 3], [Vec3::Z; 3]],
        slots: vec![0, 1],
        ..Mesh::default()
    }
}

fn named(name: &str) -> Material {
    Material { name: name.to_owned(), ..Material::default() }
}

fn instance(transform: Transform, materials: Vec<u32>) -> Instance {
    Instance { mesh_ix: 0, transform, materials, ..Instance::default() }
}

fn scene(instances: Vec<Instance>) -> Scene {
    Scene {
        name: "squares".to_owned(),
        origin: DVec3::ZERO,
        meshes: vec![square()],
        instances,
        materials: ["red", "green", "blue"].map(named).into(),
        lights: vec![Light::Point { position: Vec3::Z, intensity: Vec3::ONE }],
        chosen_light: None,
        images: Vec::new(),
        chosen_camera: false,
        cameras: Vec::new(),
        animations: Vec::new(),
        camera: Camera {
            eye: Vec3::Z,
            target: Vec3::ZERO,
            up: Vec3::Y,
            projection: Projection::Perspective { vertical_fov_degrees: 60.0 },
        },
        ambient: Vec3::ZERO,
        ground: None,
        background: Vec3::ZERO,
        environment: None,
        sky: None,
        studio: None,
        defaults: RenderDefaults::default(),
    }
}

fn moved(x: f64) -> Transform {
    Transform::new(DVec3::ONE, DQuat::IDENTITY, DVec3::new(x, 0.0, 0.0)).expect("a transform")
}

#[test]
fn each_instance_has_its_place_and_its_materials() {
    let mirrored = Transform::new(DVec3::new(-1.0, 1.0, 1.0), DQuat::IDENTITY, DVec3::ZERO).expect("a transform");
    let scene = scene(vec![instance(moved(5.0), vec![2, 0]), instance(mirrored, vec![1])]);
    let flat = FlatScene::new(&scene).expect("a scene that fits together");
    assert_eq!((flat.triangles.len(), scene.n_triangles()), (4, 4));
    // Slots beyond the last material begin again at the first one.
    assert_eq!(*flat.triangle_materials, [2, 0, 1, 1]);
    assert_eq!(flat.material_names, ["red", "green", "blue"]);
    let [first, second, third, _] = flat.triangles[..] else { panic!("four triangles") };
    assert_eq!([first.v0, first.v1, first.v2], [vec3(5.0, 0.0, 0.0), vec3(6.0, 0.0, 0.0), vec3(6.0, 1.0, 0.0)]);
    assert_eq!([first.n0, second.n0], [FLAT_NORMAL, encode_octahedral(Vec3::Z)]);
    // A reflection swaps two corners, so that the front remains the front.
    assert_eq!([third.v0, third.v1, third.v2], [Vec3::ZERO, vec3(-1.0, 1.0, 0.0), vec3(-1.0, 0.0, 0.0)]);
    assert_eq!(scene.bounds(), (vec3(-1.0, 0.0, 0.0), vec3(6.0, 1.0, 0.0)));
    assert_eq!(flat.bounds(), scene.bounds());
}

#[test]
fn a_file_and_a_program_describe_the_same_triangles() {
    let of_file =
        load_toml("[[mesh]]\ngenerator = 'plane'\nsize = [1, 1]\ntransform = { translate = [3, 0, 0], scale = 2 }");
    let plane = load_toml("[[mesh]]\ngenerator = 'plane'\nsize = [1, 1]");
    let transform = Transform::new(DVec3::splat(2.0), DQuat::IDENTITY, DVec3::new(3.0, 0.0, 0.0)).expect("a transform");
    let corners: Vec<Vec3> = plane.triangles.iter().flat_map(|t| [t.v0, t.v1, t.v2]).collect();
    let placed: Vec<Vec3> = corners.iter().map(|p| transform.point(*p)).collect();
    let expected: Vec<Vec3> = of_file.triangles.iter().flat_map(|t| [t.v0, t.v1, t.v2]).collect();
    assert_eq!(placed, expected);
}

#[test]
fn what_does_not_fit_together_is_refused() {
    let refusal = |change: fn(&mut Scene)| {
        let mut scene = scene(vec![instance(moved(0.0), vec![0]), instance(moved(2.0), vec![1])]);
        change(&mut scene);
        FlatScene::new(&scene).expect_err("a refusal").to_string()
    };
    assert_eq!(refusal(|scene| scene.instances[1].mesh_ix = 1), "instance 1 of the scene has no mesh");
    let vertex = refusal(|scene| scene.meshes[0].faces[1][2] = 4);
    assert_eq!(vertex, "instance 0 of the scene: its mesh has a face with vertex 4 of 4");
    let arrays = refusal(|scene| _ = scene.meshes[0].slots.pop());
    assert_eq!(arrays, "instance 0 of the scene: its mesh has 2 faces, 2 normals, 1 slots");
    let material = refusal(|scene| scene.instances[1].materials.clear());
    assert_eq!(material, "instance 1 of the scene: it has no material");
    let far = refusal(|scene| scene.meshes[0].positions[3] = Vec3::splat(2e9));
    assert!(far.starts_with("instance 0 of the scene: a vertex lies at [2000000000.0"), "{far}");
}

#[test]
fn a_material_that_the_scene_lacks_is_refused_with_the_world() {
    let scene = scene(vec![instance(moved(0.0), vec![3])]);
    let refused = World::new(&scene, &BuildOptions::default());
    let expected = Mismatch::Material { triangle: 0, material: 3, materials: 3 };
    assert_eq!(refused.expect_err("a refusal"), expected);
}

#[test]
fn transforms_that_flatten_or_are_no_numbers_are_refused() {
    let of_scale = |scale| Transform::new(scale, DQuat::IDENTITY, DVec3::ZERO).expect_err("a refusal");
    assert!(of_scale(DVec3::new(1.0, 0.0, 1.0)).contains("no factor may be 0"));
    assert!(of_scale(DVec3::new(1.0, f64::NAN, 1.0)).contains("not finite"));
}
