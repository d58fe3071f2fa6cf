//! The order of pixels in the ray queue, and the origins and directions of the camera's rays. Twin of
//! `rays/camera.glsl`.

use glam::{UVec2, Vec2, Vec3, uvec2, vec2};

use crate::layout::{Frame, PIXEL_GROUP_SIZE};

/// Moves bits 0, 2 and 4 of a number below 64 to bits 0, 1 and 2.
fn every_second_bit(n: u32) -> u32 {
    n & 1 | n >> 1 & 2 | n >> 2 & 4
}

/// The index from the top of the `k`-th of `n` bands, which are rows of squares. `k` counts from 0, from the middle
/// outward, alternately above and below. The last band is the bottom one, which the picture's border may cut.
fn band_outward(k: u32, n: u32) -> u32 {
    let n_left = n - 1 - k;
    if n_left.is_multiple_of(2) { n - 1 - n_left / 2 } else { n_left / 2 }
}

/// The pixel at index `order` of the queue, from 0 to `width * height - 1`. Pixels are ordered square by square, and in
/// each square along a Z-curve, so that neighbours in the queue are blocks of the image. In squares that the border
/// cuts, pixels are ordered row by row. The bands of squares come from the middle outward.
pub fn pixel_of(order: u32, width: u32, height: u32) -> UVec2 {
    let nth_band = order / (PIXEL_GROUP_SIZE * width);
    let in_band = order - nth_band * PIXEL_GROUP_SIZE * width;
    let band = band_outward(nth_band, height.div_ceil(PIXEL_GROUP_SIZE));
    let rows = PIXEL_GROUP_SIZE.min(height - band * PIXEL_GROUP_SIZE);
    let square = in_band / (PIXEL_GROUP_SIZE * rows);
    let in_square = in_band - square * PIXEL_GROUP_SIZE * rows;
    let columns = PIXEL_GROUP_SIZE.min(width - square * PIXEL_GROUP_SIZE);
    let is_whole = rows == PIXEL_GROUP_SIZE && columns == PIXEL_GROUP_SIZE;
    let at = if is_whole {
        uvec2(every_second_bit(in_square), every_second_bit(in_square >> 1))
    } else {
        uvec2(in_square % columns, in_square / columns)
    };
    PIXEL_GROUP_SIZE * uvec2(square, band) + at
}

/// The pixel's index in buffers of the window's pixels, which hold rows from the top.
pub fn pixel_ix_of(frame: &Frame, pixel: UVec2) -> u32 {
    pixel.y * frame.width + pixel.x
}

/// Converts a pixel of the window to the same pixel's coordinates in the whole picture.
pub fn in_picture(frame: &Frame, pixel: UVec2) -> UVec2 {
    pixel + uvec2(frame.window_x, frame.window_y)
}

/// Where the sample of a pixel of the window is in the picture: -1 to 1 from its left edge to its right one, and from
/// its upper edge to its lower one. The rasterizer tests the same sample.
fn sample_in_picture(frame: &Frame, pixel: UVec2) -> Vec2 {
    let at_px = in_picture(frame, pixel).as_vec2() + vec2(frame.sample_x, frame.sample_y);
    at_px / uvec2(frame.picture_width, frame.picture_height).as_vec2() * 2.0 - 1.0
}

/// Where the ray through the sample of a pixel of the window begins.
pub fn camera_origin(frame: &Frame, pixel: UVec2) -> Vec3 {
    if frame.is_orthographic == 0 {
        return frame.eye;
    }
    let at = sample_in_picture(frame, pixel);
    frame.eye + (at.x * frame.right - at.y * frame.up)
}

/// The unit direction of the ray through the sample of a pixel of the window.
pub fn camera_direction(frame: &Frame, pixel: UVec2) -> Vec3 {
    if frame.is_orthographic == 1 {
        return frame.forward;
    }
    let at = sample_in_picture(frame, pixel);
    (frame.forward + at.x * frame.right - at.y * frame.up).normalize()
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn every_pixel_has_one_place() {
        for (width, height) in [(16, 8), (21, 13), (3, 40), (1, 1)] {
            let pixels: HashSet<UVec2> = (0..width * height).map(|order| pixel_of(order, width, height)).collect();
            assert_eq!(pixels.len() as u32, width * height);
            assert!(pixels.iter().all(|pixel| pixel.x < width && pixel.y < height));
        }
    }

    #[test]
    fn bands_come_from_the_middle_outward() {
        let bands = |n| (0..n).map(|k| band_outward(k, n)).collect::<Vec<_>>();
        assert_eq!(bands(1), [0]);
        assert_eq!(bands(4), [1, 2, 0, 3]);
        assert_eq!(bands(5), [2, 1, 3, 0, 4]);
    }

    #[test]
    fn neighbours_in_the_queue_are_blocks() {
        for (n, block) in [(4, uvec2(2, 2)), (8, uvec2(4, 2)), (16, uvec2(4, 4)), (32, uvec2(8, 4)), (64, uvec2(8, 8))]
        {
            for first in (0..24 * 16).step_by(n as usize) {
                let pixels = || (first..first + n).map(|order| pixel_of(order, 24, 16));
                let (least, most) = pixels().fold((UVec2::MAX, UVec2::ZERO), |(a, b), p| (a.min(p), b.max(p)));
                assert_eq!(most - least + 1, block);
            }
        }
    }
}
