//! Tonemap: applies a tone curve and encodes the result as sRGB with 8 bits per channel. Twin of `tonemap.comp`.

use glam::Vec3;
use rayon::prelude::*;

use super::{display::srgb_encode, tone_curves::tone_mapped};
use crate::{frame::Tonemap, layout::Frame};

/// Writes `pixel_display` (RGBA, opaque).
pub fn tonemap(frame: &Frame, curve: Tonemap, pixel_filtered: &[[f32; 4]], pixel_display: &mut [[u8; 4]]) {
    pixel_filtered.par_iter().zip(pixel_display).with_min_len(1024).for_each(|(&[r, g, b, _], display)| {
        let encoded = srgb_encode(tone_mapped(curve.constant(), Vec3::new(r, g, b), frame.exposure));
        let [r, g, b] = encoded.to_array().map(|x| (x * 255.0 + 0.5) as u8);
        *display = [r, g, b, 255];
    });
}
