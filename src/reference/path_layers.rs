//! Path layers: the layers of the light of each pixel's paths. Twin of `path_layers.comp`, which says what they are.

use glam::Vec3;

use super::{
    camera::pixel_ix_of,
    paths::{path_of, pixel_at},
    sample_sums::sum_of_samples,
};
use crate::layout::{Batch, Frame, LIGHT_LAYERS, PathState};

/// Writes the pixels of the batch in the layer that is complete after the batch's bounce: the sum of what the radiance
/// of the frame's samples has gained since the layer before. `pixel_layers`: all layers, one after the other.
/// `snapshots`: an element for each path.
pub fn path_layers(
    frame: &Frame,
    batch: &Batch,
    states: &[PathState],
    snapshots: &mut [[f32; 4]],
    pixel_layers: &mut [[f32; 4]],
) {
    let layer_ix = batch.depth.min(LIGHT_LAYERS - 1);
    let layer_begin = layer_ix as usize * pixel_layers.len() / LIGHT_LAYERS as usize;
    for place in 0..batch.n_pixels {
        let path_ix = |sample_ix: u32| path_of(frame, place, sample_ix) as usize;
        let sum = sum_of_samples(frame.samples_log2, |sample_ix| {
            let [x, y, z, _] = snapshots[path_ix(sample_ix)];
            let before = if layer_ix == 0 { Vec3::ZERO } else { Vec3::new(x, y, z) };
            (states[path_ix(sample_ix)].radiance - before).extend(1.0)
        });
        (0..1 << frame.samples_log2).map(path_ix).for_each(|path_ix| {
            snapshots[path_ix] = states[path_ix].radiance.extend(0.0).to_array();
        });
        let pixel_ix = pixel_ix_of(frame, pixel_at(frame, batch, place)) as usize;
        pixel_layers[layer_begin + pixel_ix] = sum.to_array();
    }
}
