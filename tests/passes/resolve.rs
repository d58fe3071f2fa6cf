//! Resolve against its twin: sums in the same order, so the same to the last bit.

use kdray::{
    cpu,
    layout::{Batch, Ray},
};

use super::stage::{FIRST, RAY_COUNTS, Stage, UNTOUCHED_RAY, options};
use crate::support::{compare, random::Random, scenes};

/// Rays in runs of up to `longest` a pixel.
fn runs(n_rays: u32, longest: usize) -> Vec<Ray> {
    let mut random = Random(9);
    (0..)
        .flat_map(|pixel_ix| vec![Ray { pixel_ix, ..UNTOUCHED_RAY }; 1 + random.below(longest)])
        .take(n_rays as usize)
        .collect()
}

fn check(stage: &Stage, depth: u32, rays: &[Ray]) {
    let resources = &stage.resources;
    let mut random = Random(4);
    let mut some = |n: usize| -> Vec<[f32; 4]> { (0..n).map(|_| [0; 4].map(|_| random.between(0.0, 5.0))).collect() };
    let before = some(resources.pixels.pixel_radiance.len());
    let radiance = some(rays.len());
    let mut expected = before.clone();
    cpu::resolve::resolve(depth, rays, &radiance, &mut expected);
    // Even depths: the set whose queue `set_rays` fills.
    let batch = Batch { depth, ..FIRST };
    stage.set_n_rays(rays.len() as u32);
    stage.set_rays(rays);
    resources.queues.ray_radiance.upload(&radiance).expect("ray_radiance");
    resources.pixels.pixel_radiance.upload(&before).expect("pixel_radiance");
    stage.run(&batch, |commands| stage.passes.resolve.record(commands, resources, &batch));
    compare::exact(&expected, &resources.pixels.pixel_radiance.download().expect("pixel_radiance")).unwrap();
}

#[test]
fn agrees_with_its_twin() {
    let mut scene = scenes::empty();
    scenes::add(&mut scene, Vec::new(), scenes::BLACK);
    let stage = Stage::new(scene, options(50, 50), 2010);
    for n_rays in RAY_COUNTS {
        for (depth, longest) in [(0, 1), (2, 1), (2, 5), (4, 300)] {
            check(&stage, depth, &runs(n_rays, longest));
        }
    }
}
