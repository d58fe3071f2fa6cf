//! Pictures with outputs beside colour (AOVs), as one OpenEXR file of many channels.

use std::{io::Cursor, path::Path};

use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, LineOrder, SmallVec, WritableImage,
};

use tracing::info_span;

use super::{OutputError, dimension_mismatch, write};
use crate::{
    frame::{Aov, Channel, Picture, Samples},
    layout::Feature,
};

/// Writes an OpenEXR file with the radiance as R, G and B and with the channels of each AOV. The file is written
/// whole or not at all. Counts and indices are 32-bit integers, all other values are 32-bit floats. `features` has an
/// entry for each pixel; without AOVs it may be empty.
///
/// # Errors
/// Fails as [`write()`] does, or if the pixels cannot be encoded.
pub fn write_layers(path: &Path, picture: &Picture, aovs: &[Aov], features: &[Feature]) -> Result<(), OutputError> {
    let n_pixels = picture.width as usize * picture.height as usize;
    if picture.radiance.len() != n_pixels || (!aovs.is_empty() && features.len() != n_pixels) {
        return Err(OutputError::encode(path, dimension_mismatch()));
    }
    let colour = |name: &str, component: usize| Channel {
        name: name.to_owned(),
        samples: Samples::Float(picture.radiance.iter().map(|pixel| pixel[component]).collect()),
    };
    let mut channels = vec![colour("R", 0), colour("G", 1), colour("B", 2)];
    for (i, aov) in aovs.iter().enumerate() {
        if !aovs[..i].contains(aov) {
            channels.extend(aov.channels(features));
        }
    }
    let size = (picture.width as usize, picture.height as usize);
    let bytes = info_span!("encode picture").in_scope(|| encode(size, channels));
    let _writing = info_span!("write picture").entered();
    write(path, &bytes.map_err(|source| OutputError::encode(path, source))?)
}

fn encode(size: (usize, usize), channels: Vec<Channel>) -> Result<Vec<u8>, exr::error::Error> {
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
    let layer = Layer::new(size, LayerAttributes::default(), encoding, AnyChannels::sort(channels));
    let mut file = Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut file)?;
    Ok(file.into_inner())
}
