//! The memory that a picture takes, checked before it is allocated.

use kdray::{
    frame::{Aov, RenderOptions},
    layout::PixelAovs,
    util::memory::require,
};

use crate::cli::error::CliError;

/// Bytes of a pixel's radiance as floats.
const RADIANCE: u64 = size_of::<[f32; 4]>() as u64;
/// Bytes of a pixel's colour for display.
const DISPLAY: u64 = size_of::<[u8; 4]>() as u64;
/// Bytes of a pixel while a PNG is written: its RGB colour and its encoded form.
const ENCODED: u64 = 6;

/// Refuses pictures that do not fit in memory. With `--cpu`, the renderer's buffers are counted, too. `n_at_once`:
/// number of pictures that are drawn at the same time.
pub fn check_memory(options: &RenderOptions, n_samples: u32, on_cpu: bool, n_at_once: u64) -> Result<(), CliError> {
    let (window, crop) = (options.window(), options.crop_or_whole());
    let n_pixels = |width: u32, height: u32| u64::from(width) * u64::from(height);
    let n_rendered = if on_cpu { n_pixels(window.width(), window.height()) } else { 0 };
    let needed = n_rendered * rendered_bytes(options, n_samples)
        + n_pixels(crop.width(), crop.height())
            * (RADIANCE + DISPLAY + ENCODED + aovs_bytes(options) + layer_bytes(options));
    let pictures = if n_at_once == 1 { "a picture".to_owned() } else { format!("{n_at_once} pictures") };
    require(&format!("{pictures} of {}x{} pixels", crop.width(), crop.height()), n_at_once * needed)?;
    Ok(())
}

/// Returns the bytes per pixel of the CPU renderer's buffers: the index of the visible triangle, the sample, the sum
/// of samples, the filtered picture and the picture for display. Layers of light have samples and sums of their own.
fn rendered_bytes(options: &RenderOptions, n_samples: u32) -> u64 {
    let sums = if n_samples > 1 { RADIANCE } else { 0 };
    let layers = layer_bytes(options) * (1 + sums / RADIANCE);
    size_of::<u32>() as u64 + RADIANCE + sums + RADIANCE + DISPLAY + aovs_bytes(options) + layers
}

/// Returns the bytes of a pixel in the layers of light.
fn layer_bytes(options: &RenderOptions) -> u64 {
    if options.has_light_layers() { Aov::OF_LIGHT.len() as u64 * RADIANCE } else { 0 }
}

fn aovs_bytes(options: &RenderOptions) -> u64 {
    if options.pixel_aovs { size_of::<PixelAovs>() as u64 } else { 0 }
}

#[cfg(test)]
mod tests {
    use kdray::frame::Integrator;

    use super::*;

    #[test]
    fn a_pixel_s_buffers_are_counted_and_a_usual_picture_is_not_refused() {
        let usual = RenderOptions::default();
        check_memory(&usual, 1, true, 1).unwrap();
        assert_eq!(rendered_bytes(&usual, 1), 40);
        assert_eq!(rendered_bytes(&usual, 2), 56);
        let with_aovs = RenderOptions { pixel_aovs: true, ..usual };
        assert_eq!(rendered_bytes(&with_aovs, 1), 40 + size_of::<PixelAovs>() as u64);
        let integrator = Integrator::Path;
        let with_layers = RenderOptions { light_layers: true, integrator, ..RenderOptions::default() };
        assert_eq!([1, 2].map(|n_samples| rendered_bytes(&with_layers, n_samples)), [40 + 48, 56 + 96]);
    }
}
