//! Tests of frames that trace paths: closed forms, and the same bits however the frame is cut into samples, batches,
//! crops and bands.

use glam::{DQuat, DVec3, Vec3, vec3};
use kdray::{
    accel::kdtree::Traversal,
    cpu::{self, Batching},
    frame::{
        Crop, Denoise, FrameProperties, FrameRenderer, Goal, Integrator, Pass, PathOptions, Picture, PixelFilter, Plan,
        RenderOptions, plan, sampling::samples_log2,
    },
    gpu::DeviceOverrides,
    layout::{MATERIAL_MICROFACET, MOST_SAMPLES_LOG2, Material},
    render::{BandedRenderer, GpuRenderer},
    scene::{self, Alpha, Maps, Projection, Texture, Transform},
    world::FlatScene,
};

use super::studio::{assert_silent, device, differing, identical, world_of};
use crate::support::{meshes, pretended, scenes, textured};

fn options(width: u32, height: u32, max_depth: u32) -> RenderOptions {
    let (integrator, denoise) = (Integrator::Path, Denoise::Off);
    RenderOptions { width, height, max_depth, integrator, denoise, ..RenderOptions::default() }
}

/// Draws samples on the device, as many in a frame as the renderer can.
fn draw(renderer: &mut GpuRenderer, n_samples: u32) -> Picture {
    while renderer.n_samples() < n_samples {
        renderer.set_samples_per_frame(samples_log2(renderer.n_samples(), n_samples, MOST_SAMPLES_LOG2));
        renderer.draw_sample().expect("samples");
    }
    renderer.picture().expect("a picture")
}

fn on_device(scene: &FlatScene, options: &RenderOptions, n_samples: u32) -> Picture {
    let context = device();
    let mut renderer = GpuRenderer::new(context.clone(), &world_of(scene), options).expect("a renderer");
    let picture = draw(&mut renderer, n_samples);
    assert_silent(&context);
    picture
}

fn on_cpu(scene: &FlatScene, options: &RenderOptions, n_samples: u32) -> Picture {
    on_cpu_in_batches(scene, options, n_samples, Batching::default())
}

fn on_cpu_in_batches(scene: &FlatScene, options: &RenderOptions, n_samples: u32, batching: Batching) -> Picture {
    let mut renderer = cpu::CpuRenderer::new(&world_of(scene), options, batching);
    while renderer.n_samples() < n_samples {
        renderer.set_samples_per_frame(samples_log2(renderer.n_samples(), n_samples, MOST_SAMPLES_LOG2));
        renderer.draw_sample();
    }
    renderer.picture()
}

/// Scenes with mirrors, glass, see-through surfaces and lights of several kinds.
fn all_kinds() -> Vec<(&'static str, FlatScene)> {
    let lamp = |mut scene: FlatScene| {
        scenes::add(&mut scene, meshes::torus(6, 5), scenes::emissive(vec3(3.0, 2.0, 1.0)));
        scene
    };
    let many_lamps = |mut scene: FlatScene| {
        let mut triangles = Vec::new();
        for ix in 0..130 {
            let corner = vec3((ix % 8) as f32 - 4.0, 3.0, (ix / 8) as f32 - 8.0);
            triangles.push(meshes::triangle(corner, corner + 0.1 * Vec3::X, corner + 0.1 * Vec3::Z));
            scene.lights.push(scenes::point_light(corner + 0.5, Vec3::splat(0.1)));
        }
        scenes::add(&mut scene, triangles, scenes::emissive(Vec3::splat(30.0)));
        scene
    };
    vec![
        ("with many lamps", many_lamps(scenes::mixed_outdoors())),
        ("indoors", scenes::mixed()),
        ("outdoors", scenes::mixed_outdoors()),
        ("with a lamp", lamp(scenes::mixed())),
        ("in parallel", scenes::orthographic(scenes::mixed_outdoors())),
        ("in a studio", FlatScene { studio: Some(Vec3::Z), ..scenes::mixed_outdoors() }),
    ]
}

/// Returns the mean radiance of a picture, and the standard error of that mean if its pixels are independent.
fn mean_of(picture: &Picture) -> (Vec3, f32) {
    let n = picture.radiance.len() as f32;
    let pixels = || picture.radiance.iter().map(|&[r, g, b, _]| vec3(r, g, b));
    let mean = pixels().sum::<Vec3>() / n;
    let variance = pixels().map(|pixel| (pixel - mean).length_squared() / 3.0).sum::<f32>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

#[test]
fn device_and_cpu_agree() {
    for (name, scene) in all_kinds() {
        let options = options(40, 30, 5);
        let (found, expected) = (on_device(&scene, &options, 3), on_cpu(&scene, &options, 3));
        // Sines and cosines are rounded differently, so a few paths take another way.
        let n_differing = differing(&found, &expected, 1e-3).len();
        assert!(n_differing <= 1200 / 20, "{name}: {n_differing} of 1200 pixels differ");
        let n_others = differing(&found, &on_cpu(&scene, &options, 2), 1e-3).len();
        assert!(n_others > 300, "{name}: pictures of other samples differ in {n_others} pixels");
    }
}

/// In a scene of many triangles, the CPU traces all but camera rays one by one through a wide hierarchy, unless the
/// options name another traversal than that of packets.
#[test]
fn rays_one_by_one_make_the_picture_of_the_tree() {
    for mut scene in [scenes::mixed(), scenes::mixed_outdoors()] {
        scenes::add(&mut scene, meshes::torus(60, 30), scenes::veil(vec3(0.8, 0.5, 0.2), 0.5));
        scenes::add(&mut scene, scenes::smooth_sphere(20, 0.7, Vec3::ZERO), scenes::glass(1.5));
        assert!(scene.triangles.len() > 4096, "{}", scene.triangles.len());
        let picture = |traversal| on_cpu(&scene, &RenderOptions { traversal, ..options(48, 36, 6) }, 4);
        let [expected, found] = [Traversal::Mask, Traversal::OF_CPU].map(picture);
        assert!(identical(&expected, &found), "{} pixels differ", differing(&expected, &found, 0.0).len());
    }
}

/// A mirror shows the studio. Lambertian surfaces and the camera do not see it.
#[test]
fn only_narrow_lobes_see_the_studio() {
    let options = options(24, 18, 3);
    let flags = MATERIAL_MICROFACET;
    let metal = Material { metallic: 1.0, roughness: 0.0, flags, ..scenes::diffuse(Vec3::ONE) };
    for (material, mirrors) in [(scenes::diffuse(Vec3::splat(0.7)), false), (metal, true)] {
        let ball = |studio| {
            let mut scene = FlatScene { background: Vec3::splat(0.2), studio, ..scenes::empty() };
            scenes::add(&mut scene, scenes::smooth_sphere(12, 1.0, Vec3::ZERO), material);
            scene.camera.eye = vec3(0.0, 0.0, 3.0);
            scene.camera.target = Vec3::ZERO;
            scene
        };
        for render in [on_cpu, on_device] {
            let [without, within] = [None, Some(Vec3::Z)].map(|studio| render(&ball(studio), &options, 4));
            let n_differing = differing(&without, &within, 0.0).len();
            let n_pixels = within.radiance.len();
            assert!(if mirrors { (20..n_pixels).contains(&n_differing) } else { n_differing == 0 }, "{n_differing}");
            assert_eq!(without.radiance[0], within.radiance[0], "the camera sees the background in the corner");
        }
    }
}

#[test]
fn a_profile_has_the_passes_of_the_plan() {
    let (scene, options) = (scenes::mixed(), RenderOptions { pixel_aovs: true, ..options(20, 15, 2) });
    let mut renderer = GpuRenderer::new(device(), &world_of(&scene), &options).expect("a renderer");
    let mut on_cpu = cpu::CpuRenderer::new(&world_of(&scene), &options, Batching::default());
    let plan = Plan::new(&FrameProperties::new(&options, &world_of(&scene).frame_constants(&options)));
    let entries = [plan.bounces.concat(), plan.light, plan.image].concat();
    let expected: Vec<_> = plan::passes(&entries).map(Pass::name).collect();
    for profile in [renderer.draw_sample().expect("a sample"), on_cpu.draw_sample()] {
        let found: Vec<_> = profile.passes.iter().map(|pass| pass.name).collect();
        assert_eq!(found, expected);
        assert!(profile.bounces[0].n_rays == 300 && profile.bounces[0].n_shadow_rays > 100, "{:?}", profile.bounces);
    }
}

#[test]
fn the_number_of_samples_in_a_frame_changes_no_bit() {
    let (scene, options) = (scenes::mixed_outdoors(), options(17, 13, 4));
    let context = device();
    let world = world_of(&scene);
    let render = |frames: &[u32]| {
        let mut renderer = GpuRenderer::new(context.clone(), &world, &options).expect("a renderer");
        for log2 in frames {
            renderer.set_samples_per_frame(*log2);
            renderer.draw_sample().expect("samples");
        }
        assert_eq!(renderer.n_samples(), 53);
        renderer.picture().expect("a picture")
    };
    let one_by_one = render(&[0; 53]);
    for frames in [
        &[4, 4, 4, 2, 0][..],
        &[5, 4, 2, 0],
        &[1; 26].iter().chain(&[0]).copied().collect::<Vec<_>>(),
        &[0, 0, 1, 2, 3, 4, 4, 2, 0],
    ] {
        assert!(identical(&one_by_one, &render(frames)), "{frames:?}");
    }
    assert!(!identical(&one_by_one, &on_device(&scene, &options, 52)));
    let on_cpu_one_by_one = {
        let mut renderer = cpu::CpuRenderer::new(&world, &options, Batching::default());
        (0..53).for_each(|_| drop(renderer.draw_sample()));
        renderer.picture()
    };
    assert!(identical(&on_cpu_one_by_one, &on_cpu(&scene, &options, 53)));
    assert_silent(&context);
}

#[test]
fn batches_and_bands_change_no_bit() {
    let (scene, options, context) = (scenes::mixed(), options(31, 80, 5), device());
    let world = world_of(&scene);
    let whole = on_device(&scene, &options, 20);
    for capacity in [100, 1000, 31 * 80 * 16] {
        let renderer = GpuRenderer::with_queue_capacity(context.clone(), &world, &options, capacity);
        assert!(identical(&whole, &draw(&mut renderer.expect("a renderer"), 20)), "a queue for {capacity} paths");
    }
    let narrow = pretended(DeviceOverrides { storage_range: Some(31 * 25 * 128), ..DeviceOverrides::default() });
    let mut renderer = BandedRenderer::new(narrow.clone(), &world, &options).expect("a renderer");
    assert!(renderer.n_bands() > 3);
    renderer.draw(Goal::Samples(20), &mut || ()).expect("a picture");
    assert!(identical(&whole, &renderer.picture().expect("a picture")));
    let whole = on_cpu(&scene, &options, 20);
    for n_pixels in [1, 100] {
        let batching = Batching { n_pixels, ..Batching::default() };
        let in_batches = on_cpu_in_batches(&scene, &options, 20, batching);
        assert!(identical(&whole, &in_batches), "batches of {n_pixels} pixels");
    }
    [&context, &narrow].into_iter().for_each(|context| assert_silent(context));
}

#[test]
fn a_crop_is_a_part_of_the_whole() {
    let (scene, options) = (scenes::mixed_outdoors(), options(61, 47, 4));
    let lens = PathOptions { aperture: 0.1, filter: PixelFilter::Gaussian, ..PathOptions::default() };
    let options = RenderOptions { paths: lens, ..options };
    let crop = Crop { x0: 13, y0: 9, x1: 50, y1: 31 };
    for render in [on_device as fn(&_, &_, _) -> Picture, on_cpu] {
        let whole = render(&scene, &options, 5);
        let part = render(&scene, &RenderOptions { crop: Some(crop), ..options.clone() }, 5);
        let pixels = (crop.y0..crop.y1).flat_map(|y| (crop.x0..crop.x1).map(move |x| (y * 61 + x) as usize));
        let (radiance, display) = pixels.map(|i| (whole.radiance[i], whole.display[i])).unzip();
        assert!(identical(&Picture { width: 37, height: 22, radiance, display }, &part));
    }
}

/// Rays and shadow rays that are suspended go on in further dispatches.
#[test]
fn a_limit_of_loop_iterations_changes_no_bit() {
    let (scene, options) = (scenes::mixed(), options(24, 18, 4));
    let overrides =
        DeviceOverrides { loop_limit: Some(400), n_suspension_slots: Some(50), ..DeviceOverrides::default() };
    let context = pretended(overrides);
    let mut renderer = GpuRenderer::new(context.clone(), &world_of(&scene), &options).expect("a renderer");
    assert!(identical(&draw(&mut renderer, 5), &on_device(&scene, &options, 5)));
    assert_silent(&context);
}

/// A closed box whose walls give off 1 - r and reflect r of the light: every point has the radiance 1, of which each
/// bounce brings its share of the geometric series. It is the same for all ways of sampling, and after roulette.
#[test]
fn light_in_a_closed_box_is_a_geometric_series() {
    let reflectance = 0.75;
    let mut scene = scenes::empty();
    let walls = Material { ke: Vec3::splat(1.0 - reflectance), ..scenes::diffuse(Vec3::splat(reflectance)) };
    scenes::add(&mut scene, scenes::room(1.0), walls);
    scene.camera.eye = vec3(0.1, 0.2, 0.3);
    scene.camera.target = vec3(0.7, -0.4, 0.5);
    for max_depth in [1, 2, 3, 64] {
        let picture = on_cpu(&scene, &options(32, 32, max_depth), 64);
        let (mean, error) = mean_of(&picture);
        let expected = 1.0 - reflectance.powi(max_depth as i32 + 1);
        assert!(
            (mean - expected).abs().max_element() < (4.0 * error).max(1e-5),
            "{max_depth}: {mean}, {expected} +- {error}"
        );
        assert!(error < 0.01, "{max_depth}: {error}");
        // The test can fail: without the last bounce there is less.
        assert!(max_depth > 9 || (mean - (1.0 - reflectance.powi(max_depth as i32))).x > 5.0 * error);
    }
}

/// A sphere that reflects half of the light, in a white environment, is grey: it does not see itself.
#[test]
fn a_grey_sphere_in_a_furnace_is_grey() {
    let mut scene = scenes::empty();
    scenes::add(&mut scene, scenes::smooth_sphere(40, 1.0, Vec3::ZERO), scenes::diffuse(Vec3::splat(0.5)));
    scene.background = Vec3::ONE;
    scene.camera.eye = vec3(0.0, 0.0, 3.0);
    scene.camera.projection = Projection::Perspective { vertical_fov_degrees: 20.0 };
    let picture = on_cpu(&scene, &options(32, 32, 3), 64);
    let (mean, error) = mean_of(&picture);
    assert!((mean - 0.5).abs().max_element() < 4.0 * error.max(5e-4), "{mean} +- {error}");
}

/// Sixteen times the samples leave a quarter of the error, up to chance: few bright paths are much of it.
#[test]
fn the_error_falls_with_the_number_of_samples() {
    let scene = scenes::mixed_outdoors();
    let options = options(48, 36, 4);
    let truth = on_cpu(&scene, &options, 1024);
    let error = |n_samples| {
        let picture = on_cpu(&scene, &options, n_samples);
        let squared = |(a, b): (&[f32; 4], &[f32; 4])| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f32>();
        (picture.radiance.iter().zip(&truth.radiance).map(squared).sum::<f32>() / truth.radiance.len() as f32).sqrt()
    };
    let [few, many] = [4, 64].map(error);
    assert!(few / many > 3.0, "{few}, {many}");
}

/// With a lens, what is at the distance of sharpness has an edge of the width of a pixel, and what is farther has none.
#[test]
fn a_lens_blurs_what_is_out_of_focus() {
    let mut scene = scenes::empty();
    let corner = |x: f32, y: f32| vec3(x, y, 0.0);
    let half_plane = meshes::triangle(corner(0.0, -90.0), corner(0.0, 90.0), corner(-90.0, 0.0));
    scenes::add(&mut scene, vec![half_plane], scenes::emissive(Vec3::ONE));
    scene.camera.eye = vec3(0.0, 0.0, 4.0);
    scene.camera.target = Vec3::ZERO;
    let n_grey = |paths| {
        let picture = on_cpu(&scene, &RenderOptions { paths, ..options(40, 30, 1) }, 64);
        picture.radiance.iter().filter(|pixel| (0.05..0.95).contains(&pixel[0])).count()
    };
    let sharp = PathOptions { filter: PixelFilter::Box, ..PathOptions::default() };
    let [pinhole, focused] = [0.0, 0.4].map(|aperture| n_grey(PathOptions { aperture, ..sharp }));
    let blurred = n_grey(PathOptions { aperture: 0.4, focus: Some(2.0), ..sharp });
    assert!(pinhole <= 60 && focused <= 60 && blurred > 150, "{pinhole}, {focused}, {blurred}");
}

/// Rays pass a see-through sheet of microfacets at random, as often as its opacity says, on the device as on the CPU.
#[test]
fn paths_see_sheets_as_often_as_their_opacity_says() {
    let mut scene = textured::empty();
    let sheet = textured::rough(Vec3::ZERO);
    let image = textured::add_image(&mut scene, [1, 1], |_, _| [0, 0, 0, 128]);
    let maps = Maps { base_colour: Some(Texture::of_image(image)), ..Maps::default() };
    let sheet = scene::Material { ks: Vec3::ZERO, d: 0.5, alpha: Alpha::Blend, maps, ..sheet };
    textured::add(&mut scene, textured::square(), textured::placed(3.0, DVec3::new(0.0, 0.0, 0.5)), sheet);
    scene.background = Vec3::ONE;
    let scene = FlatScene::new(&scene).expect("a scene that fits together");
    for picture in [on_device(&scene, &options(16, 16, 2), 64), on_cpu(&scene, &options(16, 16, 2), 64)] {
        let mean = picture.radiance.iter().map(|pixel| pixel[0]).sum::<f32>() / picture.radiance.len() as f32;
        let expected = 1.0 - 0.5 * 128.0 / 255.0;
        // The deviation of 16,384 rays is 0.0034.
        assert!((mean - expected).abs() < 0.02, "{mean}, not {expected}");
    }
}

/// An unlit surface shows its colour as it is, as by the integrator `whitted`. Light that is too bright for sums of
/// samples is bounded, not lost.
#[test]
fn bright_surfaces_are_shown() {
    let bright = |kd: Vec3, ke: Vec3| {
        let mut scene = textured::empty();
        let phong = scene::Material { kd, ke, is_unlit: ke == Vec3::ZERO, ..scene::Material::default() };
        textured::add(&mut scene, textured::square(), textured::placed(3.0, DVec3::ZERO), phong);
        FlatScene::new(&scene).expect("a scene that fits together")
    };
    let unlit = bright(vec3(3.0, 0.5, 1e29), Vec3::ZERO);
    let [too_bright, glowing] =
        [(Vec3::splat(3e38), Vec3::ZERO), (Vec3::ONE, vec3(1e37, 2.0, 0.0))].map(|(kd, ke)| bright(kd, ke));
    let options = options(8, 8, 2);
    for draw in [on_device, on_cpu] {
        let centre = |scene| {
            let [r, g, b, _] = draw(scene, &options, 4).radiance[36];
            vec3(r, g, b)
        };
        let found = centre(&unlit);
        assert!((found / vec3(3.0, 0.5, 1e29) - 1.0).abs().max_element() < 1e-5, "{found}");
        assert!((centre(&too_bright) / 1e30 - 1.0).abs().max_element() < 1e-5, "{}", centre(&too_bright));
        let found = centre(&glowing);
        assert!((found / vec3(1e30, 2.0, 1.0) - vec3(1.0, 1.0, 0.0)).abs().max_element() < 1e-5, "{found}");
    }
}

/// Which rays pass through sheets does not depend on how a device rounds the points at which they meet them.
#[test]
fn device_and_cpu_agree_behind_sheets() {
    let mut scene = textured::empty();
    let image = textured::add_image(&mut scene, [1, 1], |_, _| [200, 120, 90, 128]);
    let maps = Maps { base_colour: Some(Texture::of_image(image)), ..Maps::default() };
    let sheet = scene::Material { ks: Vec3::ZERO, d: 0.9, alpha: Alpha::Blend, maps, ..textured::rough(Vec3::ONE) };
    for i in 0..3 {
        let offset = DVec3::new(0.1 * f64::from(i), -0.2, 0.7 * f64::from(i));
        let placed = Transform::new(DVec3::splat(1.3), DQuat::from_rotation_y(0.3 + 0.4 * f64::from(i)), offset);
        textured::add(&mut scene, textured::square(), placed.expect("a transform"), sheet.clone());
    }
    let wall = textured::placed(4.0, DVec3::new(0.0, 0.0, -1.5));
    textured::add(&mut scene, textured::square(), wall, textured::rough(Vec3::splat(0.7)));
    scene.lights = vec![scene::Light::Point { position: vec3(1.0, 2.0, 4.0), intensity: Vec3::splat(20.0) }];
    scene.background = Vec3::splat(0.4);
    let (scene, options) = (FlatScene::new(&scene).expect("a scene that fits together"), options(48, 36, 5));
    let n_differing = |a: &Picture, b: &Picture| differing(a, b, 1e-2).len();
    let (found, expected) = (on_device(&scene, &options, 2), on_cpu(&scene, &options, 2));
    assert!(n_differing(&found, &expected) <= 1728 / 20, "{} of 1728 pixels", n_differing(&found, &expected));
    let others = n_differing(&found, &on_cpu(&scene, &options, 4));
    assert!(others > 600, "pictures of other samples differ in {others} of 1728 pixels");
}
