//! Tests of the kernel surface_layers against its twin, for both integrators.

use glam::{Vec3, vec3};
use kdray::{
    frame::RenderOptions,
    layout::{Batch, NO_TRIANGLE, SURFACE_LAYERS},
    reference::{primary_hit::primary_rays, surface_layers::surface_layers},
    world::FlatScene,
};

use super::{
    path_stage::PathStage,
    stage::{FIRST, Stage, UNTOUCHED_PIXEL, UNTOUCHED_RAY, hits_of, options},
};
use crate::support::{compare, scenes};

const N_LAYERS: usize = SURFACE_LAYERS as usize;

/// Returns a scene that some rays miss, with all kinds of materials.
fn outdoors() -> FlatScene {
    let mut scene = scenes::mixed_outdoors();
    (scene.camera.eye, scene.camera.target) = (vec3(9.0, 4.0, 9.0), vec3(0.0, 1.5, 0.0));
    scene
}

#[test]
fn agrees_with_its_twin_for_paths() {
    for (samples_log2, light_layers) in [(0, false), (1, true), (4, false)] {
        let asked = RenderOptions { light_layers, surface_layers: true, ..RenderOptions::default() };
        let stage = PathStage::with_layers(outdoors(), samples_log2, &asked);
        let (rays, hits) = stage.rays_and_hits();
        let radiance = &stage.resources.pixels.pixel_radiance;
        radiance.upload(&vec![UNTOUCHED_PIXEL; radiance.len()]).expect("pixel_radiance");
        stage.resources.queue.rays.upload(&rays).expect("rays");
        stage.resources.queue.hits.upload(&hits).expect("hits");
        let kernel = stage.passes.surface_layers.as_ref().expect("the options ask for it");
        stage.run(|commands| kernel.record(commands, &stage.batch()));
        let found = radiance.download().expect("pixel_radiance");
        let begin = found.len() - N_LAYERS * 1200;
        let mut expected = vec![UNTOUCHED_PIXEL; N_LAYERS * 1200];
        surface_layers(&stage.inputs(), samples_log2, (&rays, &hits), &mut expected);
        compare::exact(&vec![UNTOUCHED_PIXEL; begin], &found[..begin]).unwrap();
        compare::pixels(1e-4, 24, &expected, &found[begin..]).unwrap();
        let n_missed = hits.iter().filter(|hit| hit.triangle_ix == NO_TRIANGLE).count();
        assert!(n_missed > hits.len() / 20 && n_missed < hits.len() * 19 / 20, "{n_missed} of {}", hits.len());
        assert!(expected.iter().all(|sum| sum[3] == (1 << samples_log2) as f32), "the weight of each sample is 1");
    }
}

#[test]
fn agrees_with_its_twin_for_ray_trees() {
    let stage = Stage::new(outdoors(), RenderOptions { surface_layers: true, ..options(50, 40) }, 2000);
    let mut rays = vec![UNTOUCHED_RAY; 2000];
    primary_rays(stage.resources.constants(), 0, &mut rays);
    let hits = hits_of(&stage, &rays);
    let batch = Batch { n_pixels: 2000, ..FIRST };
    stage.set_n_rays(&[batch.n_pixels]);
    stage.set_hits(&hits);
    let kernel = stage.passes.surface_layers.as_ref().expect("the options ask for it");
    stage.run(|commands| kernel.record(commands, &batch));
    let found = stage.resources.pixels.pixel_radiance.download().expect("pixel_radiance");
    let mut expected = vec![UNTOUCHED_PIXEL; N_LAYERS * 2000];
    surface_layers(&stage.inputs(), 0, (&rays, &hits), &mut expected);
    compare::pixels(1e-4, 20, &expected, &found[2000..]).unwrap();
    let (albedos, normals) = expected.split_at(2000);
    let vector = |pixel: &[f32; 4]| Vec3::new(pixel[0], pixel[1], pixel[2]);
    assert!(albedos.iter().all(|albedo| vector(albedo).cmpge(Vec3::ZERO).all() && vector(albedo).max_element() <= 1.0));
    assert!(normals.iter().all(|normal| vector(normal) == Vec3::ZERO || vector(normal).is_normalized()));
}
