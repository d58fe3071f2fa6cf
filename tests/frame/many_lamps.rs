//! Tests of so many lamps that a tree samples them: what a floor shows of them against closed forms.

use std::f32::consts::PI;

use glam::{Vec3, vec3};
use kdray::{
    layout::{AREA_SPHERE, AreaLight},
    world::FlatScene,
};

use super::lamps::{LAMP_HEIGHT, REFLECTANCE, floor, on_cpu, on_device, places};
use crate::support::{meshes, scenes};

const WIDTH: f32 = 60.0;
const N_COLUMNS: u32 = 256;
/// Columns whose mean is compared. The noise of a single one is larger than the tolerance.
const N_IN_GROUP: usize = 32;
const RADIUS: f32 = 0.05;
/// Half an edge of the squares that two triangles make up.
const HALF_EDGE: f32 = 0.04;
const N_LAMPS: usize = 240;

/// The place of a lamp along x, whose brightness is `brightness_of`.
fn place_of(ix: usize) -> f32 {
    (ix as f32 + 0.5) / N_LAMPS as f32 * WIDTH - WIDTH / 2.0
}

/// Lamps are brighter to the right.
fn brightness_of(ix: usize) -> f32 {
    1.0 + 3.0 * ix as f32 / N_LAMPS as f32
}

/// Returns the floor below a row of lamps: in turn points, spheres and squares.
fn hall() -> FlatScene {
    let mut scene = floor(WIDTH, N_COLUMNS);
    for ix in 0..N_LAMPS {
        let (position, light) = (vec3(place_of(ix), LAMP_HEIGHT, 0.0), Vec3::splat(brightness_of(ix)));
        match ix % 3 {
            0 => scene.lights.push(scenes::point_light(position, light)),
            1 => scene.area_lights.push(AreaLight {
                position,
                kind: AREA_SPHERE,
                radiance: light / (RADIUS * RADIUS),
                radius: RADIUS,
                area: 4.0 * PI * RADIUS * RADIUS,
                ..AreaLight::default()
            }),
            _ => {
                let corner = |x: f32, z: f32| position + HALF_EDGE * vec3(x, 0.0, z);
                let [a, b, c, d] = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
                let square = vec![meshes::triangle(a, b, c), meshes::triangle(a, c, d)];
                scenes::add(&mut scene, square, scenes::emissive(light / (HALF_EDGE * HALF_EDGE)));
            }
        }
    }
    scene
}

/// What the floor shows at x of all lamps.
fn expected(x: f32) -> f32 {
    let of_lamp = |ix: usize| {
        let squared = (x - place_of(ix)).powi(2) + LAMP_HEIGHT * LAMP_HEIGHT;
        let of_point = REFLECTANCE * LAMP_HEIGHT / (squared * squared.sqrt());
        // A small square sends its radiance times its area times the cosine; a point of intensity 1 sends pi.
        let of_square = 4.0 / PI * LAMP_HEIGHT / squared.sqrt() * of_point;
        brightness_of(ix) * if ix % 3 == 2 { of_square } else { of_point }
    };
    (0..N_LAMPS).map(of_lamp).sum()
}

/// Returns the largest relative difference between the means of groups of columns and what is expected.
fn error_of(found: &[f32]) -> f32 {
    let expected: Vec<f32> = places(WIDTH, N_COLUMNS).map(expected).collect();
    let groups = found.chunks(N_IN_GROUP).zip(expected.chunks(N_IN_GROUP));
    groups
        .map(|(found, expected)| (found.iter().sum::<f32>() / expected.iter().sum::<f32>() - 1.0).abs())
        .fold(0.0, f32::max)
}

#[test]
fn many_lamps_light_the_floor_as_their_sum_says() {
    let scene = hall();
    for found in [on_device(&scene, N_COLUMNS, 128), on_cpu(&scene, N_COLUMNS, 128)] {
        let error = error_of(&found);
        assert!(error < 0.02, "{error}");
        // The comparison can fail.
        let brighter: Vec<f32> = found.iter().map(|light| 1.04 * light).collect();
        assert!(error_of(&brighter) > 0.02);
    }
}
