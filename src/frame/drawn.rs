//! What comes of drawing a picture, and who watches it.

use super::Profile;
use crate::layout::Feature;

/// What comes of drawing, beside the picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drawn {
    /// What the rays of each pixel met and cost, of the first sample; empty unless the options ask for it.
    pub features: Vec<Feature>,
    /// Times and counts of all samples of all bands.
    pub profile: Profile,
}

/// Follows a drawing as it goes on.
pub trait Watcher {
    /// Whether [`Watcher::part`] is of use: waiting for the device within a sample takes time.
    fn sees_parts(&self) -> bool {
        false
    }

    /// Notes that a share of the sample is drawn, 0 to 1.
    fn part(&mut self, _share: f32) {}

    /// Notes that a sample of a band is done.
    fn sample(&mut self);
}

impl<F: FnMut()> Watcher for F {
    fn sample(&mut self) {
        self();
    }
}
