//! Tests of lamps over a floor against closed forms: how their light falls off, and how wide penumbras are.

use std::f32::consts::PI;

use glam::{Vec3, vec3};
use kdray::{
    cpu::{self, Batching},
    frame::{Denoise, FrameRenderer, Integrator, Picture, PixelFilter, RenderOptions, sampling::samples_log2},
    layout::{AREA_DISK, AREA_RECTANGLE, AREA_SPHERE, AreaLight, MOST_SAMPLES_LOG2},
    render::GpuRenderer,
    scene::{Camera, Projection},
    world::FlatScene,
};

use super::studio::{assert_silent, device, world_of};
use crate::support::{meshes, scenes};

/// The reflectance of the floor, which is the plane y = 0.
pub const REFLECTANCE: f32 = 0.8;
/// The height of the lamps, world units.
pub const LAMP_HEIGHT: f32 = 3.0;
/// Rows of a picture, which all show the same within the tolerance of the tests.
const N_ROWS: u32 = 4;

/// Returns the floor, of which a camera below the lamp shows a strip that is `width` wide, along x.
pub fn floor(width: f32, n_columns: u32) -> FlatScene {
    let mut scene = scenes::empty();
    let corner = |x: f32, z: f32| vec3(x, 0.0, z);
    let floor = [
        meshes::triangle(corner(-50.0, -50.0), corner(-50.0, 50.0), corner(50.0, 50.0)),
        meshes::triangle(corner(-50.0, -50.0), corner(50.0, 50.0), corner(50.0, -50.0)),
    ];
    scenes::add(&mut scene, floor.to_vec(), scenes::diffuse(Vec3::splat(REFLECTANCE)));
    scene.camera = Camera {
        eye: vec3(0.0, 0.5, 0.0),
        target: Vec3::ZERO,
        up: Vec3::NEG_Z,
        projection: Projection::Orthographic { height: width * N_ROWS as f32 / n_columns as f32 },
    };
    scene
}

/// Adds a screen at the height 1, which covers what is on the side of negative x.
fn with_screen(mut scene: FlatScene) -> FlatScene {
    let screen = meshes::triangle(vec3(0.0, 1.0, -90.0), vec3(0.0, 1.0, 90.0), vec3(-90.0, 1.0, 0.0));
    scenes::add(&mut scene, vec![screen], scenes::diffuse(Vec3::ZERO));
    scene
}

fn options(n_columns: u32) -> RenderOptions {
    let mut options = RenderOptions {
        width: n_columns,
        height: N_ROWS,
        integrator: Integrator::Path,
        denoise: Denoise::Off,
        max_depth: 1,
        ..RenderOptions::default()
    };
    options.paths.filter = PixelFilter::Box;
    options
}

/// Returns the mean of each column in red.
fn columns(picture: &Picture) -> Vec<f32> {
    let width = picture.width as usize;
    let column = |x| picture.radiance.iter().skip(x).step_by(width).map(|pixel| pixel[0]).sum::<f32>();
    (0..width).map(|x| column(x) / N_ROWS as f32).collect()
}

pub fn on_device(scene: &FlatScene, n_columns: u32, n_samples: u32) -> Vec<f32> {
    let context = device();
    let mut renderer = GpuRenderer::new(context.clone(), &world_of(scene), &options(n_columns)).expect("a renderer");
    while renderer.n_samples() < n_samples {
        renderer.set_samples_per_frame(samples_log2(renderer.n_samples(), n_samples, MOST_SAMPLES_LOG2));
        renderer.draw_sample().expect("samples");
    }
    assert_silent(&context);
    columns(&renderer.picture().expect("a picture"))
}

pub fn on_cpu(scene: &FlatScene, n_columns: u32, n_samples: u32) -> Vec<f32> {
    let mut renderer = cpu::CpuRenderer::new(&world_of(scene), &options(n_columns), Batching::default());
    while renderer.n_samples() < n_samples {
        renderer.set_samples_per_frame(samples_log2(renderer.n_samples(), n_samples, MOST_SAMPLES_LOG2));
        renderer.draw_sample();
    }
    columns(&renderer.picture())
}

/// Returns the places of the columns' middles on the floor.
pub fn places(width: f32, n_columns: u32) -> impl Iterator<Item = f32> {
    (0..n_columns).map(move |column| ((column as f32 + 0.5) / n_columns as f32 - 0.5) * width)
}

/// Half the width along x, and half the length along z, of the smaller rectangle.
const HALF_EDGES: (f32, f32) = (0.5, 1.0);

/// A lamp of radiance 1 that shines down.
const LAMP: AreaLight = AreaLight {
    position: vec3(0.0, LAMP_HEIGHT, 0.0),
    kind: 0,
    radiance: Vec3::ONE,
    radius: RADIUS,
    axis: Vec3::NEG_Y,
    area: 0.0,
    edge_u: Vec3::X,
    probability: 1.0,
    edge_v: Vec3::Z,
    leaf_ix: 0,
};

fn rectangle((half_width, half_length): (f32, f32)) -> AreaLight {
    let (edge_u, edge_v) = (half_width * Vec3::X, half_length * Vec3::Z);
    AreaLight { kind: AREA_RECTANGLE, edge_u, edge_v, area: 4.0 * half_width * half_length, ..LAMP }
}

fn disk() -> AreaLight {
    AreaLight { kind: AREA_DISK, area: PI * RADIUS * RADIUS, ..LAMP }
}

/// The radius of spheres and disks.
const RADIUS: f32 = 0.4;

fn sphere() -> AreaLight {
    AreaLight { kind: AREA_SPHERE, area: 4.0 * PI * RADIUS * RADIUS, ..LAMP }
}

/// Returns what the floor shows at x of a rectangle of radiance 1 whose part from `low` to `high` along x is seen: the
/// configuration factor of an element of area and a parallel rectangle, as a sum over the corners.
fn floor_below_rectangle(x: f32, (low, high): (f32, f32), half_length: f32) -> f32 {
    let part = |a: f32, b: f32| a / (1.0 + a * a).sqrt() * (b / (1.0 + a * a).sqrt()).atan();
    let corner = |at: f32| {
        let (a, b) = ((at - x) / LAMP_HEIGHT, half_length / LAMP_HEIGHT);
        // Of the two corners along z, which are at the same distance.
        part(a, b) + part(b, a)
    };
    REFLECTANCE / PI * (corner(high) - corner(low))
}

/// What the floor shows at x of a disk of radiance 1: the configuration factor of an element of area and a parallel
/// disk, in units of the offset.
fn floor_below_disk(x: f32) -> f32 {
    let offset = x.abs().max(0.05);
    let (h, r) = ((LAMP_HEIGHT / offset).powi(2), (RADIUS / offset).powi(2));
    let z = 1.0 + h + r;
    REFLECTANCE * 0.5 * (1.0 - (1.0 + h - r) / (z * z - 4.0 * r).sqrt())
}

/// What the floor shows at x of a point of intensity 1.
fn floor_below_point(x: f32) -> f32 {
    let squared = x * x + LAMP_HEIGHT * LAMP_HEIGHT;
    REFLECTANCE * LAMP_HEIGHT / (squared * squared.sqrt())
}

/// A lamp over the floor: its name, the scene, and what the floor shows at x.
type Lamp = (&'static str, FlatScene, Box<dyn Fn(f32) -> f32>);

/// Returns a lamp of each kind. The light of a sphere is that of a point at its centre.
fn lamps(width: f32, n_columns: u32) -> Vec<Lamp> {
    let empty = floor(width, n_columns);
    let with = |lamp| FlatScene { area_lights: vec![lamp], ..empty.clone() };
    let point = scenes::point_light(LAMP.position, Vec3::ONE);
    let below = |(half_width, half_length): (f32, f32)| -> Box<dyn Fn(f32) -> f32> {
        Box::new(move |x| floor_below_rectangle(x, (-half_width, half_width), half_length))
    };
    let large = (4.0, 2.5);
    vec![
        ("point", FlatScene { lights: vec![point], ..empty.clone() }, Box::new(floor_below_point)),
        ("sphere", with(sphere()), Box::new(|x| RADIUS * RADIUS * floor_below_point(x))),
        ("disk", with(disk()), Box::new(floor_below_disk)),
        ("rectangle", with(rectangle(HALF_EDGES)), below(HALF_EDGES)),
        ("large rectangle", with(rectangle(large)), below(large)),
    ]
}

/// Near the lamp and far from it, the floor shows the closed form to 2 %.
#[test]
fn light_falls_off_as_the_closed_forms_say() {
    let (width, n_columns) = (16.0, 256);
    for (lamp, scene, expected) in lamps(width, n_columns) {
        for found in [on_device(&scene, n_columns, 128), on_cpu(&scene, n_columns, 128)] {
            for (x, found) in places(width, n_columns).zip(found) {
                // The mean over the column, by three points (Simpson's rule).
                let half = 0.5 * width / n_columns as f32;
                let mean = (expected(x - half) + 4.0 * expected(x) + expected(x + half)) / 6.0;
                assert!((found / mean - 1.0).abs() < 0.02, "{lamp} at {x}: {found}, {mean}");
            }
        }
    }
}

/// The columns of a penumbra: where there is some light, and less than without the screen. Where all light arrives, the
/// picture has the same bits with and without the screen, since its paths are the same.
fn penumbra(lit: &[f32], screened: &[f32]) -> (usize, usize) {
    let first = screened.iter().position(|light| *light > 0.0).expect("light");
    let end = lit.iter().zip(screened).rposition(|(lit, screened)| lit != screened).expect("shadow") + 1;
    (first, end)
}

const N_COLUMNS: u32 = 160;
const WIDTH: f32 = 0.8;

/// Fails unless the penumbra of a lamp begins and ends within 3 columns of `half_width` from the middle, on the CPU and
/// on the device. Returns the light of the columns on the CPU.
fn assert_penumbra(lamp: AreaLight, half_width: f32) -> Vec<f32> {
    let lit = FlatScene { area_lights: vec![lamp], ..floor(WIDTH, N_COLUMNS) };
    let screened = with_screen(lit.clone());
    let in_columns = half_width / WIDTH * N_COLUMNS as f32;
    let expected = [-in_columns, in_columns].map(|ix| ix + N_COLUMNS as f32 / 2.0);
    let found = on_cpu(&screened, N_COLUMNS, 256);
    for (lit, screened) in [
        (on_cpu(&lit, N_COLUMNS, 256), found.clone()),
        (on_device(&lit, N_COLUMNS, 256), on_device(&screened, N_COLUMNS, 256)),
    ] {
        let (first, end) = penumbra(&lit, &screened);
        assert!((first as f32 - expected[0]).abs() < 3.0, "begins at column {first}, expected {}", expected[0]);
        assert!((end as f32 - expected[1]).abs() < 3.0, "ends at column {end}, expected {}", expected[1]);
    }
    found
}

/// The screen is at a third of the lamp's height, so the penumbra is half as wide as the lamp. Within it, the floor
/// shows the part of the lamp that is seen past the screen.
#[test]
fn the_penumbra_of_a_rectangle_is_as_wide_as_similar_triangles_say() {
    let found = assert_penumbra(rectangle(HALF_EDGES), HALF_EDGES.0 / (LAMP_HEIGHT - 1.0));
    let full = floor_below_rectangle(0.0, (-HALF_EDGES.0, HALF_EDGES.0), HALF_EDGES.1);
    for (x, found) in places(WIDTH, N_COLUMNS).zip(found) {
        let low = (-(LAMP_HEIGHT - 1.0) * x).clamp(-HALF_EDGES.0, HALF_EDGES.0);
        let expected = floor_below_rectangle(x, (low, HALF_EDGES.0), HALF_EDGES.1);
        assert!((found - expected).abs() < 0.015 * full, "at {x}: {found}, {expected}");
    }
}

/// The planes through the screen's edge that touch the sphere meet the floor where the penumbra begins and ends.
#[test]
fn the_penumbra_of_a_sphere_ends_at_its_tangents() {
    let above_screen = LAMP_HEIGHT - 1.0;
    assert_penumbra(sphere(), RADIUS / (above_screen * above_screen - RADIUS * RADIUS).sqrt());
}

/// The comparison can fail: a lamp that is a fifth larger has another penumbra.
#[test]
#[should_panic(expected = "at column")]
fn another_width_is_noticed() {
    assert_penumbra(sphere(), 1.2 * RADIUS / (LAMP_HEIGHT - 1.0));
}
