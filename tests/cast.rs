//! Compares casts on the device, under the validation layer, and on the CPU with brute force over all triangles.

mod support;

use std::{
    ops::RangeInclusive,
    sync::{
        Arc, Mutex,
        atomic::{AtomicUsize, Ordering},
    },
};

use fearless_simd::Level;
use glam::{Vec3, vec3};
use kdray::{
    accel::{
        Accel, AccelOptions, Query,
        grid::GridOptions,
        kdtree::{BuildOptions, Traversal},
        wide_bvh::WideBvh,
    },
    cast::{CpuCaster, GpuCaster, Hit, NO_TRIANGLE, QueryPoint, RAYS_PER_CHUNK, Ray, StreamRay, cast_on_cpu},
    cpu::wide_traverser::WideTraverser,
    gpu::{Context, DeviceOverrides},
    layout::{KD_MAX_DEPTH, KD_WORD_DEPTH, PathRay},
    reference::{cast::cast_by, search_ray::SearchRay, traversal_ray::near_scene},
    world::Geometry,
};
use rayon::{ThreadPoolBuilder, prelude::*};
use support::{
    MeshWithTree,
    chain::chain,
    compare, device, meshes, pretended,
    random::Random,
    rays::{nasty_ray, ray, streamed},
    with_lanes,
};

const MISS: Hit = Hit { t: f32::INFINITY, triangle_ix: NO_TRIANGLE, u: 0.0, v: 0.0 };

/// A device under validation. When it is dropped, there must be no validation messages.
struct Device(Arc<Context>);

impl Device {
    fn new() -> Self {
        Self(device())
    }

    /// Opens a device that runs kernels as a GPU of `n_lanes` lanes does, whatever it is.
    fn with_lanes(n_lanes: u32) -> Self {
        Self(with_lanes(n_lanes))
    }

    fn caster(&self, world: &MeshWithTree, traversal: Traversal) -> GpuCaster {
        GpuCaster::new(&self.0, world.geometry(), traversal).expect("a caster")
    }

    /// Returns the number of rays that may differ from the CPU's. It is 0 where the arithmetic is exactly the CPU's.
    /// Elsewhere divisions are 2.5 units in the last place off, and a few rays at edges hit other triangles.
    fn n_outliers(&self, n_rays: usize) -> usize {
        if self.0.is_software() { 0 } else { n_rays.div_ceil(500) }
    }

    /// Succeeds if the hits are as expected.
    fn agree(&self, expected: &[Hit], found: &[Hit]) -> Result<(), String> {
        compare::exact_or_hits(self.n_outliers(found.len()), expected, found)
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            assert_eq!(self.0.validation_messages(), Vec::<String>::new());
        }
    }
}

/// Returns a ray to cast whose direction is `scale` times as long as that of `ray`.
fn scaled(ray: &PathRay, t_min: f32, scale: f32) -> Ray {
    Ray { origin: ray.origin, t_min, direction: ray.direction * scale, t_max: ray.t_max / scale }
}

/// Returns nasty rays with directions of all lengths. A fourth of them begin behind their origins or before them.
fn some_rays(world: &MeshWithTree, n: usize, scale_log2: RangeInclusive<f32>) -> Vec<Ray> {
    let some_ray = |i: usize| {
        let mut random = Random(i as u64);
        let ray = nasty_ray(&mut random, world, i);
        let scale = 2f32.powf(random.between(*scale_log2.start(), *scale_log2.end()));
        let t_min = if i.is_multiple_of(4) { random.between(-1.0, 1.0) * world.radius() / scale } else { 0.0 };
        scaled(&ray, t_min, scale)
    };
    (0..n).map(some_ray).collect()
}

fn bare(ray: &Ray) -> [f32; 6] {
    let ([x, y, z], [dx, dy, dz]) = (ray.origin.to_array(), ray.direction.to_array());
    [x, y, z, dx, dy, dz]
}

/// Finds the hit without the tree, and with the direction as it is.
fn by_brute_force(world: &MeshWithTree, cast: &Ray) -> Hit {
    let ray = PathRay { t_max: cast.t_max, ..ray(cast.origin, cast.direction) };
    let hit = world.by_brute_force(&ray, cast.t_min);
    if hit.triangle_ix == NO_TRIANGLE { MISS } else { hit }
}

fn all_by_brute_force(world: &MeshWithTree, rays: &[Ray]) -> Vec<Hit> {
    rays.par_iter().map(|ray| by_brute_force(world, ray)).collect()
}

/// Tells whether the hits are of the same triangle and equal within rounding, in whatever unit t is.
fn is_close(a: &Hit, b: &Hit) -> bool {
    let unit = |hit: &Hit| Hit { t: hit.t / a.t, ..*hit };
    a == b || (a.triangle_ix == b.triangle_ix && compare::hits(0, &[unit(a)], &[unit(b)]).is_ok())
}

/// Returns whether each ray hits anything.
fn occluded(hits: &[Hit]) -> Vec<bool> {
    hits.iter().map(|hit| hit.triangle_ix != NO_TRIANGLE).collect()
}

fn check(device: &Device, world: &MeshWithTree, rays: &[Ray]) {
    let all_expected = all_by_brute_force(world, rays);
    for &traversal in Traversal::ALL {
        // The default traversal is tested with more rays than the others, which have their own tests.
        let n = if traversal == Traversal::Mask { rays.len() } else { rays.len() / 20 };
        let (rays, expected) = (&rays[..n], &all_expected[..n]);
        let n_outliers = device.n_outliers(n);
        let on_cpu = |query| cast_on_cpu(world.geometry(), traversal, rays, query);
        compare::exact(expected, &on_cpu(Query::Closest)).unwrap();
        assert_eq!(occluded(expected), occluded(&on_cpu(Query::Any)));
        let mut caster = device.caster(world, traversal);
        let closest = caster.cast(rays, Query::Closest, 1).expect("a cast");
        device.agree(expected, &closest.hits).unwrap();
        let any = caster.cast(rays, Query::Any, 1).expect("a cast");
        let (expected, found) = (occluded(expected), occluded(&any.hits));
        assert!(expected.iter().zip(&found).filter(|(a, b)| a != b).count() <= n_outliers);
        assert_eq!((closest.n_invalid, any.n_invalid), (0, 0));
    }
}

/// Returns meshes of all shapes, sizes and places.
fn worlds() -> impl Iterator<Item = MeshWithTree> {
    let meshes = [
        meshes::torus(40, 20),
        meshes::cube(9, 0.0),
        meshes::cube(10, 1.0),
        meshes::threefold(meshes::torus(20, 10)),
        meshes::soup(1200, 7),
        meshes::placed(meshes::torus(40, 20), 1e-6, Vec3::ZERO),
        meshes::placed(meshes::torus(40, 20), 0.3, vec3(1000.0, -70.0, 3.0)),
        vec![meshes::triangle(Vec3::X, Vec3::Y, Vec3::Z)],
    ];
    meshes.into_iter().map(MeshWithTree::new)
}

#[test]
fn finds_what_brute_force_finds() {
    let device = Device::new();
    for world in worlds() {
        check(&device, &world, &some_rays(&world, 20_000, -20.0..=20.0));
    }
}

/// Every query through trees that the device builds finds what it finds through the host's trees.
#[test]
fn a_device_s_tree_has_the_same_hits() {
    let device = Device::new();
    for world in worlds() {
        let lazy = Accel::new(&world.triangles, &AccelOptions::LazyTree(BuildOptions::default()));
        let geometry = Geometry::new(&world.triangles, &lazy).expect("a tree of these triangles");
        let flat = Geometry::new(&world.triangles, &world.accel).expect("a tree of these triangles");
        let of = |geometry| GpuCaster::new(&device.0, geometry, Traversal::Mask).expect("a caster");
        let (mut expected, mut found) = (of(flat), of(geometry));
        assert!(matches!(&lazy, Accel::LazyTree(tree) if tree.device_build().is_some()));
        let rays = some_rays(&world, 4000, -20.0..=20.0);
        for query in [Query::Closest, Query::Any] {
            let [expected, found] =
                [&mut expected, &mut found].map(|it| it.cast(&rays, query, 1).expect("a cast").hits);
            match query {
                Query::Closest => compare::exact(&expected, &found).unwrap(),
                Query::Any => assert_eq!(occluded(&expected), occluded(&found)),
            }
        }
        let [counts, of_lazy] = [&mut expected, &mut found].map(|it| it.count_hits(&rays).expect("counts"));
        assert_eq!(counts, of_lazy);
        let [lists, of_lazy] = [&mut expected, &mut found].map(|it| it.all_hits(&rays, None).expect("hits"));
        assert_eq!(lists, of_lazy);
        let points: Vec<_> = rays.iter().map(|ray| QueryPoint { position: ray.origin, t_max: f32::INFINITY }).collect();
        let [nearest, of_lazy] =
            [&mut expected, &mut found].map(|it| it.closest_points(&points, 1).expect("points").hits);
        compare::exact(&nearest, &of_lazy).unwrap();
    }
}

#[test]
fn lanes_apart_find_the_same() {
    let device = Device::with_lanes(5000);
    // Only some meshes are tested, since a software driver takes long to compile the kernels.
    for world in worlds().step_by(3) {
        check(&device, &world, &some_rays(&world, 4000, -20.0..=20.0));
    }
}

#[test]
fn a_mask_of_two_words_finds_the_same() {
    let world = chain(KD_MAX_DEPTH - 2);
    assert!(world.tree().depth() > KD_WORD_DEPTH);
    for device in [Device::new(), Device::with_lanes(5000)] {
        // For rays towards the chain's root, every level is pending.
        check(&device, &world, &some_rays(&world, 4000, 0.0..=0.0));
    }
}

#[test]
fn any_number_of_rays_in_batches_of_any_size() {
    // First with two or more lanes for each ray, then with one.
    any_number_on(&Device::with_lanes(2000));
    any_number_on(&Device::new());
}

fn any_number_on(device: &Device) {
    let world = MeshWithTree::new(meshes::torus(40, 20));
    for n in [0, 1, 63, 64, 65, 1000] {
        let rays = some_rays(&world, n, 0.0..=0.0);
        let expected = all_by_brute_force(&world, &rays);
        for n_in_batch in [1, 64, 100, 999, 1000, usize::MAX] {
            if n_in_batch == 1 && n > 65 {
                continue; // a thousand submits
            }
            let mut caster = device.caster(&world, Traversal::Mask).with_batches_of(n_in_batch);
            let cast = caster.cast(&rays, Query::Closest, 1).expect("a cast");
            device.agree(&expected, &cast.hits).unwrap();
        }
    }
}

/// The same caster casts more rays, fewer, and other ones. Nothing of the previous cast remains.
#[test]
fn casts_follow_one_another() {
    let device = Device::new();
    let world = MeshWithTree::new(meshes::cube(9, 0.0));
    let mut caster = device.caster(&world, Traversal::Mask).with_batches_of(300);
    for n in [10, 1000, 5, 0, 250] {
        let rays = some_rays(&world, n, -1.0..=1.0);
        let cast = caster.cast(&rays, Query::Closest, 1).expect("a cast");
        device.agree(&all_by_brute_force(&world, &rays), &cast.hits).unwrap();
    }
}

/// Parts of streams are cast at the same time, and find the hits that a cast finds.
#[test]
fn streams_find_the_hits_of_casts() {
    let limits = DeviceOverrides { loop_limit: Some(100), n_suspension_slots: Some(40), ..Default::default() };
    let copies = DeviceOverrides { copies_inputs: true, ..Default::default() };
    for device in [Device::new(), Device(pretended(limits)), Device(pretended(copies))] {
        let world = MeshWithTree::new(meshes::torus(40, 20));
        let rays = some_rays(&world, 1000, 0.0..=0.0);
        let mut caster = device.caster(&world, Traversal::Mask).with_batches_of(130);
        let on_cpu = CpuCaster::new(world.geometry(), Traversal::OF_CPU);
        for (query, n) in [(Query::Closest, 1000), (Query::Any, 999), (Query::Closest, 3), (Query::Closest, 0)] {
            let expected = caster.cast(&rays[..n], query, 1).expect("a cast").hits;
            assert_eq!(streamed::<_, Hit>(&mut caster, &rays[..n], query), expected, "{query:?} {n}");
            let ts: Vec<f32> = expected.iter().map(|hit| hit.t).collect();
            assert_eq!(streamed::<_, f32>(&mut caster, &rays[..n], query), ts, "{query:?} {n}");
            let bare: Vec<_> = rays[..n].iter().map(bare).collect();
            let whole: Vec<_> = bare.iter().map(StreamRay::to_ray).collect();
            let expected = caster.cast(&whole, query, 1).expect("a cast").hits;
            assert_eq!(streamed::<_, Hit>(&mut caster, &bare, query), expected, "{query:?} {n}");
            let ts: Vec<f32> = expected.iter().map(|hit| hit.t).collect();
            assert_eq!(streamed::<_, f32>(&mut caster, &bare, query), ts, "{query:?} {n}");
            let of_cpu = Mutex::new(vec![0.0; n]);
            let make = |first: usize, rays: &mut [[f32; 6]]| rays.copy_from_slice(&bare[first..][..rays.len()]);
            let take = |first: usize, ts: &[f32]| of_cpu.lock().unwrap()[first..][..ts.len()].copy_from_slice(ts);
            on_cpu.cast_stream(n, query, make, take);
            let expected: Vec<f32> = on_cpu.cast(&whole, query).iter().map(|hit| hit.t).collect();
            assert_eq!(of_cpu.into_inner().unwrap(), expected, "{query:?} {n}");
        }
        // A lane that has too little memory for a stream is replaced by a larger one, which serves later streams.
        let mut growing = device.caster(&world, Traversal::Mask);
        let hits = caster.cast(&rays, Query::Closest, 1).expect("a cast").hits;
        let ts: Vec<f32> = hits.iter().map(|hit| hit.t).collect();
        assert_eq!(streamed::<_, f32>(&mut growing, &rays[..100], Query::Closest), ts[..100]);
        assert_eq!(streamed::<_, Hit>(&mut growing, &rays, Query::Closest), hits);
        assert_eq!(streamed::<_, f32>(&mut growing, &rays, Query::Closest), ts);
        let found: Vec<Hit> = streamed(&mut caster, &rays, Query::Closest);
        assert!(found.iter().filter(|hit| **hit != MISS).count() > 100);
        let hidden: Vec<u32> = found.iter().map(|hit| hit.triangle_ix).filter(|ix| *ix != NO_TRIANGLE).collect();
        let mut caster = caster.hiding(&hidden).expect("a caster");
        let expected = caster.cast(&rays, Query::Closest, 1).expect("a cast").hits;
        assert_ne!(expected, found);
        assert_eq!(streamed::<_, Hit>(&mut caster, &rays, Query::Closest), expected);
    }
}

/// Every chunk is whole but for the last, however many threads and submissions there are.
#[test]
fn streams_come_in_chunks() {
    let device = Device::new();
    let world = MeshWithTree::new(meshes::cube(9, 0.0));
    let rays = some_rays(&world, 5 * RAYS_PER_CHUNK + 77, -1.0..=1.0);
    let mut caster = device.caster(&world, Traversal::Mask).with_batches_of(2 * RAYS_PER_CHUNK + 999);
    let on_cpu = CpuCaster::new(world.geometry(), Traversal::OF_CPU);
    let expected = caster.cast(&rays, Query::Closest, 1).expect("a cast").hits;
    for (n_threads, n) in
        [(1, rays.len()), (3, rays.len()), (3, RAYS_PER_CHUNK), (1, RAYS_PER_CHUNK + 1), (3, 7), (2, rays.len())]
    {
        let pool = ThreadPoolBuilder::new().num_threads(n_threads).build().expect("threads");
        for is_on_cpu in [false, true] {
            let n_made = AtomicUsize::new(0);
            let check = |first: usize, len: usize| {
                assert!(first.is_multiple_of(RAYS_PER_CHUNK) && len == RAYS_PER_CHUNK.min(n - first), "{first} {len}");
            };
            let make = |first: usize, chunk: &mut [Ray]| {
                check(first, chunk.len());
                n_made.fetch_add(chunk.len(), Ordering::Relaxed);
                chunk.copy_from_slice(&rays[first..][..chunk.len()]);
            };
            let n_taken = AtomicUsize::new(0);
            let take = |first: usize, hits: &[Hit]| {
                check(first, hits.len());
                n_taken.fetch_add(hits.len(), Ordering::Relaxed);
                device.agree(&expected[first..][..hits.len()], hits).unwrap();
            };
            pool.install(|| match is_on_cpu {
                true => on_cpu.cast_stream(n, Query::Closest, make, take),
                false => caster.cast_stream(n, Query::Closest, make, take).expect("a stream"),
            });
            assert_eq!((n_made.into_inner(), n_taken.into_inner()), (n, n));
        }
    }
}

#[test]
fn repetitions_are_timed_one_by_one() {
    let device = Device::new();
    let world = MeshWithTree::new(meshes::torus(40, 20));
    let rays = some_rays(&world, 1000, 0.0..=0.0);
    let mut caster = device.caster(&world, Traversal::Mask).with_batches_of(300);
    let once = caster.cast(&rays, Query::Closest, 1).expect("a cast");
    let often = caster.cast(&rays, Query::Closest, 5).expect("a cast");
    assert_eq!(once.hits, often.hits);
    let times = often.gpu_ms.expect("the device has timestamps");
    assert!(times.len() == 5 && times.iter().all(|ms| *ms > 0.0 && ms.is_finite()), "{times:?}");
    assert_eq!(caster.cast(&[], Query::Closest, 3).expect("a cast").gpu_ms, Some(vec![0.0; 3]));
}

/// The interval contains its far end and not its near one, to the last bit if the origin is not moved.
#[test]
fn the_interval_s_ends_are_exact() {
    let device = Device::new();
    let world = MeshWithTree::new(meshes::torus(40, 20));
    let is_near =
        |cast: &Ray| near_scene(&world.inputs(), &SearchRay::from(&ray(cast.origin, cast.direction))).1 == 0.0;
    let rays: Vec<_> = some_rays(&world, 5000, -9.0..=9.0).into_iter().filter(is_near).collect();
    let mut caster = device.caster(&world, Traversal::Mask);
    let mut cast = |rays: &[Ray]| {
        let on_cpu = cast_on_cpu(world.geometry(), Traversal::Mask, rays, Query::Closest);
        let found = caster.cast(rays, Query::Closest, 1).expect("a cast").hits;
        device.agree(&on_cpu, &found).unwrap();
        found
    };
    let first = cast(&rays);
    let (rays, first): (Vec<_>, Vec<_>) = rays.into_iter().zip(first).filter(|(_, hit)| hit.t.is_normal()).unzip();
    assert!(first.len() > 1000);
    let with = |ends: &dyn Fn(&Ray, f32) -> Ray| -> Vec<_> {
        rays.iter().zip(&first).map(|(ray, hit)| ends(ray, hit.t)).collect()
    };
    let before = cast(&with(&|ray, t| Ray { t_max: t.next_down(), ..*ray }));
    let wrong = before.iter().position(|hit| *hit != MISS).map(|i| (&rays[i], &first[i], &before[i]));
    assert_eq!(wrong, None, "a hit beyond the end");
    assert_eq!(cast(&with(&|ray, t| Ray { t_max: t, ..*ray })), first);
    assert_eq!(cast(&with(&|ray, t| Ray { t_min: t.next_down(), ..*ray })), first);
    let behind = cast(&with(&|ray, t| Ray { t_min: t, ..*ray }));
    assert!(behind.iter().zip(&first).all(|(hit, first)| hit.t > first.t));
    let empty = cast(&with(&|ray, t| Ray { t_min: t.next_up(), t_max: t.next_down(), ..*ray }));
    assert!(empty.iter().all(|hit| *hit == MISS));
}

/// Returns rays at a mesh from so far away that their origins are moved near it. Every fourth begins behind its origin.
fn rays_from_afar(world: &MeshWithTree, n: usize) -> Vec<Ray> {
    let ray = |i: usize| {
        let mut random = Random(i as u64);
        let within = random.in_box(world.tree().box_min(), world.tree().box_max());
        let distance = world.radius() * 2f32.powf(random.between(1.0, 9.0));
        let towards = random.direction();
        let (scale, t_min) = (2f32.powf(random.between(-9.0, 9.0)), if i.is_multiple_of(4) { -1e9 } else { 0.0 });
        let ray = ray(within - distance * towards, if i.is_multiple_of(8) { -towards } else { towards });
        scaled(&ray, t_min, scale)
    };
    (0..n).map(ray).collect()
}

/// A way to cast rays: its name, and what casts.
type Way<'a> = (String, Box<dyn FnMut(&[Ray], Query) -> Vec<Hit> + 'a>);

/// Returns how rays can be cast into a mesh: on the device and on the CPU, by each algorithm and structure.
fn ways_to_cast<'a>(
    device: &Device,
    world: &'a MeshWithTree,
    (grids, bvh): (&'a [Accel], &'a WideBvh),
) -> Vec<Way<'a>> {
    let trees = Traversal::ALL.iter().map(|&traversal| (traversal, world.geometry()));
    let of_grid = |grid| (Traversal::Mask, Geometry::new(&world.triangles, grid).expect("a grid of these triangles"));
    let mut ways: Vec<Way> = Vec::new();
    for (way_ix, (traversal, geometry)) in trees.chain(grids.iter().map(of_grid)).enumerate() {
        let name = format!("{way_ix}: {} by {traversal}", geometry.accel().kind());
        let mut caster = GpuCaster::new(&device.0, geometry, traversal).expect("a caster");
        let on_device = move |rays: &[Ray], query| caster.cast(rays, query, 1).expect("a cast").hits;
        ways.push((format!("{name} on the device"), Box::new(on_device)));
        let on_cpu = move |rays: &[Ray], query| cast_on_cpu(geometry, traversal, rays, query);
        ways.push((name, Box::new(on_cpu)));
    }
    let one_by_one = move |rays: &[Ray], query| {
        let mut hits = vec![MISS; rays.len()];
        cast_by(&world.inputs(), || WideTraverser::new(bvh, Level::new()), query, rays, &mut hits);
        hits
    };
    ways.push(("one by one".to_owned(), Box::new(one_by_one)));
    ways
}

/// The t of a ray whose origin is moved is a rounded sum. It is in the ray's interval nevertheless.
#[test]
fn hits_of_moved_rays_are_in_the_interval() {
    let device = Device::new();
    let ground = meshes::triangle(vec3(-4e4, -1.0, -4e4), vec3(4e4, -1.0, -4e4), vec3(0.0, -1.0, 4e4));
    let on_ground = [meshes::cube(9, 0.0), vec![ground]].concat();
    for triangles in [meshes::cube(2, 0.0), meshes::placed(meshes::torus(40, 20), 0.3, vec3(9.0, -7.0, 3.0)), on_ground]
    {
        let world = MeshWithTree::new(triangles);
        let options = [GridOptions::uniform(), GridOptions::two_level()].map(AccelOptions::Grid);
        let grids = options.map(|options| Accel::new(&world.triangles, &options));
        let bvh = WideBvh::new(world.tree(), &world.triangles);
        let rays = rays_from_afar(&world, 6000);
        for (name, mut cast) in ways_to_cast(&device, &world, (&grids, &bvh)) {
            let first = cast(&rays, Query::Closest);
            let struck = || rays.iter().zip(&first).filter(|(_, hit)| hit.triangle_ix != NO_TRIANGLE);
            assert!(struck().count() > 1000, "{name}");
            let behind: Vec<_> = struck().map(|(ray, hit)| Ray { t_min: hit.t, ..*ray }).collect();
            let before: Vec<_> = struck().map(|(ray, hit)| Ray { t_max: hit.t, ..*ray }).collect();
            for (rays, query) in
                [&behind, &before].into_iter().flat_map(|rays| [Query::Closest, Query::Any].map(|q| (rays, q)))
            {
                let hits = cast(rays, query);
                let is_in = |ray: &Ray, hit: &Hit| *hit == MISS || (ray.t_min < hit.t && hit.t <= ray.t_max);
                let wrong: Vec<_> = rays.iter().zip(&hits).filter(|(ray, hit)| !is_in(ray, hit)).collect();
                assert!(wrong.is_empty(), "{name}, {query:?}: {} hits, first {:?}", wrong.len(), wrong[0]);
            }
        }
    }
}

/// A direction may have any length that a float holds without denormals.
#[test]
fn the_direction_s_length_is_the_unit_of_t() {
    let device = Device::new();
    let world = MeshWithTree::new(meshes::torus(40, 20));
    let unit = ray(vec3(0.05, 3.0, 1.02), Vec3::NEG_Y);
    let expected = by_brute_force(&world, &scaled(&unit, 0.0, 1.0));
    assert!(expected.t > 2.0 && expected.t < 3.0);
    let exponents = -126..=127;
    let rays: Vec<_> = exponents.clone().map(|e| scaled(&unit, 0.0, 2f32.powi(e))).collect();
    let found = device.caster(&world, Traversal::Mask).cast(&rays, Query::Closest, 1).expect("a cast");
    let on_cpu = cast_on_cpu(world.geometry(), Traversal::Mask, &rays, Query::Closest);
    for ((e, found), on_cpu) in exponents.zip(&found.hits).zip(&on_cpu) {
        let t = (f64::from(expected.t) / 2f64.powi(e)) as f32;
        // Beyond the greatest float there is no hit; below the least normal one a device may flush t to zero.
        let wanted = if t == f32::INFINITY { MISS } else { Hit { t, ..expected } };
        assert!(is_close(on_cpu, &wanted) || t < f32::MIN_POSITIVE, "CPU: 2^{e}: {on_cpu:?}, not {wanted:?}");
        assert!(is_close(found, &wanted) || t < f32::MIN_POSITIVE, "2^{e}: {found:?}, not {wanted:?}");
    }
    assert_eq!(found.n_invalid, 0);
}

fn with(mut v: Vec3, axis: usize, value: f32) -> Vec3 {
    v[axis] = value;
    v
}

#[test]
fn what_is_no_ray_misses_and_is_counted() {
    let device = Device::new();
    let world = MeshWithTree::new(meshes::torus(40, 20));
    let good = Ray { origin: vec3(0.05, 3.0, 1.02), t_min: 0.0, direction: Vec3::NEG_Y, t_max: f32::INFINITY };
    assert_ne!(by_brute_force(&world, &good), MISS);
    let mut none = vec![Ray { t_min: f32::NAN, ..good }, Ray { t_max: f32::NAN, ..good }];
    none.extend([0.0, -0.0, 1e-40, -1e-45].map(|short| Ray { direction: Vec3::splat(short), ..good }));
    for axis in 0..3 {
        for wrong in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            none.push(Ray { origin: with(good.origin, axis, wrong), ..good });
            none.push(Ray { direction: with(good.direction, axis, wrong), ..good });
        }
    }
    let empty = [(1.0, 1.0), (5.0, -5.0), (f32::INFINITY, f32::INFINITY), (0.0, f32::NEG_INFINITY), (0.0, 0.0)];
    let must_miss: Vec<_> = empty.map(|(t_min, t_max)| Ray { t_min, t_max, ..good }).into();
    let mut far = vec![Ray { t_min: f32::NEG_INFINITY, ..good }];
    for wrong in [f32::MAX, f32::MIN_POSITIVE, 1e-40, -1e30, 1e20] {
        far.extend((0..3).map(|axis| Ray { origin: with(good.origin, axis, wrong), ..good }));
        far.extend([0, 2].map(|axis| Ray { direction: with(good.direction, axis, wrong), ..good }));
    }
    let rays = [&none[..], &must_miss, &far, &[good]].concat();
    for &traversal in Traversal::ALL {
        for query in [Query::Closest, Query::Any] {
            let cast = device.caster(&world, traversal).cast(&rays, query, 1).expect("a cast");
            let on_cpu = cast_on_cpu(world.geometry(), traversal, &rays, query);
            for hits in [&cast.hits, &on_cpu] {
                let n_misses = none.len() + must_miss.len();
                assert!(hits[..n_misses].iter().all(|hit| *hit == MISS), "{traversal}, {query:?}: {hits:?}");
                assert_ne!(hits[n_misses], MISS, "from minus infinity");
                assert_ne!(hits.last(), Some(&MISS));
            }
            assert_eq!(cast.n_invalid, none.len() as u64);
        }
    }
}

#[test]
fn nothing_is_hit_in_an_empty_world() {
    let device = Device::new();
    let world = MeshWithTree::new(Vec::new());
    let rays = [ray(Vec3::ZERO, Vec3::X), ray(Vec3::ONE, Vec3::NEG_ONE)].map(|ray| scaled(&ray, 0.0, 1.0));
    let cast = device.caster(&world, Traversal::Mask).cast(&rays, Query::Closest, 1).expect("a cast");
    assert_eq!(cast.hits, [MISS; 2]);
    assert_eq!(cast_on_cpu(world.geometry(), Traversal::Mask, &rays, Query::Closest), [MISS; 2]);
}

#[test]
fn a_wrong_hit_is_noticed() {
    let world = MeshWithTree::new(meshes::torus(40, 20));
    let rays = some_rays(&world, 1000, 0.0..=0.0);
    let hits = cast_on_cpu(world.geometry(), Traversal::Mask, &rays, Query::Closest);
    compare::exact(&hits, &hits).unwrap();
    let struck = hits.iter().position(|hit| hit.triangle_ix != NO_TRIANGLE).expect("a hit");
    let wrong: [fn(&mut Hit); 4] =
        [|hit| hit.t *= 1.0 + 1e-4, |hit| hit.triangle_ix ^= 1, |hit| hit.u += 0.01, |hit| *hit = MISS];
    for spoil in wrong {
        let mut spoilt = hits.clone();
        spoil(&mut spoilt[struck]);
        assert!(compare::exact(&hits, &spoilt).is_err());
        assert!(!is_close(&hits[struck], &spoilt[struck]));
    }
    let mut last_bit = hits.clone();
    last_bit[struck].t = last_bit[struck].t.next_up();
    assert!(compare::exact(&hits, &last_bit).is_err());
    assert!(compare::exact(&hits, &hits[1..]).is_err());
}
