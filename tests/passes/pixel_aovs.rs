//! Tests of the kernel pixel_aovs against its twin on the CPU.

use std::collections::HashSet;

use glam::vec3;
use kdray::{
    frame::RenderOptions,
    layout::{Batch, NO_TRIANGLE, PathRay, PixelAovs},
    reference,
    scene::{Camera, Projection},
};

use super::stage::{FIRST, RAY_COUNTS, Stage, UNTOUCHED_RAY, hits_of, options};
use crate::support::scenes;

/// Returns the first `n` camera rays.
fn primary_rays(stage: &Stage, n: u32) -> Vec<PathRay> {
    let mut rays = vec![UNTOUCHED_RAY; n as usize];
    reference::primary_hit::primary_rays(stage.resources.constants(), 0, &mut rays);
    rays
}

fn noted(stage: &Stage, rays: &[PathRay], before: &[PixelAovs]) -> Vec<PixelAovs> {
    let hits = hits_of(stage, rays);
    let batch = Batch { n_pixels: rays.len() as u32, ..FIRST };
    stage.set_n_rays(&[batch.n_pixels]);
    stage.set_hits(&hits);
    stage.resources.pixels.pixel_aovs.upload(before).expect("pixel_aovs");
    stage.run(|commands| stage.passes.pixel_aovs.record(commands, &batch));
    stage.resources.pixels.pixel_aovs.download().expect("pixel_aovs")
}

/// Returns the first index at which AOVs differ, in indices, counts or albedo at all, or otherwise by more than
/// rounding.
fn difference(a: &[PixelAovs], b: &[PixelAovs]) -> Option<usize> {
    let exact = |f: &PixelAovs| (f.triangle_ix, f.material_ix, f.n_rays, f.n_steps, f.albedo.to_array());
    let agree = |a: &PixelAovs, b: &PixelAovs| {
        let near = |a: glam::Vec3, b: glam::Vec3| (a - b).abs().max_element() <= 1e-4;
        exact(a) == exact(b)
            && near(a.position_world, b.position_world)
            && near(a.normal_world, b.normal_world)
            && (a.depth == b.depth || (a.depth - b.depth).abs() <= 1e-4)
    };
    assert_eq!(a.len(), b.len());
    (0..a.len()).find(|&i| !agree(&a[i], &b[i]))
}

fn stage() -> Stage {
    let options = RenderOptions { pixel_aovs: true, ..options(50, 40) };
    let mut scene = scenes::mixed_outdoors();
    scene.camera = Camera {
        eye: vec3(7.0, 3.0, 7.0),
        projection: Projection::Perspective { vertical_fov_degrees: 100.0 },
        ..scene.camera
    };
    Stage::new(scene, options, 2000)
}

#[test]
fn agrees_with_its_twin() {
    let stage = stage();
    for n in RAY_COUNTS {
        let rays = primary_rays(&stage, n);
        // AOVs are cleared except for their counts, which the kernel keeps.
        let before: Vec<_> =
            (0..2000).map(|i| PixelAovs { n_rays: i, n_steps: 7 * i, ..PixelAovs::default() }).collect();
        let mut expected = before.clone();
        reference::pixel_aovs::pixel_aovs(&stage.inputs(), rays.iter().zip(&hits_of(&stage, &rays)), &mut expected);
        let found = noted(&stage, &rays, &before);
        assert_eq!(difference(&expected, &found), None);
        let with_ray: HashSet<_> = rays.iter().map(|ray| ray.pixel_ix as usize).collect();
        let without = (0..2000).filter(|pixel_ix| !with_ray.contains(pixel_ix));
        assert!(without.into_iter().all(|i| found[i] == before[i]), "pixels without a ray");
    }
    let rays = primary_rays(&stage, 2000);
    let found = noted(&stage, &rays, &[PixelAovs::default(); 2000]);
    let n_missed = found.iter().filter(|aovs| aovs.triangle_ix == NO_TRIANGLE).count();
    assert!((100..1900).contains(&n_missed), "{n_missed} of 2000 rays miss");
}

#[test]
fn one_changed_aovs_is_noticed() {
    let some = vec![PixelAovs { depth: 1.0, ..PixelAovs::default() }; 5];
    assert_eq!(difference(&some, &some), None);
    let changes: [fn(&mut PixelAovs); 7] = [
        |f| f.triangle_ix ^= 1,
        |f| f.material_ix ^= 1,
        |f| f.n_steps ^= 1,
        |f| f.normal_world.y += 0.001,
        |f| f.position_world.z = f32::NAN,
        |f| f.albedo.x += 0.001,
        |f| f.depth = f32::INFINITY,
    ];
    for change in changes {
        let mut changed = some.clone();
        change(&mut changed[3]);
        assert_eq!(difference(&some, &changed), Some(3));
    }
}
