// Coverage masks: which pixels of a small rectangle a triangle may cover, one bit per pixel, row by row. All
// coordinates are in pixels; (0, 0) is the sample of the rectangle's first pixel.
#ifndef KDRAY_COVERED
#define KDRAY_COVERED

#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require

#include "layout.glsl"

// The lines of a triangle's edges, x = at_first + y * step in row y, one edge per component. They bound the pixels of
// a row that the triangle may cover. Each edge has a low and a high line, and bounds x by one of them: either from
// below or from above. The line that is not a bound is at -FAR (low) or FAR (high).
struct EdgeLines {
    vec3 low_at_first;
    vec3 low_step;
    vec3 high_at_first;
    vec3 high_step;
};

const float FAR = 1e9;

// The lines of the edges of a triangle a, b, c. slack: the error of a point on each axis, px. A pixel that is outside
// an edge by no more than that still counts as covered.
EdgeLines edge_lines(vec2 a, vec2 b, vec2 c, float slack) {
    vec3 along_x = vec3(b.x - a.x, c.x - b.x, a.x - c.x);
    vec3 along_y = vec3(b.y - a.y, c.y - b.y, a.y - c.y);
    vec3 from_x = vec3(a.x, b.x, c.x), from_y = vec3(a.y, b.y, c.y);
    float area = along_x.x * along_y.y - along_y.x * along_x.y;
    vec3 spans = slack * (abs(along_x) + abs(along_y));
    // Rounding may have reversed a sliver's winding, so its edges exclude no pixel.
    bool is_sliver = abs(area) <= 4.0 * (spans.x + spans.y + spans.z);
    float side = area < 0.0 ? -1.0 : 1.0;
    // at_first + x * step_x + y * step_y is twice the signed area that an edge spans with a pixel, plus the slack.
    // The sum is not below 0 for a covered pixel.
    vec3 step_x = -side * along_y, step_y = side * along_x;
    vec3 at_first = side * (along_y * from_x - along_x * from_y) + spans;
    // An edge that is parallel to the rows gets a tiny slope. In rows on its inner side, it then crosses left of all
    // pixels and excludes none. In rows on its outer side, it crosses right of all pixels and excludes all.
    step_x = mix(step_x, vec3(1e-6), lessThan(abs(step_x), vec3(1e-6)));
    vec3 crossing = -at_first / step_x, step = -step_y / step_x;
    bvec3 is_low = greaterThan(step_x, vec3(0.0)), is_high = not(is_low);
    if (is_sliver) is_low = is_high = bvec3(false);
    return EdgeLines(
        mix(vec3(-FAR), crossing, is_low), mix(vec3(0.0), step, is_low),
        mix(vec3(FAR), crossing, is_high), mix(vec3(0.0), step, is_high)
    );
}

// The mask of row y of a rectangle; bit 0 is the row's first pixel. width: 32 at most.
uint covered_of_row(EdgeLines lines, float y, float width) {
    vec3 low = lines.low_at_first + y * lines.low_step, high = lines.high_at_first + y * lines.high_step;
    float first = clamp(ceil(max(low.x, max(low.y, low.z))), 0.0, width);
    float end = clamp(floor(min(high.x, min(high.y, high.z))) + 1.0, first, width);
    return bitfieldInsert(0u, 0xffffffffu, int(first), int(end - first));
}

// The mask of a rectangle, low word first. The rectangle has at most RASTER_SMALL pixels, in rows of at most 32.
uvec2 covered_of(uvec2 size, EdgeLines lines) {
    uint64_t bits = uint64_t(0);
    uint n = 0u;
    for (uint y = 0u; y < size.y; ++y, n += size.x) {
        bits |= uint64_t(covered_of_row(lines, float(y), float(size.x))) << n;
    }
    return unpackUint2x32(bits);
}

#endif
