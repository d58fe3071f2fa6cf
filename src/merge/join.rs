//! Joins the parts of a picture, of which none is missing.

use std::path::Path;

use super::{Part, coverage::Tile, part::Mean};
use crate::{
    cpu,
    frame::{Aov, Channel, Crop, Picture, SampleRange, SampleSums, Samples, Tonemap, variance_of_joined},
    output::{self, Format, OutputError, Record},
};

/// A picture that was joined from its parts.
#[derive(Clone, Debug)]
pub struct Merged {
    /// The whole picture. Its display is encoded on the CPU.
    pub picture: Picture,
    /// The channels beside colour. Those of single samples are from the parts with the first samples.
    pub channels: Vec<Channel>,
    /// What the picture shows. If the parts come from several devices, the record names all of them.
    pub record: Record,
    /// The devices and drivers of the parts, each once. If there are several, parts may differ in their last bits.
    pub devices: Vec<String>,
    /// The number of parts.
    pub n_parts: usize,
}

impl Merged {
    /// Writes the picture with its record, and with the channels beside colour if it is an OpenEXR file.
    ///
    /// # Errors
    /// Fails as [`output::write_picture`] does.
    pub fn write(&self, path: &Path) -> Result<(), OutputError> {
        match Format::of(path)? {
            Format::Exr => output::write_with_channels(path, &self.picture, self.channels.clone(), &self.record),
            Format::Png => output::write_recorded(path, &self.picture, Some(&self.record)),
        }
    }
}

/// Joins tiles that cover the picture.
pub fn join(tiles: Vec<Tile>) -> Merged {
    let first = &tiles[0][0].record;
    let (width, height) = (first.whole.width, first.whole.height);
    let parts = || tiles.iter().flatten();
    let mut devices: Vec<_> = parts().map(|part| device_of(&part.record)).collect();
    devices.sort();
    devices.dedup();
    let mut record = Record {
        crop: Crop::whole(width, height),
        samples: SampleRange::whole(first.whole.n_samples),
        checksum: None,
        ..first.clone()
    };
    if devices.len() > 1 {
        (record.device, record.driver) = (devices.join("; "), String::new());
    }
    let (n_pixels, all) = (width as usize * height as usize, Crop::whole(width, height));
    let mut radiance = vec![[0.0; 4]; n_pixels];
    let mut channels: Vec<_> = tiles[0][0]
        .channels
        .iter()
        .map(|Channel { name, samples }| Channel {
            name: name.clone(),
            samples: match samples {
                Samples::Float(_) => Samples::Float(vec![0.0; n_pixels]),
                Samples::Uint(_) => Samples::Uint(vec![0; n_pixels]),
            },
        })
        .collect();
    let n_parts = parts().count();
    for tile in tiles {
        let crop = tile[0].record.crop;
        all.place(&mut radiance, &crop, &mean_of(&tile, |part| &part.picture));
        let means: Vec<_> = (0..tile[0].means.len())
            .map(|layer_ix| (tile[0].means[layer_ix].0, mean_of(&tile, |part| &part.means[layer_ix].1)))
            .collect();
        for (channel_ix, whole) in channels.iter_mut().enumerate() {
            let joined = channel_of_mean(&means, &whole.name).unwrap_or_else(|| joined_channel(&tile, channel_ix));
            match (&mut whole.samples, joined) {
                (Samples::Float(whole), Samples::Float(part)) => all.place(whole, &crop, &part),
                (Samples::Uint(whole), Samples::Uint(part)) => all.place(whole, &crop, &part),
                _ => (),
            }
        }
    }
    let tonemap = record.whole.tonemap.parse().unwrap_or(Tonemap::Linear);
    let display = cpu::display(&radiance, record.whole.exposure, tonemap);
    Merged { picture: Picture { width, height, radiance, display }, channels, record, devices, n_parts }
}

fn device_of(record: &Record) -> String {
    if record.driver.is_empty() { record.device.clone() } else { format!("{}, {}", record.device, record.driver) }
}

/// Returns the mean of all samples of a tile. `mean`: of a part.
fn mean_of(tile: &Tile, mean: impl Fn(&Part) -> &Mean) -> Vec<[f32; 4]> {
    match &tile[..] {
        [part] => mean(part).radiance.clone(),
        parts => {
            let mut sums = SampleSums::default();
            parts.iter().for_each(|part| mean(part).add_to(part.record.samples, &mut sums));
            sums.mean()
        }
    }
}

/// Returns a channel of a layer that is a mean of all samples, if it is one. `means`: these layers of a tile.
fn channel_of_mean(means: &[(Aov, Vec<[f32; 4]>)], name: &str) -> Option<Samples> {
    let (aov, mean) = means.iter().find(|(aov, _)| is_of(name, *aov))?;
    let component = aov.components().iter().position(|component| name.ends_with(component))?;
    Some(Samples::Float(mean.iter().map(|pixel| pixel[component]).collect()))
}

/// Returns a channel of a tile. It is that of the part with the first samples, unless it is about all samples.
fn joined_channel(tile: &Tile, channel_ix: usize) -> Samples {
    let samples = |part: &Part| part.channels[channel_ix].samples.clone();
    let name = tile[0].channels[channel_ix].name.as_str();
    let mut joined = samples(&tile[0]);
    match &mut joined {
        Samples::Float(variances) if is_of(name, Aov::Variance) => {
            let mut n_before = tile[0].record.samples.len();
            for part in &tile[1..] {
                let (n, Samples::Float(others)) = (part.record.samples.len(), samples(part)) else { continue };
                for (variance, other) in variances.iter_mut().zip(others) {
                    *variance = variance_of_joined([(n_before, *variance), (n, other)].into_iter());
                }
                n_before += n;
            }
        }
        Samples::Uint(counts) if is_of(name, Aov::Samples) => {
            for part in &tile[1..] {
                let Samples::Uint(others) = samples(part) else { continue };
                counts.iter_mut().zip(others).for_each(|(count, other)| *count = count.saturating_add(other));
            }
        }
        _ => (),
    }
    joined
}

/// Whether a channel is one of an output variable's.
fn is_of(channel: &str, aov: Aov) -> bool {
    channel.split_once('.').is_some_and(|(layer, _)| layer == aov.to_string())
}
