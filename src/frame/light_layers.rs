//! Layers of the light of a picture of paths: emission, direct and indirect light.

use super::{BlockSum, Crop, SampleRange, SampleSums};
use crate::layout::LIGHT_LAYERS;

/// The number of layers.
const N_LAYERS: usize = LIGHT_LAYERS as usize;

/// The layers of light of a picture, in the order of [`Aov::OF_LIGHT`](super::Aov::OF_LIGHT). Each has the pixels of
/// the picture's radiance, whose sum they are up to rounding. All are empty if the options do not ask for layers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LightLayers(pub [Vec<[f32; 4]>; N_LAYERS]);

impl LightLayers {
    /// Whether there are no pixels.
    pub fn is_empty(&self) -> bool {
        self.0.iter().all(Vec::is_empty)
    }

    /// Appends the pixels of each layer.
    pub(crate) fn append(&mut self, mut next: Self) {
        self.0.iter_mut().zip(&mut next.0).for_each(|(layer, next)| layer.append(next));
    }

    /// Copies the pixels of `crop` to their places in those of `whole`, whose pixels these layers have.
    pub(crate) fn place(&mut self, whole: &Crop, crop: &Crop, part: &Self) {
        let layers = self.0.iter_mut().zip(&part.0).filter(|(layer, _)| !layer.is_empty());
        layers.for_each(|(layer, part)| whole.place(layer, crop, part));
    }
}

/// The sums of a range of samples: of the picture, and of its layers of light.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RangeSums {
    /// The sums of the radiance.
    pub picture: SampleSums,
    /// The sums of each layer of light. Without layers, they have no blocks.
    pub light: [SampleSums; N_LAYERS],
}

impl RangeSums {
    /// Adds the next block of samples, whose mean a picture and its layers have.
    ///
    /// # Panics
    /// As [`SampleSums::push_mean`].
    pub(crate) fn push_mean(&mut self, samples: SampleRange, radiance: &[[f32; 4]], light: &LightLayers) {
        self.picture.push_mean(samples, radiance);
        if !light.is_empty() {
            self.light.iter_mut().zip(&light.0).for_each(|(sums, layer)| sums.push_mean(samples, layer));
        }
    }

    /// Returns the means of the layers of light.
    pub fn mean_of_light(&self) -> LightLayers {
        LightLayers(self.light.each_ref().map(SampleSums::mean))
    }

    /// Returns the blocks of samples of the picture and of its layers, for a file whose mean does not tell them: there
    /// are none if all samples are one block.
    pub fn untold(&self) -> (&[BlockSum], [&[BlockSum]; N_LAYERS]) {
        fn untold(sums: &SampleSums) -> &[BlockSum] {
            if sums.blocks().len() > 1 { sums.blocks() } else { &[] }
        }
        (untold(&self.picture), self.light.each_ref().map(untold))
    }
}
