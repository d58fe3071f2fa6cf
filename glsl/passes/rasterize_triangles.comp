#version 460
#extension GL_GOOGLE_include_directive : require
// Rasterize, 1 of 2: one invocation per triangle finds the pixels that the triangle may cover. The invocations of a
// workgroup share the tests of all pixels of its small triangles; large triangles are left to rasterize_blocks.comp.
// Reads triangles; updates pixel_nearest, raster_groups, raster_count; writes large_triangles.
#include "layout.glsl"
#include "rasterize/rasterize.glsl"
#include "rasterize/footprint.glsl"
#include "rasterize/covered.glsl"

layout(local_size_x = RAY_GROUP_SIZE) in;

// Tests of small triangles against pixels, one word each. A word has, from the lowest bit on, the triangle's index in
// the workgroup (PLACE_BITS), then the pixel's x (OFFSET_BITS) and y in the triangle's rectangle.
const uint N_TESTS = 512u;
const uint PLACE_BITS = 6u; // holds an index below RAY_GROUP_SIZE
const uint OFFSET_BITS = 6u; // holds an offset below RASTER_SMALL
shared uint tests[N_TESTS];
// The number of tests of all triangles of the workgroup. They run in rounds of N_TESTS.
shared uint n_tests;
// The first pixel of each triangle's rectangle, px of the window: x in the lower half, y in the upper.
shared uint first_pixels[RAY_GROUP_SIZE];

// The pixels of one invocation's triangle that are still to be tested. covered: one bit per pixel of the rectangle
// (rasterize/covered.glsl). place: the index of the first of these pixels' tests among all tests of the workgroup.
struct PixelTests {
    Rectangle rectangle;
    uvec2 covered;
    uint place;
};

PixelTests nothing_pending() {
    return PixelTests(Rectangle(uvec2(0u), uvec2(0u)), uvec2(0u), 0u);
}

// Reserves the tests of the covered pixels.
PixelTests pixel_tests_of(Rectangle rectangle, uvec2 covered) {
    first_pixels[gl_LocalInvocationIndex] = rectangle.first.x | rectangle.first.y << 16;
    return PixelTests(rectangle, covered, atomicAdd(n_tests, bitCount(covered.x) + bitCount(covered.y)));
}

// Removes the next pixel and returns its bit's index.
uint take_pixel(inout PixelTests pending) {
    uint word = pending.covered.x != 0u ? 0u : 1u;
    uint left = pending.covered[word];
    pending.covered[word] = left & (left - 1u);
    pending.place += 1u;
    return 32u * word + uint(findLSB(left));
}

// Writes those of the invocation's tests whose index is below `end`.
void put_tests(inout PixelTests pending, uint end) {
    float rows_per_pixel = 1.0 / float(pending.rectangle.size.x);
    while (pending.covered != uvec2(0u) && pending.place < end) {
        uint place = pending.place % N_TESTS, bit = take_pixel(pending);
        uint y = uint((float(bit) + 0.5) * rows_per_pixel), x = bit - y * pending.rectangle.size.x;
        tests[place] = gl_LocalInvocationIndex | x << PLACE_BITS | y << (PLACE_BITS + OFFSET_BITS);
    }
}

void run_test(uint test, uint first_triangle) {
    uint place = bitfieldExtract(test, 0, int(PLACE_BITS));
    uvec2 offset = uvec2(bitfieldExtract(test, int(PLACE_BITS), int(OFFSET_BITS)), test >> (PLACE_BITS + OFFSET_BITS));
    uint first = first_pixels[place];
    test_pixel(
        uvec2(first & 0xffffu, first >> 16) + offset, triangle_at(first_triangle + place), first_triangle + place
    );
}

// Appends a large triangle. One atomic advances both counts, so large triangles are in the order of their blocks.
void add_large(uint triangle_ix, Rectangle rectangle) {
    uvec2 n = blocks_of(rectangle.size);
    uvec2 before = unpackUint2x32(atomicAdd(raster_count, packUint2x32(uvec2(n.x * n.y, 1u))));
    large_triangles[before.y] = LargeTriangle(
        triangle_ix, before.x, rectangle.first.x | rectangle.first.y << 16, rectangle.size.x | rectangle.size.y << 16
    );
    uint n_groups = before.x + n.x * n.y;
    atomicMax(raster_groups.y, min((n_groups - 1u) / RASTER_GROUPS_X + 1u, RASTER_GROUPS_Y));
}

// Handles a triangle with a corner that is too steep to be projected (STEEPEST): appends it to large_triangles,
// unless it certainly covers no pixel of the window.
void rasterize_beside_eye(uint triangle_ix, vec3 a, vec3 b, vec3 c, vec3 ahead) {
    Rectangle rectangle = rectangle_beside_eye(a, b, c, ahead);
    if (area_of(rectangle) == 0u || misses(edge_heights(a, b, c, rectangle), rectangle)) return;
    add_large(triangle_ix, rectangle);
}

// Returns the pixels of a triangle whose corners are projected to a_px, b_px and c_px, if it is small. slack: how far
// off the corners may be because of rounding. Appends a large triangle to large_triangles, and returns no pixels.
PixelTests rasterize_projected(uint triangle_ix, vec2 a_px, vec2 b_px, vec2 c_px, float slack) {
    Footprint bounds = Footprint(min(a_px, min(b_px, c_px)), max(a_px, max(b_px, c_px)), slack);
    Rectangle rectangle = rectangle_of(bounds);
    if (area_of(rectangle) == 0u) return nothing_pending();
    if (area_of(rectangle) > RASTER_SMALL || rectangle.size.x > 32u) {
        add_large(triangle_ix, rectangle);
        return nothing_pending();
    }
    vec2 first = vec2(rectangle.first);
    return pixel_tests_of(
        rectangle, covered_of(rectangle.size, edge_lines(a_px - first, b_px - first, c_px - first, bounds.slack))
    );
}

// Returns the pixels of a small triangle. Appends a large triangle to large_triangles, and returns no pixels.
PixelTests rasterize(Triangle triangle, uint triangle_ix) {
    vec3 a = triangle.v0 - frame.eye, b = triangle.v1 - frame.eye, c = triangle.v2 - frame.eye;
    vec3 ahead = vec3(dot(a, frame.forward), dot(b, frame.forward), dot(c, frame.forward));
    if (ORTHOGRAPHIC) {
        if (is_behind(a, b, c, ahead)) return nothing_pending();
        vec2 a_px = projected_in_parallel(a), b_px = projected_in_parallel(b), c_px = projected_in_parallel(c);
        return rasterize_projected(triangle_ix, a_px, b_px, c_px, parallel_slack_px(a, b, c));
    }
    if (all(lessThanEqual(ahead, vec3(0.0)))) return nothing_pending();
    if (is_steep(a, ahead.x) || is_steep(b, ahead.y) || is_steep(c, ahead.z)) {
        rasterize_beside_eye(triangle_ix, a, b, c, ahead);
        return nothing_pending();
    }
    vec2 a_px = projected(a, ahead.x), b_px = projected(b, ahead.y), c_px = projected(c, ahead.z);
    return rasterize_projected(triangle_ix, a_px, b_px, c_px, least_slack());
}

void main() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint first_triangle = group * RAY_GROUP_SIZE;
    if (gl_LocalInvocationIndex == 0u) n_tests = 0u;
    barrier();
    PixelTests pending = nothing_pending();
    uint triangle_ix = first_triangle + gl_LocalInvocationIndex;
    if (triangle_ix < frame.n_triangles) {
        Triangle t = triangle_at(triangle_ix);
        if (is_for_camera()) pending = rasterize(t, triangle_ix);
    }
    barrier();
    for (uint first = 0u; first < n_tests; first += N_TESTS) {
        put_tests(pending, first + N_TESTS);
        barrier();
        for (uint i = gl_LocalInvocationIndex; i < min(n_tests - first, N_TESTS); i += RAY_GROUP_SIZE) {
            run_test(tests[i], first_triangle);
        }
        barrier();
    }
}
