//! Tests of the kernel primary_hit against its twin on the CPU, with the same triangle IDs.

use kdray::{
    layout::{Batch, Hit},
    reference,
};

use super::stage::{FIRST, RAY_COUNTS, Stage, UNTOUCHED_HIT, UNTOUCHED_RAY, options};
use crate::support::{compare, scenes};

/// Returns the hits of a batch, and the number of those that are not misses.
fn on_device(stage: &Stage, batch: &Batch) -> (Vec<Hit>, u32) {
    stage.set_n_rays(&[batch.n_pixels]);
    stage.set_hits(&[]);
    stage.run(|commands| {
        stage.draw_triangles(commands);
        stage.passes.primary_hit.record(commands, batch);
    });
    (stage.resources.queue.hits.download().expect("hits"), stage.counters()[0].n_hits)
}

/// Returns the same by the twin on the CPU, with the triangle IDs of the device's hits.
fn on_cpu(stage: &Stage, batch: &Batch, found: &[Hit]) -> (Vec<Hit>, u32) {
    let n = batch.n_pixels as usize;
    let (mut rays, mut hits) = (vec![UNTOUCHED_RAY; n], vec![UNTOUCHED_HIT; found.len()]);
    reference::primary_hit::primary_rays(stage.resources.constants(), batch.first_pixel, &mut rays);
    let mut ids = vec![0; (stage.options.width * stage.options.height) as usize];
    for (ray, hit) in rays.iter().zip(found) {
        ids[ray.pixel_ix as usize] = hit.triangle_ix;
    }
    let n_hits = reference::primary_hit::primary_hit(&stage.inputs(), &ids, &rays, &mut hits[..n]);
    (hits, n_hits)
}

fn check(stage: &Stage, batch: Batch) {
    let (hits, n_hits) = on_device(stage, &batch);
    let (expected_hits, expected_n_hits) = on_cpu(stage, &batch, &hits);
    compare::hits(0, &expected_hits, &hits).unwrap();
    assert_eq!(n_hits, expected_n_hits, "{batch:?}");
}

#[test]
fn agrees_with_its_twin() {
    let stage = Stage::new(scenes::mixed_outdoors(), options(61, 37), 2100);
    for n_pixels in RAY_COUNTS {
        check(&stage, Batch { n_pixels, ..FIRST });
        check(&stage, Batch { first_pixel: 200, n_pixels, ..FIRST });
    }
}
