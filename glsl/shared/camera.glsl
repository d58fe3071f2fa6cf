// Pixels in the order of the ray queue, and the camera's rays.
#ifndef KDRAY_CAMERA
#define KDRAY_CAMERA

#include "layout.glsl"
#include "frame.glsl"

// Every second bit of a number below 64.
uint every_second_bit(uint n) {
    return (n & 1u) | ((n >> 1) & 2u) | ((n >> 2) & 4u);
}

// The k-th of n bands from the middle outward, those below and above in turn; the last is the lowest one.
uint band_outward(uint k, uint n) {
    uint n_left = n - 1u - k;
    return (n_left & 1u) == 0u ? n - 1u - (n_left >> 1) : n_left >> 1;
}

// The pixel at place `order` when the image is walked tile by tile (TILE_SIZE squared pixels), each tile along a Z-curve,
// so that subgroups of any size are blocks of the image; row by row where the right or lower border cuts the tile.
// Without gaps. The bands of tiles come from the middle outward: that is where most pictures show what they are of, and a
// dispatch does not wait at its end for long rays that began late.
uvec2 pixel_of(uint order, uint width, uint height) {
    uint nth_band = order / (TILE_SIZE * width);
    uint in_band = order - nth_band * TILE_SIZE * width;
    uint band = band_outward(nth_band, (height + TILE_SIZE - 1u) / TILE_SIZE);
    uint rows = min(TILE_SIZE, height - band * TILE_SIZE);
    uint tile = in_band / (TILE_SIZE * rows);
    uint in_tile = in_band - tile * TILE_SIZE * rows;
    uint columns = min(TILE_SIZE, width - tile * TILE_SIZE);
    bool is_whole = rows == TILE_SIZE && columns == TILE_SIZE;
    uvec2 at = is_whole ? uvec2(every_second_bit(in_tile), every_second_bit(in_tile >> 1))
        : uvec2(in_tile % columns, in_tile / columns);
    return TILE_SIZE * uvec2(tile, band) + at;
}

// The window's pixel in the whole picture.
uvec2 in_picture(uvec2 pixel) {
    return pixel + uvec2(frame.window_x, frame.window_y);
}

// The sample of the window's pixel, the one that the rasterizer tests, as seen from the eye: in the plane at distance 1.
vec3 sample_in_image(uvec2 pixel) {
    vec2 at_px = vec2(in_picture(pixel)) + vec2(frame.sample_x, frame.sample_y);
    vec2 at = at_px / vec2(frame.picture_width, frame.picture_height) * 2.0 - 1.0;
    return frame.forward + at.x * frame.right - at.y * frame.up;
}

// Unit direction through the sample of the window's pixel.
vec3 camera_direction(uvec2 pixel) {
    return normalize(sample_in_image(pixel));
}

// Its place in buffers of the window's pixels: rows from the top.
uint pixel_ix_of(uvec2 pixel) {
    return pixel.y * frame.width + pixel.x;
}

// The ray through the pixel's sample.
PathRay camera_ray(uvec2 pixel) {
    float infinity = uintBitsToFloat(0x7f800000u);
    return PathRay(frame.eye, pixel_ix_of(pixel), camera_direction(pixel), NO_TRIANGLE, vec3(1.0), infinity);
}

#endif
