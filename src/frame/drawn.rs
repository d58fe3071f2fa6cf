//! Results of drawing a picture, and the watcher that follows its progress.

use super::{MeanLayers, Profile};
use crate::layout::PixelAovs;

/// Results of drawing, beside the picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drawn {
    /// What the ray through the centre of each pixel hits, and what all rays of its first sample cost. Empty
    /// unless the options ask for AOVs.
    pub pixel_aovs: Vec<PixelAovs>,
    /// The layers that are means of all samples. Empty unless the options ask for them.
    pub layers: MeanLayers,
    /// Times and counts of all samples of all bands.
    pub profile: Profile,
    /// Number of samples of each pixel.
    pub n_samples: u32,
}

/// Samples of noise tiles, tile by tile.
#[derive(Clone, Debug, Default)]
pub struct DrawnNoiseTiles {
    /// The AOVs and layers of the tiles' pixels, and the sums of times and counts.
    pub drawn: Drawn,
    /// The means of the samples of each pixel. The fourth component is the mean of their squared luminance.
    pub means: Vec<[f32; 4]>,
}

impl DrawnNoiseTiles {
    /// Appends further tiles.
    pub(crate) fn append(&mut self, mut next: Self) {
        self.drawn.profile.add(&next.drawn.profile);
        self.drawn.pixel_aovs.append(&mut next.drawn.pixel_aovs);
        self.drawn.layers.append(next.drawn.layers);
        self.means.append(&mut next.means);
    }
}

/// Follows the progress of a drawing.
pub trait Watcher {
    /// Whether the watcher makes use of [`Watcher::sample_progress`]. If it does not, the renderer saves the time to
    /// wait for the device several times in a sample.
    fn sees_sample_progress(&self) -> bool {
        false
    }

    /// Is called when the share `_share` of the sample, 0 to 1, has been drawn.
    fn sample_progress(&mut self, _share: f32) {}

    /// Is called when a sample of a band has been drawn.
    fn sample(&mut self);

    /// Whether the drawing should end now, with the samples so far. Renderers ask only when these samples are a whole
    /// picture: after each frame, or if the picture has a goal of noise, after each round of its tiles. They do not ask
    /// while they draw a range of samples, several bands, or on several devices without a goal of noise.
    fn ends(&mut self) -> bool {
        false
    }
}

/// Passes on the progress of a drawing that has to reach its end.
pub(crate) struct Unending<'a, W>(pub &'a mut W);

impl<W: Watcher> Watcher for Unending<'_, W> {
    fn sees_sample_progress(&self) -> bool {
        self.0.sees_sample_progress()
    }

    fn sample_progress(&mut self, share: f32) {
        self.0.sample_progress(share);
    }

    fn sample(&mut self) {
        self.0.sample();
    }
}

impl<F: FnMut()> Watcher for F {
    fn sample(&mut self) {
        self();
    }
}
