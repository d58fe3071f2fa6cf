//! Kept meshes whose trees or grids the device builds, and builds again when the meshes are deformed: hits and pictures
//! are those of new worlds, whose trees the host builds.

use std::sync::Arc;

use glam::{DVec3, Vec3, vec3};
use kdray::{
    accel::{
        AccelOptions, Query, Statistics,
        grid::GridOptions,
        kdtree::{BuildOptions, Traversal},
    },
    cast::{CpuCaster, GpuCaster, Hit, NO_TRIANGLE, QueryPoint, Ray},
    frame::{Denoise, Integrator, Picture, Primary, RenderOptions},
    gpu::{AnyBuffer, Context, GpuError},
    render::GpuRenderer,
    scene::{Instance, Light, Mesh, Scene},
    world::{FlatScene, World},
};

use super::{kept, mesh_of, scene_of, transform, transforms};
use crate::support::{assert_silent, device, meshes, random::Random};

/// The mesh of [`scene`] that is deformed and whose structure the device builds, one with a structure of the host, and
/// one like the first that is never deformed.
const LARGE: usize = 0;
const SMALL: usize = 1;
const RIGID: usize = 2;

/// A large mesh that occurs four times, once mirrored, a small one that occurs twice, and a large one that occurs once.
/// The corners of all have colours.
pub(super) fn scene() -> Scene {
    let mut scene = scene_of(&meshes::cube(19, 0.9), &transforms(2.5)[..4]);
    scene.meshes.push(mesh_of(&meshes::cube(6, 0.4)));
    scene.meshes.push(mesh_of(&meshes::torus(50, 24)));
    assert!(scene.meshes[RIGID].faces.len() >= 2048 && scene.meshes[SMALL].faces.len() < 2048);
    for (mesh_ix, at) in [(SMALL, vec3(0.0, 2.4, 0.0)), (SMALL, vec3(2.0, -2.0, 1.0)), (RIGID, vec3(3.0, 2.0, -1.0))] {
        let transform = transform(DVec3::splat(0.8), 0.5, at.as_dvec3());
        scene.instances.push(Instance { mesh_ix, transform, materials: vec![0], ..Instance::default() });
    }
    scene.meshes.iter_mut().for_each(|mesh| colour(mesh, 0));
    scene.lights = vec![Light::Point { position: vec3(1.0, 9.0, 4.0), intensity: Vec3::splat(90.0) }];
    scene.camera.eye = vec3(3.0, 2.0, 14.0);
    scene.camera.target = vec3(3.0, 0.0, 1.0);
    scene
}

fn colour(mesh: &mut Mesh, moment: u64) {
    let mut random = Random(moment + 5);
    let corner = |random: &mut Random| (0.5 + 0.5 * random.in_box(Vec3::ZERO, Vec3::ONE)).extend(1.0);
    mesh.colours = mesh.faces.iter().map(|_| [0; 3].map(|_| corner(&mut random))).collect();
}

/// Deforms a mesh in waves, and gives its corners other colours.
fn deform(mesh: &mut Mesh, moment: u64) {
    let wave = moment as f32;
    for p in &mut mesh.positions {
        *p *= 1.0 + 0.15 * (4.0 * p.y + wave).sin();
        p.x += 0.1 * (5.0 * p.z - wave).cos();
    }
    colour(mesh, moment);
}

/// Returns the world whose trees devices build.
pub(super) fn lazy(scene: &Scene) -> World {
    lazy_of(scene, &lazy_options()[0])
}

/// Returns the options of all structures that devices build: kd-trees first, then grids.
pub(super) fn lazy_options() -> [AccelOptions; 3] {
    let [grid, grid2] = [GridOptions::uniform(), GridOptions::two_level()].map(AccelOptions::Grid);
    [AccelOptions::LazyTree(BuildOptions::default()), grid, grid2]
}

/// Returns the world whose structures devices build.
pub(super) fn lazy_of(scene: &Scene, options: &AccelOptions) -> World {
    let flat = FlatScene::with_instances(scene).expect("a scene that fits together");
    World::with_accel(flat, options).expect("a world")
}

/// Returns the world of the next moment: the large mesh is deformed, at every other moment also the small one, and an
/// instance moves.
pub(super) fn next_moment(scene: &mut Scene, world: &World, moment: u64) -> World {
    let deformed = if moment.is_multiple_of(2) { vec![LARGE, SMALL] } else { vec![LARGE] };
    deformed.iter().for_each(|mesh_ix| deform(&mut scene.meshes[*mesh_ix], moment));
    let place = vec3(2.0, -1.8, moment as f32 * 0.3).as_dvec3();
    scene.instances[5].transform = transform(DVec3::ONE, 0.2 * moment as f64, place);
    let deformed = deformed.into_iter().map(|mesh_ix| (mesh_ix, None)).collect();
    world.posed(scene, &deformed).expect("a scene that fits together").expect("a pose")
}

fn rays(n: usize) -> Vec<Ray> {
    let mut random = Random(11);
    let ray = |_| {
        let origin = vec3(3.0, -1.0, 1.0) + 9.0 * random.direction();
        let direction = vec3(3.0, 0.0, 1.0) + 4.0 * random.in_box(Vec3::NEG_ONE, Vec3::ONE) - origin;
        Ray { origin, t_min: 0.0, direction, t_max: f32::INFINITY }
    };
    (0..n).map(ray).collect()
}

fn points(n: usize) -> Vec<QueryPoint> {
    let mut random = Random(12);
    let mut position = || vec3(3.0, 0.0, 1.0) + 4.0 * random.in_box(Vec3::NEG_ONE, Vec3::ONE);
    (0..n).map(|_| QueryPoint { position: position(), t_max: f32::INFINITY }).collect()
}

fn closest(caster: &mut GpuCaster, rays: &[Ray]) -> Vec<Hit> {
    caster.cast(rays, Query::Closest, 1).expect("hits").hits
}

/// Checks that all queries of rays have the same results in both, and those of points in kd-trees.
pub(super) fn check_queries(name: &str, expected: &mut GpuCaster, found: &mut GpuCaster) {
    let rays = rays(1000);
    let hits = closest(expected, &rays);
    assert!(hits.iter().filter(|hit| hit.triangle_ix != NO_TRIANGLE).count() > 100, "{name}");
    assert!(closest(found, &rays) == hits, "{name}: closest hits");
    let any = found.cast(&rays, Query::Any, 1).expect("hits").hits;
    let is_same = |(a, b): (&Hit, &Hit)| (a.triangle_ix == NO_TRIANGLE) == (b.triangle_ix == NO_TRIANGLE);
    assert!(any.iter().zip(&hits).all(is_same), "{name}: any hits");
    let [counts, expected_counts] = [&mut *found, expected].map(|it| it.count_hits(&rays).expect("counts"));
    assert!(counts == expected_counts, "{name}: counts");
    let [lists, expected_lists] = [&mut *found, expected].map(|it| it.all_hits(&rays, Some(4)).expect("lists"));
    assert!(lists == expected_lists, "{name}: lists");
    let points = points(300);
    let distances = |caster: &mut GpuCaster| {
        let found = caster.closest_points(&points, 1)?;
        Ok::<_, GpuError>(found.hits.iter().map(|hit| hit.t).collect::<Vec<_>>())
    };
    match distances(found) {
        Ok(near) => assert!(near == distances(expected).expect("points"), "{name}: closest points"),
        Err(error) => assert!(error.to_string().contains("found in kd-trees"), "{name}: {error}"),
    }
}

#[test]
fn queries_through_the_devices_trees_are_those_through_the_hosts() {
    let (context, scene) = (device(), scene());
    let (host, lazy) = (kept(&scene), lazy(&scene));
    let caster = |world: &World, traversal| GpuCaster::new(&context, world.geometry(), traversal).expect("a caster");
    assert_eq!(lazy.device_build(), None);
    for traversal in [Traversal::Mask, Traversal::Ropes, Traversal::MaskBoxes, Traversal::Backtrack] {
        let (mut expected, mut found) = (caster(&host, traversal), caster(&lazy, traversal));
        check_queries(&traversal.to_string(), &mut expected, &mut found);
    }
    let few = rays(200);
    let expected = closest(&mut caster(&host, Traversal::Brute), &few);
    assert!(closest(&mut caster(&lazy, Traversal::Mask), &few) == expected, "brute force");
    let report = lazy.device_build().expect("a report");
    assert!(report.stages.iter().any(|stage| stage.name == "kdtree_leaves"), "{report:?}");
    let (Statistics::KdTree(known), Statistics::KdTree(best)) = (lazy.statistics(), host.statistics()) else {
        panic!("both are kd-trees")
    };
    assert!(known.n_references.abs_diff(best.n_references) * 5 < best.n_references, "{known:?}, {best:?}");
    // The CPU builds its own trees.
    let on_cpu = |world: &World| CpuCaster::new(world.geometry(), Traversal::Mask).cast(&few, Query::Closest);
    assert!(on_cpu(&lazy) == on_cpu(&host));
    assert_silent(&context);
}

#[test]
fn queries_in_a_film_are_those_in_new_worlds() {
    let context = device();
    let [trees, grid, grid2] = &lazy_options();
    let cases =
        [(trees, Traversal::Mask), (trees, Traversal::Ropes), (grid, Traversal::Mask), (grid2, Traversal::Mask)];
    for (options, traversal) in cases {
        let mut scene = scene();
        let mut world = lazy_of(&scene, options);
        let mut caster = GpuCaster::new(&context, world.geometry(), traversal).expect("a caster");
        let first = world.clone();
        let mut on_cpu = CpuCaster::new(first.geometry(), traversal);
        for moment in 1..4 {
            let before = closest(&mut caster, &rays(1000));
            world = next_moment(&mut scene, &world, moment);
            caster.set_world(&world).expect("a change");
            let host = kept(&scene);
            let mut of_new = GpuCaster::new(&context, host.geometry(), traversal).expect("a caster");
            check_queries(&format!("{options:?}, {traversal}, moment {moment}"), &mut of_new, &mut caster);
            assert!(closest(&mut caster, &rays(1000)) != before, "the mesh is deformed");
            on_cpu.set_world(&world).expect("a change");
            let new = CpuCaster::new(host.geometry(), traversal);
            assert!(on_cpu.cast(&rays(200), Query::Closest) == new.cast(&rays(200), Query::Closest));
        }
        let error = caster.set_world(&kept(&scene)).expect_err("a refusal").to_string();
        assert!(error.contains("other geometries"), "{error}");
    }
    assert_silent(&context);
}

pub(super) fn options(integrator: Integrator) -> RenderOptions {
    let (primary, denoise) = (Primary::Trace, Denoise::Off);
    let size = RenderOptions { width: 60, height: 44, max_depth: 3, ..RenderOptions::default() };
    RenderOptions { integrator, primary, denoise, ..size }
}

pub(super) fn drawn(renderer: &mut GpuRenderer) -> Picture {
    renderer.render().expect("a picture").0
}

pub(super) fn renderer(context: &Arc<Context>, world: &World, integrator: Integrator) -> GpuRenderer {
    GpuRenderer::new(context.clone(), world, &options(integrator)).expect("a renderer")
}

/// Returns the arrays of triangles and structures.
fn arrays(renderer: &GpuRenderer) -> Vec<Arc<AnyBuffer>> {
    let arrays = &renderer.resources().accel.arrays;
    let of_trees = [arrays.kd_parents.any(), arrays.leaf_triangles.any(), arrays.leaf_planes.any()];
    [arrays.triangles.any(), arrays.kd_nodes.any(), arrays.kd_slabs.any(), arrays.grid_cells.any()]
        .into_iter()
        .chain(of_trees)
        .cloned()
        .collect()
}

fn are_same(a: &[Arc<AnyBuffer>], b: &[Arc<AnyBuffer>]) -> bool {
    a.iter().zip(b).all(|(a, b)| Arc::ptr_eq(a, b))
}

#[test]
fn pictures_of_a_film_are_those_of_new_worlds_in_the_same_arrays() {
    let context = device();
    let [trees, grid, grid2] = &lazy_options();
    for (integrator, options, last_stage) in [
        (Integrator::Whitted, trees, "kdtree_leaves"),
        (Integrator::Path, trees, "kdtree_leaves"),
        (Integrator::Whitted, grid, "grid_leaves"),
        (Integrator::Path, grid2, "grid_leaves"),
    ] {
        let mut scene = scene();
        let mut world = lazy_of(&scene, options);
        let mut film = renderer(&context, &world, integrator);
        let mut before = drawn(&mut film);
        let made = arrays(&film);
        let words = film.resources().accel.arrays.texture_words.clone();
        for moment in 1..4 {
            if moment == 3 {
                let Light::Point { position, .. } = &mut scene.lights[0] else { panic!("a point light") };
                position.x -= 4.0;
            }
            world = next_moment(&mut scene, &world, moment);
            film.set_world(&world).expect("a change");
            assert!(are_same(&made, &arrays(&film)), "{integrator}, moment {moment}: the arrays stay");
            let expected = drawn(&mut renderer(&context, &kept(&scene), integrator));
            let now = drawn(&mut film);
            let is_same = now.radiance == expected.radiance && now.display == expected.display;
            assert!(is_same, "{integrator}, moment {moment}");
            assert!(now.radiance != before.radiance, "the mesh is deformed");
            let report = world.device_build().expect("a report");
            assert_eq!(report.stages.iter().filter(|stage| stage.name == last_stage).count(), 1);
            before = now;
        }
        let keeps_words = Arc::ptr_eq(words.any(), film.resources().accel.arrays.texture_words.any());
        assert!(keeps_words || integrator == Integrator::Path, "only emitters take other words");
    }
    assert_silent(&context);
}

#[test]
fn an_update_makes_few_objects_and_a_failed_one_changes_nothing() {
    let context = device();
    lazy_options().iter().for_each(|options| update_with_failures(&context, options));
    assert_silent(&context);
}

fn update_with_failures(context: &Arc<Context>, options: &AccelOptions) {
    let mut scene = scene();
    let mut world = lazy_of(&scene, options);
    let mut film = renderer(context, &world, Integrator::Whitted);
    // The first one makes the builder.
    world = next_moment(&mut scene, &world, 1);
    film.set_world(&world).expect("a change");
    let before = drawn(&mut film);
    let next = next_moment(&mut scene, &world, 3);
    let n_creations = (0..)
        .find(|n| {
            context.fail_creations_after(Some(*n));
            let result = film.set_world(&next);
            context.fail_creations_after(None);
            if result.is_err() {
                assert!(drawn(&mut film).radiance == before.radiance, "after {n} creations");
            }
            result.is_ok()
        })
        .expect("a number");
    // Staging buffers, command buffers, the instances, the constants, and a descriptor set with its pool.
    assert!(n_creations <= 20, "{n_creations} creations");
    let expected = drawn(&mut renderer(context, &kept(&scene), Integrator::Whitted));
    assert!(drawn(&mut film).radiance == expected.radiance);
}

#[test]
fn a_structure_without_room_uploads_everything() {
    let context = device();
    lazy_options().iter().for_each(|options| outgrow(&context, options));
    assert_silent(&context);
}

fn outgrow(context: &Arc<Context>, options: &AccelOptions) {
    let mut scene = scene();
    let positions = scene.meshes[LARGE].positions.clone();
    scene.meshes[LARGE].positions.fill(Vec3::ONE);
    let world = lazy_of(&scene, options);
    let mut film = renderer(context, &world, Integrator::Whitted);
    let n_elements = |film: &GpuRenderer| {
        let arrays = &film.resources().accel.arrays;
        arrays.kd_nodes.len() + arrays.grid_cells.len()
    };
    let caster = GpuCaster::new(context, world.geometry(), Traversal::Mask).expect("a caster");
    let mut caster = caster.hiding(&[3, 9000]).expect("triangles of the world");
    let n_before = n_elements(&film);
    // A point becomes a ball.
    scene.meshes[LARGE].positions = positions;
    let grown = world.posed(&scene, &[(LARGE, None)].into()).expect("a scene that fits together").expect("a pose");
    film.set_world(&grown).expect("a change");
    caster.set_world(&grown).expect("a change");
    assert!(n_elements(&film) > n_before, "more room");
    let host = kept(&scene);
    assert!(drawn(&mut film).radiance == drawn(&mut renderer(context, &host, Integrator::Whitted)).radiance);
    let of_new = GpuCaster::new(context, host.geometry(), Traversal::Mask).expect("a caster");
    let mut of_new = of_new.hiding(&[3, 9000]).expect("triangles of the world");
    check_queries("grown", &mut of_new, &mut caster);
}

#[test]
fn renderers_that_share_arrays_show_their_own_worlds() {
    let context = device();
    lazy_options().iter().for_each(|options| share(&context, options));
    assert_silent(&context);
}

fn share(context: &Arc<Context>, options: &AccelOptions) {
    let mut scene = scene();
    let world = lazy_of(&scene, options);
    let mut film = renderer(context, &world, Integrator::Whitted);
    let mut other = film.sharing(&self::options(Integrator::Path)).expect("a renderer");
    let expected = drawn(&mut other);
    let next = next_moment(&mut scene, &world, 1);
    film.set_world(&next).expect("a change");
    assert!(!are_same(&arrays(&film), &arrays(&other)));
    assert!(drawn(&mut other).radiance == expected.radiance, "the other one is at the first moment");
    other.set_world(&next).expect("a change");
    for (renderer, integrator) in [(&mut film, Integrator::Whitted), (&mut other, Integrator::Path)] {
        let expected = drawn(&mut self::renderer(context, &kept(&scene), integrator));
        assert!(drawn(renderer).radiance == expected.radiance, "{integrator}");
    }
}
