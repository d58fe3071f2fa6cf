//! Path begin: the camera rays of a batch's paths. It makes the rays of the reference's pass, with the random numbers
//! of sixteen paths computed together.

use fearless_simd::{Level, dispatch};
use glam::{UVec2, vec2};
use rayon::prelude::*;

use super::{
    lanes::LANES,
    sampler::{KeysSoa, PairsSoa, random_pairs},
};
use crate::{
    layout::{Batch, Frame, PathRay},
    reference::{
        inputs::KernelInputs,
        path_camera::path_camera_ray,
        paths::{key_of_path, path_of, pixel_at, place_of_path, sample_of_path},
        sampler::SampleKey,
    },
};

/// The number of paths that one thread begins at a time.
const PATHS_PER_TASK: usize = 32 * LANES;

/// A pixel of a batch.
#[derive(Clone, Copy, Debug)]
pub struct PixelOfBatch {
    /// The window's pixel.
    at: UVec2,
    /// The key of the first sample that the batch draws of it.
    key: SampleKey,
}

/// Returns the pixels of a batch, in the order of its paths.
pub fn pixels_of_batch(inputs: &KernelInputs, batch: &Batch) -> Vec<PixelOfBatch> {
    let frame = inputs.frame();
    let pixel = |place| {
        let at = pixel_at(frame, batch, place);
        PixelOfBatch { at, key: key_of_path(inputs, path_of(frame, place, 0), at) }
    };
    (0..batch.n_pixels).map(pixel).collect()
}

impl PixelOfBatch {
    /// Returns the key of a path of this pixel.
    #[inline(always)]
    pub fn key_of_path(&self, frame: &Frame, path_ix: u32) -> SampleKey {
        SampleKey { sample_ix: self.key.sample_ix + sample_of_path(frame, path_ix), ..self.key }
    }
}

/// Writes the camera ray of each path.
pub fn path_begin(inputs: &KernelInputs, pixels: &[PixelOfBatch], rays: &mut [PathRay]) {
    let (simd_level, frame) = (Level::new(), inputs.frame());
    let pixel_of = |path_ix| &pixels[place_of_path(frame, path_ix) as usize];
    rays.par_chunks_mut(PATHS_PER_TASK).enumerate().for_each(|(task, rays)| {
        for (group, rays) in rays.chunks_mut(LANES).enumerate() {
            let first_path = (task * PATHS_PER_TASK + group * LANES) as u32;
            let mut keys = KeysSoa::default();
            for (lane, path_ix) in (first_path..first_path + rays.len() as u32).enumerate() {
                keys.set(lane, pixel_of(path_ix).key_of_path(frame, path_ix));
            }
            let [in_pixel, in_lens]: [PairsSoa; 2] = dispatch!(simd_level, simd => random_pairs(simd, &keys, 0));
            for (lane, ray) in rays.iter_mut().enumerate() {
                let [in_pixel, in_lens] = [in_pixel, in_lens].map(|[x, y]| vec2(x[lane], y[lane]));
                *ray = path_camera_ray(inputs, pixel_of(first_path + lane as u32).at, in_pixel, in_lens);
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use bytemuck::Zeroable;
    use glam::Vec3;

    use super::*;
    use crate::{
        accel::kdtree::BuildOptions,
        frame::RenderOptions,
        layout::Frame,
        reference,
        scene::Scene,
        world::{FlatScene, World},
    };

    #[test]
    fn camera_rays_are_those_of_the_reference() {
        let scene = FlatScene::new(&Scene::empty(Path::new("scene"))).expect("a scene");
        let world = World::of_flat(scene, &BuildOptions::default()).expect("a world");
        let of_picture = world.frame_constants(&RenderOptions { width: 37, height: 29, ..RenderOptions::default() });
        let (right, up, forward) = (Vec3::X, Vec3::Y, Vec3::NEG_Z);
        let of_samples = Frame { samples_log2: 2, first_sample: 4, ..of_picture };
        let frame = Frame { right, up, forward, aperture: 0.1, focus: 2.0, ..of_samples };
        let inputs = KernelInputs::new(&world, &frame);
        // The last group of sixteen paths is not full.
        let batch = Batch { first_pixel: 100, n_pixels: 301, ..Batch::default() };
        let (mut expected, mut found) = (vec![PathRay::zeroed(); 4 * 301], vec![PathRay::zeroed(); 4 * 301]);
        reference::path_begin::path_begin(&inputs, &batch, &mut expected);
        path_begin(&inputs, &pixels_of_batch(&inputs, &batch), &mut found);
        assert!(found == expected);
        assert!(found[0].direction != found[1].direction, "samples differ");
    }
}
