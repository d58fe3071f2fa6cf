// The picture's pixels that paths belong to. The window of paths is a rectangle of the picture, or a column of noise
// tiles from anywhere in the picture, one below the other: those that still get samples. Twin of
// src/reference/noise_tiles.rs. Needs nothing. Provides `picture_pixel_of`.
#ifndef KDRAY_NOISE_TILES
#define KDRAY_NOISE_TILES

#include "layout.glsl"
#include "camera.glsl"

// The places of the window's tiles, in units of their side: x in the lower half of a word, y in the upper half.
layout(std140, set = 0, binding = BIND_NOISE_TILES) uniform NoiseTilesBlock {
    uvec4 noise_tiles[MOST_NOISE_TILES / 4u];
};

// Converts a pixel of the window to the same pixel's coordinates in the whole picture. Tiles at the right and at the
// lower edge may extend beyond the picture.
uvec2 picture_pixel_of(uvec2 pixel) {
    if (frame.window_x != WINDOW_OF_TILES) return in_picture(pixel);
    uint tile_ix = pixel.y / NOISE_TILE_SIZE;
    uint place = noise_tiles[tile_ix / 4u][tile_ix % 4u];
    return NOISE_TILE_SIZE * uvec2(place & 0xffffu, place >> 16) + uvec2(pixel.x, pixel.y % NOISE_TILE_SIZE);
}

#endif
