// The order of pixels in the ray queue, and the camera's rays. Needs nothing before it; provides frame (frame.glsl).
// "Pixel" means a pixel of the window, the part of the picture that is rendered.
#ifndef KDRAY_CAMERA
#define KDRAY_CAMERA

#include "layout.glsl"
#include "constants.glsl"
#include "frame.glsl"

// Moves bits 0, 2 and 4 of a number below 64 to bits 0, 1 and 2.
uint every_second_bit(uint n) {
    return (n & 1u) | ((n >> 1) & 2u) | ((n >> 2) & 4u);
}

// The index from the top of the k-th of n bands, which are rows of squares. k counts from 0, from the middle outward,
// alternately above and below. The bottom band, which the window's border may cut, comes last. So all bands before it
// have the same number of pixels, and `pixel_of` finds a pixel's band by a division.
uint band_outward(uint k, uint n) {
    uint n_left = n - 1u - k;
    return (n_left & 1u) == 0u ? n - 1u - (n_left >> 1) : n_left >> 1;
}

// The pixel at index `order` of the queue, from 0 to width * height - 1. Pixels are ordered square by square
// (PIXEL_GROUP_SIZE x PIXEL_GROUP_SIZE pixels), and in each square along a Z-curve, so that subgroups of any size are
// blocks of the image. In squares that the right or lower border cuts, pixels are ordered row by row. The bands of
// squares come from the middle outward: most pictures show their subject in the middle, where rays take longest. These
// rays start early, so that a dispatch does not wait for them at its end.
uvec2 pixel_of(uint order, uint width, uint height) {
    uint nth_band = order / (PIXEL_GROUP_SIZE * width);
    uint in_band = order - nth_band * PIXEL_GROUP_SIZE * width;
    uint band = band_outward(nth_band, (height + PIXEL_GROUP_SIZE - 1u) / PIXEL_GROUP_SIZE);
    uint rows = min(PIXEL_GROUP_SIZE, height - band * PIXEL_GROUP_SIZE);
    uint square = in_band / (PIXEL_GROUP_SIZE * rows);
    uint in_square = in_band - square * PIXEL_GROUP_SIZE * rows;
    uint columns = min(PIXEL_GROUP_SIZE, width - square * PIXEL_GROUP_SIZE);
    bool is_whole = rows == PIXEL_GROUP_SIZE && columns == PIXEL_GROUP_SIZE;
    uvec2 at = is_whole ? uvec2(every_second_bit(in_square), every_second_bit(in_square >> 1))
        : uvec2(in_square % columns, in_square / columns);
    return PIXEL_GROUP_SIZE * uvec2(square, band) + at;
}

// Converts a pixel of the window to the same pixel's coordinates in the whole picture.
uvec2 in_picture(uvec2 pixel) {
    return pixel + uvec2(frame.window_x, frame.window_y);
}

// The point of the pixel's sample in the image plane of a perspective camera, which is at distance 1 from the eye. The
// rasterizer tests the same sample. The point is relative to the eye, with world axes.
vec3 sample_in_image(uvec2 pixel) {
    vec2 at_px = vec2(in_picture(pixel)) + vec2(frame.sample_x, frame.sample_y);
    vec2 at = at_px / vec2(frame.picture_width, frame.picture_height) * 2.0 - 1.0;
    return frame.forward + at.x * frame.right - at.y * frame.up;
}

// The same point for an orthographic camera, whose image plane contains the eye. `precise`: all kernels must compute
// the same bits.
vec3 sample_beside_eye(uvec2 pixel) {
    vec2 at_px = vec2(in_picture(pixel)) + vec2(frame.sample_x, frame.sample_y);
    vec2 at = at_px / vec2(frame.picture_width, frame.picture_height) * 2.0 - 1.0;
    precise vec3 point = at.x * frame.right - at.y * frame.up;
    return point;
}

// Where the ray through the pixel's sample begins.
vec3 camera_origin(uvec2 pixel) {
    precise vec3 origin = frame.eye;
    if (ORTHOGRAPHIC) origin = frame.eye + sample_beside_eye(pixel);
    return origin;
}

// The unit direction of the ray through the pixel's sample.
vec3 camera_direction(uvec2 pixel) {
    if (ORTHOGRAPHIC) return frame.forward;
    return normalize(sample_in_image(pixel));
}

// The pixel's index in buffers of the window's pixels, which hold rows from the top.
uint pixel_ix_of(uvec2 pixel) {
    return pixel.y * frame.width + pixel.x;
}

// The camera ray through the pixel's sample.
PathRay camera_ray(uvec2 pixel) {
    vec3 direction = camera_direction(pixel);
    return PathRay(camera_origin(pixel), pixel_ix_of(pixel), direction, NO_TRIANGLE, vec3(1.0), INFINITY);
}

#endif
