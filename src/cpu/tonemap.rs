//! Tonemap: radiance to sRGB, 8 bits a channel. Twin of `tonemap.comp`.

use glam::Vec3;
use rayon::prelude::*;

use super::display::{displayed, srgb_encode};
use crate::layout::Frame;

/// Writes `pixel_display` (RGBA, opaque).
pub fn tonemap(frame: &Frame, pixel_filtered: &[[f32; 4]], pixel_display: &mut [[u8; 4]]) {
    pixel_filtered.par_iter().zip(pixel_display).with_min_len(1024).for_each(|(&[r, g, b, _], display)| {
        let encoded = srgb_encode(displayed(Vec3::new(r, g, b), frame.exposure));
        let [r, g, b] = encoded.to_array().map(|x| (x * 255.0 + 0.5) as u8);
        *display = [r, g, b, 255];
    });
}
