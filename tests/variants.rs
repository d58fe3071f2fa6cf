//! Compares the kernels that search kd-trees and grids on the device, under the validation layer. Each finds, bit for
//! bit, what the kernel without a structure finds, and that kernel finds what brute force on the CPU finds.

mod support;

use std::{fmt::Display, sync::Arc};

use glam::{DVec3, Vec3, vec3};
use kdray::{
    accel::{
        Query,
        kdtree::{BuildOptions, Traversal},
    },
    buffers::{Needs, Resources},
    cast::{GpuCaster, Ray},
    frame::RenderOptions,
    gpu::{Access, Context, GpuError},
    layout::{
        BRUTE_MAX_TRIANGLES, Batch, Bounce, Frame, Hit, LIGHT_DIRECTIONAL, LIGHT_LIT, LIGHT_POINT, LIGHT_SHADOWED,
        LIGHT_UNTESTED, Light, NO_TRIANGLE, PathRay, Triangle,
    },
    passes::Passes,
    render::GpuRenderer,
    scene::{Camera, Projection, RenderDefaults},
    world::{FlatScene, World},
};
use support::{
    MeshWithTree, device, meshes, n_outliers,
    random::Random,
    rays::{N_KINDS, nasty_ray, outward_ray},
    scenes, world_by,
};

const N_RAYS: usize = 4000;

/// Returns a scene of the triangles under a lamp and a sun.
fn scene(triangles: &[Triangle]) -> FlatScene {
    let lamp = Light { position: vec3(0.3, 1.5, 0.2), kind: LIGHT_POINT, intensity: Vec3::ONE, ..Light::default() };
    let sun = Light { position: vec3(0.48, 0.6, 0.64), kind: LIGHT_DIRECTIONAL, ..lamp };
    FlatScene {
        name: "variants".into(),
        origin: DVec3::ZERO,
        triangles: triangles.to_vec().into(),
        instances: None,
        triangle_materials: vec![0; triangles.len()].into(),
        occurrences: Vec::new().into(),
        materials: vec![scenes::diffuse(Vec3::ONE)],
        material_names: vec![String::new()],
        textures: kdray::world::Textures::default().into(),
        lights: vec![lamp, sun],
        camera: Camera {
            eye: vec3(0.0, 0.5, 5.0),
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

/// The results of the trace and the shadow kernel.
#[derive(PartialEq)]
struct Traced {
    /// The words t, triangle, u and v; floats as their bits.
    hits: Vec<[u32; 4]>,
    light_visibility: Vec<u32>,
    n_hits: u32,
}

fn traced(context: &Arc<Context>, world: &World, rays: &[PathRay], traversal: Traversal) -> Traced {
    let options = RenderOptions { width: 8, height: 8, max_depth: 1, traversal, ..RenderOptions::default() };
    let constants = Frame { queue_capacity: rays.len() as u32, ..world.frame_constants(&options) };
    let needs = Needs { constants: &constants, options: &options, n_bounces: 1 };
    let resources = Resources::new(context, world, &needs).expect("resources");
    let passes = Passes::new(context, &resources.bindings, &options).expect("passes");
    resources.queue.rays.upload(rays).expect("rays");
    resources.bounces.upload(&[Bounce::of(rays.len() as u32, &constants)]).expect("bounces");
    context.run("clear", |commands| resources.clear_counters(commands)).expect("cleared counters");
    let batch = Batch { first_pixel: 0, n_pixels: 0, bounce_ix: 0, depth: 0, resume_pass: 0 };
    let record = |commands: &kdray::gpu::Commands| {
        resources.bind(commands);
        passes.trace.record(commands, &resources, &batch);
        commands.barrier(Access::ComputeWrite, Access::ComputeUpdate); // hits, counters
        passes.shadow.record(commands, &resources, &batch);
    };
    context.run("variant", record).expect("run");
    let counters = resources.counters().expect("counters")[0];
    Traced {
        hits: bytemuck::cast_slice(&resources.queue.hits.download().expect("hits")).to_vec(),
        light_visibility: resources.queue.light_visibility.download().expect("light_visibility"),
        n_hits: counters.n_hits,
    }
}

/// Describes the first ray on which two variants disagree.
fn difference(rays: &[PathRay], expected: &Traced, found: &Traced) -> Option<String> {
    let wrong = (0..rays.len()).find(|&i| expected.hits[i] != found.hits[i]);
    let describe = |i: usize| {
        let [expected, found]: [Hit; 2] = bytemuck::cast([expected.hits[i], found.hits[i]]);
        format!("ray {i} (kind {}): {:?}: {found:?}, not {expected:?}", i % N_KINDS, rays[i])
    };
    wrong.map(describe).or_else(|| (expected != found).then(|| "light_visibility or counters".to_owned()))
}

fn world_of_tree(mesh: &MeshWithTree) -> World {
    let (scene, tree) = (scene(&mesh.triangles), mesh.tree().clone());
    World::with_tree(scene, tree, &BuildOptions::default()).expect("a world")
}

fn check(context: &Arc<Context>, name: &str, triangles: Vec<Triangle>) {
    let world = MeshWithTree::new(triangles);
    let with_tree = world_of_tree(&world);
    let rays: Vec<PathRay> = (0..N_RAYS).map(|i| nasty_ray(&mut Random(i as u64), &world, i)).collect();
    let without_tree = traced(context, &with_tree, &rays, Traversal::Brute);
    let n_outliers = n_outliers(context, N_RAYS).max(N_RAYS / 200);
    check_against_cpu(name, &world, &rays, (&without_tree, n_outliers));
    let assert_same = |variant: &dyn Display, found: &Traced| {
        if let Some(difference) = difference(&rays, &without_tree, found) {
            panic!("{name}, {variant}: {difference}");
        }
    };
    for &traversal in Traversal::ALL {
        assert_same(&traversal, &traced(context, &with_tree, &rays, traversal));
    }
    for with_grid in support::grid_worlds(with_tree.scene()) {
        assert_same(&with_grid.accel().kind(), &traced(context, &with_grid, &rays, Traversal::Mask));
    }
}

/// Compares hits with the CPU's. A device's division may differ in the last bits, and with it a hit at an edge.
fn check_against_cpu(name: &str, world: &MeshWithTree, rays: &[PathRay], (found, n_outliers): (&Traced, usize)) {
    let hits: &[Hit] = bytemuck::cast_slice(&found.hits);
    let differs = |(ray, hit): (&PathRay, &Hit)| {
        let expected = world.by_brute_force(ray, 0.0);
        let is_near = (hit.t - expected.t).abs() <= 1e-5 * expected.t || hit.t == expected.t;
        !is_near || hit.triangle_ix != expected.triangle_ix
    };
    let n_wrong = rays.iter().zip(hits).filter(|&pair| differs(pair)).count();
    let n_hits = hits.iter().filter(|hit| hit.triangle_ix != NO_TRIANGLE).count();
    assert!(n_wrong <= n_outliers, "{name}: {n_wrong} rays differ from the CPU's");
    assert!(n_hits > N_RAYS / 5 && found.n_hits == n_hits as u32, "{name}: {n_hits} hits, {} counted", found.n_hits);
    let n_of = |state| found.light_visibility.iter().filter(|&&visibility| visibility == state).count();
    let n_shadow_rays = [LIGHT_UNTESTED, LIGHT_LIT, LIGHT_SHADOWED].map(n_of);
    assert!(n_shadow_rays.into_iter().all(|n| n > 0), "{name}: {n_shadow_rays:?} not tested, lit, in shadow");
}

#[test]
fn all_kernels_find_the_same() {
    let context = device();
    check(&context, "torus", meshes::torus(40, 20));
    check(&context, "cube", meshes::cube(9, 0.0));
    check(&context, "soup", meshes::soup(1200, 7));
    check(&context, "threefold", meshes::threefold(meshes::torus(20, 10)));
    assert_eq!(context.validation_messages(), Vec::<String>::new());
}

/// Traces rays from inside a closed mesh at its vertices and edges, through each structure.
#[test]
fn rays_from_inside_never_leak() {
    let context = device();
    for (name, triangles) in [("sphere", meshes::cube(20, 1.0)), ("cube", meshes::cube(20, 0.0))] {
        let rays: Vec<Ray> = (0..50_000).map(|i| cast_ray(&outward_ray(&mut Random(i), &triangles))).collect();
        let scene = scene(&triangles);
        let [grid, grid2] = support::grid_worlds(&scene);
        for world in [world_by(&scene, &BuildOptions::default()), grid, grid2] {
            let mut caster = GpuCaster::new(&context, world.geometry(), Traversal::Mask).expect("a caster");
            let hits = caster.cast(&rays, Query::Closest, 1).expect("a cast").hits;
            let n_leaks = hits.iter().filter(|hit| hit.triangle_ix == NO_TRIANGLE).count();
            assert_eq!(n_leaks, 0, "{name}, {}", world.accel().kind());
        }
        let with_a_hole = world_by(&self::scene(&triangles[1..]), &BuildOptions::default());
        let mut caster = GpuCaster::new(&context, with_a_hole.geometry(), Traversal::Mask).expect("a caster");
        let hits = caster.cast(&rays, Query::Closest, 1).expect("a cast").hits;
        assert!(hits.iter().any(|hit| hit.triangle_ix == NO_TRIANGLE), "{name}: a hole is noticed");
    }
    assert_eq!(context.validation_messages(), Vec::<String>::new());
}

fn cast_ray(ray: &PathRay) -> Ray {
    Ray { origin: ray.origin, t_min: 0.0, direction: ray.direction, t_max: ray.t_max }
}

#[test]
fn a_wrong_bit_is_noticed() {
    let world = MeshWithTree::new(meshes::torus(20, 10));
    let rays: Vec<PathRay> = (0..64).map(|i| nasty_ray(&mut Random(i), &world, i as usize)).collect();
    let context = device();
    let of = |traversal| traced(&context, &world_of_tree(&world), &rays, traversal);
    let expected = of(Traversal::Mask);
    for wrong in 0..4 {
        let mut found = of(Traversal::Mask);
        assert_eq!(difference(&rays, &expected, &found), None);
        match wrong {
            0 => found.hits[63][1] ^= 1,
            1 => found.hits[0][0] ^= 1,
            2 => found.light_visibility[5] ^= 1,
            _ => found.n_hits += 1,
        }
        assert!(difference(&rays, &expected, &found).is_some());
    }
}

#[test]
fn brute_force_refuses_large_meshes() {
    let triangles = vec![meshes::triangle(Vec3::X, Vec3::Y, Vec3::Z); BRUTE_MAX_TRIANGLES as usize + 1];
    let world = world_by(&scene(&triangles), &BuildOptions::fast());
    let options = RenderOptions { width: 8, height: 8, traversal: Traversal::Brute, ..RenderOptions::default() };
    let refused = GpuRenderer::new(device(), &world, &options).err();
    assert!(matches!(refused, Some(GpuError::Limit { value: 65_001, limit: 65_000, .. })), "{refused:?}");
}
