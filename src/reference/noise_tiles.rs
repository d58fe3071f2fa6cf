//! The picture's pixels that paths belong to. Twin of `noise_tiles.glsl`.

use glam::{UVec2, uvec2};

use super::camera::in_picture;
use crate::layout::{Frame, NOISE_TILE_SIZE, WINDOW_OF_TILES};

/// Converts a pixel of the window to the same pixel's coordinates in the whole picture. `noise_tiles`: the places of
/// the window's tiles, in units of their side, x in the lower half of a word and y in the upper half.
pub fn picture_pixel_of(frame: &Frame, noise_tiles: &[u32], pixel: UVec2) -> UVec2 {
    if frame.window_x != WINDOW_OF_TILES {
        return in_picture(frame, pixel);
    }
    let place = noise_tiles[(pixel.y / NOISE_TILE_SIZE) as usize];
    NOISE_TILE_SIZE * uvec2(place & 0xffff, place >> 16) + uvec2(pixel.x, pixel.y % NOISE_TILE_SIZE)
}
