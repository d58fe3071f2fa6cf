//! Tests of the AOVs of first hits: position, normal, albedo, depth, ids and costs of each pixel.

use glam::{Vec3, vec3};
use kdray::{
    accel::kdtree::{BuildOptions, Traversal},
    cpu::{self, Batching},
    frame::{Crop, FrameRenderer, Goal, Integrator, PathOptions, Primary, Profile, RenderOptions},
    layout::{NO_TRIANGLE, PixelAovs},
    render::GpuRenderer,
    world::{FlatScene, World},
};

use super::{
    batches::glass_in_glass,
    studio::{assert_silent, device, identical, on_both, options, world_of},
};
use crate::support::{kept, meshes, scenes, world_by};

fn on_device(scene: &FlatScene, options: &RenderOptions) -> Vec<PixelAovs> {
    on_device_by(&world_of(scene), options)
}

fn on_device_by(world: &World, options: &RenderOptions) -> Vec<PixelAovs> {
    let context = device();
    let mut renderer = GpuRenderer::new(context.clone(), world, options).expect("a renderer");
    renderer.draw().expect("a frame");
    assert_silent(&context);
    renderer.pixel_aovs().expect("pixel_aovs")
}

fn on_cpu(scene: &FlatScene, options: &RenderOptions) -> Vec<PixelAovs> {
    on_cpu_by(&world_of(scene), options)
}

fn on_cpu_by(world: &World, options: &RenderOptions) -> Vec<PixelAovs> {
    let mut renderer = cpu::CpuRenderer::new(world, options, Batching::default());
    renderer.draw_sample();
    renderer.pixel_aovs()
}

fn noting(options: RenderOptions) -> RenderOptions {
    RenderOptions { pixel_aovs: true, ..options }
}

/// The scene is a room of half width 5, seen from its middle along -z.
#[test]
fn a_wall_s_aovs_are_known() {
    let mut scene = scenes::empty();
    scenes::add(&mut scene, Vec::new(), scenes::BLACK);
    scenes::add(&mut scene, scenes::room(5.0), scenes::diffuse(vec3(0.25, 0.5, 0.75)));
    scene.camera.eye = Vec3::ZERO;
    scene.camera.target = vec3(0.0, 0.0, -1.0);
    let lamp = scenes::point_light(vec3(0.0, 0.0, 1.0), Vec3::ONE);
    scene.lights = vec![lamp, scenes::point_light(vec3(0.0, 0.0, -9.0), Vec3::ONE)];
    for pixel_aovs in [on_device, on_cpu].map(|render| render(&scene, &noting(options(32, 24, 3)))) {
        for (i, aovs) in pixel_aovs.iter().enumerate() {
            assert!((aovs.depth - 5.0).abs() < 1e-5 && (aovs.position_world.z + 5.0).abs() < 1e-5);
            assert_eq!((aovs.normal_world, aovs.albedo), (Vec3::Z, vec3(0.25, 0.5, 0.75)));
            assert_eq!(aovs.material_ix, 1);
            // The second lamp is behind the wall, so it gets no shadow ray.
            assert_eq!(aovs.n_rays, 2);
            let x = ((i % 32) as f32 + 0.5) / 16.0 - 1.0;
            let half_width = 5.0 * (45.0_f32 / 2.0).to_radians().tan() * 32.0 / 24.0;
            assert!((aovs.position_world.x - x * half_width).abs() < 1e-4);
        }
    }
}

#[test]
fn nothing_has_aovs_too() {
    let mut scene = scenes::empty();
    scenes::add(&mut scene, Vec::new(), scenes::BLACK);
    let nothing = PixelAovs {
        triangle_ix: NO_TRIANGLE,
        material_ix: NO_TRIANGLE,
        depth: f32::INFINITY,
        n_rays: 1,
        ..PixelAovs::default()
    };
    for primary in [Primary::Raster, Primary::Trace] {
        let options = noting(RenderOptions { primary, ..options(9, 7, 2) });
        for mut pixel_aovs in [on_device, on_cpu].map(|render| render(&scene, &options)) {
            pixel_aovs.iter_mut().for_each(|aovs| aovs.n_steps = 0); // a ray that misses may read the root
            assert!(pixel_aovs == [nothing; 63], "{primary}: {:?}", pixel_aovs[0]);
        }
    }
}

#[test]
fn device_and_cpu_agree() {
    let scene = scenes::mixed_outdoors();
    for primary in [Primary::Raster, Primary::Trace] {
        let options = noting(RenderOptions { primary, ..options(80, 60, 4) });
        let [a, b] = [on_device, on_cpu].map(|render| render(&scene, &options));
        let differs = |(a, b): (&PixelAovs, &PixelAovs)| a.triangle_ix != b.triangle_ix || a.n_rays != b.n_rays;
        let n_differing = a.iter().zip(&b).filter(|pair| differs(*pair)).count();
        assert!(n_differing <= 4800 / 50, "{primary}: {n_differing}");
        assert!(a.iter().map(|aovs| aovs.n_rays).max() > Some(20));
    }
}

/// Device and CPU read the same nodes, slabs and triangles, except for a few rays that rounding sends another way. A
/// software device tests no slabs, so the CPU's tree has none then.
#[test]
fn device_and_cpu_count_the_same_steps() {
    let scene = scenes::mixed_outdoors();
    let world = world_of(&scene);
    let slabs = !device().is_software();
    let on_cpu = world_by(&scene, &BuildOptions { slabs, ..BuildOptions::default() });
    for &traversal in Traversal::ALL.iter().filter(|&&traversal| traversal != Traversal::Brute) {
        let options = noting(RenderOptions { primary: Primary::Trace, traversal, ..options(60, 45, 3) });
        let (a, b) = (on_device_by(&world, &options), on_cpu_by(&on_cpu, &options));
        let n_differing = a.iter().zip(&b).filter(|(a, b)| a.n_steps != b.n_steps).count();
        assert!(n_differing <= a.len() / 20, "{traversal}: {n_differing} of {} pixels", a.len());
        let sum = |pixel_aovs: &[PixelAovs]| pixel_aovs.iter().map(|aovs| f64::from(aovs.n_steps)).sum::<f64>();
        assert!((sum(&a) / sum(&b) - 1.0).abs() < 0.01, "{traversal}: {} steps, {}", sum(&a), sum(&b));
        assert!(sum(&a) > 20.0 * a.len() as f64);
    }
}

/// The counts of paths are those of each pixel's first sample, however many samples a frame has, on the device as on
/// the CPU.
#[test]
fn the_rays_of_the_first_sample_of_paths_are_counted() {
    let mut scene = scenes::mixed_outdoors();
    scenes::add(&mut scene, meshes::torus(6, 5), scenes::emissive(vec3(3.0, 2.0, 1.0)));
    let context = device();
    let build_options = BuildOptions { slabs: !context.is_software(), ..BuildOptions::default() };
    let (world, world_of_cpu) = (world_of(&scene), world_by(&scene, &build_options));
    for traversal in [Traversal::Mask, Traversal::Stack] {
        let options = noting(RenderOptions { integrator: Integrator::Path, traversal, ..options(60, 45, 4) });
        let on_device = |samples_log2| {
            let mut renderer = GpuRenderer::new(context.clone(), &world, &options).expect("a renderer");
            renderer.set_samples_per_frame(samples_log2);
            let profile = renderer.draw_sample().expect("samples");
            (profile, renderer.pixel_aovs().expect("pixel_aovs"))
        };
        let on_cpu = |samples_log2| {
            // A batch has several pixels and is not the whole picture.
            let batching = Batching { n_pixels: 500, ..Batching::default() };
            let mut renderer = cpu::CpuRenderer::new(&world_of_cpu, &options, batching);
            renderer.set_samples_per_frame(samples_log2);
            (renderer.draw_sample(), renderer.pixel_aovs())
        };
        let [device, cpu] = [&on_device as &dyn Fn(u32) -> (Profile, Vec<PixelAovs>), &on_cpu].map(|draw| {
            let (profile, of_one) = draw(0);
            let n_rays: u64 = profile.bounces.iter().map(|bounce| bounce.n_rays + bounce.n_shadow_rays).sum();
            assert_eq!(of_one.iter().map(|aovs| u64::from(aovs.n_rays)).sum::<u64>(), n_rays, "{traversal}");
            assert!(draw(2).1 == of_one, "{traversal}: the number of samples changes the pixel_aovs");
            of_one
        });
        // Sines and cosines are rounded differently, so a few paths take another way.
        for count in [|aovs: &PixelAovs| aovs.n_rays, |aovs: &PixelAovs| aovs.n_steps] {
            let n_differing = device.iter().zip(&cpu).filter(|(a, b)| count(a) != count(b)).count();
            assert!(n_differing <= device.len() / 20, "{traversal}: {n_differing} of {} pixels", device.len());
        }
        assert!(cpu.iter().all(|aovs| aovs.n_rays > 0) && cpu.iter().any(|aovs| aovs.n_rays > 4));
    }
    assert_silent(&context);
}

/// What a pixel's centre shows is the same for both integrators, whatever samples are drawn and however wide the lens
/// is, and costs are those of the first sample.
#[test]
fn first_hits_of_paths_are_at_the_centres_of_pixels() {
    let (plain, context) = (scenes::mixed_outdoors(), device());
    for scene in [scenes::orthographic(plain.clone()), plain] {
        let world = world_of(&scene);
        let whitted = noting(RenderOptions { primary: Primary::Trace, ..options(40, 30, 2) });
        let paths = PathOptions { aperture: 0.3, first_sample: 32, ..PathOptions::default() };
        let of_paths = RenderOptions { integrator: Integrator::Path, paths, ..whitted.clone() };
        let drawn = |options: &RenderOptions| {
            let mut renderer = GpuRenderer::new(context.clone(), &world, options).expect("a renderer");
            let on_device = renderer.draw_window(Goal::Samples(20), &mut || ()).expect("a picture");
            let mut renderer =
                cpu::CpuRenderer::new(&world, options, Batching { n_pixels: 500, ..Batching::default() });
            [on_device, renderer.draw_window(Goal::Samples(20), &mut || ()).expect("a picture")]
        };
        for (found, expected) in drawn(&of_paths).iter().zip(drawn(&whitted)) {
            let differs = |(a, b): (&PixelAovs, &PixelAovs)| {
                let is_near = a.position_world.distance(b.position_world) <= 1e-3 && (a.depth - b.depth).abs() <= 1e-3;
                (a.triangle_ix, a.material_ix) != (b.triangle_ix, b.material_ix) || !(is_near || a.depth == b.depth)
            };
            let n_differing = found.pixel_aovs.iter().zip(&expected.pixel_aovs).filter(|pair| differs(*pair)).count();
            // Rays that differ in their last bits may hit another triangle at an edge.
            assert!(n_differing <= 1200 / 100, "{n_differing} of 1200 pixels differ");
            assert!(found.pixel_aovs.iter().all(|aovs| aovs.n_rays > 0 && aovs.n_samples == 20));
        }
    }
    assert_silent(&context);
}

/// A ray through a tree of one leaf reads the leaf and its triangles. A ray that misses the tree reads nothing.
#[test]
fn steps_through_one_leaf_are_known() {
    if kept::leaves_out("the steps of one tree") {
        return;
    }
    let mut scene = scenes::empty();
    scenes::add(&mut scene, scenes::room(0.5)[..2].to_vec(), scenes::diffuse(Vec3::ONE));
    let n_triangles = scene.triangles.len() as u32;
    let world = world_by(&scene, &BuildOptions { slabs: false, ..BuildOptions::default() });
    assert_eq!(world.tree().nodes().len(), 2, "the root and the place beside it");
    for pixel_aovs in [on_device_by, on_cpu_by]
        .map(|render| render(&world, &noting(RenderOptions { primary: Primary::Trace, ..options(40, 30, 1) })))
    {
        let steps: std::collections::HashSet<_> = pixel_aovs.iter().map(|aovs| aovs.n_steps).collect();
        assert_eq!(steps, [0, 1 + n_triangles].into());
        assert!(pixel_aovs.iter().all(|aovs| aovs.triangle_ix == NO_TRIANGLE || aovs.n_steps > 0));
    }
}

#[test]
fn rays_are_counted_as_in_the_profile() {
    let (scene, options) = (scenes::mixed(), noting(options(40, 30, 4)));
    let world = world_of(&scene);
    let mut device = GpuRenderer::new(device(), &world, &options).expect("a renderer");
    let batching = Batching { n_pixels: 500, queue_capacity: 300 };
    let mut cpu = cpu::CpuRenderer::new(&world, &options, batching);
    let profiles = [device.draw().expect("a frame"), cpu.draw_sample()];
    for (profile, pixel_aovs) in profiles.iter().zip([device.pixel_aovs().expect("pixel_aovs"), cpu.pixel_aovs()]) {
        let counted: u64 = pixel_aovs.iter().map(|aovs| u64::from(aovs.n_rays)).sum();
        let expected: u64 = profile.bounces.iter().map(|bounce| bounce.n_rays + bounce.n_shadow_rays).sum();
        assert_eq!(counted, expected);
    }
}

#[test]
fn neither_batches_nor_crops_nor_the_picture_are_changed_by_them() {
    let (scene, plain, context) = (glass_in_glass(), options(32, 24, 6), device());
    let (world, options) = (world_of(&scene), noting(plain.clone()));
    let pixel_aovs = |options: &RenderOptions, capacity| {
        let renderer = GpuRenderer::with_queue_capacity(context.clone(), &world, options, capacity);
        let mut renderer = renderer.expect("a renderer");
        renderer.draw_sample().expect("a sample");
        renderer.draw_sample().expect("a sample");
        renderer.pixel_aovs().expect("pixel_aovs")
    };
    let whole = pixel_aovs(&options, 100_000);
    assert!(whole == pixel_aovs(&options, 300));
    let crop = Crop { x0: 3, y0: 5, x1: 20, y1: 9 };
    let part = pixel_aovs(&RenderOptions { crop: Some(crop), ..options.clone() }, 100_000);
    let pixels = (5..9).flat_map(|y| (3..20).map(move |x| y * 32 + x));
    assert!(part == pixels.map(|i| whole[i]).collect::<Vec<_>>());
    for (with, without) in on_both(&scene, &options).iter().zip(&on_both(&scene, &plain)) {
        assert!(identical(with, without));
    }
    assert_silent(&context);
}
