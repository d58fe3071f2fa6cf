//! Pixels in the order of the ray queue, and the camera's rays. Twin of `camera.glsl`.

use glam::{UVec2, Vec2, Vec3, uvec2};

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

/// Unit direction through the pixel's centre, the sample that the rasterizer tests.
pub fn camera_direction(frame: &Frame, pixel: UVec2) -> Vec3 {
    let size = Vec2::new(frame.width as f32, frame.height as f32);
    let centre = (pixel.as_vec2() + 0.5) / size * 2.0 - 1.0;
    (frame.forward + centre.x * frame.right - centre.y * frame.up).normalize()
}
