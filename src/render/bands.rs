//! Draws pictures whose pixels take more bytes than a device can bind as one buffer: in bands, one after the other,
//! which the host joins. Bands are full rows, or parts of rows if there are fewer bands then, because a noise filter
//! reads a border around each band.

use std::{borrow::Cow, sync::Arc};

use super::{GpuRenderer, JoinedPicture};
use crate::{
    buffers::Pixels,
    frame::{
        Crop, Drawn, DrawnNoiseTiles, FrameRenderer, Goal, NoiseTileSamples, NoiseTiles, PathOptions, Picture, Profile,
        RenderOptions, Unending, Watcher,
    },
    gpu::{Context, DeviceInfo, ExternalImage, GpuError, Limits, TimelinePoint},
    scene::Camera,
    world::World,
};

/// Renderer of whole pictures of any size. If the widest buffer of pixels exceeds what the device can bind as one
/// storage buffer, bands are drawn. The joined picture has the same bits as one that is drawn at once.
pub struct BandedRenderer {
    pub(super) renderer: GpuRenderer,
    /// The bands from top to bottom, and from left to right. Together they are the picture, or its crop.
    pub(super) bands: Vec<Crop>,
    /// The picture that was drawn last, joined from its bands. None before the first picture is complete. Always None
    /// if there is a single band: its picture stays on the device.
    pub(super) joined: Option<Picture>,
}

impl BandedRenderer {
    /// Uploads the scene and creates the pipelines.
    ///
    /// # Errors
    /// The scene, or a single row of the picture, exceeds the device's limits or memory, or the driver refuses a
    /// shader.
    pub fn new(context: Arc<Context>, world: &World, options: &RenderOptions) -> Result<Self, GpuError> {
        options.check()?;
        let bands = bands(context.limits(), options);
        let renderer = match largest(&bands, options) {
            None => GpuRenderer::new(context, world, options)?,
            Some(crop) => GpuRenderer::new(context, world, &RenderOptions { crop: Some(crop), ..options.clone() })?,
        };
        tracing::debug!(n_bands = bands.len(), "the picture's bands");
        Ok(Self { renderer, bands, joined: None })
    }

    /// Returns what is known of the device.
    pub fn device(&self) -> &DeviceInfo {
        self.renderer.context.info()
    }

    /// Number of bands of the picture.
    pub fn n_bands(&self) -> u32 {
        self.bands.len() as u32
    }

    /// Sets the camera of the next pictures.
    pub fn set_camera(&mut self, camera: &Camera) {
        self.renderer.set_camera(camera);
    }

    /// Draws another world from now on, as [`GpuRenderer::set_world`] does.
    ///
    /// # Errors
    /// Fails as [`GpuRenderer::set_world`] does.
    pub fn set_world(&mut self, world: &World) -> Result<(), GpuError> {
        self.joined = None;
        self.renderer.set_world(world)
    }

    /// Sets the part of the picture that is drawn next, a rectangle. Buffers are kept as [`GpuRenderer::set_crop`]
    /// keeps them.
    ///
    /// # Errors
    /// The crop is empty or exceeds the picture, or the part exceeds the device's limits or memory.
    pub fn set_crop(&mut self, crop: Crop) -> Result<(), GpuError> {
        if self.bands == [crop] && self.renderer.options().noise_tiles.is_none() {
            return Ok(());
        }
        let options = RenderOptions { crop: Some(crop), noise_tiles: None, ..self.renderer.options().clone() };
        options.check_ranges()?;
        let bands = bands(self.renderer.context.limits(), &options);
        let crop = largest(&bands, &options).unwrap_or(crop);
        self.renderer.set_options(&RenderOptions { crop: Some(crop), ..options })?;
        (self.bands, self.joined) = (bands, None);
        Ok(())
    }

    /// Sets the index of the next picture's first sample: any index if the picture has a single sample, else that of an
    /// aligned block of its samples. Only frames of paths know it.
    ///
    /// # Errors
    /// A Vulkan call fails.
    pub fn set_first_sample(&mut self, first_sample: u32) -> Result<(), GpuError> {
        self.set_paths(PathOptions { first_sample, ..self.renderer.options().paths })
    }

    /// Sets the random numbers of the next pictures ([`PathOptions::seed`]).
    ///
    /// # Errors
    /// A Vulkan call fails.
    pub fn set_seed(&mut self, seed: u32) -> Result<(), GpuError> {
        self.set_paths(PathOptions { seed, ..self.renderer.options().paths })
    }

    fn set_paths(&mut self, paths: PathOptions) -> Result<(), GpuError> {
        let options = self.renderer.options();
        if options.paths == paths {
            return Ok(());
        }
        self.renderer.set_options(&RenderOptions { paths, ..options.clone() })
    }

    /// Draws a new picture and reports its progress to the watcher. If the goal is a time and there are several bands,
    /// the first band gets its share of the time, and the others as many samples as the first one.
    ///
    /// # Errors
    /// A Vulkan call fails; one pixel alone makes more rays than the queue holds; out of memory.
    pub fn draw(&mut self, goal: Goal, watcher: &mut impl Watcher) -> Result<Drawn, GpuError> {
        if let [_] = self.bands[..] {
            return self.renderer.draw_window(goal, watcher);
        }
        self.joined = None;
        // A lack of memory is found before the first band is drawn.
        let mut joined = JoinedPicture::new(self.whole(), self.renderer.options())?;
        let (mut n_samples, mut profile) = (0, Profile::default());
        let mut goal = match goal {
            Goal::Time(time) => Goal::Time(time / self.n_bands()),
            samples => samples,
        };
        for band in self.bands.clone() {
            self.renderer.set_crop(band)?;
            // All bands have as many samples as the first one.
            let drawn = self.renderer.draw_window(goal, &mut Unending(watcher))?;
            goal = Goal::Samples(drawn.n_samples);
            joined.place(&band, &self.renderer.picture()?, &drawn);
            n_samples = drawn.n_samples;
            profile.append(drawn.profile);
        }
        self.joined = Some(joined.picture);
        Ok(Drawn { n_samples, profile, ..joined.drawn })
    }

    /// Returns the mean of the samples before the noise filter, of the crop and the border that the filter reads.
    ///
    /// # Panics
    /// There are several bands.
    ///
    /// # Errors
    /// A copy fails.
    pub fn window_mean(&self) -> Result<Vec<[f32; 4]>, GpuError> {
        assert_eq!(self.bands.len(), 1, "one band");
        self.renderer.window_mean()
    }

    /// Replaces the mean of the samples, which [`BandedRenderer::window_mean`] returns, and returns the picture of it,
    /// filtered and encoded. The next sample is the first of a new picture. If this fails, `mean` keeps its contents,
    /// else they may have become the picture.
    ///
    /// # Panics
    /// There are several bands, or the mean has another number of pixels.
    ///
    /// # Errors
    /// A copy fails.
    pub fn picture_of(&mut self, mean: &mut Vec<[f32; 4]>) -> Result<Picture, GpuError> {
        assert_eq!(self.bands.len(), 1, "one band");
        self.renderer.picture_of(mean)
    }

    /// Returns the picture that was drawn last. It is downloaded if it is still on the device.
    ///
    /// # Errors
    /// A copy fails.
    pub fn picture(&self) -> Result<Cow<'_, Picture>, GpuError> {
        match &self.joined {
            Some(picture) => Ok(Cow::Borrowed(picture)),
            None => self.renderer.picture().map(Cow::Owned),
        }
    }

    /// Copies the displayed picture into an image that the caller owns, as [`GpuRenderer::copy_picture_to`] does.
    ///
    /// # Errors
    /// The picture was drawn in several bands, so that it is not on the device. Also fails as
    /// [`GpuRenderer::copy_picture_to`] does.
    pub fn copy_picture_to(
        &self,
        image: &ExternalImage,
        after: Option<TimelinePoint>,
        then: Option<TimelinePoint>,
    ) -> Result<(), GpuError> {
        if self.bands.len() > 1 {
            let value = self.bands.len() as u64;
            return Err(GpuError::Limit { what: "bands of a picture that stays on the device", value, limit: 1 });
        }
        self.renderer.copy_picture_to(image, after, then)
    }

    /// Draws samples of noise tiles from anywhere in the picture, as many tiles together as the device can bind. All
    /// get equally many. [`BandedRenderer::set_crop`] ends the drawing of tiles.
    ///
    /// # Panics
    /// The options have a noise filter, or they do not ask for paths.
    ///
    /// # Errors
    /// Fails as [`BandedRenderer::draw`] does.
    pub fn draw_noise_tiles(&mut self, tiles: &[NoiseTileSamples]) -> Result<DrawnNoiseTiles, GpuError> {
        let n_pixels = self.renderer.context.limits().storage_range / Pixels::bytes_per_pixel(self.renderer.options());
        let most = (n_pixels as usize / NoiseTiles::N_PIXELS).clamp(1, NoiseTiles::MOST);
        // One band that no crop equals, so that `set_crop` sets the next one.
        (self.bands, self.joined) = (vec![Crop::whole(0, 0)], None);
        self.renderer.draw_noise_tiles(tiles, most)
    }

    /// Returns the part of the picture that all bands are together.
    fn whole(&self) -> Crop {
        let (first, last) = (self.bands[0], self.bands[self.bands.len() - 1]);
        Crop { x1: last.x1, y1: last.y1, ..first }
    }
}

/// The most bands side by side.
const MOST_COLUMNS: u32 = 256;

/// Returns as few bands as possible, of equal size except for the last ones. Each buffer of a band's pixels, with the
/// border that the noise filter reads, is small enough for the device to bind. If no band of a row's
/// [`MOST_COLUMNS`]th part is small enough, the bands are single rows, which the device refuses.
fn bands(limits: &Limits, options: &RenderOptions) -> Vec<Crop> {
    let (asked, window, border) = (options.crop_or_whole(), options.window(), options.border());
    let most_pixels = limits.storage_range / Pixels::bytes_per_pixel(options);
    if u64::from(window.width()) * u64::from(window.height()) <= most_pixels {
        return vec![asked];
    }
    // The most rows of bands of this many columns that the device can bind.
    let most_rows = |width: u32| {
        let of_window = most_pixels / u64::from((width + 2 * border).min(window.width()));
        u32::try_from(of_window).unwrap_or(u32::MAX).saturating_sub(2 * border)
    };
    let size = (1..=MOST_COLUMNS.min(asked.width()))
        .map(|n_columns| asked.width().div_ceil(n_columns))
        .filter_map(|width| Some((width, Some(most_rows(width)).filter(|rows| *rows > 0)?)))
        .min_by_key(|(width, rows)| asked.width().div_ceil(*width) * asked.height().div_ceil(*rows));
    let (width, most_rows) = size.unwrap_or((asked.width(), 1));
    let n_rows = asked.height().div_ceil(asked.height().div_ceil(most_rows));
    let rows = (asked.y0..asked.y1).step_by(n_rows as usize);
    rows.flat_map(|y0| {
        let columns = (asked.x0..asked.x1).step_by(width as usize);
        columns.map(move |x0| Crop { x0, y0, x1: (x0 + width).min(asked.x1), y1: (y0 + n_rows).min(asked.y1) })
    })
    .collect()
}

/// Returns the band that needs the most memory, or None if there is only one band.
fn largest(bands: &[Crop], options: &RenderOptions) -> Option<Crop> {
    let n_pixels = |crop: &&Crop| {
        let window = RenderOptions { crop: Some(**crop), ..options.clone() }.window();
        u64::from(window.width()) * u64::from(window.height())
    };
    bands.iter().max_by_key(n_pixels).copied().filter(|_| bands.len() > 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Denoise, Integrator};

    fn limits(storage_range: u64) -> Limits {
        Limits {
            storage_range,
            n_texels: 0,
            buffer_bytes: u64::MAX,
            target_size: 1 << 14,
            n_groups: 65_535,
            group_size: 1024,
        }
    }

    /// Each pixel of the picture is in one band, whose window fits the device.
    #[test]
    fn bands_are_the_picture_and_fit_the_device() {
        let filter = Denoise::Paper { threshold: 1.0 };
        let part = Crop { x0: 5, y0: 7, x1: 60, y1: 41 };
        for (denoise, pixel_aovs, crop) in
            [(Denoise::Off, false, None), (filter, false, None), (filter, true, None), (filter, false, Some(part))]
        {
            let options =
                RenderOptions { width: 64, height: 48, denoise, pixel_aovs, crop, ..RenderOptions::default() };
            for range in [2 << 10, 16 << 10, 20_000, 24 << 10, 48 << 10, 1 << 30] {
                assert_fit(&options, range);
            }
        }
        let (integrator, denoise) = (Integrator::Path, Denoise::Edge);
        for (width, height) in [(16_384, 500), (3000, 3000), (500, 16_384)] {
            let options = RenderOptions { width, height, integrator, denoise, ..RenderOptions::default() };
            for range in [8 << 20, 128 << 20] {
                assert_fit(&options, range);
            }
        }
    }

    fn assert_fit(options: &RenderOptions, range: u64) {
        let (bands, asked) = (bands(&limits(range), options), options.crop_or_whole());
        let mut n_bands_of = vec![0_u8; asked.width() as usize * asked.height() as usize];
        for band in &bands {
            let window = RenderOptions { crop: Some(*band), ..options.clone() }.window();
            let n_pixels = u64::from(window.width()) * u64::from(window.height());
            assert!(n_pixels * Pixels::bytes_per_pixel(options) <= range, "{range}: {band}");
            let mut n_before = asked.cut(&n_bands_of, band);
            n_before.iter_mut().for_each(|n| *n += 1);
            asked.place(&mut n_bands_of, band, &n_before);
        }
        assert!(n_bands_of.iter().all(|n| *n == 1), "{range}: {bands:?}");
        assert_eq!(bands.len() == 1, largest(&bands, options).is_none());
    }

    #[test]
    fn there_are_no_more_bands_than_needed() {
        let options = |denoise| RenderOptions { width: 64, height: 48, denoise, ..RenderOptions::default() };
        let of = |n_rows: u64, denoise| bands(&limits(n_rows * 64 * 16), &options(denoise));
        let n_bands = |n_rows: u64, denoise| of(n_rows, denoise).len();
        let filter = Denoise::Paper { threshold: 1.0 };
        assert_eq!([48, 47, 24, 23, 1].map(|n_rows| n_bands(n_rows, Denoise::Off)), [1, 2, 2, 3, 48]);
        assert_eq!([48, 47, 26, 25].map(|n_rows| n_bands(n_rows, filter)), [1, 2, 2, 3]);
        // Full rows would be 48 bands, each with two rows of border.
        let narrow = of(3, filter);
        assert!(narrow.len() < 30 && narrow[0].width() < 64, "{narrow:?}");
        // Nothing fits a device that binds less than a pixel with its border.
        assert_eq!(bands(&limits(64), &options(filter)).len(), 48);
    }
}
