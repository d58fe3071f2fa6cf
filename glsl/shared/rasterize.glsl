// Triangles onto the window's pixels by kernels. Which pixels a triangle may cover is reckoned roughly, with slack; whether it
// does is said by the test that rays do in the tree, so that what is found is what camera rays hit, to the last bit.
#ifndef KDRAY_RASTERIZE
#define KDRAY_RASTERIZE

#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require

#include "layout.glsl"
#include "scene.glsl"
#include "camera.glsl"
#include "triangle.glsl"

layout(std430, set = 0, binding = BIND_PIXEL_NEAREST) buffer PixelNearestBlock { uint64_t pixel_nearest[]; };

layout(push_constant) uniform RasterPushBlock { RasterPush raster; };
// raster_count: large triangles in the upper half, their blocks in the lower. One buffer holds both, since some devices bind no
// more than 30 in a stage.
layout(std430, set = 0, binding = BIND_RASTER_GROUPS) buffer RasterGroupsBlock {
    RasterGroups raster_groups;
    uint64_t raster_count;
};
layout(std430, set = 0, binding = BIND_LARGE_TRIANGLES) buffer LargeTrianglesBlock { LargeTriangle large_triangles[]; };

// How many blocks it is cut into, each way.
uvec2 blocks_of(uvec2 size) {
    return (size + (1u << raster.block_log2) - 1u) >> raster.block_log2;
}

// The least of hits by distance, then by triangle: distances are positive, and in their order as bits.
void keep_nearest(uvec2 pixel, float t, uint triangle_ix) {
    atomicMin(pixel_nearest[pixel_ix_of(pixel)], packUint2x32(uvec2(triangle_ix, floatBitsToUint(t))));
}

void test_pixel(uvec2 pixel, Triangle triangle, uint triangle_ix) {
    Hit hit;
    if (!intersect_triangle(shear_of(frame.eye, camera_direction(pixel)), triangle, triangle_ix, hit)) return;
    if (hit.t > 0.0) keep_nearest(pixel, hit.t, triangle_ix);
}

#endif
