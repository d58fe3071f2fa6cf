//! A part of a picture, read from its OpenEXR file.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    path::{Path, PathBuf},
};

use exr::{
    meta::{BlockDescription, MetaData},
    prelude::{
        AnyChannel, AnyChannels, AttributeValue, FlatSamples, Layer, LayerAttributes, ReadChannels, ReadLayers, Text,
        f16, read as exr_read,
    },
};

use super::MergeError;
use crate::{
    frame::{Aov, BlockSum, Channel, SampleRange, SampleSums, Samples},
    output::{self, RECORD_ATTRIBUTE, Record},
    util::{memory, text::short_line},
};

/// A part of a picture.
#[derive(Clone, Debug)]
pub struct Part {
    /// The file that it comes from.
    pub path: PathBuf,
    /// What it shows.
    pub record: Record,
    /// The mean of its samples.
    pub(super) picture: Mean,
    /// The layers that are means of all samples and that it has, each with its name.
    pub(super) means: Vec<(Aov, Mean)>,
    /// Its channels beside colour, with these means.
    pub channels: Vec<Channel>,
}

/// A mean of samples.
#[derive(Clone, Debug)]
pub(super) struct Mean {
    /// Linear RGB, rows from the top. The fourth component is 1.
    pub radiance: Vec<[f32; 4]>,
    /// The sums of the samples, if they are some of the picture's samples, but not one aligned block of them.
    sums: Vec<BlockSum>,
}

impl Mean {
    /// Adds the samples of a part to the sums of earlier ones. `samples`: of the part.
    ///
    /// # Panics
    /// The samples do not follow those of the sums.
    pub fn add_to(&self, samples: SampleRange, sums: &mut SampleSums) {
        if self.sums.is_empty() {
            sums.push_mean(samples, &self.radiance);
        } else {
            self.sums.iter().for_each(|block| sums.push(block.clone()));
        }
    }
}

impl Part {
    /// Reads a part.
    ///
    /// # Errors
    /// The file cannot be read, has no record, is damaged, or lacks a channel.
    pub fn read(path: &Path) -> Result<Self, MergeError> {
        // A fault of the decoder must not end the process because of a file.
        let part = catch_unwind(AssertUnwindSafe(|| Self::decode(path)));
        let part = part.unwrap_or_else(|_| Err("its decoder failed".to_owned()));
        part.map_err(|message| MergeError::Part { path: path.to_owned(), message: short_line(&message) })
    }

    fn decode(path: &Path) -> Result<Self, String> {
        check_size(path)?;
        let image = exr_read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer();
        let image = image.all_attributes().from_file(path).map_err(|error| error.to_string())?;
        Self::of_layer(path, &image.layer_data)
    }

    fn of_layer(path: &Path, layer: &Layer<AnyChannels<FlatSamples>>) -> Result<Self, String> {
        let record = record_of(&layer.attributes)?;
        let channels: Vec<_> = layer.channel_data.list.iter().map(channel_of).collect();
        // Hardly a file of a fuzzer would have the right checksum.
        if !cfg!(fuzzing) && !record.is_intact(&channels) {
            return Err(
                "its checksum is not that of its contents: the file is damaged, render the part again".to_owned()
            );
        }
        let blocks: Vec<_> = record.samples.blocks().collect();
        let is_whole = record.samples == SampleRange::whole(record.whole.n_samples);
        let blocks = if is_whole || blocks.len() == 1 { Vec::new() } else { blocks };
        let picture = mean_of(&channels, ("", COLOUR), &blocks)?;
        let mut means = Vec::new();
        for aov in Aov::OF_MEANS {
            let prefix = format!("{aov}.");
            if channels.iter().any(|channel| channel.name.starts_with(&prefix)) {
                let mean = mean_of(&channels, (&prefix, aov.components()), &blocks);
                let mean = mean.map_err(|what| match Aov::OF_SURFACES.contains(&aov) {
                    true => format!("{what}: earlier versions wrote {aov} of the first sample, so render it again"),
                    false => what,
                });
                means.push((aov, mean?));
            }
        }
        let is_sum = |name: &str| name.starts_with("sum ") || name.contains(".sum ");
        let is_colour = |name: &str| COLOUR.contains(&name);
        let channels = channels.into_iter().filter(|Channel { name, .. }| !is_sum(name) && !is_colour(name)).collect();
        Ok(Self { path: path.to_owned(), record, picture, means, channels })
    }
}

/// The components of a colour.
const COLOUR: [&str; 3] = ["R", "G", "B"];

/// The longest side of a file's tiles, pixels. The decoder allocates whole tiles; those that kdray writes are smaller.
const MOST_TILE_SIDE: usize = 1024;

/// Refuses a file that is not a part, or whose header asks for more pixels than its record states or than fit into
/// memory, since the decoder allocates them all.
fn check_size(path: &Path) -> Result<(), String> {
    let meta = MetaData::read_from_file(path, false).map_err(|error| error.to_string())?;
    let [header] = &meta.headers[..] else { return Err(format!("it has {} layers, not one", meta.headers.len())) };
    let record = record_of(&header.own_attributes)?;
    let (width, height) = (header.layer_size.0, header.layer_size.1);
    if (width, height) != (record.crop.width() as usize, record.crop.height() as usize) {
        return Err(format!("it has {width}x{height} pixels, which are not those of its crop"));
    }
    if let BlockDescription::Tiles(tiles) = header.blocks
        && tiles.tile_size.0.max(tiles.tile_size.1) > MOST_TILE_SIDE
    {
        return Err(format!("it has tiles of {}x{} pixels", tiles.tile_size.0, tiles.tile_size.1));
    }
    let factors = [width, height, 4, header.channels.list.len()];
    let n_bytes = factors.iter().fold(2_u64, |product, factor| product.saturating_mul(*factor as u64));
    memory::require("reading it", n_bytes).map_err(|error| error.to_string())
}

fn record_of(attributes: &LayerAttributes) -> Result<Record, String> {
    match attributes.other.get(&Text::from(RECORD_ATTRIBUTE)) {
        Some(AttributeValue::Text(json)) => {
            Record::of_json(&json.to_string()).map_err(|error| format!("its record cannot be used: {error}"))
        }
        _ => Err("the file does not say what it shows: `kdray render` writes files that do".to_owned()),
    }
}

fn channel_of(channel: &AnyChannel<FlatSamples>) -> Channel {
    let samples = match &channel.sample_data {
        FlatSamples::F32(samples) => Samples::Float(samples.clone()),
        FlatSamples::F16(samples) => Samples::Float(samples.iter().map(|sample: &f16| sample.to_f32()).collect()),
        FlatSamples::U32(samples) => Samples::Uint(samples.clone()),
    };
    Channel { name: channel.name.to_string(), samples }
}

/// Returns the mean of samples, and the sums of its blocks, whose channels' names begin with `prefix` and end with
/// `components`.
fn mean_of(
    channels: &[Channel],
    (prefix, components): (&str, [&str; 3]),
    blocks: &[SampleRange],
) -> Result<Mean, String> {
    let values = |prefix: &str| values_of(channels, prefix, components);
    let radiance = values(prefix)?.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect();
    let sum = |&samples: &SampleRange| Ok(BlockSum { samples, sums: values(&output::sum_prefix(prefix, samples))? });
    Ok(Mean { radiance, sums: blocks.iter().map(sum).collect::<Result<_, String>>()? })
}

/// Returns the values of the channels whose names begin with `prefix` and end with `components`.
fn values_of(channels: &[Channel], prefix: &str, components: [&str; 3]) -> Result<Vec<[f32; 3]>, String> {
    let channel = |component: &str| {
        let name = format!("{prefix}{component}");
        match channels.iter().find(|channel| channel.name == name).map(|channel| &channel.samples) {
            Some(Samples::Float(samples)) => Ok(samples),
            _ => Err(format!("it lacks the channel `{name}`")),
        }
    };
    let [r, g, b] = components.map(channel);
    Ok(r?.iter().zip(g?).zip(b?).map(|((r, g), b)| [*r, *g, *b]).collect())
}
