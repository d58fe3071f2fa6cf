//! Facts about an image that take a look at all of its pixels. Each is found when it is first asked for, and kept: many
//! materials can show one image.

use std::cell::OnceCell;

use crate::scene::model::{Channel, Image};

/// Share of the opacities that are 0 or 1 in the map of a surface with holes, such as a leaf.
const ALPHA_MASK_SHARE: f64 = 0.95;

/// Least and largest share of the pixels that are wholly transparent, in an image that is a cut-out. Fewer are a
/// blemish, and an image of more shows nothing.
const HOLES: (f64, f64) = (0.05, 0.98);

/// An image and what is known about it.
#[derive(Debug)]
pub(crate) struct Examined {
    image: Image,
    is_see_through: OnceCell<bool>,
    shows_normals: OnceCell<bool>,
    is_cut_out: OnceCell<bool>,
    /// For each channel, whether almost all of its values are 0 or 1.
    is_nearly_binary: [OnceCell<bool>; Channel::ALL.len()],
}

impl Examined {
    /// Wraps an image of which nothing is known yet.
    pub fn new(image: Image) -> Self {
        let [is_see_through, shows_normals, is_cut_out] = [const { OnceCell::new() }; 3];
        Self { image, is_see_through, shows_normals, is_cut_out, is_nearly_binary: Default::default() }
    }

    pub fn image(&self) -> &Image {
        &self.image
    }

    pub fn into_image(self) -> Image {
        self.image
    }

    /// Returns the channel that holds the opacity: alpha if a pixel is not opaque, else luminance.
    pub fn opacity_channel(&self) -> Channel {
        let is_see_through = *self.is_see_through.get_or_init(|| self.image.is_see_through());
        if is_see_through { Channel::Alpha } else { Channel::Luminance }
    }

    /// Returns whether almost all values of a channel are 0 or 1.
    pub fn is_nearly_binary(&self, channel: Channel) -> bool {
        let known = &self.is_nearly_binary[channel as usize];
        *known.get_or_init(|| is_nearly_binary(&self.image, channel))
    }

    /// Returns whether an image of colours is cut out, as that of a leaf: its opacity is almost everywhere 0 or 1, and
    /// a considerable part of it is 0.
    pub fn is_cut_out(&self) -> bool {
        *self.is_cut_out.get_or_init(|| has_holes(&self.image) && self.is_nearly_binary(Channel::Alpha))
    }

    /// Returns whether an image under `bump` is a normal map and no height map: its mean colour is blue, as normals
    /// along +z are, while heights are grey.
    pub fn shows_normals(&self) -> bool {
        *self.shows_normals.get_or_init(|| shows_normals(&self.image))
    }
}

fn is_nearly_binary(Image { pixels, .. }: &Image, channel: Channel) -> bool {
    // A byte away from 0 or 1 counts as such.
    let is_end = |value: f32| !(0.5 / 255.0..=254.5 / 255.0).contains(&value);
    let n = pixels.len();
    // Whatever its encoding, a colour whose luminance is 0 or 1 is black or white.
    let n_ends = (0..n).filter(|ix| is_end(channel.of(pixels.get(*ix)))).count();
    n_ends as f64 >= ALPHA_MASK_SHARE * n as f64
}

fn has_holes(Image { pixels, .. }: &Image) -> bool {
    let n_holes = (0..pixels.len()).filter(|ix| pixels.get(*ix)[3] < 0.5 / 255.0).count();
    let share = n_holes as f64 / pixels.len() as f64;
    (HOLES.0..=HOLES.1).contains(&share)
}

fn shows_normals(Image { pixels, .. }: &Image) -> bool {
    let n = pixels.len();
    let sum = (0..n).map(|ix| pixels.get(ix)).fold([0.0; 3], |sum: [f64; 3], [r, g, b, _]| {
        [sum[0] + f64::from(r), sum[1] + f64::from(g), sum[2] + f64::from(b)]
    });
    let [r, g, b] = sum.map(|sum| sum / n as f64);
    // A map of slopes up to 45 degrees has a mean blue of 0.85 or more, and a mean red and green of about 0.5.
    b > 0.6 && b - r > 0.15 && b - g > 0.15
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::model::Pixels;

    fn examined(pixels: Vec<[u8; 4]>) -> Examined {
        let (width, pixels) = (pixels.len() as u32, Pixels::Bytes(pixels));
        Examined::new(Image { name: "image".to_owned(), width, height: 1, pixels, is_linear: false })
    }

    #[test]
    fn facts_are_those_of_all_pixels() {
        let leaf = examined(vec![[40, 90, 20, 255], [40, 90, 20, 0]]);
        assert_eq!((leaf.opacity_channel(), leaf.shows_normals()), (Channel::Alpha, false));
        assert_eq!((leaf.is_nearly_binary(Channel::Alpha), leaf.is_nearly_binary(Channel::Red)), (true, false));
        let normals = examined(vec![[128, 128, 255, 255], [100, 140, 250, 255]]);
        assert_eq!((normals.opacity_channel(), normals.shows_normals()), (Channel::Luminance, true));
    }

    #[test]
    fn cut_outs_have_holes() {
        let of = |opacities: [u8; 4]| examined(opacities.repeat(5).into_iter().map(|a| [90, 90, 20, a]).collect());
        assert!(of([255, 0, 255, 255]).is_cut_out() && of([0, 0, 255, 0]).is_cut_out());
        // A picture without holes, one of nothing, and a mask of gloss.
        assert!(!of([255; 4]).is_cut_out() && !of([0; 4]).is_cut_out() && !of([0, 80, 160, 255]).is_cut_out());
    }

    #[test]
    fn facts_are_found_once() {
        let mut image = examined(vec![[40, 90, 20, 0]]);
        let facts = |it: &Examined| {
            let is_binary = Channel::ALL.map(|channel| it.is_nearly_binary(channel));
            (it.opacity_channel(), it.shows_normals(), it.is_cut_out(), is_binary)
        };
        let found = facts(&image);
        // Whoever asks again is told what was found before.
        image.image.pixels = Pixels::Bytes(vec![[0, 0, 255, 255]]);
        assert_eq!(facts(&image), found);
        assert_ne!(facts(&examined(vec![[0, 0, 255, 255]])), found);
    }
}
