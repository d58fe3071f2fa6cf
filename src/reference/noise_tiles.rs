//! The picture's pixels and samples that paths belong to. Twin of `rays/noise_tiles.glsl`.

use glam::{UVec2, uvec2};

use super::camera::in_picture;
use crate::layout::{Frame, NOISE_TILE_SIZE, WINDOW_OF_NOISE_TILES};

/// Converts a pixel of the window to the same pixel's coordinates in the whole picture. `noise_tiles`: the tiles of the
/// window, as the kernel reads them.
pub fn picture_pixel_of(frame: &Frame, noise_tiles: &[u32], pixel: UVec2) -> UVec2 {
    if frame.window_x != WINDOW_OF_NOISE_TILES {
        return in_picture(frame, pixel);
    }
    let tile = noise_tiles[(pixel.y / NOISE_TILE_SIZE) as usize];
    NOISE_TILE_SIZE * uvec2(tile & 0xfff, tile >> 12 & 0xfff) + uvec2(pixel.x, pixel.y % NOISE_TILE_SIZE)
}

/// Returns the index of the first sample that the frame draws of a pixel of the window.
pub fn first_sample_of(frame: &Frame, noise_tiles: &[u32], pixel: UVec2) -> u32 {
    if frame.window_x != WINDOW_OF_NOISE_TILES {
        return frame.first_sample;
    }
    frame.first_sample + (noise_tiles[(pixel.y / NOISE_TILE_SIZE) as usize] >> 24) * frame.window_y
}
