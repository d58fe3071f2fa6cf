//! False colour: displays one of the AOVs of each pixel. Twin of `false_color.comp`.

use glam::{Vec3, vec3};

use crate::layout::{FalseColor, NO_TRIANGLE, PixelAovs, VIEW_COST, VIEW_ID, VIEW_NORMAL, VIEW_RAYS};

/// A colour for an index. Neighbouring indices get different colours: the low bits of a multiplicative hash (Knuth
/// 6.4).
fn id_color(id: u32) -> Vec3 {
    let hash = id.wrapping_mul(2_654_435_761);
    let hash = hash ^ hash >> 15;
    let channel = |shift: u32| (hash >> shift & 255) as f32;
    0.25 + 0.75 * vec3(channel(0), channel(8), channel(16)) / 255.0
}

/// A heat map: from black over violet, red and yellow to white as x rises from 0 to 1.
pub fn heat_color(x: f32) -> Vec3 {
    let rising = (3.0 * x - vec3(0.0, 1.0, 2.0)).clamp(Vec3::ZERO, Vec3::ONE);
    rising + vec3(0.0, 0.0, 0.5 * (1.0 - (6.0 * x - 1.5).abs() / 1.5).max(0.0))
}

fn color(aovs: &PixelAovs, push: &FalseColor) -> Vec3 {
    match push.view {
        VIEW_COST => heat_color(aovs.n_steps as f32 / push.brightest),
        VIEW_RAYS => heat_color(aovs.n_rays as f32 / push.brightest),
        _ if aovs.triangle_ix == NO_TRIANGLE => Vec3::ZERO,
        VIEW_NORMAL => 0.5 + 0.5 * aovs.normal_world,
        VIEW_ID => id_color(aovs.triangle_ix),
        _ => Vec3::splat(1.0 / (1.0 + aovs.depth / push.brightest)),
    }
}

/// Writes `pixel_display` (RGBA, opaque): the view `push.view`, one of `VIEW_*`.
pub fn false_color(push: &FalseColor, pixel_aovs: &[PixelAovs], pixel_display: &mut [[u8; 4]]) {
    for (aovs, display) in pixel_aovs.iter().zip(pixel_display) {
        let [r, g, b] = color(aovs, push).clamp(Vec3::ZERO, Vec3::ONE).to_array().map(|x| (x * 255.0 + 0.5) as u8);
        *display = [r, g, b, 255];
    }
}
