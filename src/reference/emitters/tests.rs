//! Tests of the emitters against closed forms, and of pdfs against samples.

use std::{f32::consts::PI, path::Path};

use glam::{DVec3, Vec3, vec3};

use super::{LightSample, ambient_radiance, emission_at, emission_pdf, sample_light, seen_environment, seen_light};
use crate::{
    accel::kdtree::BuildOptions,
    frame::RenderOptions,
    layout::{Frame, Material, Triangle},
    reference::{
        chi_square::{LARGEST_DEVIATION, Uniform, chi_square},
        inputs::KernelInputs,
    },
    scene::{Environment, Light, Scene, Sky, Up},
    world::{Emitters, FlatScene, World},
};

pub(super) fn world_with(lights: Vec<Light>, change: impl FnOnce(&mut FlatScene)) -> World {
    let scene = Scene { lights, ..Scene::empty(Path::new("scene")) };
    let mut flat = FlatScene::new(&scene).unwrap();
    change(&mut flat);
    World::of_flat(flat, &BuildOptions::default()).unwrap()
}

pub(super) fn world(lights: Vec<Light>) -> World {
    world_with(lights, |_| {})
}

/// The inputs of kernels of paths.
pub(super) fn inputs_of<'a>(world: &'a World, frame: &'a Frame) -> KernelInputs<'a> {
    KernelInputs::new(world, frame).of_paths(&world.scene().materials, world.emitters())
}

pub(super) fn frame(world: &World) -> Frame {
    world.frame_constants(&RenderOptions::default())
}

/// Two triangles in the plane z = 2 that emit light, as a square with edges of 2.
pub(super) fn emitting_square(scene: &mut FlatScene) {
    let corners = [vec3(-1.0, -1.0, 2.0), vec3(1.0, -1.0, 2.0), vec3(1.0, 1.0, 2.0), vec3(-1.0, 1.0, 2.0)];
    let triangle =
        |[a, b, c]: [usize; 3]| Triangle { v0: corners[a], v1: corners[b], v2: corners[c], ..Triangle::default() };
    scene.triangles = [[0, 1, 2], [0, 1, 2], [0, 2, 3]].map(triangle).to_vec().into();
    // The first triangle is far away and dark.
    scene.triangles[0].v0.z = 9.0;
    scene.triangle_materials = vec![1, 0, 0].into();
    scene.materials = vec![Material { ke: vec3(3.0, 2.0, 1.0), ..Material::default() }, Material::default()];
    scene.material_names = vec![String::new(); 2];
}

/// The random numbers of `n` samples: points of a sequence that fills the cube evenly.
pub(super) fn numbers(n: usize) -> impl Iterator<Item = Vec3> {
    const STEPS: DVec3 = DVec3::new(0.819_172_513_4, 0.671_043_606_7, 0.549_700_477_9);
    (0..n).map(|i| (STEPS * i as f64 + 0.5).fract().as_vec3().min(Vec3::splat(0.999_999)))
}

/// The irradiance that samples estimate at a point of a surface.
pub(super) fn irradiance(inputs: &KernelInputs, point: Vec3, normal: Vec3) -> Vec3 {
    const N: usize = 100_000;
    let sum: DVec3 = numbers(N)
        .map(|u| {
            let LightSample { direction, light, .. } = sample_light(inputs, point, u);
            (light * direction.dot(normal).max(0.0)).as_dvec3()
        })
        .sum();
    (sum / N as f64).as_vec3()
}

pub(super) fn assert_near(found: f32, expected: f32, tolerance: f32) {
    assert!((found - expected).abs() <= tolerance * expected.abs(), "{found}, expected {expected}");
}

/// Irradiance below the middle of a rectangle that is parallel to the surface, from its half edges at distance 1.
fn under_rectangle(a: f32, b: f32) -> f32 {
    let part = |a: f32, b: f32| a / (1.0 + a * a).sqrt() * (b / (1.0 + a * a).sqrt()).atan();
    2.0 * (part(a, b) + part(b, a))
}

/// Integrates over all directions.
fn over_sphere(of: impl Fn(Vec3) -> f32) -> f32 {
    const N: usize = 1500;
    let mut sum = 0.0_f64;
    for row in 0..N {
        let up = 1.0 - 2.0 * (row as f32 + 0.5) / N as f32;
        let sine = (1.0 - up * up).sqrt();
        for column in 0..N {
            let azimuth = 2.0 * PI * (column as f32 + 0.5) / N as f32;
            sum += f64::from(of(vec3(sine * azimuth.sin(), up, -sine * azimuth.cos())));
        }
    }
    (sum * 4.0 * std::f64::consts::PI / (N * N) as f64) as f32
}

fn rectangle() -> Light {
    let radiance = vec3(2.0, 1.0, 0.5);
    Light::Rectangle { position: vec3(0.0, 0.0, 2.0), edge_u: 2.0 * Vec3::Y, edge_v: 3.0 * Vec3::X, radiance }
}

fn disk() -> Light {
    Light::Disk { position: vec3(0.0, 0.0, 2.0), towards: Vec3::NEG_Z, radius: 1.5, radiance: Vec3::ONE }
}

fn sphere() -> Light {
    Light::Sphere { position: vec3(0.0, 0.0, 3.0), radius: 1.0, radiance: Vec3::splat(4.0) }
}

pub(super) fn sun() -> Light {
    Light::Sun { towards: vec3(0.0, 0.6, 0.8), irradiance: Vec3::splat(2.0), angle_degrees: 20.0 }
}

#[test]
fn light_without_a_size_falls_with_the_squared_distance() {
    let world = world(vec![Light::Point { position: vec3(0.0, 0.0, 2.0), intensity: Vec3::splat(3.0) }]);
    let frame = frame(&world);
    let inputs = inputs_of(&world, &frame);
    assert_near(irradiance(&inputs, Vec3::ZERO, Vec3::Z).x, PI * 3.0 / 4.0, 1e-4);
    assert_near(irradiance(&inputs, vec3(0.0, 0.0, -2.0), Vec3::Z).x, PI * 3.0 / 16.0, 1e-4);
    assert_eq!(sample_light(&inputs, vec3(0.0, 0.0, 2.0), Vec3::splat(0.5)), LightSample::NONE);
    assert_eq!(sample_light(&inputs, Vec3::ZERO, Vec3::splat(0.5)).pdf, 0.0);
}

/// Lights, and the red irradiance that they cause at the origin on a surface that faces +z.
fn closed_forms() -> Vec<(World, f32)> {
    let directional = |angle_degrees| Light::Sun { towards: Vec3::Z, irradiance: Vec3::splat(2.0), angle_degrees };
    vec![
        (world(vec![rectangle()]), 2.0 * under_rectangle(1.0, 1.5)),
        (world(vec![disk()]), PI * 1.5 * 1.5 / (1.5 * 1.5 + 4.0)),
        (world(vec![sphere()]), PI * 4.0 / 9.0),
        (world_with(Vec::new(), emitting_square), 3.0 * under_rectangle(0.5, 0.5)),
        (world(vec![directional(0.5)]), 2.0 * PI),
        (world(vec![directional(60.0)]), 2.0 * PI),
        (world(vec![Light::Directional { towards: Vec3::Z, irradiance: Vec3::ONE }]), PI),
        (world_with(Vec::new(), |scene| (scene.background, scene.ambient) = (Vec3::ONE, Vec3::ONE)), 2.0 * PI),
    ]
}

#[test]
fn irradiance_is_that_of_closed_forms() {
    for (world, expected) in closed_forms() {
        let frame = frame(&world);
        let found = irradiance(&inputs_of(&world, &frame), Vec3::ZERO, Vec3::Z).x;
        assert_near(found, expected, 3e-3);
    }
}

/// A wrong pdf shifts the irradiance beyond what the comparison allows.
#[test]
fn a_wrong_area_changes_the_irradiance() {
    let world = world(vec![disk()]);
    let mut emitters: Emitters = world.emitters().clone();
    emitters.area_lights[0].area *= 1.02;
    let frame = frame(&world);
    let inputs = KernelInputs { emitters: Some(&emitters), ..inputs_of(&world, &frame) };
    let found = irradiance(&inputs, Vec3::ZERO, Vec3::Z).x;
    assert!((found / (PI * 1.5 * 1.5 / (1.5 * 1.5 + 4.0)) - 1.0).abs() > 1e-2, "{found}");
}

/// The solid angle of a triangle whose corners are seen at these places (Van Oosterom, Strackee: The Solid Angle of a
/// Plane Triangle, 1983).
fn solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    let lengths = [a.length(), b.length(), c.length()];
    let below =
        lengths[0] * lengths[1] * lengths[2] + a.dot(b) * lengths[2] + b.dot(c) * lengths[0] + c.dot(a) * lengths[1];
    2.0 * a.dot(b.cross(c)).abs().atan2(below)
}

/// From nearby, all directions to a rectangle have the same pdf, which is that of the solid angle. From far away,
/// and from where it is seen edge-on, the pdfs are those of points on its area. Both are finite.
#[test]
fn rectangles_are_sampled_by_solid_angle_from_nearby() {
    let world = world(vec![rectangle()]);
    let frame = frame(&world);
    let inputs = inputs_of(&world, &frame);
    for (point, is_near) in [
        (Vec3::ZERO, true),
        (vec3(2.9, 1.9, 1.99), true),
        (vec3(-7.0, 0.0, 1.0), true),
        (vec3(0.0, 9.0, -3.0), true),
        (vec3(3.5, 0.0, 1.9999), false),
        (vec3(0.0, 0.0, -14.0), false),
    ] {
        let samples: Vec<_> = numbers(500).map(|u| sample_light(&inputs, point, u)).collect();
        let pdfs = samples.iter().map(|sample| sample.pdf).filter(|pdf| *pdf > 0.0);
        let (least, most) = pdfs.fold((f32::INFINITY, 0.0_f32), |(least, most), d| (least.min(d), most.max(d)));
        assert_eq!(most / least < 1.0001, is_near, "{point}: {least} to {most}");
        for sample in samples.iter().filter(|sample| sample.pdf > 0.0) {
            assert!(sample.direction.is_normalized() && (sample.pdf / most - 1.0).is_finite(), "{sample:?}");
            let at = point + sample.distance * sample.direction;
            let beyond = (at.abs() - vec3(3.0, 2.0, 2.0)).max_element();
            assert!(beyond < 1e-4 && (at.z - 2.0).abs() < 1e-4, "{point}: {at} is not on the rectangle");
        }
        if is_near {
            let corner = |x, y| DVec3::new(x, y, 2.0) - point.as_dvec3();
            let [a, b, c, d] = [corner(-3.0, -2.0), corner(3.0, -2.0), corner(3.0, 2.0), corner(-3.0, 2.0)];
            assert_near(1.0 / most, (solid_angle([a, b, c]) + solid_angle([a, c, d])) as f32, 1e-4);
        }
    }
    assert!(
        numbers(100).all(|u| sample_light(&inputs, vec3(0.0, 0.0, 2.5), u) == LightSample::NONE),
        "the back is dark"
    );
}

#[test]
fn pdfs_of_area_lights_are_whole() {
    for light in [rectangle(), disk(), sphere()] {
        let world = world(vec![light]);
        let frame = frame(&world);
        let inputs = inputs_of(&world, &frame);
        for point in [Vec3::ZERO, vec3(1.0, -0.5, 0.5)] {
            let sum = over_sphere(|direction| seen_light(&inputs, point, direction, f32::INFINITY).pdf);
            assert_near(sum, 1.0, 5e-3);
        }
    }
}

/// Sampled directions are distributed by the pdf that is stated for rays that meet the light.
#[test]
fn samples_have_the_stated_pdf() {
    let worlds = [
        world(vec![rectangle()]),
        world(vec![disk()]),
        world(vec![sphere()]),
        world(vec![sun()]),
        world_with(Vec::new(), |scene| scene.environment = Some(map(40.0))),
    ];
    for (ix, world) in worlds.iter().enumerate() {
        let frame = frame(world);
        let inputs = inputs_of(world, &frame);
        for point in [Vec3::ZERO, vec3(0.3, -0.5, 1.0)] {
            let mut random = Uniform(ix as u64);
            let mut sample = || {
                let sample = sample_light(&inputs, point, random.point());
                (sample != LightSample::NONE).then_some(sample.direction)
            };
            let pdf = |direction| {
                let seen = seen_light(&inputs, point, direction, f32::INFINITY).pdf;
                seen + seen_environment(&inputs, direction).pdf
            };
            // Lights have sharp edges, which many points in a cell resolve.
            let found = chi_square((30_000, 100), &mut sample, &pdf);
            assert!(found < LARGEST_DEVIATION, "{found} deviations of light {ix} at {point}");
            // A pdf that is 15 % higher on one side is noticed.
            let skewed = |direction: Vec3| pdf(direction) * (1.0 + 0.15 * direction.x.signum());
            let found = chi_square((30_000, 100), &mut sample, &skewed);
            assert!(found > LARGEST_DEVIATION, "{found} deviations of light {ix} at {point}");
        }
    }
}

/// An image with a bright texel, dark ones and a NaN.
pub(super) fn map(rotation: f32) -> Environment {
    let mut colours: Vec<Vec3> = (0..32 * 17).map(|ix| Vec3::splat((ix % 5) as f32 * 0.1)).collect();
    colours[4 * 32 + 24] = Vec3::splat(50.0);
    colours[0] = vec3(f32::NAN, 1.0, 1.0);
    Environment::new([32, 17], colours, (rotation, 1.0)).unwrap().0
}

#[test]
fn pdfs_of_environments_are_whole() {
    let of_map = |scene: &mut FlatScene| scene.environment = Some(map(40.0));
    let of_background = |scene: &mut FlatScene| scene.background = Vec3::ONE;
    for world in [
        world_with(Vec::new(), of_map),
        world_with(vec![sun()], of_map),
        world_with(vec![sun()], of_background),
        world_with(vec![sun()], |_| {}),
    ] {
        let frame = frame(&world);
        let inputs = inputs_of(&world, &frame);
        assert_near(over_sphere(|direction| seen_environment(&inputs, direction).pdf), 1.0, 5e-3);
        // Samples find all the light that there is.
        let found = irradiance(&inputs, Vec3::ZERO, Vec3::Y).x;
        let expected = over_sphere(|it| seen_environment(&inputs, it).radiance.x * it.y.max(0.0));
        assert_near(found, expected, 2e-2);
    }
}

/// Light from a map is sampled in proportion to its luminance, also between a bright texel and its dark neighbours. So
/// what a sample brings hardly varies: by as much as the sine does from row to row.
#[test]
fn samples_of_a_map_bring_the_same_light() {
    let mut colours = vec![Vec3::splat(0.25); 64 * 32];
    colours[12 * 64 + 20] = Vec3::splat(8000.0);
    colours[20 * 64 + 63] = vec3(0.0, 500.0, 0.0);
    let environment = Environment::new([64, 32], colours, (70.0, 1.0)).unwrap().0;
    let world = world_with(Vec::new(), |scene| scene.environment = Some(environment.clone()));
    let frame = frame(&world);
    let inputs = inputs_of(&world, &frame);
    let found: Vec<f32> = numbers(20_000)
        .map(|u| sample_light(&inputs, Vec3::ZERO, u))
        .map(|sample| sample.light.dot(vec3(0.2126, 0.7152, 0.0722)))
        .collect();
    let mean = found.iter().sum::<f32>() / found.len() as f32;
    let worst = found.iter().map(|light| (light / mean - 1.0).abs()).fold(0.0, f32::max);
    assert!(worst < 0.06, "one sample brings {worst} more or less");
}

#[test]
fn samples_have_the_pdf_of_what_is_seen() {
    let (radiance, radius) = (Vec3::splat(3.0), 1.0);
    let lights = vec![
        Light::Rectangle { position: vec3(-9.0, 0.0, 2.0), edge_u: 2.0 * Vec3::Y, edge_v: 3.0 * Vec3::X, radiance },
        Light::Disk { position: vec3(0.0, 8.0, 3.0), towards: Vec3::NEG_Z, radius, radiance },
        Light::Sphere { position: vec3(0.0, -7.0, 3.0), radius, radiance },
        sun(),
    ];
    let world = world_with(lights, |scene| {
        emitting_square(scene);
        scene.environment = Some(map(0.0));
        scene.ambient = Vec3::splat(0.1);
    });
    let frame = frame(&world);
    let inputs = inputs_of(&world, &frame);
    let point = vec3(6.0, 0.2, -4.0);
    let (mut n_shapes, mut n_beyond, mut n_triangles, mut n_borders) = (0, 0, 0, 0);
    for u in numbers(20_000) {
        let sample = sample_light(&inputs, point, u);
        let seen = seen_light(&inputs, point, sample.direction, f32::INFINITY);
        if sample == LightSample::NONE {
            continue;
        }
        let pdf = if sample.distance.is_infinite() {
            n_beyond += 1;
            seen_environment(&inputs, sample.direction).pdf
        } else if (seen.t - sample.distance).abs() < 1e-3 * sample.distance {
            n_shapes += 1;
            seen.pdf
        } else {
            n_triangles += 1;
            let pdfs = [0, 1, 2].map(|ix| emission_pdf(&inputs, ix, point, sample.direction, sample.distance));
            assert_eq!(pdfs[0], 0.0);
            // Both triangles are in one plane and have the same size.
            pdfs[1]
        };
        if (pdf - sample.pdf).abs() > 1e-2 * sample.pdf {
            // At the border of two texels and of the sun, rounding decides.
            assert!(sample.distance.is_infinite(), "{u}: {pdf}, {sample:?}");
            n_borders += 1;
        }
    }
    assert!(n_borders * 1000 <= n_beyond, "{n_borders} of {n_beyond}");
    assert!(n_shapes > 50 && n_beyond > 50 && n_triangles > 50, "{n_shapes} {n_beyond} {n_triangles}");
    assert_eq!(emission_at(&inputs, 1, 0.2, 0.2), vec3(3.0, 2.0, 1.0));
    assert_eq!(ambient_radiance(&inputs, Vec3::X), Vec3::splat(0.1));
}

#[test]
fn nearer_lights_hide_what_is_behind_them() {
    let behind = Light::Point { position: vec3(0.0, 0.0, 9.0), intensity: Vec3::ONE };
    let world = world(vec![behind, sphere()]);
    let frame = frame(&world);
    let inputs = inputs_of(&world, &frame);
    assert!(numbers(500).all(|u| sample_light(&inputs, Vec3::ZERO, u).distance < 3.0));
    // Beside the sphere, both are seen.
    assert!(numbers(500).any(|u| sample_light(&inputs, vec3(5.0, 0.0, 0.0), u).distance > 9.0));
}

#[test]
fn the_map_is_where_it_is_documented() {
    for (rotation, expected) in [(0.0, Vec3::X), (90.0, Vec3::NEG_Z), (-90.0, Vec3::Z)] {
        let mut colours = vec![Vec3::ZERO; 64 * 32];
        // Both texels beside the quarter to the right of the middle.
        for ix in [15 * 64 + 47, 15 * 64 + 48, 16 * 64 + 47, 16 * 64 + 48] {
            colours[ix] = Vec3::ONE;
        }
        let (made, _) = Environment::new([64, 32], colours, (rotation, 1.0)).unwrap();
        let world = world_with(Vec::new(), |scene| scene.environment = Some(made));
        let frame = frame(&world);
        let inputs = inputs_of(&world, &frame);
        assert_near(seen_environment(&inputs, expected).radiance.x, 1.0, 1e-3);
        assert_eq!(seen_environment(&inputs, -expected).radiance, Vec3::ZERO);
    }
    let mut colours = vec![Vec3::ZERO; 64 * 32];
    colours[..64].fill(Vec3::ONE);
    let (made, _) = Environment::new([64, 32], colours, (0.0, 1.0)).unwrap();
    let world = world_with(Vec::new(), |scene| scene.environment = Some(made));
    let frame = frame(&world);
    assert_eq!(seen_environment(&inputs_of(&world, &frame), Vec3::Y).radiance, Vec3::ONE);
}

/// A sky is seen where its sun is stated, with the radiance of its formula, and the sun's disk before it.
#[test]
fn skies_are_seen_as_their_formula_tells() {
    for up in [Up::Y, Up::Z] {
        let sky = Sky::new([35.0, 250.0], up).unwrap();
        let scene = Scene { sky: Some(sky), ..Scene::empty(Path::new("scene")) };
        let world = World::of_flat(FlatScene::new(&scene).unwrap(), &BuildOptions::default()).unwrap();
        let frame = frame(&world);
        let inputs = inputs_of(&world, &frame);
        let zenith = up.vector();
        // Directions that are at least a texel above the horizon.
        let directions = numbers(2000).map(|u| (2.0 * u - 1.0).normalize_or(zenith)).filter(|d| d.dot(zenith) > 0.02);
        for direction in directions.filter(|d| d.distance(sky.towards_sun) > 0.05) {
            let (seen, expected) = (seen_environment(&inputs, direction).radiance, sky.radiance(direction));
            assert!((seen / expected - 1.0).abs().max_element() < 0.01, "{up} {direction}: {seen} {expected}");
        }
        let Light::Sun { towards, irradiance, angle_degrees } = sky.sun() else { panic!("{:?}", sky.sun()) };
        let disk = irradiance.x / (angle_degrees / 2.0).to_radians().sin().powi(2);
        let beside =
            |degrees: f32| (towards + towards.any_orthonormal_vector() * degrees.to_radians().tan()).normalize();
        // The cosine of a quarter of a degree has three digits of 1 - cos in single precision.
        assert_near(seen_environment(&inputs, towards).radiance.x, disk, 1e-2);
        assert_near(seen_environment(&inputs, beside(0.26)).radiance.x, disk, 1e-2);
        assert!(seen_environment(&inputs, beside(0.27)).radiance.x < 10.0);
        let hidden = Scene { sky: Some(Sky { has_sun: false, ..sky }), ..scene };
        let world = World::of_flat(FlatScene::new(&hidden).unwrap(), &BuildOptions::default()).unwrap();
        assert!(seen_environment(&inputs_of(&world, &frame), towards).radiance.x < 10.0);
        assert_eq!((world.emitters().suns().len(), world.scene().lights.len()), (0, 0));
    }
}

#[test]
fn texels_that_are_no_radiance_are_mended() {
    let colours = vec![vec3(f32::NAN, 1.0, 2.0), vec3(-3.0, 0.0, 0.0), vec3(f32::INFINITY, 5.0, 0.0), Vec3::ONE];
    let (made, mended) = Environment::new([2, 2], colours, (0.0, 2.0)).unwrap();
    assert_eq!(made.colours(), [vec3(0.0, 2.0, 4.0), Vec3::ZERO, vec3(10.0, 10.0, 0.0), Vec3::splat(2.0)]);
    assert_eq!((mended.n_nan, mended.n_negative, mended.n_infinite), (1, 1, 1));
    assert!(mended.message().unwrap().contains("1 NaN, 1 negative, 1 infinite"));
    let (_, mended) = Environment::new([1, 1], vec![Vec3::ONE], (0.0, 1.0)).unwrap();
    assert_eq!(mended.message(), None);
    assert!(Environment::new([2, 2], vec![Vec3::ONE; 3], (0.0, 1.0)).is_err());
}

#[test]
fn nothing_is_sampled_where_there_is_no_light() {
    let black = Light::Sphere { position: Vec3::ONE, radius: 0.0, radiance: Vec3::ONE };
    let world = world(vec![black, Light::Point { position: Vec3::ONE, intensity: Vec3::ZERO }]);
    let frame = frame(&world);
    let inputs = inputs_of(&world, &frame);
    assert!(numbers(100).all(|u| sample_light(&inputs, Vec3::ZERO, u) == LightSample::NONE));
    assert!(world.scene().area_lights.is_empty());
    assert_eq!(self::world(vec![disk()]).scene().area_lights.len(), 1);
}
