//! Tests what is chosen and why: with invented times, with spoilt cache files, and with a real measurement.

mod support;

use std::{convert::Infallible, fs, path::PathBuf};

use glam::Vec3;
use kdray::{
    accel::{
        AccelOptions, Query,
        kdtree::{BuildOptions, Traversal},
    },
    cast::{GpuCaster, Ray},
    engine::choices::{
        Cache, Candidates, Chosen, Key, Reason, Request, Timings, TreeKind, Workload, measure_traversals,
    },
    frame::{Primary, RenderOptions},
    gpu::DeviceInfo,
    layout::Triangle,
    render::GpuRenderer,
    scene::{Camera, Projection},
    world::{FlatScene, World},
};
use support::{meshes, pretended, random::Random, scenes, with_lanes, world_by, world_of};
use tempfile::TempDir;

const RULE: Traversal = Traversal::OF_GPUS;

/// Returns the description of a device that does not exist.
fn device() -> DeviceInfo {
    DeviceInfo {
        index: 0,
        name: "Abacus 9".to_owned(),
        kind: "discrete GPU".to_owned(),
        driver: "beads 1.2".to_owned(),
        api_version: "1.3.0".to_owned(),
        subgroup_size: 32,
        memory_bytes: 1 << 30,
        missing: Vec::new(),
    }
}

fn key() -> Key {
    Key::new(&device(), &meshes::torus(40, 20), &AccelOptions::KdTree(BuildOptions::default()))
}

/// Returns the candidates of a run with enough rays for all traversals and for a measurement.
fn candidates() -> Candidates<Traversal> {
    Candidates::of_traversals(1600, u64::MAX).expect("enough triangles")
}

fn timings(mask: f64, stack: f64, ropes: f64) -> Timings {
    [(Traversal::Mask, mask), (Traversal::Stack, stack), (Traversal::Ropes, ropes)].into_iter().collect()
}

/// Returns what is chosen if a measurement gives these times.
fn choose(cache: &Cache, key: &Key, measured: Option<Timings>) -> Chosen<Traversal> {
    let measure = |_: &[Traversal]| Ok::<_, Infallible>(measured);
    candidates().choose(cache, key, RULE, measure).unwrap().0
}

/// Returns what is chosen where a measurement is an error.
fn choose_again(cache: &Cache, key: &Key, candidates: &Candidates<Traversal>) -> Chosen<Traversal> {
    let measure = |_: &[Traversal]| -> Result<_, Infallible> { panic!("it was measured before, or must not be") };
    candidates.choose(cache, key, RULE, measure).unwrap().0
}

fn chosen(value: Traversal, by: Reason) -> Chosen<Traversal> {
    Chosen { value, by }
}

/// Returns the only file in a cache.
fn only_file(folder: &TempDir) -> PathBuf {
    let mut files = fs::read_dir(folder).unwrap();
    let file = files.next().expect("a file").unwrap().path();
    assert!(files.next().is_none());
    file
}

#[test]
fn another_traversal_is_taken_only_if_it_is_quicker_by_more_than_noise() {
    for (times, quickest) in [
        (timings(1.0, 0.96, 0.99), Traversal::Stack),
        (timings(1.0, 0.96, 0.95), Traversal::Ropes),
        (timings(1.0, 0.98, 0.975), Traversal::Mask),
        (timings(1.0, 1.1, 1.2), Traversal::Mask),
    ] {
        let folder = TempDir::new().unwrap();
        let found = choose(&Cache::at(folder.path()), &key(), Some(times.clone()));
        assert_eq!(found, chosen(quickest, Reason::Measured), "{times:?}");
    }
}

#[test]
fn without_times_the_rule_decides() {
    let folder = TempDir::new().unwrap();
    let cache = Cache::at(folder.path());
    for times in [None, Some(timings(1.0, f64::NAN, 0.5)), Some(timings(1.0, 0.0, 0.5))] {
        assert_eq!(choose(&cache, &key(), times), chosen(RULE, Reason::Rule));
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 0);
    }
}

#[test]
fn what_was_measured_once_decides_in_later_runs() {
    let folder = TempDir::new().unwrap();
    let below = folder.path().join("not yet").join("there");
    let cache = Cache::at(&below);
    let times = timings(1.0, 0.9, 0.8);
    assert_eq!(choose(&cache, &key(), Some(times.clone())), chosen(Traversal::Ropes, Reason::Measured));
    assert_eq!(cache.get(&key()), Some(times));
    for _ in 0..2 {
        let found = choose_again(&Cache::at(&below), &key(), &candidates());
        assert_eq!(found, chosen(Traversal::Ropes, Reason::Cached));
    }
    // One frame pays neither for a measurement nor for ropes, but an earlier run has paid.
    let few = Candidates::of_traversals(1600, 1 << 20).expect("enough triangles");
    assert!(!few.may_measure && !few.methods.contains(&Traversal::Ropes));
    assert_eq!(choose_again(&cache, &key(), &few), chosen(Traversal::Stack, Reason::Cached));
    let nothing = TempDir::new().unwrap();
    assert_eq!(choose_again(&Cache::at(nothing.path()), &key(), &few), chosen(RULE, Reason::Rule));
}

#[test]
fn another_device_driver_scene_or_tree_is_measured_anew() {
    let folder = TempDir::new().unwrap();
    let cache = Cache::at(folder.path());
    choose(&cache, &key(), Some(timings(1.0, 0.9, 0.95)));
    let (triangles, options) = (meshes::torus(40, 20), AccelOptions::KdTree(BuildOptions::default()));
    let mut moved = triangles.clone();
    moved[7].v1.x = moved[7].v1.x.next_up();
    let others = [
        Key::new(&DeviceInfo { name: "Abacus 10".to_owned(), ..device() }, &triangles, &options),
        Key::new(&DeviceInfo { driver: "beads 1.3".to_owned(), ..device() }, &triangles, &options),
        Key::new(&device(), &moved, &options),
        Key::new(&device(), &triangles, &AccelOptions::KdTree(BuildOptions::fast())),
    ];
    for other in &others {
        assert_eq!(cache.get(other), None, "{other:?}");
    }
    assert_eq!(Key::new(&DeviceInfo { index: 3, ..device() }, &triangles, &options), key());
}

#[test]
fn a_spoilt_file_counts_as_none_and_is_written_anew() {
    let folder = TempDir::new().unwrap();
    let cache = Cache::at(folder.path());
    let times = timings(1.0, 0.9, 0.95);
    choose(&cache, &key(), Some(times.clone()));
    let file = only_file(&folder);
    let good = fs::read_to_string(&file).unwrap();
    let spoilt = [
        String::new(),
        good[..good.len() / 2].to_owned(),
        good.replace("stack", "bvh"),
        good.replace("0.9,", "-0.9,").replace("0.9\n", "-0.9\n"),
        good.replace("beads 1.2", "beads 1.3"),
        good.replace("1.0", "\"fast\""),
        "\u{0}\u{1}".repeat(1 << 17),
    ];
    for text in &spoilt {
        assert_ne!(text, &good);
        fs::write(&file, text).unwrap();
        let is_known = cache.get(&key()).is_some_and(|times| times.is_sound::<Traversal>());
        assert!(!is_known, "{text:.200}");
        assert_eq!(choose(&cache, &key(), Some(times.clone())), chosen(Traversal::Stack, Reason::Measured));
        assert_eq!(fs::read_to_string(only_file(&folder)).unwrap(), good);
    }
}

#[test]
fn a_folder_that_cannot_be_written_is_no_error() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("a file");
    fs::write(&file, "").unwrap();
    for at in [file.clone(), file.join("below it")] {
        let found = choose(&Cache::at(&at), &key(), Some(timings(1.0, 0.9, 0.95)));
        assert_eq!(found, chosen(Traversal::Stack, Reason::Measured));
        assert_eq!(Cache::at(&at).get(&key()), None);
    }
}

#[test]
fn small_scenes_and_short_runs_are_not_measured() {
    assert_eq!(Candidates::of_traversals(999, u64::MAX), None);
    let may_measure =
        |n_triangles, n_rays| Candidates::of_traversals(n_triangles, n_rays).expect("enough triangles").may_measure;
    // The rays of a frame of 1024x768 with three lights. The long run has 256 samples of it.
    let frame = 1024 * 768 * 8;
    assert!(!may_measure(11_141, frame) && !may_measure(872_870, frame));
    assert!(may_measure(11_141, 256 * frame) && may_measure(872_870, 256 * frame));
    assert!(!may_measure(10_000_000, 256 * frame));
}

/// Returns a torus of some thousand triangles.
fn scene() -> FlatScene {
    let mut scene = scenes::empty();
    scenes::add(&mut scene, meshes::torus(80, 40), scenes::diffuse(Vec3::ONE));
    scene
}

fn hits(context: &std::sync::Arc<kdray::gpu::Context>, world: &World, by: Traversal) -> Vec<[u32; 4]> {
    let mut random = Random(5);
    let ray = |_| {
        let (origin, target) = (3.0 * random.direction(), random.in_box(Vec3::NEG_ONE, Vec3::ONE));
        Ray { origin, t_min: 0.0, direction: target - origin, t_max: f32::INFINITY }
    };
    let rays: Vec<_> = (0..3000).map(ray).collect();
    let mut caster = GpuCaster::new(context, world.geometry(), by).expect("a caster");
    bytemuck::cast_slice(&caster.cast(&rays, Query::Closest, 1).expect("a cast").hits).to_vec()
}

/// A software driver that is treated as a GPU measures as a GPU. Whatever it finds, the hits are the same.
#[test]
fn a_measurement_changes_no_bit_and_is_kept() {
    let (scene, folder, context) = (scene(), TempDir::new().unwrap(), with_lanes(5000));
    let world = world_of(&scene);
    let tried = candidates().methods;
    let timings = measure_traversals(&context, &world, &tried).expect("a measurement").expect("timestamps");
    assert!(
        timings.is_sound::<Traversal>() && tried.iter().all(|&traversal| timings.of(traversal).is_some()),
        "{timings:?}"
    );
    let expected = hits(&context, &world, RULE);
    for traversal in tried {
        assert!(hits(&context, &world, traversal) == expected, "{traversal}");
    }
    let cache = Cache::at(folder.path());
    let methods = |request: Request, workload| {
        let methods = request.methods(Some(&context), &world, &workload, &cache);
        methods.expect("methods")
    };
    let window = Workload::of_window((160, 120));
    let first = methods(Request::default(), window);
    assert_eq!(first.traversal.by, Reason::Measured);
    assert!(first.traversal_ns.is_some() && only_file(&folder).exists());
    let second = methods(Request::default(), window);
    assert_eq!(second.traversal, chosen(first.traversal.value, Reason::Cached));
    assert_eq!(second.traversal_ns, first.traversal_ns);
    let pinned = Request { traversal: Some(Traversal::Restart), ..Request::default() };
    assert_eq!(methods(pinned, window).traversal, chosen(Traversal::Restart, Reason::Pinned));
    // What rays cost depends on the traversal, so the rule decides.
    let costs = Workload { shows_costs: true, ..window };
    assert_eq!(methods(Request::default(), costs).traversal, chosen(RULE, Reason::Rule));
    assert_eq!(context.validation_messages(), Vec::<String>::new());
}

/// Primary rays have the same hits whether kernels rasterize them or trace them, unless the camera is far away. Then
/// a rule decides.
#[test]
fn primary_rays_are_measured_where_that_changes_no_bit() {
    let (scene, folder, context) = (scene(), TempDir::new().unwrap(), with_lanes(5000));
    assert!(context.has_int64_atomics(), "the device rasterizes by kernels");
    let world = world_of(&scene);
    let cache = Cache::at(folder.path());
    let options = RenderOptions { width: 60, height: 45, max_depth: 2, ..RenderOptions::default() };
    let request = Request { traversal: Some(Traversal::Mask), ..Request::default() };
    let primary_of = |workload: Workload| {
        let methods = request.methods(Some(&context), &world, &workload, &cache);
        methods.expect("methods").primary
    };
    let many = Workload { n_rays: u64::MAX, ..Workload::of_pictures(&options, 0, 1) };
    let far = Camera { eye: Vec3::Z * 1e3, ..scene.camera };
    let wide = Camera { projection: Projection::Orthographic { height: 1e3 }, ..scene.camera };
    for unknown in [many, many.with_cameras([scene.camera, far].iter()), many.with_cameras([wide].iter())] {
        assert_eq!(primary_of(unknown), Chosen { value: Primary::SoftwareRaster, by: Reason::Rule });
    }
    let near = many.with_cameras([scene.camera].iter());
    let (first, second) = (primary_of(near), primary_of(near));
    assert_eq!((first.by, second), (Reason::Measured, Chosen { by: Reason::Cached, ..first }));
    let other_size = Workload { size: (61, 45), n_rays: 1, ..near };
    assert_eq!(primary_of(other_size).by, Reason::Rule);
    let pictures = [Primary::SoftwareRaster, Primary::Trace].map(|primary| {
        let options = RenderOptions { primary, ..options.clone() };
        let mut renderer = GpuRenderer::new(context.clone(), &world, &options).expect("a renderer");
        renderer.render().expect("a frame").0
    });
    assert!(pictures[0] == pictures[1]);
    assert_eq!(context.validation_messages(), Vec::<String>::new());
}

#[test]
fn nothing_is_measured_where_the_cpu_runs_the_kernels() {
    let (scene, folder, context) = (scene(), TempDir::new().unwrap(), pretended(Default::default()));
    let build_options = TreeKind::Best.options(kdray::engine::choices::Processor::of(Some(&context)));
    let world = world_by(&scene, &build_options);
    let cache = Cache::at(folder.path());
    let window = Workload::of_window((160, 120));
    let used = if context.is_software() { vec![None, Some(&context)] } else { vec![None] };
    for context in used {
        let methods = Request::default().methods(context, &world, &window, &cache);
        assert_eq!(methods.expect("methods").traversal.by, Reason::Rule);
    }
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 0);
}

/// Triangles in another order are another scene, because their ids differ.
#[test]
fn keys_see_the_order_of_triangles() {
    let triangles: Vec<Triangle> = meshes::torus(40, 20);
    let reversed: Vec<Triangle> = triangles.iter().rev().copied().collect();
    let key = |triangles: &[Triangle]| Key::new(&device(), triangles, &AccelOptions::KdTree(BuildOptions::default()));
    assert_eq!(key(&triangles), key(&triangles.clone()));
    assert_ne!(key(&triangles), key(&reversed));
}
