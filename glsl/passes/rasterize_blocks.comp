#version 460
#extension GL_GOOGLE_include_directive : require
// Rasterize, 2 of 2: tests the pixels that large triangles may cover. One workgroup per block of a large triangle's
// bounding rectangle; if there are more blocks than workgroups, each workgroup takes several.
// Reads triangles and the buffer of raster_groups; updates pixel_nearest.
#include "layout.glsl"
#include "rasterize/rasterize.glsl"
#include "rasterize/footprint.glsl"

layout(local_size_x = RAY_GROUP_SIZE) in;

// The large triangle that a block belongs to: the last one whose first block is this one or an earlier one.
LargeTriangle triangle_of(uint block_ix, uint n_large) {
    uint first = 0u;
    for (uint n = n_large; n > 1u; ) {
        uint half_of_n = n / 2u;
        bool is_behind = large_triangles[first + half_of_n].first_block <= block_ix;
        first += is_behind ? half_of_n : 0u;
        n = is_behind ? n - half_of_n : half_of_n;
    }
    return large_triangles[first];
}

// The lower and the upper 16 bits.
uvec2 halves(uint packed) {
    return uvec2(packed & 0xffffu, packed >> 16);
}

// Tests the pixels of a block that the triangle may cover. Each invocation takes one pixel of each square of
// PIXEL_GROUP_SIZE x PIXEL_GROUP_SIZE pixels.
void rasterize(Triangle triangle, uint triangle_ix, Rectangle block) {
    vec3 a = triangle.v0 - frame.eye, b = triangle.v1 - frame.eye, c = triangle.v2 - frame.eye;
    EdgeHeights heights = edge_heights(a, b, c, block);
    if (misses(heights, block)) return;
    uvec2 in_square = uvec2(gl_LocalInvocationIndex % PIXEL_GROUP_SIZE, gl_LocalInvocationIndex / PIXEL_GROUP_SIZE);
    for (uint y = in_square.y; y < block.size.y; y += RAY_GROUP_SIZE / PIXEL_GROUP_SIZE) {
        for (uint x = in_square.x; x < block.size.x; x += PIXEL_GROUP_SIZE) {
            uvec2 offset = uvec2(x, y);
            if (!misses_pixel(heights, offset)) test_pixel(block.first + offset, triangle, triangle_ix);
        }
    }
}

void main() {
    uvec2 n = unpackUint2x32(raster_count);
    uint group = gl_WorkGroupID.y * RASTER_GROUPS_X + gl_WorkGroupID.x;
    for (uint block_ix = group; block_ix < n.x; block_ix += gl_NumWorkGroups.x * gl_NumWorkGroups.y) {
        LargeTriangle large = triangle_of(block_ix, n.y);
        uvec2 size = halves(large.size);
        uint in_triangle = block_ix - large.first_block, n_columns = blocks_of(size).x;
        uvec2 offset = uvec2(in_triangle % n_columns, in_triangle / n_columns) << raster.block_log2;
        Rectangle block = Rectangle(halves(large.first) + offset, min(size - offset, uvec2(1u << raster.block_log2)));
        rasterize(triangle_at(large.triangle_ix), large.triangle_ix, block);
    }
}
