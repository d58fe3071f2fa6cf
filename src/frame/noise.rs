//! Measures of noise. Twin of `picture/noise.glsl`.

use glam::Vec3;

/// The luminance up to which a sample counts in variances. The sum of squares of all samples is then finite.
const MOST_SQUARED_LUMINANCE: f32 = 1e15;

/// The relative luminance of radiance (ITU-R BT.709).
pub fn luminance_of(radiance: Vec3) -> f32 {
    0.2126 * radiance.x + 0.7152 * radiance.y + 0.0722 * radiance.z
}

/// The square of a sample's luminance.
pub fn squared_luminance(radiance: Vec3) -> f32 {
    luminance_of(radiance).min(MOST_SQUARED_LUMINANCE).powi(2)
}

/// The variance of a pixel's mean luminance. `mean`: of the radiance of its samples, and in the fourth component of
/// their squared luminance. It is infinite for a single sample, whose noise is unknown.
pub fn variance_of_mean([r, g, b, squared]: [f32; 4], n_samples: u32) -> f32 {
    if n_samples < 2 {
        return f32::INFINITY;
    }
    (squared - luminance_of(Vec3::new(r, g, b)).powi(2)).max(0.0) / (n_samples - 1) as f32
}
