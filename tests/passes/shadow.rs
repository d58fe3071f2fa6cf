//! Tests of the kernel shadow against its twin on the CPU, with the same hits.

use std::collections::HashSet;

use glam::Vec3;
use kdray::{
    accel::kdtree::Traversal,
    frame::RenderOptions,
    layout::{Batch, FLAT_NORMAL, Hit, LIGHT_LIT, LIGHT_SHADOWED, LIGHT_UNTESTED, NO_TRIANGLE},
    reference::{self, shade::LitRays},
    world::FlatScene,
};

use super::stage::{FIRST, RAY_COUNTS, Stage, UNTOUCHED_WORD, hits_of, options, rays_of, some_rays};
use crate::support::{compare, scenes, textured};

/// Asserts that both agree on the rays of two bounces. Returns the light visibilities.
fn check(stage: &Stage, batch: &Batch, n_rays: u32) -> Vec<u32> {
    let queue = &stage.resources.queue;
    let (rays, stored) = rays_of(stage, batch, n_rays);
    let hits = hits_of(stage, &rays);
    let bounces = stage.set_n_rays(&[n_rays / 3, n_rays - n_rays / 3]);
    let mut expected = vec![UNTOUCHED_WORD; queue.light_visibility.len()];
    for row in &bounces[..2] {
        let (bindings, rays) = (stage.inputs(), (rays.as_slice(), hits.as_slice()));
        let n_tested = reference::shadow::shadow(&bindings, stage.options.traversal, &row.rays(), rays, &mut expected);
        let is_tested = |state: &&u32| [LIGHT_LIT, LIGHT_SHADOWED].contains(state);
        let of_lights = expected.chunks(queue.capacity() as usize);
        let n_marked: usize = of_lights.map(|of_light| of_light[row.rays()].iter().filter(is_tested).count()).sum();
        assert_eq!(n_tested as usize, n_marked);
    }
    stage.set_rays(&stored);
    stage.set_hits(&hits);
    queue.light_visibility.upload(&vec![UNTOUCHED_WORD; expected.len()]).expect("light_visibility");
    stage.trace(batch, |commands, batch| stage.passes.shadow.record(commands, &stage.resources, batch));
    let found = queue.light_visibility.download().expect("light_visibility");
    compare::exact_but_for(stage.n_outliers(n_rays * stage.world.scene().lights.len() as u32), &expected, &found)
        .unwrap();
    found
}

#[test]
fn agrees_with_its_twin() {
    for &traversal in Traversal::ALL {
        let stage = Stage::new(scenes::mixed_outdoors(), RenderOptions { traversal, ..options(8, 8) }, 2010);
        let states: HashSet<u32> = RAY_COUNTS.into_iter().flat_map(|n| check(&stage, &FIRST, n)).collect();
        assert_eq!(states, HashSet::from([LIGHT_UNTESTED, LIGHT_LIT, LIGHT_SHADOWED, UNTOUCHED_WORD]));
    }
}

#[test]
fn agrees_on_cut_outs_and_normal_maps() {
    for traversal in [Traversal::Mask, Traversal::Ropes] {
        let stage = Stage::new(textured::every_kind(), RenderOptions { traversal, ..options(50, 50) }, 2010);
        check(&stage, &Batch { n_pixels: 1200, ..FIRST }, 2000);
    }
}

#[test]
fn agrees_where_the_first_rays_are_the_cameras() {
    let stage = Stage::new(scenes::mixed_outdoors(), options(50, 50), 2010);
    for n in RAY_COUNTS {
        check(&stage, &Batch { first_pixel: 300, n_pixels: n / 3, ..FIRST }, n);
    }
}

/// Returns a scene of flat surfaces, on which a light behind the surface cannot show: diffuse ones, ones with a
/// narrow highlight, and black ones.
fn flat() -> FlatScene {
    let mut scene = scenes::mixed_outdoors();
    scene.triangles.iter_mut().for_each(|t| [t.n0, t.n1, t.n2] = [FLAT_NORMAL; 3]);
    let materials = [scenes::diffuse(Vec3::splat(0.5)), scenes::glossy(Vec3::ZERO, Vec3::ONE, 300.0), scenes::BLACK];
    scene.materials = (0..scene.materials.len()).map(|i| materials[i % 3]).collect();
    scene
}

/// Lights that are not tested would not change the radiance if they were lit. Lights that are tested would.
#[test]
fn lights_that_are_not_asked_for_could_not_be_seen() {
    let stage = Stage::new(flat(), options(8, 8), 2000);
    let (rays, n) = (some_rays(&stage, 2000), 2000);
    let hits = hits_of(&stage, &rays);
    let mut asked_for = vec![UNTOUCHED_WORD; stage.resources.queue.light_visibility.len()];
    let traversal = stage.options.traversal;
    reference::shadow::shadow(&stage.inputs(), traversal, &(0..n), (rays.as_slice(), hits.as_slice()), &mut asked_for);
    let shaded = |light_visibility: &[u32]| {
        let mut radiance = vec![[0.0; 4]; n];
        let lit = LitRays { rays: &rays, hits: &hits, n_of_camera: rays.len(), light_visibility };
        reference::shade::shade(&stage.inputs(), lit, &mut radiance);
        radiance
    };
    let instead =
        |of: u32| asked_for.iter().map(|&state| if state == of { LIGHT_LIT } else { state }).collect::<Vec<_>>();
    let greatest_difference = |light_visibility: &[u32]| {
        let (asked_for, instead) = (shaded(&asked_for), shaded(light_visibility));
        let both = asked_for.as_flattened().iter().zip(instead.as_flattened());
        both.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    };
    // The bound is 2^-64 of a radiance of some 20 by three lights.
    assert!(greatest_difference(&instead(LIGHT_UNTESTED)) < 3e-18);
    assert!(greatest_difference(&instead(LIGHT_SHADOWED)) > 0.1);
    // On glossy surfaces, most lights are not tested, but some are.
    let is_glossy =
        |hit: &Hit| hit.triangle_ix != NO_TRIANGLE && stage.inputs().material_ix_of(hit.triangle_ix) % 3 == 1;
    let of_glossy = |state: u32| (0..n).filter(|&i| is_glossy(&hits[i]) && asked_for[i] == state).count();
    assert!(
        of_glossy(LIGHT_UNTESTED) > 3 * of_glossy(LIGHT_LIT) && of_glossy(LIGHT_LIT) + of_glossy(LIGHT_SHADOWED) > 0
    );
}
