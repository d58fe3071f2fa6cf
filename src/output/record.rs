//! The record of a picture: what it shows and how it was made. Picture files carry it as JSON, so that pictures can be
//! traced back, and parts of one picture can be told from those of others.

use serde::{Deserialize, Serialize};

use crate::{
    frame::{Channel, Crop, Denoise, Integrator, Primary, RenderOptions, SampleRange, Samples, Tonemap},
    scene::{Camera, Projection},
    world::FlatScene,
};

/// The name of the attribute of an OpenEXR file, and of the text of a PNG file, that has the record.
pub const RECORD_ATTRIBUTE: &str = "kdray";

/// What a picture shows, and how it was made. All parts of one picture have the same `whole`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// The scene's name.
    pub scene: String,
    /// What the parts of a picture have in common.
    pub whole: WholeRecord,
    /// The part of the picture that the file has: columns `x0` to `x1` and rows `y0` to `y1`, the second of each not
    /// included.
    #[serde(with = "word")]
    pub crop: Crop,
    /// The samples of each pixel that the file has. Those of whitted are numbered from 0 on, too.
    #[serde(with = "range")]
    pub samples: SampleRange,
    /// The name of the device; `CPU` for the CPU engine.
    pub device: String,
    /// Name and version of the driver; empty for the CPU engine.
    pub driver: String,
    /// The acceleration structure, and for a kd-tree which of them was built and how rays went through it. Rays hit the
    /// same triangles with all of them.
    pub accel: String,
    /// The checksum of the rest of the record and of the file's channels. Records of PNG files have none, since that
    /// format has its own.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub checksum: Option<String>,
}

/// What the parts of a picture have in common. Parts of which any of this differs do not fit together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WholeRecord {
    /// The version of kdray.
    pub version: String,
    /// A hash of everything that the scene's frames read: triangles, materials, texels and lights.
    pub scene_hash: String,
    /// The camera: eye, target and up in world space, and the projection.
    pub camera: String,
    /// Width of the whole picture, pixels.
    pub width: u32,
    /// Height of the whole picture, pixels.
    pub height: u32,
    /// Number of samples of each pixel of the whole picture.
    pub n_samples: u32,
    /// The time at which animations are shown, with its unit; none if they stand at rest.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub time: Option<String>,
    /// When the picture is exposed, in frames from its time on, and the frames a second; none if all samples show one
    /// moment.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub shutter: Option<String>,
    /// Which random numbers paths have; 0 for whitted, which has none.
    #[serde(default)]
    pub seed: u32,
    /// How light is computed.
    pub integrator: String,
    /// Number of bounces, the primary rays included.
    pub max_depth: u32,
    /// Factor by which radiance is multiplied before it is encoded for display.
    pub exposure: f32,
    /// The curve from radiance to display.
    pub tonemap: String,
    /// The noise filter, with its threshold if it has one.
    pub denoise: String,
    /// Whether primary hits came from the graphics pipeline. Their bits differ from those of `trace` and of the compute
    /// rasterizer.
    pub is_rasterized: bool,
    /// The filters and bounds of paths; none for whitted.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub paths: Option<PathRecord>,
    /// The most noise of a tile, if tiles have as many samples as they needed for it. `n_samples` is the most then.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub noise: Option<f32>,
}

/// The filters and bounds of paths.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PathRecord {
    /// The density of samples around the centre of their pixel.
    pub pixel_filter: String,
    /// The most light that a path adds after its first hit; none if there is no bound.
    pub clamp: Option<f32>,
    /// Radius of the lens, world units.
    pub aperture: f32,
    /// Distance at which things are sharp, world units; none for the camera's target.
    pub focus: Option<f32>,
}

impl WholeRecord {
    /// Returns the record of a whole picture from the scene's own camera.
    pub fn new(scene: &FlatScene, options: &RenderOptions, n_samples: u32) -> Self {
        let RenderOptions { width, height, max_depth, exposure, .. } = *options;
        let denoise = match options.denoise {
            Denoise::Off => "off".to_owned(),
            Denoise::Paper { threshold } => format!("paper {threshold}"),
            Denoise::Edge => "edge".to_owned(),
        };
        // Primary rays of paths are always traced.
        let of_paths = options.integrator == Integrator::Path;
        let paths = options.paths;
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            scene_hash: scene.hash(),
            camera: Self::camera(&scene.camera),
            width,
            height,
            n_samples,
            time: None,
            shutter: None,
            seed: if of_paths { paths.seed } else { 0 },
            integrator: options.integrator.to_string(),
            max_depth,
            exposure,
            tonemap: options.tonemap.to_string(),
            denoise,
            is_rasterized: !of_paths && options.primary == Primary::Raster,
            paths: of_paths.then(|| PathRecord {
                pixel_filter: paths.filter.to_string(),
                clamp: paths.clamp.is_finite().then_some(paths.clamp),
                aperture: paths.aperture,
                focus: paths.focus,
            }),
            noise: None,
        }
    }

    /// Returns what a record says of a camera.
    pub fn camera(camera: &Camera) -> String {
        let Camera { eye, target, up, projection } = camera;
        let projection = match projection {
            Projection::Perspective { vertical_fov_degrees } => {
                format!("vertical field of view {vertical_fov_degrees}")
            }
            Projection::Orthographic { height } => format!("orthographic height {height}"),
        };
        format!("eye {eye}, target {target}, up {up}, {projection}")
    }

    /// Returns the first property in which two records differ, with both values as JSON.
    pub fn difference(&self, other: &Self) -> Option<String> {
        let [own, others] = [self, other].map(|record| serde_json::to_value(record).expect("plain values"));
        let names = [&own, &others].into_iter().filter_map(|record| record.as_object()).flatten().map(|(name, _)| name);
        let value = |record: &serde_json::Value, name: &str| record.get(name).cloned().unwrap_or_default();
        let mut differing = names.filter(|name| value(&own, name) != value(&others, name));
        differing.next().map(|name| format!("{name}: {} and {}", value(&own, name), value(&others, name)))
    }
}

impl Record {
    /// Returns the record as one line of JSON in ASCII, since attributes of files cannot have all characters.
    pub fn json(&self) -> String {
        let json = serde_json::to_string(self).expect("plain values");
        let mut ascii = String::with_capacity(json.len());
        for character in json.chars() {
            if character.is_ascii() {
                ascii.push(character);
            } else {
                // Only strings have such characters, and JSON's strings can escape them.
                let mut units = [0; 2];
                character.encode_utf16(&mut units).iter().for_each(|unit| ascii.push_str(&format!("\\u{unit:04x}")));
            }
        }
        ascii
    }

    /// Returns the record with the checksum of its file.
    pub(super) fn sealed(&self, channels: &[Channel]) -> Self {
        Self { checksum: Some(self.checksum_with(channels)), ..self.clone() }
    }

    /// Whether the record's checksum is that of the file's channels and of the record itself.
    pub fn is_intact(&self, channels: &[Channel]) -> bool {
        self.checksum.as_ref() == Some(&self.checksum_with(channels))
    }

    /// Returns the first half of a BLAKE3 hash, in hexadecimal. OpenEXR itself notices damage only where it breaks the
    /// compression.
    fn checksum_with(&self, channels: &[Channel]) -> String {
        let mut hasher = blake3::Hasher::new();
        hasher.update(Self { checksum: None, ..self.clone() }.json().as_bytes());
        // Files keep channels in the order of their names.
        let mut channels: Vec<_> = channels.iter().collect();
        channels.sort_by(|a, b| a.name.cmp(&b.name));
        for Channel { name, samples } in channels {
            hasher.update(name.as_bytes());
            match samples {
                Samples::Float(samples) => hasher.update_rayon(bytemuck::cast_slice(samples)),
                Samples::Uint(samples) => hasher.update_rayon(bytemuck::cast_slice(samples)),
            };
        }
        hasher.finalize().to_hex()[..32].to_owned()
    }

    /// Returns the record that a line of JSON states.
    ///
    /// # Errors
    /// The text is no record, or that of another version of kdray, or its crop or samples are none of the picture.
    pub fn of_json(text: &str) -> Result<Self, String> {
        let value: serde_json::Value = serde_json::from_str(text).map_err(|error| error.to_string())?;
        let version = env!("CARGO_PKG_VERSION");
        // Other versions may have other properties.
        match value.pointer("/whole/version").and_then(|found| found.as_str()) {
            Some(found) if found != version => {
                return Err(format!("kdray {found} has written it, and this is kdray {version}"));
            }
            _ => (),
        }
        let record: Self = serde_json::from_value(value).map_err(|error| error.to_string())?;
        record.whole.tonemap.parse::<Tonemap>().map_err(|error| error.to_string())?;
        let Self { whole: WholeRecord { width, height, n_samples, .. }, crop, samples, .. } = &record;
        if crop.x1 > *width || crop.y1 > *height {
            return Err(format!("the crop {crop} reaches beyond {width}x{height} pixels"));
        }
        if samples.end > *n_samples {
            return Err(format!("the samples {samples} reach beyond the picture's {n_samples}"));
        }
        Ok(record)
    }
}

/// Values as the words that `Display` and `FromStr` know.
mod word {
    use std::fmt::Display;

    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    use crate::frame::Crop;

    pub fn serialize<S: Serializer>(value: &impl Display, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(value)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Crop, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(D::Error::custom)
    }
}

/// Ranges of samples as `A-B`, of any numbers.
mod range {
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    use crate::frame::SampleRange;

    pub fn serialize<S: Serializer>(range: &SampleRange, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(range)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<SampleRange, D::Error> {
        let word = String::deserialize(deserializer)?;
        let ends = word.split_once('-').and_then(|(first, end)| Some((first.parse().ok()?, end.parse().ok()?)));
        match ends {
            Some((first, end)) if first < end => Ok(SampleRange { first, end }),
            _ => Err(D::Error::custom(format!("`{word}` is no range of samples"))),
        }
    }
}
