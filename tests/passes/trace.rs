//! Tests of the kernel trace against its twin on the CPU, with ordinary rays and with rays on which traversals may
//! fail.

use kdray::{
    accel::kdtree::Traversal,
    frame::{Primary, RenderOptions},
    layout::Batch,
    reference,
    world::FlatScene,
};

use super::stage::{FIRST, RAY_COUNTS, Stage, UNTOUCHED_HIT, UNTOUCHED_RAY, options, some_rays};
use crate::support::{compare, meshes, n_outliers, scenes};

fn check(stage: &Stage, n_rays: u32) {
    let n = n_rays as usize;
    let rays = some_rays(stage, n_rays);
    let mut expected = vec![UNTOUCHED_HIT; stage.resources.queue.hits.len()];
    let n_hits = reference::trace::trace(&stage.inputs(), stage.options.traversal, &rays, &mut expected[..n]);
    stage.set_n_rays(&[n_rays]);
    stage.set_rays(&rays);
    stage.set_hits(&[]);
    stage.trace(&FIRST, |commands, batch| stage.passes.trace.record(commands, &stage.resources, batch));
    let found = stage.resources.queue.hits.download().expect("hits");
    // Many of these rays begin on triangles: on an H200, 4 % have another hit. A single ray must have its own.
    let n_outliers = if n_rays == 1 { 0 } else { n_outliers(&stage.context, n_rays as usize) };
    if stage.context.is_software() {
        compare::exact(&expected, &found).unwrap();
    } else {
        compare::hits(n_outliers, &expected, &found).unwrap();
    }
    assert!(stage.counters()[0].n_hits.abs_diff(n_hits) as usize <= n_outliers, "{n_rays} rays");
}

fn check_all(scene: &FlatScene, counts: &[u32]) {
    for &traversal in Traversal::ALL {
        let capacity = counts.iter().max().expect("some") + 9;
        let stage = Stage::new(scene.clone(), RenderOptions { traversal, ..options(8, 8) }, capacity);
        counts.iter().for_each(|&n| check(&stage, n));
    }
}

#[test]
fn agrees_with_its_twin() {
    check_all(&scenes::mixed(), &RAY_COUNTS);
}

#[test]
fn agrees_on_many_rays_at_many_triangles() {
    for triangles in [meshes::soup(20_000, 11), meshes::torus(100, 60), meshes::threefold(meshes::cube(9, 0.0))] {
        let mut scene = scenes::empty();
        scenes::add(&mut scene, triangles, scenes::BLACK);
        check_all(&scene, &[20_000]);
    }
}

#[test]
fn camera_rays_are_traced_by_their_places() {
    let options = RenderOptions { primary: Primary::Trace, ..options(20, 10) };
    let stage = Stage::new(scenes::mixed_outdoors(), options, 250);
    let batch = Batch { first_pixel: 30, n_pixels: 150, ..FIRST };
    stage.set_n_rays(&[batch.n_pixels]);
    stage.set_rays(&[]);
    stage.set_hits(&[]);
    stage.trace(&batch, |commands, batch| stage.passes.trace.record(commands, &stage.resources, batch));
    let mut rays = [UNTOUCHED_RAY; 150];
    reference::primary_hit::primary_rays(stage.resources.constants(), batch.first_pixel, &mut rays);
    let mut hits = super::stage::hits_of(&stage, &rays);
    hits.resize(250, UNTOUCHED_HIT);
    compare::hits(0, &hits, &stage.resources.queue.hits.download().expect("hits")).unwrap();
}

#[test]
fn nothing_is_hit_in_an_empty_scene() {
    let mut scene = scenes::empty();
    scenes::add(&mut scene, Vec::new(), scenes::BLACK);
    let stage = Stage::new(scene, options(8, 8), 9);
    let rays = vec![crate::support::rays::ray(glam::Vec3::ZERO, glam::Vec3::X); 9];
    stage.set_n_rays(&[9]);
    stage.set_rays(&rays);
    stage.trace(&FIRST, |commands, batch| stage.passes.trace.record(commands, &stage.resources, batch));
    compare::exact(&super::stage::hits_of(&stage, &rays), &stage.resources.queue.hits.download().expect("hits"))
        .unwrap();
}
