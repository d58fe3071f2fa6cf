//! Tests of the kernel resolve against its twin on the CPU, and against the sum of a pixel's rays in the queue's
//! order: the same to the last bit.

use kdray::{
    layout::{Batch, PathRay},
    reference,
};

use super::stage::{FIRST, RAY_COUNTS, Stage, UNTOUCHED_PIXEL, UNTOUCHED_RAY, options};
use crate::support::{compare, random::Random, scenes};

/// First pixel of the batch.
const FIRST_PIXEL: u32 = 200;

/// The rays of a batch, bounce after bounce.
struct Family {
    rays: Vec<PathRay>,
    first_children: Vec<u32>,
    n_rays: Vec<u32>,
}

/// Makes one ray per pixel, and `n_bounces` bounces in which each ray has up to `most_children` children.
fn family(stage: &Stage, n_primary: u32, n_bounces: usize, most_children: usize) -> Family {
    let mut random = Random(9);
    let mut rays = vec![UNTOUCHED_RAY; n_primary as usize];
    reference::primary_hit::primary_rays(stage.resources.constants(), FIRST_PIXEL, &mut rays);
    let (mut first_children, mut n_rays) = (Vec::new(), vec![n_primary]);
    for _ in 1..n_bounces {
        let parents = first_children.len()..rays.len();
        for parent in parents.clone() {
            let ray = rays[parent];
            first_children.push(rays.len() as u32);
            rays.extend(vec![ray; random.below(most_children + 1)]);
        }
        n_rays.push((rays.len() - parents.end) as u32);
    }
    Family { rays, first_children, n_rays }
}

fn check(stage: &Stage, family: &Family) {
    let resources = &stage.resources;
    let Family { rays, first_children, n_rays } = family;
    let mut random = Random(4);
    let radiance: Vec<[f32; 4]> = rays.iter().map(|_| [0; 4].map(|_| random.between(0.0, 5.0))).collect();
    let before = vec![UNTOUCHED_PIXEL; resources.pixels.pixel_radiance.len()];
    let mut sums = before.clone();
    rays[..n_rays[0] as usize].iter().for_each(|ray| sums[ray.pixel_ix as usize] = [0.0, 0.0, 0.0, 1.0]);
    for (ray, radiance) in rays.iter().zip(&radiance) {
        (0..3).for_each(|i| sums[ray.pixel_ix as usize][i] += radiance[i]);
    }
    let bounces = stage.set_n_rays(n_rays);
    let mut expected = before.clone();
    reference::resolve::resolve(&bounces[..n_rays.len()], rays, &radiance, first_children, &mut expected);
    compare::exact(&sums, &expected).unwrap();
    resources.queue.ray_radiance.upload(&radiance).expect("ray_radiance");
    resources.queue.first_children.upload(first_children).expect("first_children");
    resources.pixels.pixel_radiance.upload(&before).expect("pixel_radiance");
    let batch = Batch { first_pixel: FIRST_PIXEL, n_pixels: n_rays[0], ..FIRST };
    stage.run(|commands| stage.passes.resolve.record(commands, &batch));
    compare::exact(&expected, &resources.pixels.pixel_radiance.download().expect("pixel_radiance")).unwrap();
}

#[test]
fn agrees_with_its_twin() {
    let mut scene = scenes::empty();
    scenes::add(&mut scene, Vec::new(), scenes::BLACK);
    let stage = Stage::new(scene, options(50, 50), 100_000);
    let max_depth = stage.options.max_depth as usize;
    for n_rays in RAY_COUNTS {
        for (n_bounces, most_children) in
            [(1, 0), (2, 1), (max_depth, 0), (max_depth, 1), (max_depth - 1, 3), (max_depth, 3)]
        {
            check(&stage, &family(&stage, n_rays, n_bounces, most_children));
        }
    }
}
