//! Small scenes that are made in code.

use std::path::Path;

use glam::{DVec3, Vec3, vec3};
use kdray::{
    layout::{
        LIGHT_DIRECTIONAL, LIGHT_POINT, Light, MATERIAL_FRESNEL, MATERIAL_REFLECT, MATERIAL_REFRACT, MATERIAL_SPECULAR,
        Material, Triangle, normal::encode_octahedral,
    },
    scene::{Camera, Projection, RenderDefaults, Scene},
    world::{FlatScene, Textures},
};

use super::meshes;

/// Loads a scene file and flattens it.
pub fn load(path: &Path) -> FlatScene {
    FlatScene::new(&Scene::load(path).expect("a scene")).expect("a loaded scene fits together")
}

/// Returns a scene without triangles and lights, seen from z = 4.
pub fn empty() -> FlatScene {
    FlatScene {
        name: "test".to_owned(),
        origin: DVec3::ZERO,
        triangles: Vec::new().into(),
        instances: None,
        triangle_materials: Vec::new().into(),
        occurrences: Vec::new().into(),
        materials: Vec::new(),
        material_names: Vec::new(),
        textures: Textures::default().into(),
        lights: Vec::new(),
        camera: Camera {
            eye: vec3(0.0, 0.0, 4.0),
            target: Vec3::ZERO,
            up: Vec3::Y,
            projection: Projection::Perspective { vertical_fov_degrees: 45.0 },
        },
        ambient: Vec3::ZERO,
        ground: None,
        background: Vec3::ZERO,
        area_lights: Vec::new(),
        environment: None,
        studio: None,
        defaults: RenderDefaults::default(),
    }
}

/// Returns the scene as an orthographic camera shows it obliquely, with triangles on both sides of the eye.
pub fn orthographic(scene: FlatScene) -> FlatScene {
    let (eye, target) = (vec3(1.0, 0.7, 2.6), vec3(-0.1, -0.2, 0.1));
    let projection = Projection::Orthographic { height: 3.5 };
    FlatScene { camera: Camera { eye, target, projection, ..scene.camera }, ..scene }
}

/// Adds a mesh of one material.
pub fn add(scene: &mut FlatScene, triangles: Vec<Triangle>, material: Material) {
    scene.triangle_materials.extend(triangles.iter().map(|_| scene.materials.len() as u32));
    scene.triangles.extend(triangles);
    scene.material_names.push(format!("material {}", scene.materials.len()));
    scene.materials.push(material);
}

/// A material that neither emits nor reflects light.
pub const BLACK: Material = Material {
    ka: Vec3::ZERO,
    ns: 1.0,
    kd: Vec3::ZERO,
    d: 1.0,
    ks: Vec3::ZERO,
    ni: 1.0,
    ke: Vec3::ZERO,
    flags: 0,
    tf: Vec3::ONE,
    transmission: 0.0,
    absorption: Vec3::ZERO,
    metallic: 0.0,
    roughness: 1.0,
    clearcoat: 0.0,
    clearcoat_roughness: 0.0,
    sheen_roughness: 0.0,
    sheen_colour: Vec3::ZERO,
    reserved0: 0,
    conductor_eta: Vec3::ZERO,
    reserved1: 0,
    conductor_k: Vec3::ZERO,
    reserved2: 0,
};

pub fn diffuse(kd: Vec3) -> Material {
    Material { ka: kd, kd, ..BLACK }
}

pub fn glossy(kd: Vec3, ks: Vec3, ns: f32) -> Material {
    Material { ks, ns, flags: MATERIAL_SPECULAR, ..diffuse(kd) }
}

pub fn emissive(ke: Vec3) -> Material {
    Material { ke, ..BLACK }
}

pub fn mirror(ks: Vec3) -> Material {
    Material { ks, flags: MATERIAL_REFLECT, ..BLACK }
}

/// A material that reflects and refracts by Fresnel's term.
pub fn glass(ni: f32) -> Material {
    let flags = MATERIAL_SPECULAR | MATERIAL_REFLECT | MATERIAL_REFRACT | MATERIAL_FRESNEL;
    Material { ks: Vec3::ONE, ns: 50.0, ni, flags, ..BLACK }
}

/// A diffuse material under a mirror whose share grows towards grazing views.
pub fn varnish(ks: Vec3, ni: f32) -> Material {
    Material { ks, ni, flags: MATERIAL_REFLECT | MATERIAL_FRESNEL, ..diffuse(vec3(0.3, 0.1, 0.1)) }
}

/// A material that reflects Ks and refracts the rest. Without reflection it refracts all.
pub fn plain_glass(ks: Vec3, tf: Vec3, reflects: bool) -> Material {
    let flags = MATERIAL_REFRACT | if reflects { MATERIAL_REFLECT } else { 0 };
    Material { ks, tf, ni: 1.4, flags, ..BLACK }
}

/// A material that lets a part of the light straight through.
pub fn veil(kd: Vec3, d: f32) -> Material {
    Material { d, ..diffuse(kd) }
}

pub fn point_light(position: Vec3, intensity: Vec3) -> Light {
    Light { position, kind: LIGHT_POINT, intensity, ..Light::default() }
}

pub fn directional_light(towards: Vec3, intensity: Vec3) -> Light {
    Light { position: towards.normalize(), kind: LIGHT_DIRECTIONAL, intensity, ..Light::default() }
}

/// A closed sphere with interpolated normals.
pub fn smooth_sphere(n: usize, radius: f32, centre: Vec3) -> Vec<Triangle> {
    let mut triangles = meshes::cube(n, 1.0);
    for t in &mut triangles {
        [t.n0, t.n1, t.n2] = [t.v0, t.v1, t.v2].map(encode_octahedral);
    }
    meshes::placed(triangles, radius, centre)
}

/// A box of side 2 * `half` whose front faces are inside.
pub fn room(half: f32) -> Vec<Triangle> {
    let mut triangles = meshes::placed(meshes::cube(2, 0.0), half, Vec3::ZERO);
    triangles.iter_mut().for_each(|t| (t.v1, t.v2) = (t.v2, t.v1));
    triangles
}

/// Returns a scene with every material in a room, under two lamps and a directional light.
pub fn mixed() -> FlatScene {
    let mut scene = empty();
    add(&mut scene, room(5.0), diffuse(vec3(0.7, 0.6, 0.5)));
    add(
        &mut scene,
        meshes::placed(meshes::torus(24, 12), 1.0, vec3(0.1, -1.0, 0.0)),
        glossy(vec3(0.2, 0.5, 0.3), Vec3::splat(0.5), 20.0),
    );
    add(&mut scene, smooth_sphere(6, 0.7, vec3(-1.2, 0.6, 0.3)), mirror(vec3(0.9, 0.8, 0.7)));
    add(&mut scene, smooth_sphere(6, 0.7, vec3(1.1, 0.5, 0.8)), glass(1.5));
    add(&mut scene, meshes::placed(meshes::cube(1, 0.0), 0.4, vec3(0.0, 1.2, -0.5)), glass(1.3));
    add(&mut scene, meshes::placed(meshes::cube(1, 0.0), 0.5, vec3(0.2, -0.1, 1.7)), veil(vec3(0.9, 0.1, 0.1), 0.4));
    let small_sphere = |x: f32| smooth_sphere(5, 0.35, vec3(x, -0.9, 1.9));
    add(&mut scene, small_sphere(-0.9), varnish(vec3(0.9, 0.5, 0.7), 1.6));
    add(&mut scene, small_sphere(0.0), plain_glass(Vec3::splat(0.2), vec3(0.6, 0.9, 0.8), true));
    add(&mut scene, small_sphere(0.9), plain_glass(Vec3::splat(0.2), vec3(0.9, 0.6, 0.8), false));
    add(&mut scene, meshes::soup(100, 5), emissive(vec3(0.3, 0.1, 0.6)));
    scene.lights = vec![
        point_light(vec3(2.0, 3.5, 3.0), vec3(9.0, 8.0, 7.0)),
        point_light(vec3(-3.0, 2.5, 2.0), vec3(3.0, 4.0, 5.0)),
        directional_light(vec3(0.3, 1.0, 0.5), Vec3::splat(0.4)),
    ];
    scene.ambient = Vec3::splat(0.2);
    scene.background = vec3(0.1, 0.2, 0.4);
    scene
}

/// Returns `mixed` without the walls of its room at the upper ends of x and z, so that some rays leave.
pub fn mixed_outdoors() -> FlatScene {
    let scene = mixed();
    let keep: Vec<bool> = scene
        .triangles
        .iter()
        .map(|t| t.v0.z.min(t.v1.z).min(t.v2.z) < 4.9 && t.v0.x.min(t.v1.x).min(t.v2.x) < 4.9)
        .collect();
    let mut kept = keep.iter();
    let mut outdoors = scene.clone();
    outdoors.triangles.retain(|_| *kept.next().expect("one a triangle"));
    let mut kept = keep.iter();
    outdoors.triangle_materials.retain(|_| *kept.next().expect("one a triangle"));
    outdoors
}
