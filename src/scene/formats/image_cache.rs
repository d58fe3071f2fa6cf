//! The images of a scene. Each image file is read and decoded once, whichever of the scene's files name it.

use std::{collections::HashMap, path::PathBuf};

use super::image::{Encoded, Examined, MAX_PIXELS, decode_all, normals_of_heights};
use crate::{
    scene::{
        files::SourceFile,
        model::{Channel, Image, MaterialChoice, Pixels, error::Checked, preset::is_replaced},
    },
    util::{memory::require, progress::Progress},
};

/// What a texture shows of an image file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum View {
    /// The image itself.
    Plain,
    /// The normal map of the heights in a channel. The bits of the heights' factor follow.
    Heights(Channel, u32),
    /// 1 - x for each colour x.
    Inverted,
}

/// Image files, and the images that textures show, whose indices are those of the scene.
#[derive(Debug, Default)]
pub(crate) struct Images {
    /// Which materials are replaced. The images of their files are not needed.
    replaced: Vec<MaterialChoice>,
    files: Vec<File>,
    by_path: HashMap<PathBuf, usize>,
    shown: Vec<Shown>,
    /// Index into `shown` by file and view.
    views: HashMap<(usize, View), u32>,
    /// Number of pixels of all images, with those that are yet to be made from others.
    n_pixels: u64,
    /// Size of the images that are yet to be made, bytes.
    n_bytes_to_make: u64,
    progress: Progress,
}

#[derive(Debug)]
struct File {
    source: SourceFile,
    /// `None` until the file is decoded. An error is a message that names the file.
    image: Option<Checked<Examined>>,
}

/// An image that textures show.
#[derive(Debug)]
enum Shown {
    OfFile(usize, View),
    /// An image of a glTF file.
    Own(Image),
}

impl Images {
    /// Returns no images. `replaced`: which materials are replaced once they are loaded. `progress` is told of images
    /// that are decoded.
    pub fn new(replaced: Vec<MaterialChoice>, progress: &Progress) -> Self {
        Self { replaced, progress: progress.clone(), ..Self::default() }
    }

    /// Returns whether the materials of a name are replaced, so that their images need not be read.
    pub fn is_replaced(&self, material: &str) -> bool {
        is_replaced(&self.replaced, material)
    }

    /// Returns which materials are replaced.
    pub fn replaced(&self) -> &[MaterialChoice] {
        &self.replaced
    }

    /// Who is told of the progress of loading.
    pub fn progress(&self) -> &Progress {
        &self.progress
    }

    /// Returns the index of a file.
    pub fn add(&mut self, source: SourceFile) -> usize {
        // One file can have several names. A file that does not exist has those that are stated.
        *self.by_path.entry(source.canonical()).or_insert_with(|| {
            self.files.push(File { source, image: None });
            self.files.len() - 1
        })
    }

    /// Reads and decodes the files that have not been decoded.
    pub fn decode(&mut self) {
        let read = |file: &SourceFile| {
            let name = file.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            file.bytes().map(|bytes| Encoded { name, bytes: bytes.into() })
        };
        let (mut encoded, mut waiting) = (Vec::new(), Vec::new());
        for file in self.files.iter_mut().filter(|file| file.image.is_none()) {
            match read(&file.source) {
                Ok(read) => {
                    encoded.push(read);
                    waiting.push(file);
                }
                Err(error) => file.image = Some(Err(error.to_string())),
            }
        }
        for (file, decoded) in waiting.into_iter().zip(decode_all(encoded, self.n_pixels, &self.progress)) {
            self.n_pixels += decoded.as_ref().map_or(0, |image| image.pixels.len() as u64);
            let decoded = decoded.map(Examined::new).map_err(|what| format!("{}: {what}", file.source.path.display()));
            file.image = Some(decoded);
        }
    }

    /// Returns the image of a texture, if it is that of a file which has been decoded.
    pub fn shown_image(&self, image_ix: u32) -> Option<&Image> {
        match self.shown.get(image_ix as usize)? {
            Shown::OfFile(file, View::Plain) => self.get(*file).ok().map(Examined::image),
            Shown::OfFile(..) => None,
            Shown::Own(image) => Some(image),
        }
    }

    /// Returns the image of a file that has been decoded. An error is a message that names the file.
    pub fn get(&self, file: usize) -> Result<&Examined, &str> {
        let image = self.files[file].image.as_ref().expect("files are decoded before they are shown");
        image.as_ref().map_err(String::as_str)
    }

    /// Returns the index, among the shown images, of a view of a file that has an image. The view itself is made later.
    ///
    /// # Errors
    /// With the view, the images have too many pixels or need more memory than there is.
    pub fn show(&mut self, file: usize, view: View) -> Checked<u32> {
        if let Some(known) = self.views.get(&(file, view)) {
            return Ok(*known);
        }
        if view != View::Plain {
            let image = self.get(file)?.image();
            let n_pixels = self.n_pixels.saturating_add(image.pixels.len() as u64);
            if n_pixels > MAX_PIXELS {
                let name = &image.name;
                return Err(format!("with a copy of `{name}`, the scene's images have more than {MAX_PIXELS} pixels"));
            }
            let pixel_bytes = if matches!((view, &image.pixels), (View::Inverted, Pixels::Halves(_))) { 8 } else { 4 };
            let n_bytes = self.n_bytes_to_make.saturating_add(image.pixels.len() as u64 * pixel_bytes);
            require("making images from others", n_bytes)?;
            (self.n_pixels, self.n_bytes_to_make) = (n_pixels, n_bytes);
        }
        self.shown.push(Shown::OfFile(file, view));
        let ix = (self.shown.len() - 1) as u32;
        self.views.insert((file, view), ix);
        Ok(ix)
    }

    /// Returns the number of pixels of all images, with those that are yet to be made from others.
    pub fn n_pixels(&self) -> u64 {
        self.n_pixels
    }

    /// Adds the images of a glTF file. Returns the index of the first one.
    pub fn adopt(&mut self, images: Vec<Image>) -> u32 {
        let first = self.shown.len() as u32;
        self.n_pixels += images.iter().map(|image| image.pixels.len() as u64).sum::<u64>();
        self.shown.extend(images.into_iter().map(Shown::Own));
        first
    }

    /// Returns the shown images.
    pub fn finish(self) -> Vec<Image> {
        let made = |shown: &Shown| match *shown {
            Shown::Own(_) => None,
            Shown::OfFile(file, view) => view_of(self.get(file).expect("only images are shown").image(), view),
        };
        // Plain views take the images that the others are made of.
        let made: Vec<Option<Image>> = self.shown.iter().map(made).collect();
        let Self { mut files, shown, .. } = self;
        let image = |(shown, made)| match (shown, made) {
            (_, Some(made)) => made,
            (Shown::Own(image), None) => image,
            (Shown::OfFile(file, _), None) => {
                let image = files[file].image.take().and_then(Result::ok);
                image.expect("each plain view is shown once").into_image()
            }
        };
        shown.into_iter().zip(made).map(image).collect()
    }
}

/// Returns a view of an image, or `None` for the image itself.
fn view_of(image: &Image, view: View) -> Option<Image> {
    match view {
        View::Plain => None,
        View::Heights(channel, scale) => Some(normals_of_heights(image, channel, f32::from_bits(scale))),
        View::Inverted => Some(inverted(image)),
    }
}

/// Returns the image with 1 - x in place of each number x, opacity included.
fn inverted(image: &Image) -> Image {
    let half = |bits: u16| half::f16::from_f32(1.0 - half::f16::from_bits(bits).to_f32()).to_bits();
    let pixels = match &image.pixels {
        Pixels::Bytes(pixels) => Pixels::Bytes(pixels.iter().map(|pixel| pixel.map(|byte| 255 - byte)).collect()),
        Pixels::Halves(pixels) => Pixels::Halves(pixels.iter().map(|pixel| pixel.map(half)).collect()),
    };
    Image { pixels, ..image.clone() }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::scene::LoadOptions;

    fn images() -> Images {
        let pixels = Pixels::Bytes(vec![[9, 8, 7, 6]; 20]);
        let image = Image { name: "a.png".to_owned(), width: 5, height: 4, pixels, is_linear: false };
        let mut images = Images::default();
        let source = SourceFile::new(Path::new("a.png"), &LoadOptions::default());
        images.files.push(File { source, image: Some(Ok(Examined::new(image))) });
        images
    }

    #[test]
    fn each_view_is_made_once() {
        let mut images = images();
        let heights = |scale: f32| View::Heights(Channel::Red, scale.to_bits());
        let views = [heights(1.0), View::Plain, heights(2.0), View::Inverted, heights(1.0), View::Plain];
        assert_eq!(views.map(|view| images.show(0, view).unwrap()), [0, 1, 2, 3, 0, 1]);
        let shown = images.finish();
        assert_eq!(shown.len(), 4);
        assert_eq!((shown[1].pixels.get(0)[0], shown[3].pixels.get(0)[0]), (9.0 / 255.0, 246.0 / 255.0));
    }

    #[test]
    fn views_are_limited_together() {
        let mut images = images();
        images.n_pixels = MAX_PIXELS - 50;
        for scale in 0..2_u32 {
            images.show(0, View::Heights(Channel::Red, scale)).unwrap();
        }
        let error = images.show(0, View::Inverted).unwrap_err();
        assert!(error.contains("with a copy of `a.png`"), "{error}");
        images.show(0, View::Plain).unwrap();
        let mut images = self::images();
        images.n_bytes_to_make = u64::MAX;
        assert!(images.show(0, View::Inverted).unwrap_err().contains("memory"));
    }
}
