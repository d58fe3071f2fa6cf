//! Layers of a picture that are means of all samples, as the picture is: of its light, emission, direct and indirect
//! light, and of the surfaces that camera rays hit, albedo and normal.

use super::{Aov, BlockSum, Crop, SampleRange, SampleSums};

/// The number of layers.
const N_LAYERS: usize = Aov::OF_MEANS.len();

/// The layers of a picture that are means of all samples, in the order of [`Aov::OF_MEANS`]. Each has the pixels of
/// the picture's radiance, or is empty if the options do not ask for it. The fourth component of a pixel has no
/// meaning. The layers of light add up to the radiance, up to rounding.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeanLayers(pub [Vec<[f32; 4]>; N_LAYERS]);

impl MeanLayers {
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

/// The sums of a range of samples: of the picture, and of its layers that are means.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RangeSums {
    /// The sums of the radiance.
    pub picture: SampleSums,
    /// The sums of each layer. Those that the picture lacks have no blocks.
    pub layers: [SampleSums; N_LAYERS],
}

impl RangeSums {
    /// Adds the next block of samples, whose mean a picture and its layers have.
    ///
    /// # Panics
    /// As [`SampleSums::push_mean`].
    pub(crate) fn push_mean(&mut self, samples: SampleRange, radiance: &[[f32; 4]], layers: &MeanLayers) {
        self.picture.push_mean(samples, radiance);
        let of_layers = self.layers.iter_mut().zip(&layers.0).filter(|(_, layer)| !layer.is_empty());
        of_layers.for_each(|(sums, layer)| sums.push_mean(samples, layer));
    }

    /// Returns the means of the layers.
    pub fn mean_of_layers(&self) -> MeanLayers {
        MeanLayers(self.layers.each_ref().map(SampleSums::mean))
    }

    /// Returns the blocks of samples of the picture and of its layers, for a file whose mean does not tell them: there
    /// are none if all samples are one block.
    pub fn untold(&self) -> (&[BlockSum], [&[BlockSum]; N_LAYERS]) {
        fn untold(sums: &SampleSums) -> &[BlockSum] {
            if sums.blocks().len() > 1 { sums.blocks() } else { &[] }
        }
        (untold(&self.picture), self.layers.each_ref().map(untold))
    }
}
