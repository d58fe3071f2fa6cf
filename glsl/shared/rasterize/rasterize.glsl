// Rasterization of triangles by kernels. Conservative bounds, with slack, select the pixels that a triangle may
// cover. The triangle test of the traversal then decides whether it does, so the result is what camera rays hit, to
// the last bit.
#ifndef KDRAY_RASTERIZE
#define KDRAY_RASTERIZE

#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require

#include "layout.glsl"
#include "scene.glsl"
#include "rays/camera.glsl"
#include "search/triangle.glsl"
#include "shading/alpha_test.glsl"
#include "shading/back_faces.glsl"

layout(std430, set = 0, binding = BIND_PIXEL_NEAREST) buffer PixelNearestBlock { uint64_t pixel_nearest[]; };

layout(push_constant) uniform RasterPushBlock { RasterPush raster; };
// raster_count: the number of large triangles in the upper 32 bits, the number of their blocks in the lower 32 bits.
// All of this is in one buffer, since some devices bind no more than 30 buffers in a stage.
layout(std430, set = 0, binding = BIND_RASTER_GROUPS) buffer RasterGroupsBlock {
    RasterGroups raster_groups;
    uint64_t raster_count;
    uint64_t reserved;
    LargeTriangle large_triangles[];
};

// The number of blocks that a rectangle of this size is cut into, along x and y.
uvec2 blocks_of(uvec2 size) {
    return (size + (1u << raster.block_log2) - 1u) >> raster.block_log2;
}

// Keeps the nearest of a pixel's hits. Of two hits at the same t, keeps the one with the lower triangle index. t must
// be positive: the bits of positive numbers have the same order as the numbers.
void keep_nearest(uvec2 pixel, float t, uint triangle_ix) {
    atomicMin(pixel_nearest[pixel_ix_of(pixel)], packUint2x32(uvec2(triangle_ix, floatBitsToUint(t))));
}

// Tests a triangle against a pixel's camera ray, and keeps its hit if it is the nearest.
void test_pixel(uvec2 pixel, Triangle triangle, uint triangle_ix) {
    Hit hit;
    Shear shear = shear_of(camera_origin(pixel), camera_direction(pixel));
    if (!intersect_triangle(shear, triangle, triangle_ix, hit)) return;
    if (CULLS_BACK_FACES && is_culled(shear, triangle, triangle_ix)) return;
    if (ALPHA_MASKS && fails_alpha_test(triangle_ix, hit.u, hit.v, false)) return;
    if (hit.t > 0.0) keep_nearest(pixel, hit.t, triangle_ix);
}

#endif
