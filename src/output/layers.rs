//! Pictures as OpenEXR files of many channels: radiance, outputs beside it (AOVs), sums of samples, and the record.

use std::{io::Cursor, path::Path};

use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Encoding, FlatSamples, Image, IntegerBounds, Layer, LayerAttributes,
    LineOrder, SmallVec, Text, Vec2, WritableImage,
};

use tracing::info_span;

use super::{OutputError, RECORD_ATTRIBUTE, Record, dimension_mismatch, write};
use crate::{
    frame::{Aov, BlockSum, Channel, Crop, Picture, SampleRange, Samples},
    layout::PixelAovs,
};

/// What an OpenEXR file has beside the radiance. The default is nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Layers<'a> {
    /// Output variables, made from `pixel_aovs`.
    pub aovs: &'a [Aov],
    /// An entry for each pixel; may be empty without AOVs.
    pub pixel_aovs: &'a [PixelAovs],
    /// The vectors of [`Aov::Motion`], if `aovs` lists it: X and Y of each pixel.
    pub motion: &'a [[f32; 2]],
    /// The layers that are means of all samples. Those that `aovs` lists have the pixels of the picture.
    pub means: [&'a [[f32; 4]]; Aov::OF_MEANS.len()],
    /// Sums of blocks of samples, for parts of a picture whose means do not tell the sums.
    pub sums: &'a [BlockSum],
    /// The same sums of these layers.
    pub mean_sums: [&'a [BlockSum]; Aov::OF_MEANS.len()],
    /// What the picture shows. It places a crop in the whole picture.
    pub record: Option<&'a Record>,
}

/// The three channels of a colour.
const COLOUR: [&str; 3] = ["R", "G", "B"];

/// Writes an OpenEXR file with the radiance as R, G and B, and with further layers. The file is written whole or not
/// at all. Counts and indices are 32-bit integers, all other values are 32-bit floats. With a record, the file's data
/// window is the crop, and its display window is the whole picture.
///
/// # Errors
/// Fails as [`write()`] does, or if the pixels cannot be encoded.
pub fn write_layers(path: &Path, picture: &Picture, layers: &Layers) -> Result<(), OutputError> {
    write_channels(path, (picture.width, picture.height), channels(picture, layers), layers.record)
}

/// Writes an OpenEXR file with the radiance and further channels, as [`write_layers`] does.
///
/// # Errors
/// Fails as [`write_layers`] does.
pub fn write_with_channels(
    path: &Path,
    picture: &Picture,
    further: Vec<Channel>,
    record: &Record,
) -> Result<(), OutputError> {
    let mut channels = channels(picture, &Layers::default());
    channels.extend(further);
    write_channels(path, (picture.width, picture.height), channels, Some(record))
}

fn write_channels(
    path: &Path,
    size: (u32, u32),
    channels: Vec<Channel>,
    record: Option<&Record>,
) -> Result<(), OutputError> {
    let n_pixels = size.0 as usize * size.1 as usize;
    let len = |channel: &Channel| match &channel.samples {
        Samples::Float(samples) => samples.len(),
        Samples::Uint(samples) => samples.len(),
    };
    if channels.iter().any(|channel| len(channel) != n_pixels) {
        return Err(OutputError::encode(path, dimension_mismatch()));
    }
    let bytes = info_span!("encode picture").in_scope(|| encode(size, channels, record));
    let _writing = info_span!("write picture").entered();
    write(path, &bytes.map_err(|source| OutputError::encode(path, source))?)
}

fn channels(picture: &Picture, layers: &Layers) -> Vec<Channel> {
    let mut channels = components("", COLOUR, &picture.radiance, layers.sums);
    let is_first = |(i, aov): &(usize, &Aov)| !layers.aovs[..*i].contains(aov);
    for (_, aov) in layers.aovs.iter().enumerate().filter(is_first) {
        match Aov::OF_MEANS.iter().position(|layer| layer == aov) {
            Some(layer_ix) => {
                let (mean, sums) = (layers.means[layer_ix], layers.mean_sums[layer_ix]);
                channels.extend(components(&format!("{aov}."), aov.components(), mean, sums));
            }
            None if *aov == Aov::Motion => channels.extend(float_channels("motion.", ["X", "Y"], layers.motion)),
            None => channels.extend(aov.channels(layers.pixel_aovs)),
        }
    }
    channels
}

/// Returns the channels of a mean of samples, and of the sums of its blocks. `prefix`: the layer and a dot, or nothing.
fn components(prefix: &str, names: [&str; 3], mean: &[[f32; 4]], sums: &[BlockSum]) -> Vec<Channel> {
    let sums = sums.iter().flat_map(|block| float_channels(&sum_prefix(prefix, block.samples), names, &block.sums));
    float_channels(prefix, names, mean).into_iter().chain(sums).collect()
}

/// Returns the channels of the first `M` components of pixels.
fn float_channels<const M: usize, const N: usize>(prefix: &str, names: [&str; M], pixels: &[[f32; N]]) -> [Channel; M] {
    std::array::from_fn(|ix| Channel {
        name: format!("{prefix}{}", names[ix]),
        samples: Samples::Float(pixels.iter().map(|pixel| pixel[ix]).collect()),
    })
}

/// Returns what the names of the channels begin with that have the sums of a block of samples. `prefix`: what those of
/// the mean begin with.
pub(crate) fn sum_prefix(prefix: &str, samples: SampleRange) -> String {
    format!("{prefix}sum {samples}.")
}

fn encode(
    (width, height): (u32, u32),
    channels: Vec<Channel>,
    record: Option<&Record>,
) -> Result<Vec<u8>, exr::error::Error> {
    let json = record.map(|record| record.sealed(&channels).json());
    let channels: SmallVec<_> = channels
        .into_iter()
        .map(|channel| {
            let samples = match channel.samples {
                Samples::Float(samples) => FlatSamples::F32(samples),
                Samples::Uint(samples) => FlatSamples::U32(samples),
            };
            AnyChannel::new(channel.name.as_str(), samples)
        })
        .collect();
    // Blocks are compressed in parallel. They are written in order, so that the same picture always gives the same
    // file.
    let encoding = Encoding { line_order: LineOrder::Increasing, ..Encoding::FAST_LOSSLESS };
    let size = Vec2(width as usize, height as usize);
    let (mut attributes, mut whole) = (LayerAttributes::default(), IntegerBounds::from_dimensions(size));
    if let Some(record) = record {
        let Crop { x0, y0, .. } = record.crop;
        attributes.layer_position = Vec2(x0 as i32, y0 as i32);
        attributes.software_name = Text::new_or_none(concat!("kdray ", env!("CARGO_PKG_VERSION")));
        whole = IntegerBounds::from_dimensions(Vec2(record.whole.width as usize, record.whole.height as usize));
    }
    if let Some(json) = json {
        // Several attributes of our own would be written in a random order.
        attributes.other.insert(Text::from(RECORD_ATTRIBUTE), AttributeValue::Text(Text::from(json.as_str())));
    }
    let layer = Layer::new(size, attributes, encoding, AnyChannels::sort(channels));
    let mut image = Image::from_layer(layer);
    image.attributes.display_window = whole;
    let mut file = Cursor::new(Vec::new());
    image.write().to_buffered(&mut file)?;
    Ok(file.into_inner())
}
