//! Image files that the files of a scene name.

use std::{collections::HashMap, path::PathBuf};

use super::{
    error::Checked,
    image::{Encoded, decode_all, normals_of_heights},
    needs::require_for_bytes,
    read::read_bytes,
    texture::{Channel, Image, Pixels},
};

/// Image files, each of which is read once.
#[derive(Debug, Default)]
pub(super) struct ImageFiles {
    paths: Vec<PathBuf>,
    by_path: HashMap<PathBuf, usize>,
}

impl ImageFiles {
    /// Returns the index of a file.
    pub fn add(&mut self, path: PathBuf) -> usize {
        *self.by_path.entry(path).or_insert_with_key(|path| {
            self.paths.push(path.clone());
            self.paths.len() - 1
        })
    }

    /// Reads and decodes all files. An error is a message that names the file.
    pub fn decode(self) -> Vec<Checked<Image>> {
        let read = |path: &PathBuf| {
            require_for_bytes(path).map_err(|what| format!("{}: {what}", path.display()))?;
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let bytes = read_bytes(path).map_err(|error| error.to_string())?;
            Ok(Encoded { name, bytes })
        };
        let mut encoded = Vec::new();
        let read: Vec<Checked<()>> = self.paths.iter().map(|path| read(path).map(|file| encoded.push(file))).collect();
        let mut decoded = decode_all(encoded).into_iter();
        let mut next = || decoded.next().expect("each image is decoded or refused");
        let named = |(read, path): (Checked<()>, &PathBuf)| {
            read.and_then(|()| next().map_err(|what| format!("{}: {what}", path.display())))
        };
        read.into_iter().zip(&self.paths).map(named).collect()
    }
}

/// What a texture shows of an image file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum View {
    /// The image itself.
    Plain,
    /// The normal map of the heights in a channel. The bits of the heights' factor follow.
    Heights(Channel, u32),
    /// 1 - x for each colour x.
    Inverted,
}

/// Decoded images, and those of them that textures show.
pub(super) struct Images {
    decoded: Vec<Option<Image>>,
    shown: Vec<(usize, View)>,
}

impl Images {
    /// The indices of `decoded` are those of the files. None: the file has no image.
    pub fn new(decoded: Vec<Option<Image>>) -> Self {
        Self { decoded, shown: Vec::new() }
    }

    /// Returns the image of a file.
    pub fn get(&self, file: usize) -> Option<&Image> {
        self.decoded.get(file)?.as_ref()
    }

    /// Returns the index, among the shown images, of a view of a file that has an image.
    pub fn show(&mut self, file: usize, view: View) -> u32 {
        let found = self.shown.iter().position(|shown| *shown == (file, view));
        found.unwrap_or_else(|| {
            self.shown.push((file, view));
            self.shown.len() - 1
        }) as u32
    }

    /// Returns the shown images.
    pub fn finish(mut self) -> Vec<Image> {
        let made = |(file, view): &(usize, View)| {
            let image = self.decoded[*file].as_ref().expect("only images are shown");
            match view {
                View::Plain => None,
                View::Heights(channel, scale) => Some(normals_of_heights(image, *channel, f32::from_bits(*scale))),
                View::Inverted => Some(inverted(image)),
            }
        };
        let made: Vec<Option<Image>> = self.shown.iter().map(made).collect();
        let mut plain = |file: usize| self.decoded[file].take().expect("each plain view is shown once");
        made.into_iter().zip(&self.shown).map(|(image, (file, _))| image.unwrap_or_else(|| plain(*file))).collect()
    }
}

/// Returns the channel that holds the opacity of an image: alpha if it has any, else luminance.
pub(super) fn opacity_channel(image: &Image) -> Channel {
    const ONE: u16 = 0x3c00; // 1 as a half
    let has_alpha = match &image.pixels {
        Pixels::Bytes(pixels) => pixels.iter().any(|pixel| pixel[3] != 255),
        Pixels::Halves(pixels) => pixels.iter().any(|pixel| pixel[3] != ONE),
    };
    if has_alpha { Channel::Alpha } else { Channel::Luminance }
}

/// Returns the image with 1 - x in place of each number x, opacity included.
fn inverted(image: &Image) -> Image {
    let half = |bits: u16| half::f16::from_f32(1.0 - half::f16::from_bits(bits).to_f32()).to_bits();
    let pixels = match &image.pixels {
        Pixels::Bytes(pixels) => {
            Pixels::Bytes(pixels.iter().map(|[r, g, b, a]| [255 - r, 255 - g, 255 - b, 255 - a]).collect())
        }
        Pixels::Halves(pixels) => {
            Pixels::Halves(pixels.iter().map(|[r, g, b, a]| [half(*r), half(*g), half(*b), half(*a)]).collect())
        }
    };
    Image { pixels, ..image.clone() }
}
