//! Films of glTF files whose skins and morph targets deform kept meshes. Devices deform them, or the host where kernels
//! cannot. Arrays, hits and pictures are those of new worlds, whose vertices and trees the host makes, also where the
//! device builds grids.

use std::{collections::HashMap, fs, sync::Arc};

use base64::{Engine, engine::general_purpose::STANDARD};
use glam::{DMat4, DVec3, Mat4, Quat, Vec3, Vec3Swizzles, Vec4, vec3};
use kdray::{
    accel::{AccelOptions, kdtree::Traversal},
    cast::GpuCaster,
    engine::{AnimatedWorld, LoadRequest, Opened},
    frame::{Integrator, RenderOptions},
    render::GpuRenderer,
    scene::{
        AnimationChoice, Instance, Light, Mesh, PictureChoices, Scene, Transform,
        deformation::{ChangedMeshes, Deformation, Influence, JointMatrix, MorphDelta, Pose, PosedMesh},
    },
    world::{FlatScene, World},
};
use serde_json::{Value, json};

use super::{
    deformed::{check_queries, drawn, lazy, lazy_of, lazy_options, renderer},
    device_grids::check_grids,
    kept, mesh_of, scene_of, transform, transforms,
};
use crate::support::{assert_silent, compare, device, meshes, random::Random};

/// The place of the file's mesh, and its size.
const CENTRE: Vec3 = vec3(3.0, 0.0, 1.0);
const SIZE: f32 = 3.0;

/// What a file has.
#[derive(Clone, Copy, Debug, Default)]
struct Kind {
    is_skinned: bool,
    is_morphed: bool,
    has_tangents: bool,
    /// Whether a normal map needs tangents.
    has_normal_map: bool,
    /// Whether a face has another one in the same place, which looks different from behind.
    has_double: bool,
}

const SKINNED: Kind =
    Kind { is_skinned: true, is_morphed: false, has_tangents: true, has_normal_map: false, has_double: false };
const MORPHED: Kind = Kind { is_skinned: false, is_morphed: true, has_normal_map: true, ..SKINNED };
const BOTH: Kind = Kind { is_morphed: true, has_tangents: false, ..SKINNED };

/// The parts of a glTF file that is made.
#[derive(Default)]
struct Parts {
    data: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Parts {
    /// Adds an accessor of numbers, `n` each.
    fn add(&mut self, kind: &str, numbers: &[f32]) -> usize {
        let n = HashMap::from([("SCALAR", 1), ("VEC2", 2), ("VEC3", 3), ("VEC4", 4), ("MAT4", 16)])[kind];
        self.add_as((kind, 5126, numbers.len() / n), bytemuck::cast_slice(numbers))
    }

    fn add_as(&mut self, (kind, component, n): (&str, u32, usize), bytes: &[u8]) -> usize {
        self.views.push(json!({ "buffer": 0, "byteOffset": self.data.len(), "byteLength": bytes.len() }));
        self.data.extend(bytes);
        let view = self.views.len() - 1;
        self.accessors.push(json!({ "bufferView": view, "componentType": component, "count": n, "type": kind }));
        self.accessors.len() - 1
    }
}

fn vec3s(vectors: impl Iterator<Item = Vec3>) -> Vec<f32> {
    vectors.flat_map(|v| v.to_array()).collect()
}

fn vec4s(vectors: impl Iterator<Item = Vec4>) -> Vec<f32> {
    vectors.flat_map(|v| v.to_array()).collect()
}

/// Returns a torus around a place, and the normals of its vertices.
fn torus() -> (Mesh, Vec<Vec3>) {
    let mut mesh = mesh_of(&meshes::torus(50, 24));
    mesh.positions.iter_mut().for_each(|p| *p = CENTRE + SIZE * *p);
    let mut normals = vec![Vec3::ZERO; mesh.positions.len()];
    for face in &mesh.faces {
        let [a, b, c] = face.map(|ix| mesh.positions[ix as usize]);
        face.iter().for_each(|ix| normals[*ix as usize] += (b - a).cross(c - a));
    }
    let normals = normals.into_iter().map(Vec3::normalize).collect();
    (mesh, normals)
}

/// Returns a film of a torus.
fn file(kind: Kind) -> Value {
    let (mut mesh, mut normals) = torus();
    let mut random = Random(3);
    let mut colours: Vec<Vec4> =
        mesh.positions.iter().map(|_| random.in_box(Vec3::ZERO, Vec3::ONE).extend(1.0)).collect();
    if kind.has_double {
        let face = mesh.faces[0].map(|ix| ix as usize);
        let n = mesh.positions.len() as u32;
        for ix in face {
            mesh.positions.push(mesh.positions[ix]);
            normals.push(-normals[ix]);
            colours.push(Vec4::new(1.0, 0.0, 1.0, 1.0) - 0.5 * colours[ix].with_w(0.0));
        }
        mesh.faces.push([n, n + 2, n + 1]);
    }
    let mut parts = Parts::default();
    let indices = mesh.faces.as_flattened();
    let indices = parts.add_as(("SCALAR", 5125, indices.len()), bytemuck::cast_slice(indices));
    let mut attributes = json!({
        "POSITION": parts.add("VEC3", &vec3s(mesh.positions.iter().copied())),
        "NORMAL": parts.add("VEC3", &vec3s(normals.iter().copied())),
        "COLOR_0": parts.add("VEC4", &vec4s(colours.into_iter())),
    });
    let uvs: Vec<f32> = mesh.positions.iter().flat_map(|p| [p.x - p.y, p.z + 0.3 * p.y]).collect();
    attributes["TEXCOORD_0"] = json!(parts.add("VEC2", &uvs));
    if kind.has_tangents {
        let tangents = normals.iter().map(|n| n.any_orthonormal_vector().extend(if n.x < 0.1 { -1.0 } else { 1.0 }));
        attributes["TANGENT"] = json!(parts.add("VEC4", &vec4s(tangents)));
    }
    let mut node = json!({ "mesh": 0 });
    let (mut channels, mut samplers) = (Vec::new(), Vec::new());
    let times = parts.add("SCALAR", &[0.0, 1.0, 2.0]);
    let mut animate = |(node, path): (usize, &str), output: usize| {
        channels.push(json!({ "sampler": samplers.len(), "target": { "node": node, "path": path } }));
        samplers.push(json!({ "input": times, "output": output }));
    };
    let mut skins = Vec::new();
    if kind.is_skinned {
        let share = |p: &Vec3| (0.5 + 0.5 * (p.y - CENTRE.y) / SIZE).clamp(0.0, 1.0);
        let weights = mesh.positions.iter().map(|p| Vec4::new(share(p), 1.0 - share(p), 0.0, 0.0));
        attributes["WEIGHTS_0"] = json!(parts.add("VEC4", &vec4s(weights)));
        let joints = [0_u8, 1, 0, 0].repeat(mesh.positions.len());
        attributes["JOINTS_0"] = json!(parts.add_as(("VEC4", 5121, mesh.positions.len()), &joints));
        let bind = Mat4::from_translation(-CENTRE).to_cols_array();
        let bind = parts.add("MAT4", &[bind, bind].concat());
        skins.push(json!({ "joints": [1, 2], "inverseBindMatrices": bind }));
        node["skin"] = json!(0);
        let turns = [0.0, 0.8, -0.5].map(|angle| Quat::from_rotation_y(angle).to_array());
        animate((1, "rotation"), parts.add("VEC4", turns.as_flattened()));
        let places = [Vec3::ZERO, vec3(0.2, -0.5, 0.4), vec3(-0.4, 0.3, 0.0)].map(|moved| CENTRE + moved);
        animate((2, "translation"), parts.add("VEC3", &vec3s(places.into_iter())));
    }
    let mut targets = Vec::new();
    if kind.is_morphed {
        for phase in [0.0_f32, 1.5] {
            let waves = mesh.positions.iter().map(|p| vec3(0.3 * (2.0 * p.y + phase).sin(), 0.0, 0.2 * p.x.cos()));
            let added = parts.add("VEC3", &vec3s(waves));
            let turned = parts.add("VEC3", &vec3s(normals.iter().map(|n| 0.2 * n.zxy())));
            targets.push(json!({ "POSITION": added, "NORMAL": turned }));
        }
        animate((0, "weights"), parts.add("SCALAR", &[0.1, 0.0, 1.0, 0.4, 0.0, -0.7]));
    }
    let mut primitive = json!({ "attributes": attributes, "indices": indices, "material": 0 });
    if !targets.is_empty() {
        primitive["targets"] = json!(targets);
    }
    let mut material = json!({ "pbrMetallicRoughness": { "roughnessFactor": 0.8, "metallicFactor": 0 } });
    if kind.has_normal_map {
        material["normalTexture"] = json!({ "index": 0 });
    }
    let uri = |kind: &str, data: &[u8]| format!("data:{kind};base64,{}", STANDARD.encode(data));
    let mut all = json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0, 1, 2] }],
        "nodes": [node, { "translation": CENTRE.to_array() }, { "translation": CENTRE.to_array() }],
        "meshes": [{ "primitives": [primitive] }], "materials": [material],
        "images": [{ "uri": uri("image/png", &normal_map()) }], "textures": [{ "source": 0 }],
        "animations": [{ "channels": channels, "samplers": samplers }],
        "buffers": [{
            "byteLength": parts.data.len(), "uri": uri("application/octet-stream", &parts.data),
        }],
        "bufferViews": parts.views, "accessors": parts.accessors,
    });
    if !skins.is_empty() {
        all["skins"] = json!(skins);
    }
    all
}

/// Returns a picture of a normal that leans to the tangent.
fn normal_map() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 1, 1);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(&[200, 128, 220]).unwrap();
    bytes
}

/// Returns the world of a flat scene whose trees the host builds.
fn of_host(flat: FlatScene) -> World {
    World::of_flat(flat, &Default::default()).expect("a world")
}

/// Checks that two renderers have the same triangles and texture words, and draw the same picture.
fn check(name: &str, expected: &mut GpuRenderer, film: &mut GpuRenderer) {
    let arrays = |renderer: &GpuRenderer| {
        let arrays = &renderer.resources().accel.arrays;
        (arrays.triangles.download().expect("triangles"), arrays.texture_words.download().expect("words"))
    };
    let ((triangles, words), (expected_triangles, expected_words)) = (arrays(film), arrays(expected));
    compare::exact(&expected_triangles, &triangles).unwrap_or_else(|what| panic!("{name}: triangles: {what}"));
    compare::exact(&expected_words, &words).unwrap_or_else(|what| panic!("{name}: words: {what}"));
    assert!(drawn(expected).radiance == drawn(film).radiance, "{name}: the picture");
}

/// Plays a film. `on_device`: whether devices deform the mesh.
fn play(kind: Kind, on_device: bool) {
    play_in(kind, &lazy_options()[0], on_device);
}

/// Plays a film of a mesh in a structure of these options.
fn play_in(kind: Kind, options: &AccelOptions, on_device: bool) {
    let context = device();
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("film.gltf");
    fs::write(&path, file(kind).to_string()).expect("a file");
    let mut request = LoadRequest::pictures(PictureChoices::default());
    request.scene.at = Some(0.0);
    let scene = Opened::read(path.as_path(), &request).expect("a scene").scene;
    let first = lazy_of(&scene, options);
    let mut film = renderer(&context, &first, Integrator::Whitted);
    let mut caster = GpuCaster::new(&context, first.geometry(), Traversal::Mask).expect("a caster");
    let mut animated = AnimatedWorld::new(&path, &request, scene, &first);
    let mut before = drawn(&mut film);
    for at in [0.4, 1.0, 1.7, 0.2] {
        let name = format!("{kind:?} at {at} s");
        let (world, _) = animated.at(at).expect("a moment");
        assert_eq!(world.poses().get(0).is_some(), on_device, "{name}");
        film.set_world(&world).expect("a change");
        caster.set_world(&world).expect("a change");
        let now = drawn(&mut film);
        assert!(now.radiance != before.radiance, "{name}: the mesh is deformed");
        before = now;
        assert_eq!(world.scene().triangles.is_made(), !on_device, "{name}: the host's triangles");
        request.scene.at = Some(at);
        let read = Opened::read(path.as_path(), &request).expect("a scene").scene;
        let alone = FlatScene::with_instances(&read).expect("a scene that fits together");
        assert!(alone.triangles == world.scene().triangles, "{name}: the triangles of a frame alone");
        assert!(alone.textures == world.scene().textures, "{name}: the corners of a frame alone");
        let host = of_host(world.scene().clone());
        let mut expected = renderer(&context, &host, Integrator::Whitted);
        check(&name, &mut expected, &mut film);
        let mut of_new = GpuCaster::new(&context, host.geometry(), Traversal::Mask).expect("a caster");
        check_queries(&name, &mut of_new, &mut caster);
        check_grids(&name, &film, &world);
    }
    assert_silent(&context);
}

/// A file whose mesh has no weights until an animation sets them, and another animation.
#[test]
fn an_animation_that_ends_leaves_no_pose() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("film.gltf");
    let mut file = file(Kind { is_skinned: true, ..MORPHED });
    file["nodes"][0].as_object_mut().expect("a node").remove("skin");
    let all = file["animations"][0]["channels"].as_array().expect("channels").clone();
    let (of_weights, others): (Vec<Value>, Vec<Value>) = all.into_iter().partition(|it| it["target"]["node"] == 0);
    let samplers = file["animations"][0]["samplers"].clone();
    file["animations"] = json!([
        { "name": "wave", "channels": of_weights, "samplers": samplers },
        { "name": "turn", "channels": others, "samplers": samplers },
    ]);
    fs::write(&path, file.to_string()).expect("a file");
    let request = LoadRequest::pictures(PictureChoices::default());
    let scene = Opened::read(path.as_path(), &request).expect("a scene").scene;
    let first = lazy(&scene);
    let mut animated = AnimatedWorld::new(&path, &request, scene, &first);
    animated.set_animation(AnimationChoice::Named("wave".to_owned()));
    let waving = animated.at(1.0).expect("a moment").0;
    assert!(waving.scene().triangles != first.scene().triangles && waving.poses().get(0).is_some());
    animated.set_animation(AnimationChoice::Named("turn".to_owned()));
    let turning = animated.at(1.0).expect("a moment").0;
    compare::exact(&first.scene().triangles, &turning.scene().triangles).expect("the mesh at rest");
}

#[test]
fn skinned_meshes_are_deformed_by_the_device() {
    play(SKINNED, true);
}

#[test]
fn morphed_meshes_are_deformed_by_the_device() {
    play(MORPHED, true);
}

#[test]
fn meshes_with_both_are_deformed_by_the_device() {
    play(BOTH, true);
}

#[test]
fn grids_of_meshes_that_the_device_deforms_are_the_hosts() {
    let [_, grid, grid2] = &lazy_options();
    play_in(SKINNED, grid, true);
    play_in(MORPHED, grid2, true);
    play_in(Kind { has_tangents: false, ..MORPHED }, grid2, false);
}

#[test]
fn what_kernels_cannot_do_is_done_by_the_host() {
    play(Kind { has_tangents: false, ..MORPHED }, false);
    play(Kind { has_double: true, ..SKINNED }, false);
}

/// A scene of two large meshes, of which the second one is larger and also stands mirrored, and a small one, whose tree
/// the host builds.
fn cubes() -> Scene {
    let mut scene = scene_of(&meshes::cube(19, 0.9), &transforms(2.5)[..4]);
    scene.meshes.push(mesh_of(&meshes::cube(23, 0.2)));
    let place = transform(DVec3::splat(0.7), 0.5, DVec3::new(3.0, 2.0, -1.0));
    let mut push = |mesh_ix: usize, transform: Transform| {
        scene.instances.push(Instance { mesh_ix, transform, materials: vec![0], ..Instance::default() });
    };
    push(1, place);
    push(1, transform(DVec3::new(-0.5, 0.6, 0.5), 0.2, DVec3::new(-2.0, 1.0, 2.0)));
    push(2, transform(DVec3::splat(0.8), 0.3, DVec3::new(1.0, 2.5, 1.0)));
    scene.meshes.push(mesh_of(&meshes::cube(3, 0.5)));
    scene.camera.eye = vec3(3.0, 2.0, 14.0);
    scene.camera.target = vec3(3.0, 0.0, 1.0);
    scene
}

/// Returns what deforms a mesh: a joint for all vertices, and a target that moves each of them.
fn deformation(mesh: &Mesh) -> Deformation {
    let n = mesh.positions.len();
    let delta = |p: &Vec3| MorphDelta { position: 0.2 * (3.0 * p.zxy()).map(f32::sin), ..MorphDelta::default() };
    Deformation {
        positions: mesh.positions.clone(),
        deltas: mesh.positions.iter().map(delta).collect(),
        first_deltas: (0..=n as u32).collect(),
        n_influences: 1,
        influences: vec![Influence { joint: 0, weight: 1.0 }; n],
        ..Deformation::default()
    }
}

/// What deforms a mesh, and its faces.
type AtRest = (Arc<Deformation>, Arc<[[u32; 3]]>);

/// A film of [`cubes`], which the device deforms.
struct Cubes {
    scene: Scene,
    at_rest: Vec<AtRest>,
}

impl Cubes {
    fn new() -> Self {
        let scene = cubes();
        let at_rest = |mesh: &Mesh| (deformation(mesh).into(), mesh.faces.clone().into());
        Self { at_rest: scene.meshes.iter().map(at_rest).collect(), scene }
    }

    /// Deforms the meshes of the scene. Returns what the device makes them of.
    fn deform(&mut self, weight: f32) -> ChangedMeshes {
        let joints = vec![JointMatrix::new(DMat4::from_rotation_z(0.4 * f64::from(weight)), DVec3::ZERO)];
        let pose = Pose { weights: vec![weight], joints };
        let deform = |((deformation, faces), mesh): (&AtRest, &mut Mesh)| {
            let posed = PosedMesh::new(deformation.clone(), faces.clone(), pose.clone());
            posed.deform(mesh);
            Arc::new(posed)
        };
        self.at_rest.iter().zip(&mut self.scene.meshes).map(deform).map(Some).enumerate().collect()
    }
}

/// Returns the world of another moment.
fn next(world: &World, scene: &Scene, changed: &ChangedMeshes) -> World {
    world.posed(scene, changed).expect("a scene that fits together").expect("a pose")
}

#[test]
fn meshes_are_deformed_one_after_the_other() {
    lazy_options().iter().for_each(deform_one_after_the_other);
}

fn deform_one_after_the_other(options: &AccelOptions) {
    let context = device();
    let mut cubes = Cubes::new();
    let first = lazy_of(&cubes.scene, options);
    let mut film = renderer(&context, &first, Integrator::Whitted);
    let mut caster = GpuCaster::new(&context, first.geometry(), Traversal::Mask).expect("a caster");
    let mut world = first.clone();
    for weight in [0.5, 1.0, -0.3] {
        let changed = cubes.deform(weight);
        // Nobody reads the vertices of the scene's meshes.
        let mut wrong = cubes.scene.clone();
        wrong.meshes.iter_mut().for_each(|mesh| mesh.positions.reverse());
        world = next(&world, &wrong, &changed);
        film.set_world(&world).expect("a change");
        caster.set_world(&world).expect("a change");
        assert!(!world.scene().triangles.is_made());
        let (name, host) = (format!("weight {weight}"), kept(&cubes.scene));
        check(&name, &mut renderer(&context, &host, Integrator::Whitted), &mut film);
        let mut of_new = GpuCaster::new(&context, host.geometry(), Traversal::Mask).expect("a caster");
        check_queries(&name, &mut of_new, &mut caster);
        check_grids(&name, &film, &world);
    }
    assert_silent(&context);
}

/// A mesh may be deformed by the host at one moment, and have a pose at the next one.
#[test]
fn poses_and_arrays_take_turns() {
    let context = device();
    let mut cubes = Cubes::new();
    let first = lazy(&cubes.scene);
    let mut film = renderer(&context, &first, Integrator::Whitted);
    let mut world = first;
    let [no, yes] = [false, true];
    for (weight, by_host) in [(0.5, [no; 3]), (0.2, [yes, no, no]), (0.9, [no, yes, yes]), (0.4, [yes; 3])] {
        let mut changed = cubes.deform(weight);
        changed.iter_mut().filter(|(ix, _)| by_host[**ix]).for_each(|(_, pose)| *pose = None);
        world = next(&world, &cubes.scene, &changed);
        film.set_world(&world).expect("a change");
        let host = kept(&cubes.scene);
        check(&format!("{weight}"), &mut renderer(&context, &host, Integrator::Whitted), &mut film);
        assert!(host.scene().triangles == world.scene().triangles, "{weight}");
    }
    // What the first pose has moved too far is no world of poses.
    let far = Pose { weights: vec![1e30], joints: vec![JointMatrix::new(DMat4::IDENTITY, DVec3::ZERO)] };
    let (deformation, faces) = cubes.at_rest[0].clone();
    let far = PosedMesh::new(deformation, faces, far);
    let found = world.posed(&cubes.scene, &[(0, Some(Arc::new(far)))].into());
    assert!(found.expect("parts that fit together").is_none());
    assert_silent(&context);
}

/// Bounds, light and hits of the CPU are those of the deformed meshes, whoever makes their arrays.
#[test]
fn the_host_sees_poses() {
    let mut cubes = Cubes::new();
    cubes.scene.lights = vec![
        Light::Directional { towards: Vec3::Y, irradiance: Vec3::ONE },
        Light::Sphere { position: vec3(0.0, 9.0, 0.0), radius: 0.5, radiance: Vec3::ONE },
    ];
    let world = lazy(&cubes.scene);
    let changed = cubes.deform(0.7);
    let posed = next(&world, &cubes.scene, &changed);
    let host = kept(&cubes.scene);
    assert_eq!(posed.emitters(), host.emitters());
    assert_eq!(posed.frame_constants(&RenderOptions::default()), host.frame_constants(&RenderOptions::default()));
    assert!(!posed.scene().triangles.is_made());
    assert_eq!(posed.scene().bounds(), host.scene().bounds());
}

/// The first pose needs the kernels and the mesh at rest. Without room for them, the host's triangles are uploaded.
#[test]
fn a_failed_pose_changes_nothing() {
    let context = device();
    let mut cubes = Cubes::new();
    let first = lazy(&cubes.scene);
    let mut film = renderer(&context, &first, Integrator::Whitted);
    // Of several meshes, some may change.
    cubes.at_rest.truncate(1);
    cubes.deform(0.2);
    let world = next(&first, &cubes.scene, &[(0, None)].into());
    film.set_world(&world).expect("a change");
    let before = drawn(&mut film);
    let changed = cubes.deform(1.0);
    let world = next(&world, &cubes.scene, &changed);
    for n in 0.. {
        context.fail_creations_after(Some(n));
        let result = film.set_world(&world);
        context.fail_creations_after(None);
        if result.is_ok() {
            break;
        }
        assert!(drawn(&mut film).radiance == before.radiance, "after {n} creations");
    }
    check("the next moment", &mut renderer(&context, &kept(&cubes.scene), Integrator::Whitted), &mut film);
    assert_silent(&context);
}
