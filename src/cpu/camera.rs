//! Pixels in the order of the ray queue, and the camera's rays. Twin of `camera.glsl`.

use glam::{UVec2, Vec3, uvec2, vec2};

use crate::layout::{Frame, TILE_SIZE};

/// The pixel at place `order` when the image is walked tile by tile, each tile row by row. Without gaps.
pub fn pixel_of(order: u32, width: u32, height: u32) -> UVec2 {
    let band = order / (TILE_SIZE * width);
    let in_band = order - band * TILE_SIZE * width;
    let rows = TILE_SIZE.min(height - band * TILE_SIZE);
    let tile = in_band / (TILE_SIZE * rows);
    let in_tile = in_band - tile * TILE_SIZE * rows;
    let columns = TILE_SIZE.min(width - tile * TILE_SIZE);
    uvec2(tile * TILE_SIZE + in_tile % columns, band * TILE_SIZE + in_tile / columns)
}

/// The window's pixel in the whole picture.
pub fn in_picture(frame: &Frame, pixel: UVec2) -> UVec2 {
    pixel + uvec2(frame.window_x, frame.window_y)
}

/// Unit direction through the sample of the window's pixel, the one that the rasterizer tests.
pub fn camera_direction(frame: &Frame, pixel: UVec2) -> Vec3 {
    let at_px = in_picture(frame, pixel).as_vec2() + vec2(frame.sample_x, frame.sample_y);
    let at = at_px / uvec2(frame.picture_width, frame.picture_height).as_vec2() * 2.0 - 1.0;
    (frame.forward + at.x * frame.right - at.y * frame.up).normalize()
}
