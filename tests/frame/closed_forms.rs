//! Tests of pictures whose closed form is known.

use std::f32::consts::{SQRT_2, TAU};

use glam::{Vec3, vec3};
use kdray::{
    frame::{Picture, Primary, RenderOptions},
    layout::{FLAT_NORMAL, Triangle},
    scene::{Camera, Ground, Projection, Up},
    world::FlatScene,
};

use super::studio::{differing, on_both, options};
use crate::support::{meshes, random::Random, scenes};

/// Returns the largest difference of any channel of any pixel from `radiance`.
fn worst(picture: &Picture, radiance: Vec3) -> f32 {
    let off = |pixel: &[f32; 4]| (Vec3::new(pixel[0], pixel[1], pixel[2]) - radiance).abs().max_element();
    // NaN counts as an infinite difference.
    picture.radiance.iter().map(off).map(|off| if off.is_nan() { f32::INFINITY } else { off }).fold(0.0, f32::max)
}

/// A furnace: a closed room whose walls all emit the same radiance, with objects that neither add nor absorb light.
/// The picture has a single colour. Primary rays are traced, since a rasterizer may show the back of a mirror at its
/// outline, so that a ray would start inside the mirror.
#[test]
fn a_furnace_is_uniform() {
    let glow = vec3(0.2, 0.5, 0.9);
    let traced = |depth| RenderOptions { primary: Primary::Trace, ..options(80, 60, depth) };
    let mut scene = scenes::empty();
    scenes::add(&mut scene, scenes::room(5.0), scenes::emissive(glow));
    for picture in on_both(&scene, &options(40, 30, 3)) {
        assert_eq!(worst(&picture, glow), 0.0);
    }
    scenes::add(&mut scene, scenes::smooth_sphere(8, 0.8, vec3(-1.0, 0.0, 0.0)), scenes::mirror(Vec3::ONE));
    let cube = meshes::placed(meshes::cube(2, 0.0), 0.5, vec3(1.0, 0.2, 0.0));
    scenes::add(&mut scene, cube, scenes::mirror(Vec3::ONE));
    let veil = meshes::placed(meshes::cube(1, 0.0), 0.4, vec3(0.0, 0.2, 2.0));
    scenes::add(&mut scene, veil, kdray::layout::Material { ke: glow, d: 0.3, ..scenes::BLACK });
    for picture in on_both(&scene, &traced(12)) {
        assert!(worst(&picture, glow) < 2e-3, "off by {}", worst(&picture, glow));
    }
    // Glass splits rays. Near total reflection, the share that the maximum depth cuts off falls slowly with the
    // depth.
    scenes::add(&mut scene, scenes::smooth_sphere(8, 0.5, vec3(0.3, -1.1, 0.5)), scenes::glass(1.5));
    for picture in on_both(&scene, &traced(40)) {
        assert!(worst(&picture, glow) < 2e-3, "off by {}", worst(&picture, glow));
    }
}

/// With ambient light alone, the radiance of a surface does not depend on its position.
#[test]
fn ambient_light_is_ka_times_ambient() {
    let mut scene = scenes::empty();
    scenes::add(&mut scene, scenes::room(3.0), scenes::diffuse(vec3(0.25, 0.5, 0.75)));
    scene.ambient = vec3(0.5, 0.25, 1.0);
    for picture in on_both(&scene, &options(16, 12, 2)) {
        assert_eq!(worst(&picture, vec3(0.125, 0.125, 0.75)), 0.0);
    }
}

/// A white plane shows the irradiance that its slope receives: (1 + s) / 2 of the sky's and the rest of the ground's,
/// s being the cosine of the angle between its normal and the up axis.
#[test]
fn a_plane_shows_as_much_of_the_sky_as_its_slope_says() {
    let (sky, ground) = (vec3(0.25, 0.5, 1.0), vec3(0.75, 0.25, 0.0));
    for (up, normal, cosine) in [
        (Up::Y, Vec3::Y, 1.0),
        (Up::Y, Vec3::NEG_Y, -1.0),
        (Up::Y, Vec3::X, 0.0),
        (Up::Y, vec3(0.0, 0.6, 0.8), 0.6),
        (Up::Z, Vec3::Z, 1.0),
        (Up::Z, vec3(0.0, 0.6, -0.8), -0.8),
    ] {
        let mut scene = scenes::empty();
        let (right, above) = normal.any_orthonormal_pair();
        let corner = |x: f32, y: f32| 50.0 * (x * right + y * above);
        let [v0, v1, v2] = [corner(-1.0, -1.0), corner(3.0, -1.0), corner(-1.0, 3.0)];
        let plane = Triangle { v0, v1, v2, n0: FLAT_NORMAL, n1: FLAT_NORMAL, n2: FLAT_NORMAL };
        scenes::add(&mut scene, vec![plane], scenes::diffuse(Vec3::ONE));
        scene.ambient = sky;
        scene.ground = Some(Ground { ambient: ground, up });
        scene.camera = Camera { eye: 5.0 * normal, target: Vec3::ZERO, up: right, ..scene.camera };
        let expected = ground + (sky - ground) * (1.0 + cosine) / 2.0;
        for picture in on_both(&scene, &options(16, 12, 2)) {
            assert!(worst(&picture, expected) < 1e-4, "{up} {normal}: {}", worst(&picture, expected));
        }
    }
}

/// Equal colours from above and below change no bit.
#[test]
fn an_even_sky_is_ambient_light() {
    let mut scene = colourful_room();
    scenes::add(&mut scene, scenes::smooth_sphere(8, 1.0, vec3(0.5, 0.0, 0.0)), scenes::diffuse(vec3(0.3, 0.7, 0.1)));
    scene.ambient = vec3(0.1, 0.3, 0.7);
    let even = on_both(&scene, &options(32, 24, 3));
    scene.ground = Some(Ground { ambient: scene.ambient, up: Up::Z });
    assert_eq!(on_both(&scene, &options(32, 24, 3)), even);
}

/// Returns a room whose walls emit different colours.
fn colourful_room() -> FlatScene {
    let mut scene = scenes::empty();
    for (i, wall) in meshes::cube(4, 0.0).chunks(7).enumerate() {
        let colour = vec3((i * 37 % 11) as f32, (i * 53 % 13) as f32, (i * 71 % 7) as f32) / 12.0;
        scenes::add(&mut scene, meshes::placed(wall.to_vec(), 5.0, Vec3::ZERO), scenes::emissive(colour));
    }
    scene
}

/// At most a few pixels may change, on edges that are seen through the glass.
#[test]
fn glass_of_index_one_is_invisible() {
    let scene = colourful_room();
    let mut with_glass = scene.clone();
    scenes::add(&mut with_glass, scenes::smooth_sphere(8, 1.0, vec3(0.5, 0.0, 0.0)), scenes::glass(1.0));
    let cube = meshes::placed(meshes::cube(1, 0.0), 0.6, vec3(-1.2, 0.3, 0.4));
    scenes::add(&mut with_glass, cube, scenes::glass(1.0));
    let options = options(80, 60, 8);
    for (without, with) in on_both(&scene, &options).iter().zip(&on_both(&with_glass, &options)) {
        let n_differing = differing(without, with, 1e-3).len();
        assert!(n_differing <= 5, "{n_differing} pixels differ");
    }
    // With index 1.5, the glass is visible.
    with_glass
        .materials
        .iter_mut()
        .filter(|material| material.ni == 1.0 && material.flags != 0)
        .for_each(|m| m.ni = 1.5);
    for (without, with) in on_both(&scene, &options).iter().zip(&on_both(&with_glass, &options)) {
        assert!(differing(without, with, 1e-3).len() > 500);
    }
}

/// A plane mirror shows the same picture as the mirrored world in its place.
#[test]
fn a_mirror_shows_the_mirrored_world() {
    let things = |scene: &mut FlatScene, side: f32| {
        for (i, (position, scale)) in
            [(vec3(0.5, 0.2, 3.5), 0.5), (vec3(-0.8, 0.5, 3.0), 0.4), (vec3(0.1, -0.9, 2.5), 0.3)]
                .into_iter()
                .enumerate()
        {
            let mut thing = meshes::placed(meshes::torus(12, 8), scale, position);
            for v in thing.iter_mut().flat_map(|t| [&mut t.v0, &mut t.v1, &mut t.v2]) {
                v.z *= side;
            }
            scenes::add(scene, thing, scenes::emissive(vec3(0.3 + 0.3 * i as f32, 0.8 - 0.3 * i as f32, 0.5)));
        }
    };
    // The camera is between the mirror (z = 0) and the objects, and looks away from the objects.
    let camera = Camera {
        eye: vec3(0.1, 0.0, 1.5),
        target: Vec3::ZERO,
        up: Vec3::Y,
        projection: Projection::Perspective { vertical_fov_degrees: 50.0 },
    };
    let mut before = FlatScene { camera, background: vec3(0.1, 0.1, 0.2), ..scenes::empty() };
    things(&mut before, 1.0);
    let plane = meshes::triangle(vec3(-90.0, -50.0, 0.0), vec3(90.0, -50.0, 0.0), vec3(0.0, 99.0, 0.0));
    scenes::add(&mut before, vec![plane], scenes::mirror(vec3(1.0, 0.5, 0.25)));
    let mut behind = FlatScene { camera, background: vec3(0.1, 0.1, 0.2), ..scenes::empty() };
    things(&mut behind, -1.0);
    for (mirrored, mut direct) in
        on_both(&before, &options(80, 60, 2)).iter().zip(on_both(&behind, &options(80, 60, 2)))
    {
        direct.radiance.iter_mut().for_each(|[_, g, b, _]| (*g, *b) = (*g * 0.5, *b * 0.25));
        let n_differing = differing(mirrored, &direct, 1e-3).len();
        assert!(n_differing <= 60, "{n_differing} pixels differ"); // on the objects' outlines
        assert!(differing(mirrored, &direct, -1.0).len() == 4800, "the comparison looks at every pixel");
        let n_things = mirrored.radiance.iter().filter(|pixel| pixel[0] > 0.25).count();
        assert!(n_things > 200, "{n_things} pixels show things");
    }
}

/// A square of half width 0.5 in the plane y = 2, under a lamp at y = 4, casts a shadow on y = 0 that is a square of
/// half width 1.
#[test]
fn a_shadow_ends_where_it_must() {
    let square = |half: f32, y: f32| {
        let corner = |x: f32, z: f32| vec3(x * half, y, z * half);
        let [a, b, c, d] = [corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
        vec![meshes::triangle(a, b, c), meshes::triangle(a, c, d)]
    };
    let mut scene = scenes::empty();
    scenes::add(&mut scene, square(4.0, 0.0), scenes::diffuse(Vec3::ONE));
    scenes::add(&mut scene, square(0.5, 2.0), scenes::diffuse(Vec3::ONE));
    scene.lights = vec![scenes::point_light(vec3(0.0, 4.0, 0.0), Vec3::splat(16.0))];
    // With a field of view of 90 degrees from a height of 1.5, the picture's edge is 1.5 from its middle.
    scene.camera = Camera {
        eye: vec3(0.0, 1.5, 0.0),
        target: Vec3::ZERO,
        up: Vec3::NEG_Z,
        projection: Projection::Perspective { vertical_fov_degrees: 90.0 },
    };
    let n = 90;
    for picture in on_both(&scene, &options(n, n, 1)) {
        for (i, pixel) in picture.radiance.iter().enumerate() {
            let at = |i: usize| ((i as f32 + 0.5) / n as f32 * 2.0 - 1.0) * 1.5;
            let (x, z) = (at(i % n as usize), at(i / n as usize));
            if (x.abs().max(z.abs()) - 1.0).abs() < 0.02 {
                continue;
            }
            // Lambert's law and the inverse square of the distance give 16 / 16 below the lamp, times the cubed
            // cosine.
            let cos = 4.0 / vec3(x, 4.0, z).length();
            let expected = if x.abs().max(z.abs()) < 1.0 { 0.0 } else { cos * cos * cos };
            assert!((pixel[0] - expected).abs() < 1e-4, "at {x}, {z}: {}, not {expected}", pixel[0]);
        }
    }
}

/// Squares that overlap in one plane have no shadows on one another, whether the plane is through 0 or not.
#[test]
fn overlapping_faces_of_a_plane_do_not_shadow_one_another() {
    for (normal, distance) in [(Vec3::Y, 0.0), (Vec3::Y, 1.0), (vec3(0.36, 0.48, 0.8), 0.0), (vec3(0.6, 0.8, 0.0), 0.1)]
    {
        let (right, above) = normal.any_orthonormal_pair();
        let mut scene = scenes::empty();
        let mut random = Random(3);
        for _ in 0..8 {
            let (half, turn) = (random.between(4.0, 7.0), random.between(0.0, TAU));
            let corner = |ix: usize| {
                let angle = turn + ix as f32 * TAU / 4.0;
                distance * normal + SQRT_2 * half * (angle.cos() * right + angle.sin() * above)
            };
            let [a, b, c, d] = [0, 1, 2, 3].map(corner);
            scenes::add(
                &mut scene,
                vec![meshes::triangle(a, b, c), meshes::triangle(a, c, d)],
                scenes::diffuse(Vec3::ONE),
            );
        }
        // The camera sees 3 units of the plane, which all squares cover.
        scene.camera = Camera { eye: (distance + 3.0) * normal, target: Vec3::ZERO, up: right, ..scene.camera };
        for slope in [0.1, 0.5, 2.0] {
            let to_light = (slope * normal + right + 0.3 * above).normalize();
            scene.lights = vec![scenes::directional_light(to_light, Vec3::ONE)];
            for picture in on_both(&scene, &options(80, 60, 1)) {
                let off = worst(&picture, Vec3::splat(normal.dot(to_light)));
                assert!(off < 1e-4, "normal {normal}, distance {distance}, slope {slope}: {off}");
            }
        }
    }
}
