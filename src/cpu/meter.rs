//! The exposure of a picture whose light has physical units, measured as a camera does.

use super::{Batching, CpuRenderer};
use crate::{
    accel::kdtree::Traversal,
    frame::{Denoise, Integrator, Primary, RenderOptions},
    world::World,
};

/// Width of the picture that is measured, pixels.
const WIDTH: u32 = 96;
/// Display value that the mean luminance of all surfaces gets.
const MEAN: f32 = 0.25;
/// Number of samples a pixel if surfaces are lamps, whose light comes by chance.
const PATH_SAMPLES: u32 = 16;
/// Share of the surfaces that may be brighter than the display.
const CLIPPED: f32 = 0.05;

/// Returns the exposure at which the scene's own camera shows surfaces of medium brightness, without more than a few
/// that are too bright for the display. It is measured in a small picture of one sample a pixel, or of a few paths a
/// pixel if the scene has no other lights than surfaces that shine. It is rounded to two digits, so that it does not
/// depend on the device. It is 1 if the camera sees no light.
///
/// The CPU measures it on the current rayon pool. If the scene has a grid, the host builds it for this.
pub fn metered_exposure(world: &World) -> f32 {
    let defaults = &world.scene().defaults;
    let height = (WIDTH as f32 * defaults.height as f32 / defaults.width as f32).round().max(1.0) as u32;
    let needs_paths = world.scene().lights.is_empty() && defaults.integrator == Integrator::Path;
    let (integrator, n_samples) = if needs_paths { (Integrator::Path, PATH_SAMPLES) } else { (Integrator::Whitted, 1) };
    let defaults = defaults.for_integrator(Some(integrator));
    let options = RenderOptions {
        integrator,
        width: WIDTH,
        height,
        max_depth: defaults.max_depth,
        denoise: Denoise::Off,
        traversal: Traversal::Stack,
        primary: Primary::Trace,
        pixel_aovs: true,
        ..RenderOptions::default()
    };
    let mut renderer = CpuRenderer::new(world, &options, Batching::default());
    for _ in 0..n_samples {
        renderer.draw_sample();
    }
    let pixel_aovs = renderer.pixel_aovs();
    let pixels = renderer.picture().radiance.into_iter().zip(pixel_aovs);
    let luminance = |[r, g, b, _]: [f32; 4]| 0.2126 * r + 0.7152 * g + 0.0722 * b;
    let of_surfaces = pixels.filter(|(_, aovs)| aovs.depth.is_finite());
    let mut luminances: Vec<f32> = of_surfaces.map(|(radiance, _)| luminance(radiance)).collect();
    if needs_paths {
        leave_out_lamps(&mut luminances);
    }
    exposure_of(luminances)
}

/// Leaves out the brightest of the luminances, as many as may be clipped. They are those of the lamps, which may be a
/// thousand times as bright as what they light.
fn leave_out_lamps(luminances: &mut Vec<f32>) {
    luminances.sort_by(f32::total_cmp);
    luminances.truncate((luminances.len() as f32 * (1.0 - CLIPPED)).ceil() as usize);
}

/// Returns the exposure for surfaces of these luminances.
fn exposure_of(mut luminances: Vec<f32>) -> f32 {
    luminances.retain(|luminance| luminance.is_finite());
    luminances.sort_by(f32::total_cmp);
    let sum: f64 = luminances.iter().copied().map(f64::from).sum();
    let bright_ix = (luminances.len() as f32 * (1.0 - CLIPPED)) as usize;
    let Some(bright) = luminances.get(bright_ix.min(luminances.len().saturating_sub(1))) else { return 1.0 };
    let mean = (sum / luminances.len() as f64) as f32;
    if !(mean > 0.0) {
        return 1.0;
    }
    let exposure = if *bright > 0.0 { (MEAN / mean).min(1.0 / bright) } else { MEAN / mean };
    two_digits(exposure.clamp(1e-6, 1e6))
}

/// Rounds a positive number to two significant digits.
fn two_digits(value: f32) -> f32 {
    format!("{value:.1e}").parse().expect("a number that was just written")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_becomes_a_medium_grey() {
        assert_eq!(exposure_of(vec![50.0; 100]), 0.005);
        let mixed: Vec<f32> = (0..100).map(|i| i as f32).collect();
        assert_eq!(exposure_of(mixed), 0.0051);
    }

    #[test]
    fn few_surfaces_are_brighter_than_the_display() {
        // A tenth of all surfaces is much brighter than the rest.
        let mut luminances = vec![0.1; 90];
        luminances.extend([100.0; 10]);
        assert_eq!(exposure_of(luminances), 0.01);
    }

    #[test]
    fn lamps_do_not_darken_what_they_light() {
        let mut luminances = vec![2.5; 97];
        luminances.extend([5000.0; 3]);
        leave_out_lamps(&mut luminances);
        assert_eq!(exposure_of(luminances), 0.1);
        leave_out_lamps(&mut Vec::new());
    }

    #[test]
    fn a_dark_or_empty_picture_has_an_exposure_of_1() {
        assert_eq!([exposure_of(Vec::new()), exposure_of(vec![0.0; 9]), exposure_of(vec![f32::NAN; 3])], [1.0; 3]);
    }

    #[test]
    fn two_digits_are_left() {
        assert_eq!([0.001_234_f32, 987.6, 1.0, 0.009_96].map(two_digits), [0.0012, 990.0, 1.0, 0.01]);
    }
}
