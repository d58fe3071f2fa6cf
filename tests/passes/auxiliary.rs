//! Tests of the kernel auxiliary against its twin on the CPU, and of its means.

use glam::{Vec3, vec3};
use kdray::{
    frame::Denoise,
    layout::{Auxiliary, Batch, Hit, NO_TRIANGLE, PathState},
    reference,
    scene::{Camera, Projection},
    world::FlatScene,
};

use super::path_stage::PathStage;
use crate::support::{compare, meshes, random::Random, scenes};

/// Returns a scene that some rays miss, with all kinds of materials and a lamp.
fn outdoors() -> FlatScene {
    let mut scene = scenes::mixed_outdoors();
    scene.camera = Camera {
        eye: vec3(7.0, 3.0, 7.0),
        projection: Projection::Perspective { vertical_fov_degrees: 100.0 },
        ..scene.camera
    };
    scenes::add(&mut scene, meshes::torus(6, 5), scenes::emissive(vec3(3.0, 2.0, 1.0)));
    scene
}

/// Draws a frame after `n_earlier` samples. Returns the kernel's auxiliary buffers and the twin's.
fn drawn(stage: &mut PathStage, n_earlier: u32, before: &[Auxiliary]) -> (Vec<Auxiliary>, Vec<Auxiliary>) {
    stage.set_n_earlier(n_earlier);
    let (_, hits) = stage.rays_and_hits();
    let mut random = Random(u64::from(n_earlier));
    let state = |_| PathState { radiance: random.in_box(Vec3::ZERO, Vec3::splat(9.0)), pdf: 1.0 };
    let states: Vec<_> = hits.iter().map(state).collect();
    stage.resources.queue.hits.upload(&hits).expect("hits");
    stage.paths().path_states.upload(&states).expect("path_states");
    stage.resources.pixels.pixel_aux.upload(before).expect("pixel_aux");
    stage.run(|commands| stage.passes.edge.auxiliary.record(commands, &stage.batch()));
    let mut expected = before.to_vec();
    reference::auxiliary::auxiliary(&stage.inputs(), &stage.batch(), &hits, &states, &mut expected);
    (stage.resources.pixels.pixel_aux.download().expect("pixel_aux"), expected)
}

fn numbers(aux: &[Auxiliary]) -> Vec<[f32; 4]> {
    let rows = |g: &Auxiliary| {
        [
            g.position_world.extend(0.0),
            g.normal_world.extend(g.gloss),
            g.albedo.extend(g.seen_squared),
            g.seen.extend(0.0),
        ]
    };
    aux.iter().flat_map(rows).map(|row| row.to_array()).collect()
}

fn counts(aux: &[Auxiliary]) -> Vec<[u32; 2]> {
    aux.iter().map(|aux| [aux.n_hits, aux.n_samples]).collect()
}

#[test]
fn agrees_with_its_twin() {
    for samples_log2 in [0, 2] {
        let mut stage = PathStage::with_filter(outdoors(), samples_log2, Denoise::Edge);
        let stale = Auxiliary { n_samples: 7, seen: Vec3::ONE, ..Auxiliary::default() };
        let mut before = vec![stale; 1200];
        for n_earlier in [0, 4, 8] {
            // A frame that follows another one has that one's samples.
            before.iter_mut().for_each(|aux| aux.n_samples = n_earlier);
            let (found, expected) = drawn(&mut stage, n_earlier, &before);
            assert_eq!(counts(&found), counts(&expected));
            assert!(found.iter().all(|aux| aux.n_samples == n_earlier + (1 << samples_log2)));
            compare::pixels(1e-4, 24, &numbers(&expected), &numbers(&found)).unwrap();
            before = found;
        }
        let n_without = before.iter().filter(|aux| aux.n_hits == 0).count();
        assert!((50..1150).contains(&n_without), "{n_without} of 1200 pixels have no hit");
    }
}

/// Some frames are dropped and drawn again, with other numbers of samples.
#[test]
fn samples_are_added_once() {
    let mut stage = PathStage::with_filter(outdoors(), 2, Denoise::Edge);
    let (first, _) = drawn(&mut stage, 0, &[Auxiliary::default(); 1200]);
    let (second, _) = drawn(&mut stage, 4, &first);
    let (again, expected) = drawn(&mut stage, 4, &second);
    assert_eq!(numbers(&again), numbers(&second));
    assert_eq!(counts(&expected), counts(&second));
}

/// Of a frame, the means are those of the samples, and a sample without a hit counts as black.
#[test]
fn means_are_those_of_the_samples() {
    let stage = PathStage::with_filter(outdoors(), 4, Denoise::Edge);
    let (rays, hits) = stage.rays_and_hits();
    let batch = Batch { n_pixels: 1200, ..stage.batch() };
    let states = vec![PathState { radiance: vec3(1.0, 0.5, 0.25), pdf: 0.0 }; hits.len()];
    let mut found = vec![Auxiliary::default(); 1200];
    reference::auxiliary::auxiliary(&stage.inputs(), &batch, &hits, &states, &mut found);
    for in_batch in (0..1200).step_by(37) {
        let pixel_ix = rays[16 * in_batch].pixel_ix as usize;
        let of_pixel: Vec<(&Hit, Vec3)> = (0..16)
            .map(|sample_ix| 16 * in_batch + sample_ix)
            .map(|path_ix| (&hits[path_ix], rays[path_ix].origin + hits[path_ix].t * rays[path_ix].direction))
            .filter(|(hit, _)| hit.triangle_ix != NO_TRIANGLE)
            .collect();
        let aux = &found[pixel_ix];
        assert_eq!(aux.n_hits as usize, of_pixel.len());
        assert!(aux.seen.abs_diff_eq(vec3(1.0, 0.5, 0.25), 1e-6));
        if !of_pixel.is_empty() {
            let mean = of_pixel.iter().map(|(_, point)| *point).sum::<Vec3>() / of_pixel.len() as f32;
            assert!(aux.position_world.abs_diff_eq(mean, 1e-3), "{mean}, {aux:?}");
        }
    }
}
