//! Tests of normal maps in paths: light ends as smoothly as by the integrator `whitted`, and no triangle shows.

use glam::{DVec3, Vec3, vec3};
use kdray::{
    frame::{Integrator, PathOptions, Picture, PixelFilter, RenderOptions},
    scene::{Channel, Light, Maps, Material, Microfacet, Scene, Texture},
    world::FlatScene,
};

use super::studio::{differing, options, samples_on_cpu, samples_on_device};
use crate::support::textured::{self, add, add_image, empty, placed, sphere};

const SIZE: u32 = 40;

/// A sphere of 4 `n`^2 triangles, whose normals a map of one colour tilts.
fn tilted(n: u32, material: Material) -> Scene {
    let mut scene = empty();
    let image = add_image(&mut scene, [1, 1], |_, _| [209, 158, 221, 255]);
    let maps = Maps { normal: Some(Texture::of_data(image, Channel::Red)), normal_scale: 1.0, ..Maps::default() };
    add(&mut scene, sphere(n), placed(1.4, DVec3::ZERO), Material { maps, ..material });
    scene
}

fn lit(scene: Scene) -> FlatScene {
    let towards = vec3(0.9, 0.2, 0.4).normalize();
    let lights = vec![Light::Directional { towards, irradiance: Vec3::ONE }];
    FlatScene::new(&Scene { lights, ..scene }).expect("a scene that fits together")
}

fn lambertian() -> Material {
    Material { ks: Vec3::ZERO, ..textured::rough(Vec3::ONE) }
}

fn metal() -> Material {
    let microfacet = Some(Microfacet { metallic: 1.0, roughness: 0.5, ..Microfacet::default() });
    Material { microfacet, ..textured::rough(Vec3::ONE) }
}

/// Options of pictures with the light that surfaces receive from lights, and no other.
fn direct(integrator: Integrator) -> RenderOptions {
    let paths = PathOptions { filter: PixelFilter::Box, ..PathOptions::default() };
    RenderOptions { integrator, paths, ..options(SIZE, SIZE, 2) }
}

/// Returns the pixels whose square of three by three pixels has the sphere alone.
fn inner_pixels(picture: &Picture) -> Vec<usize> {
    let centre = 0.5 * SIZE as f32;
    let radius = 0.5 * SIZE as f32 * 1.4 / (4.0 * 0.414_213_56) - 3.0;
    let is_inner = |i: &usize| {
        let (x, y) = ((i % SIZE as usize) as f32 + 0.5 - centre, (i / SIZE as usize) as f32 + 0.5 - centre);
        x.hypot(y) < radius
    };
    (0..picture.radiance.len()).filter(is_inner).collect()
}

/// A Lambertian surface has the same light in both integrators: its shadow terminator is as soft, and a viewer behind
/// a bent normal sees no triangles.
#[test]
fn paths_bend_light_as_whitted_does() {
    let scene = lit(tilted(16, lambertian()));
    let expected = samples_on_cpu(&scene, &direct(Integrator::Whitted), 16);
    let path = direct(Integrator::Path);
    for found in [samples_on_cpu(&scene, &path, 16), samples_on_device(&scene, &path, 16)] {
        let inner = inner_pixels(&found);
        let off: Vec<_> = differing(&found, &expected, 0.03).into_iter().filter(|i| inner.contains(i)).collect();
        assert!(off.len() <= 2, "{} of {} pixels differ", off.len(), inner.len());
    }
}

/// The triangles of a coarse sphere are not seen: its pictures are those of a fine one.
#[test]
fn bent_normals_hide_the_triangles() {
    for material in [lambertian(), textured::rough(Vec3::ONE), metal()] {
        let [coarse, fine] =
            [16, 48].map(|n| samples_on_cpu(&lit(tilted(n, material.clone())), &direct(Integrator::Path), 64));
        let inner = inner_pixels(&coarse);
        let off: Vec<_> = differing(&coarse, &fine, 0.06).into_iter().filter(|i| inner.contains(i)).collect();
        assert!(off.len() <= 4, "{} of {} pixels differ", off.len(), inner.len());
    }
}
