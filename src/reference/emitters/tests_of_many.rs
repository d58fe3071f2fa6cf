//! Tests of scenes with so many lights that a tree samples them.

use std::f32::consts::PI;

use glam::{Vec3, vec3};

use super::{
    LightSample, emission_pdf, sample_light, seen_environment, seen_light,
    tests::{assert_near, emitting_square, frame, inputs_of, irradiance, map, numbers, sun, world, world_with},
};
use crate::{
    layout::{EMITTER_ENVIRONMENT, EMITTER_SUN, EMITTER_TREE, EMITTER_TRIANGLE},
    reference::chi_square::Uniform,
    scene::Light,
    world::World,
};

/// Point lights at places that are spread over a long row.
fn points(n: usize) -> Vec<Light> {
    let mut random = Uniform(1);
    let place = |_| random.point() * vec3(60.0, 5.0, 5.0) + vec3(-30.0, 0.0, 1.0);
    (0..n).map(place).map(|position| Light::Point { position, intensity: vec3(2.0, 1.0, 0.5) }).collect()
}

/// A scene with lights of all kinds, of which a tree has those with a place.
fn all_kinds() -> World {
    let radiance = Vec3::splat(3.0);
    let mut lights = points(230);
    let mut random = Uniform(2);
    for ix in 0..60 {
        let position = random.point() * vec3(60.0, 9.0, 1.0) + vec3(-30.0, -4.0, 6.0);
        lights.push(match ix % 4 {
            0 => Light::Rectangle { position, edge_u: 0.2 * Vec3::Y, edge_v: 0.3 * Vec3::X, radiance },
            1 => Light::Disk { position, towards: Vec3::NEG_Z, radius: 0.1, radiance },
            2 => Light::Sphere { position, radius: 0.1, radiance },
            _ => Light::Point { position, intensity: Vec3::ZERO },
        });
    }
    lights.push(sun());
    lights.push(Light::Directional { towards: Vec3::Z, irradiance: Vec3::ONE });
    world_with(lights, |scene| {
        emitting_square(scene);
        scene.environment = Some(map(0.0));
    })
}

#[test]
fn a_tree_samples_where_there_are_many_lights() {
    let few = world(points(255));
    assert!(few.emitters().light_nodes.is_empty() && few.emitters().n_sampled == 255);
    let mut lights = points(255);
    lights.push(Light::Point { position: Vec3::ONE, intensity: Vec3::ZERO });
    lights.push(sun());
    assert!(world(lights).emitters().light_nodes.is_empty(), "lights without power and suns do not count");
    let many = world(points(256));
    assert_eq!((many.emitters().light_nodes.len(), many.emitters().n_sampled), (511, 1));
    let emitters = all_kinds();
    let emitters = emitters.emitters();
    let kinds: Vec<u32> = emitters.entries[..emitters.n_sampled].iter().map(|emitter| emitter.kind).collect();
    assert_eq!(kinds, [0, EMITTER_SUN, EMITTER_ENVIRONMENT, EMITTER_TREE]);
    assert_eq!(emitters.light_nodes.len(), 2 * (230 + 45 + 2) - 1);
    assert!(emitters.triangles().len() == 2 && emitters.triangles().iter().all(|it| it.kind == EMITTER_TRIANGLE));
}

/// The irradiance that samples find is the sum over all lights.
#[test]
fn many_lights_add_up() {
    let lights = points(300);
    let expected: f32 = lights
        .iter()
        .map(|light| {
            let Light::Point { position, intensity } = *light else { panic!("{light:?}") };
            PI * intensity.x * position.normalize().z / position.length_squared()
        })
        .sum();
    let world = world(lights);
    let frame = frame(&world);
    assert_near(irradiance(&inputs_of(&world, &frame), Vec3::ZERO, Vec3::Z).x, expected, 5e-3);
}

/// Returns the pdf of a sample's direction, as a ray that meets the light computes it.
fn pdf_of_seen(world: &World, point: Vec3, sample: &LightSample) -> f32 {
    let frame = frame(world);
    let inputs = inputs_of(world, &frame);
    if sample.distance.is_infinite() {
        return seen_environment(&inputs, sample.direction).pdf;
    }
    let seen = seen_light(&inputs, point, sample.direction, f32::INFINITY);
    if (seen.t - sample.distance).abs() < 1e-3 * sample.distance {
        return seen.pdf;
    }
    // The triangle on whose side of the diagonal the point is.
    let at = point + sample.distance * sample.direction;
    let triangle_ix = if at.x > at.y { 1 } else { 2 };
    emission_pdf(&inputs, triangle_ix, point, sample.direction, sample.distance)
}

#[test]
fn samples_of_many_have_the_pdf_of_what_is_seen() {
    let world = all_kinds();
    let frame = frame(&world);
    let inputs = inputs_of(&world, &frame);
    let (mut n_beyond, mut n_near, mut n_borders) = (0, 0, 0);
    for point in [vec3(6.0, 0.2, -4.0), vec3(-0.3, 0.1, 1.5), vec3(3.0, 0.1, 2.1)] {
        for u in numbers(10_000) {
            let sample = sample_light(&inputs, point, u);
            if sample.pdf == 0.0 {
                continue; // a light without a size, or none
            }
            let pdf = pdf_of_seen(&world, point, &sample);
            let is_other = (pdf - sample.pdf).abs() > 1e-2 * sample.pdf;
            // At the border of two texels, of two triangles and of the sun, rounding decides.
            n_borders += usize::from(is_other);
            n_beyond += usize::from(sample.distance.is_infinite());
            n_near += usize::from(sample.distance.is_finite());
        }
    }
    assert!(n_beyond > 500 && n_near > 500, "{n_beyond} {n_near}");
    assert!(n_borders * 500 <= n_beyond + n_near, "{n_borders} of {n_beyond} and {n_near}");
}
