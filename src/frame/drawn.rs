//! Results of drawing a picture, and the watcher that follows its progress.

use super::Profile;
use crate::layout::Feature;

/// Results of drawing, beside the picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drawn {
    /// What the rays of each pixel hit and cost in the first sample; empty unless the options ask for features.
    pub features: Vec<Feature>,
    /// Times and counts of all samples of all bands.
    pub profile: Profile,
}

/// Follows the progress of a drawing.
pub trait Watcher {
    /// Whether the watcher makes use of [`Watcher::part`]. If not, the drawing need not wait for the device within a
    /// sample, which takes time.
    fn sees_parts(&self) -> bool {
        false
    }

    /// Notes that this share of the sample is drawn, 0 to 1.
    fn part(&mut self, _share: f32) {}

    /// Notes that a sample of a band is done.
    fn sample(&mut self);
}

impl<F: FnMut()> Watcher for F {
    fn sample(&mut self) {
        self();
    }
}
