//! Conversions from radiance to display values. Twin of `picture/display.glsl`.

use glam::Vec3;

/// The linear display value, 0..1; black for NaN.
#[expect(clippy::manual_clamp, reason = "`clamp` keeps NaN")]
pub fn displayed(radiance: Vec3, exposure: f32) -> Vec3 {
    (radiance * exposure).map(|x| x.max(0.0).min(1.0))
}

/// The relative luminance of the displayed colour, 0..1 (ITU-R BT.709).
pub fn luminance(radiance: Vec3, exposure: f32) -> f32 {
    displayed(radiance, exposure).dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// Encodes linear values in 0..1 as sRGB (IEC 61966-2-1).
pub fn srgb_encode(linear: Vec3) -> Vec3 {
    linear.map(|x| if x <= 0.0031308 { x * 12.92 } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 })
}
