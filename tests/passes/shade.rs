//! Tests of the kernel shade against its twin on the CPU, with the same hits and light visibilities.

use glam::vec3;
use kdray::{
    layout::{Batch, LIGHT_UNTESTED},
    reference::{self, shade::LitRays},
    scene::{Ground, Up},
};

use super::stage::{FIRST, RAY_COUNTS, Stage, UNTOUCHED_PIXEL, hits_of, options, rays_of};
use crate::support::{compare, random::Random, scenes, textured};

/// Returns how many of some rays are the camera's. Only a last bounce can be empty.
fn n_of_camera(n_rays: u32) -> u32 {
    n_rays.div_ceil(3)
}

/// Asserts that radiance agrees within 1e-4: `pow` and `inversesqrt` have an error of some 2^-13 of a steep
/// highlight. The rays are those of two bounces.
fn check(stage: &Stage, batch: &Batch, n_rays: u32) {
    let queue = &stage.resources.queue;
    let (rays, stored) = rays_of(stage, batch, n_rays);
    let hits = hits_of(stage, &rays);
    let mut random = Random(3);
    let light_visibility: Vec<u32> = (0..queue.light_visibility.len()).map(|_| random.below(3) as u32).collect();
    let mut expected = vec![UNTOUCHED_PIXEL; rays.len()];
    let lit = LitRays {
        rays: &rays,
        hits: &hits,
        n_of_camera: n_of_camera(n_rays) as usize,
        light_visibility: &light_visibility,
    };
    reference::shade::shade(&stage.inputs(), lit, &mut expected);
    expected.resize(queue.hits.len(), UNTOUCHED_PIXEL);

    let bounces = stage.set_n_rays(&[n_of_camera(n_rays), n_rays - n_of_camera(n_rays)]);
    stage.set_rays(&stored);
    stage.set_hits(&hits);
    queue.light_visibility.upload(&light_visibility).expect("light_visibility");
    queue.ray_radiance.upload(&vec![UNTOUCHED_PIXEL; queue.ray_radiance.len()]).expect("ray_radiance");
    stage.run(|commands| stage.passes.shade.record(commands, &stage.resources, batch));
    let found = queue.ray_radiance.download().expect("ray_radiance");
    compare::pixels(1e-4, stage.n_outliers(n_rays), &expected, &found).unwrap();

    let of_lights = || light_visibility.chunks(queue.capacity() as usize);
    for (row, counters) in bounces.iter().zip(stage.counters()) {
        let tested = |of_light: &[u32]| of_light[row.rays()].iter().filter(|&&state| state != LIGHT_UNTESTED).count();
        assert_eq!(counters.n_shadow_rays as usize, of_lights().map(tested).sum::<usize>(), "{n_rays} rays");
    }
}

#[test]
fn agrees_with_its_twin() {
    let stage = Stage::new(scenes::mixed_outdoors(), options(50, 50), 2010);
    for n_rays in RAY_COUNTS {
        check(&stage, &FIRST, n_rays);
        check(&stage, &Batch { first_pixel: 300, n_pixels: n_of_camera(n_rays), ..FIRST }, n_rays);
    }
}

#[test]
fn agrees_on_textures_and_microfacets() {
    let stage = Stage::new(textured::every_kind(), options(50, 50), 2010);
    for n_rays in [1, 2000] {
        check(&stage, &FIRST, n_rays);
        check(&stage, &Batch { n_pixels: n_of_camera(n_rays), ..FIRST }, n_rays);
    }
}

#[test]
fn agrees_below_a_sky() {
    for up in [Up::Y, Up::Z] {
        let mut scene = scenes::mixed();
        scene.lights.clear();
        scene.ambient = vec3(0.5, 0.7, 1.0);
        scene.ground = Some(Ground { ambient: vec3(0.4, 0.1, 0.0), up });
        check(&Stage::new(scene, options(50, 50), 500), &FIRST, 500);
    }
}

/// The camera's rays do not see the studio, and all others do.
#[test]
fn agrees_in_a_studio() {
    for (up, to_viewer) in [(Up::Y, vec3(0.6, 0.0, 0.8)), (Up::Z, vec3(0.8, -0.6, 0.0))] {
        let mut scene = scenes::mixed();
        scene.ground = Some(Ground { ambient: vec3(0.4, 0.1, 0.0), up });
        scene.studio = Some(to_viewer);
        check(&Stage::new(scene, options(50, 50), 500), &FIRST, 500);
    }
}

#[test]
fn agrees_without_lights() {
    let mut scene = scenes::mixed();
    scene.lights.clear();
    check(&Stage::new(scene, options(50, 50), 500), &FIRST, 500);
}
