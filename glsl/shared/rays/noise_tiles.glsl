// The picture's pixels and samples that paths belong to. The window of paths is a rectangle of the picture, or a column
// of noise tiles from anywhere in the picture, one below the other: those that still get samples. If they are few, each
// is in the window several times, with other samples, so that the device has enough to do. Twin of
// src/reference/noise_tiles.rs. Needs nothing. Provides `picture_pixel_of` and `first_sample_of`.
#ifndef KDRAY_NOISE_TILES
#define KDRAY_NOISE_TILES

#include "layout.glsl"
#include "rays/camera.glsl"

// The tiles of the window. Bits 0..11, 12..23: x and y of the tile, in units of its side. Bits 24..31: which block of
// `Frame.window_y` samples the tile gets, counted from `Frame.first_sample` on.
layout(std140, set = 0, binding = BIND_NOISE_TILES) uniform NoiseTilesBlock {
    uvec4 noise_tiles[MOST_NOISE_TILES / 4u];
};

// The word of the tile that a pixel of the window belongs to.
uint noise_tile_of(uvec2 pixel) {
    uint tile_ix = pixel.y / NOISE_TILE_SIZE;
    return noise_tiles[tile_ix / 4u][tile_ix % 4u];
}

// Converts a pixel of the window to the same pixel's coordinates in the whole picture. Tiles at the right and at the
// lower edge may extend beyond the picture.
uvec2 picture_pixel_of(uvec2 pixel) {
    if (frame.window_x != WINDOW_OF_NOISE_TILES) return in_picture(pixel);
    uint tile = noise_tile_of(pixel);
    uvec2 place = uvec2(tile & 0xfffu, tile >> 12 & 0xfffu);
    return NOISE_TILE_SIZE * place + uvec2(pixel.x, pixel.y % NOISE_TILE_SIZE);
}

// The index of the first sample that the frame draws of a pixel of the window.
uint first_sample_of(uvec2 pixel) {
    if (frame.window_x != WINDOW_OF_NOISE_TILES) return frame.first_sample;
    return frame.first_sample + (noise_tile_of(pixel) >> 24) * frame.window_y;
}

#endif
