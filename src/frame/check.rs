//! Check of options before anything is made for them. The limits here are those of the command and of scene files, too.

use super::{BadOptions, Denoise, Goal, Integrator, NoiseTiles, PathOptions, RenderOptions, SampleRange};
use crate::{gpu::GpuError, layout::SAMPLE_BLOCK_LOG2};

/// The last value that an index of a first sample may have: the indices of all samples of a picture, of whatever seed,
/// fit 32 bits.
const MOST_FIRST_SAMPLE: u32 = 1 << 31;

impl From<BadOptions> for GpuError {
    fn from(error: BadOptions) -> Self {
        Self::BadOptions(error.to_string())
    }
}

impl RenderOptions {
    /// The longest side of a picture, pixels: that of an image on common GPUs.
    pub const MOST_SIDE: u32 = 16_384;
    /// The greatest ray depth.
    pub const MOST_DEPTH: u32 = 64;
    /// The greatest threshold of [`Denoise::Paper`].
    pub const MOST_THRESHOLD: f32 = 4.0;

    /// Checks that pictures can be rendered with the options. Whatever renders calls it first.
    ///
    /// # Errors
    /// An option is out of its range, the crop or a noise tile is outside the picture, or noise tiles are asked for
    /// without paths or with a noise filter. The message is one line, which names the option and its range.
    pub fn check(&self) -> Result<(), BadOptions> {
        self.check_ranges()?;
        self.check_first_sample(1 << SAMPLE_BLOCK_LOG2)
    }

    /// Checks what [`RenderOptions::check`] does, but lets the picture begin with any sample, as those do that have a
    /// single sample.
    pub(crate) fn check_ranges(&self) -> Result<(), BadOptions> {
        let count = |name: &str, value: u32, most: u32| {
            check(name, value, (1..=most).contains(&value), || format!("1 to {most}"))
        };
        let number = |name: &str, value: f32, is_right: bool| {
            check(name, value, is_right, || "a finite number above 0".to_owned())
        };
        let is_positive = |value: f32| value > 0.0 && value.is_finite();
        count("width", self.width, Self::MOST_SIDE)?;
        count("height", self.height, Self::MOST_SIDE)?;
        count("max_depth", self.max_depth, Self::MOST_DEPTH)?;
        number("exposure", self.exposure, is_positive(self.exposure))?;
        if let Denoise::Paper { threshold } = self.denoise {
            let most = Self::MOST_THRESHOLD;
            check("threshold", threshold, (0.0..=most).contains(&threshold), || format!("0 to {most}"))?;
        }
        let PathOptions { seed, first_sample, filter: _, clamp, aperture, focus } = self.paths;
        check("clamp", clamp, clamp > 0.0, || "above 0".to_owned())?;
        check("aperture", aperture, aperture == 0.0 || is_positive(aperture), || "finite and at least 0".to_owned())?;
        focus.map_or(Ok(()), |focus| number("focus", focus, is_positive(focus)))?;
        let most = PathOptions::MOST_SEED;
        check("seed", seed, seed <= most, || format!("at most {most}"))?;
        let is_right = first_sample <= MOST_FIRST_SAMPLE;
        check("first_sample", first_sample, is_right, || format!("at most {MOST_FIRST_SAMPLE}"))?;
        self.check_window()
    }

    /// Checks that the samples of a picture can be drawn together: they begin with a block of the tree in which samples
    /// are added, or are an aligned block of it, as a single sample is.
    pub(crate) fn check_samples(&self, goal: Goal) -> Result<(), BadOptions> {
        let most = 1 << SAMPLE_BLOCK_LOG2;
        self.check_first_sample(match goal {
            Goal::Samples(n_samples) if n_samples < most => n_samples.next_power_of_two(),
            _ => most,
        })
    }

    fn check_first_sample(&self, size: u32) -> Result<(), BadOptions> {
        let first = self.paths.first_sample;
        check("first_sample", first, first.is_multiple_of(size), || {
            format!("a multiple of {size} up to {MOST_FIRST_SAMPLE}")
        })
    }

    /// Checks the crop and the noise tiles.
    fn check_window(&self) -> Result<(), BadOptions> {
        let Self { width, height, .. } = *self;
        if let Some(crop) = self.crop {
            let is_inside = crop.x0 < crop.x1 && crop.x1 <= width && crop.y0 < crop.y1 && crop.y1 <= height;
            check("crop", crop, is_inside, || format!("pixels of a picture of {width}x{height}"))?;
        }
        let Some(tiles) = &self.noise_tiles else { return Ok(()) };
        if self.integrator != Integrator::Path || self.noise_filter() != Denoise::Off {
            return Err(BadOptions("noise_tiles need the integrator path, and no noise filter".to_owned()));
        }
        let is_outside =
            |place: &glam::UVec2| place.x * NoiseTiles::SIZE >= width || place.y * NoiseTiles::SIZE >= height;
        match tiles.places().find(is_outside) {
            Some(place) => {
                Err(BadOptions(format!("noise_tiles: tile {place} is outside a picture of {width}x{height}")))
            }
            None => Ok(()),
        }
    }
}

impl Goal {
    /// Checks that a picture can have so many samples. No samples count as one.
    ///
    /// # Errors
    /// There are more samples than [`SampleRange::MOST`].
    pub fn check(self) -> Result<(), BadOptions> {
        match self {
            Self::Samples(n) => {
                check("samples", n, n <= SampleRange::MOST, || format!("at most {}", SampleRange::MOST))
            }
            Self::Time(_) => Ok(()),
        }
    }
}

impl SampleRange {
    /// Checks that the range can be drawn: it has samples, begins with a block, and is part of the largest picture.
    ///
    /// # Errors
    /// It does not.
    pub fn check(self) -> Result<(), BadOptions> {
        let size = 1 << SAMPLE_BLOCK_LOG2;
        let is_right = !self.is_empty() && self.first.is_multiple_of(size) && self.end <= Self::MOST;
        check("sample range", self, is_right, || format!("samples up to {} from a multiple of {size} on", Self::MOST))
    }
}

/// `range`: the phrase that says which values are right.
pub(crate) fn check<T: std::fmt::Display>(
    name: &str,
    value: T,
    is_right: bool,
    range: impl FnOnce() -> String,
) -> Result<(), BadOptions> {
    if is_right { Ok(()) } else { Err(BadOptions(format!("{name} is {value}, not {}", range()))) }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::frame::{Crop, NoiseTileSamples};

    fn crop(x0: u32, y0: u32, x1: u32, y1: u32) -> Option<Crop> {
        Some(Crop { x0, y0, x1, y1 })
    }

    fn tile(x: u32, y: u32) -> Option<NoiseTiles> {
        let samples = SampleRange { first: 0, end: 16 };
        Some(NoiseTiles::new(&[NoiseTileSamples { place: glam::uvec2(x, y), samples }]).expect("a tile"))
    }

    /// Changes that make one option wrong, and how the error begins.
    type Change = fn(&mut RenderOptions);
    const CHANGES: &[(&str, Change)] = &[
        ("width is 0, not 1 to 16384", |it| it.width = 0),
        ("width is 16385", |it| it.width = 16_385),
        ("height is 0", |it| it.height = 0),
        ("height is 4294967295", |it| it.height = u32::MAX),
        ("max_depth is 0, not 1 to 64", |it| it.max_depth = 0),
        ("max_depth is 65", |it| it.max_depth = 65),
        ("exposure is NaN, not a finite number above 0", |it| it.exposure = f32::NAN),
        ("exposure is -1", |it| it.exposure = -1.0),
        ("exposure is inf", |it| it.exposure = f32::INFINITY),
        ("threshold is NaN, not 0 to 4", |it| it.denoise = Denoise::Paper { threshold: f32::NAN }),
        ("threshold is 4.5", |it| it.denoise = Denoise::Paper { threshold: 4.5 }),
        ("clamp is NaN, not above 0", |it| it.paths.clamp = f32::NAN),
        ("clamp is 0", |it| it.paths.clamp = 0.0),
        ("aperture is -1", |it| it.paths.aperture = -1.0),
        ("aperture is inf", |it| it.paths.aperture = f32::INFINITY),
        ("focus is 0, not a finite number above 0", |it| it.paths.focus = Some(0.0)),
        ("focus is NaN", |it| it.paths.focus = Some(f32::NAN)),
        ("seed is 32768, not at most 32767", |it| it.paths.seed = 32_768),
        ("first_sample is 8, not a multiple of 16", |it| it.paths.first_sample = 8),
        ("first_sample is 4294967280, not at most 2147483648", |it| it.paths.first_sample = u32::MAX - 15),
        ("crop is 5,1,4,2, not pixels of a picture of 40x30", |it| it.crop = crop(5, 1, 4, 2)),
        ("crop is 5,1,5,2", |it| it.crop = crop(5, 1, 5, 2)),
        ("crop is 5,1,41,2", |it| it.crop = crop(5, 1, 41, 2)),
        ("crop is 5,1,6,31", |it| it.crop = crop(5, 1, 6, 31)),
        ("noise_tiles: tile [3, 0] is outside", |it| it.noise_tiles = tile(3, 0)),
        ("noise_tiles: tile [0, 2] is outside", |it| it.noise_tiles = tile(0, 2)),
        ("noise_tiles need the integrator path", |it| {
            (it.noise_tiles, it.integrator) = (tile(0, 0), Integrator::Whitted);
        }),
        ("noise_tiles need the integrator path", |it| (it.noise_tiles, it.denoise) = (tile(0, 0), Denoise::Edge)),
    ];

    #[test]
    fn an_option_out_of_range_is_named() {
        let (integrator, denoise) = (Integrator::Path, Denoise::Off);
        let good = RenderOptions { width: 40, height: 30, integrator, denoise, ..RenderOptions::default() };
        assert_eq!(good.check(), Ok(()));
        assert_eq!(RenderOptions { noise_tiles: tile(2, 1), ..good.clone() }.check(), Ok(()));
        for (expected, change) in CHANGES {
            let mut options = good.clone();
            change(&mut options);
            let error = options.check().expect_err(expected).to_string();
            assert!(error.starts_with(expected), "{error}, not {expected}");
        }
    }

    #[test]
    fn samples_that_are_drawn_together_are_blocks() {
        let from = |first_sample, goal| {
            let paths = PathOptions { first_sample, ..PathOptions::default() };
            RenderOptions { paths, ..RenderOptions::default() }.check_samples(goal)
        };
        for (first_sample, n_samples) in [(7, 1), (7, 0), (20, 2), (20, 3), (8, 8), (32, 100), (16, 32)] {
            assert_eq!(from(first_sample, Goal::Samples(n_samples)), Ok(()), "{n_samples} from {first_sample} on");
        }
        for (first_sample, n_samples, size) in [(7, 2, 2), (20, 5, 8), (8, 9, 16), (8, 32, 16)] {
            let error = from(first_sample, Goal::Samples(n_samples)).unwrap_err().to_string();
            assert!(
                error.starts_with(&format!("first_sample is {first_sample}, not a multiple of {size} up")),
                "{error}"
            );
        }
        assert!(from(8, Goal::Time(Duration::ZERO)).is_err() && from(16, Goal::Time(Duration::ZERO)).is_ok());
    }

    #[test]
    fn samples_have_a_limit() {
        assert_eq!(Goal::Samples(0).check(), Ok(()));
        assert_eq!(Goal::Time(Duration::MAX).check(), Ok(()));
        assert_eq!(Goal::Samples(65_537).check().unwrap_err().to_string(), "samples is 65537, not at most 65536");
        for (first, end) in [(0, 0), (8, 16), (32, 16), (0, 65_537), (16, u32::MAX)] {
            let error = SampleRange { first, end }.check().unwrap_err().to_string();
            assert!(error.starts_with(&format!("sample range is {first}-{end}, not samples up to 65536")), "{error}");
        }
        assert_eq!(SampleRange { first: 16, end: 65_536 }.check(), Ok(()));
    }
}
