//! Shade against its twin, from the same hits and lights.

use bytemuck::Zeroable;
use kdray::{
    cpu::{
        self,
        shade::{LitRays, Shaded},
    },
    layout::{Batch, Ray},
};

use super::stage::{
    FIRST, RAY_COUNTS, Stage, UNTOUCHED_PIXEL, UNTOUCHED_RAY, UNTOUCHED_WORD, hits_of, options, some_rays,
};
use crate::support::{compare, random::Random, scenes};

/// Everything untouched.
fn blank(n: usize) -> Shaded {
    Shaded {
        ray_radiance: vec![UNTOUCHED_PIXEL; n],
        child_rays: vec![UNTOUCHED_RAY; 2 * n],
        child_counts: vec![UNTOUCHED_WORD; n],
    }
}

/// The twin's, followed by untouched elements.
fn on_cpu(stage: &Stage, batch: &Batch, lit: LitRays) -> Shaded {
    let mut shaded = blank(lit.rays.len());
    cpu::shade::shade(&stage.bindings(), batch.depth, lit, &mut shaded);
    let capacity = stage.resources.queues.hits.len();
    shaded.ray_radiance.resize(capacity, UNTOUCHED_PIXEL);
    shaded.child_rays.resize(2 * capacity, UNTOUCHED_RAY);
    shaded.child_counts.resize(capacity, UNTOUCHED_WORD);
    shaded
}

fn on_device(stage: &Stage, batch: &Batch, lit: LitRays) -> Shaded {
    let resources = &stage.resources;
    let blank = blank(resources.queues.hits.len());
    stage.set_n_rays(lit.rays.len() as u32);
    stage.set_rays(lit.rays);
    stage.set_hits(lit.hits);
    resources.queues.light_visibility.upload(lit.light_visibility).expect("light_visibility");
    resources.queues.ray_radiance.upload(&blank.ray_radiance).expect("ray_radiance");
    resources.queues.child_rays.upload(&blank.child_rays).expect("child_rays");
    resources.queues.child_counts.upload(&blank.child_counts).expect("child_counts");
    stage.run(batch, |commands| stage.passes.shade.record(commands, resources, batch));
    Shaded {
        ray_radiance: resources.queues.ray_radiance.download().expect("ray_radiance"),
        child_rays: resources.queues.child_rays.download().expect("child_rays"),
        child_counts: resources.queues.child_counts.download().expect("child_counts"),
    }
}

/// Radiance and rays within 1e-4: `pow` and `inversesqrt` are good for some 2^-13 of a steep highlight.
fn check(stage: &Stage, depth: u32, n_rays: u32) {
    let rays = some_rays(stage, n_rays);
    let hits = hits_of(stage, &rays);
    let mut random = Random(3);
    let light_visibility: Vec<u32> =
        (0..stage.resources.queues.light_visibility.len()).map(|_| random.below(2) as u32).collect();
    let lit = LitRays { rays: &rays, hits: &hits, light_visibility: &light_visibility };
    let batch = Batch { depth, ..FIRST };
    let (expected, found) = (on_cpu(stage, &batch, lit), on_device(stage, &batch, lit));
    let n_outliers = stage.n_outliers(n_rays);
    compare::pixels(1e-4, n_outliers, &expected.ray_radiance, &found.ray_radiance).unwrap();
    compare::exact_but_for(n_outliers, &expected.child_counts, &found.child_counts).unwrap();
    compare::rays(1e-4, 2 * n_outliers, &expected.child_rays, &found.child_rays).unwrap();
    let is_child = |ray: &&Ray| **ray != UNTOUCHED_RAY && **ray != Ray::zeroed();
    let is_last = depth + 1 == stage.options.max_depth;
    assert_eq!(found.child_rays.iter().any(|ray| is_child(&ray)), !is_last && n_rays > 1, "{n_rays} rays");
}

#[test]
fn agrees_with_its_twin() {
    let stage = Stage::new(scenes::mixed_outdoors(), options(50, 50), 2010);
    for n_rays in RAY_COUNTS {
        check(&stage, 0, n_rays);
    }
    // The last level makes no rays.
    check(&stage, stage.options.max_depth - 1, 500);
}

#[test]
fn agrees_without_lights() {
    let mut scene = scenes::mixed();
    scene.lights.clear();
    check(&Stage::new(scene, options(50, 50), 500), 2, 500);
}
