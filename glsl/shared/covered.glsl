// Which pixels of a small rectangle a triangle may cover, as bits, row by row.
#ifndef KDRAY_COVERED
#define KDRAY_COVERED

#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require

#include "layout.glsl"

// The pixels of a row that a triangle may cover lie between the lines of its edges, x = at_first + y * step on row y. An edge
// ends a row or begins it, and in the other bound has an infinity.
struct EdgeLines {
    vec3 low_at_first;
    vec3 low_step;
    vec3 high_at_first;
    vec3 high_step;
};

const float FAR = 1e9;

// Corners from the rectangle's first pixel.
EdgeLines edge_lines(vec2 a, vec2 b, vec2 c, float slack) {
    vec3 along_x = vec3(b.x - a.x, c.x - b.x, a.x - c.x);
    vec3 along_y = vec3(b.y - a.y, c.y - b.y, a.y - c.y);
    vec3 from_x = vec3(a.x, b.x, c.x), from_y = vec3(a.y, b.y, c.y);
    float area = along_x.x * along_y.y - along_y.x * along_x.y;
    vec3 spans = slack * (abs(along_x) + abs(along_y));
    // A sliver has no side that is certain.
    bool is_sliver = abs(area) <= 4.0 * (spans.x + spans.y + spans.z);
    float side = area < 0.0 ? -1.0 : 1.0;
    // Twice the area that an edge spans with a pixel is at_first + x * step_x + y * step_y, and not below 0 if it is covered.
    vec3 step_x = -side * along_y, step_y = side * along_x;
    vec3 at_first = side * (along_y * from_x - along_x * from_y) + spans;
    // An edge along the row: beyond all pixels on one side of it, before all on the other.
    step_x = mix(step_x, vec3(1e-6), lessThan(abs(step_x), vec3(1e-6)));
    vec3 crossing = -at_first / step_x, step = -step_y / step_x;
    bvec3 is_low = greaterThan(step_x, vec3(0.0)), is_high = not(is_low);
    if (is_sliver) is_low = is_high = bvec3(false);
    return EdgeLines(
        mix(vec3(-FAR), crossing, is_low), mix(vec3(0.0), step, is_low),
        mix(vec3(FAR), crossing, is_high), mix(vec3(0.0), step, is_high)
    );
}

// Of a row of the rectangle, from `first` on: as bits, from the lowest on.
uint covered_of_row(EdgeLines lines, float y, float width) {
    vec3 low = lines.low_at_first + y * lines.low_step, high = lines.high_at_first + y * lines.high_step;
    float first = clamp(ceil(max(low.x, max(low.y, low.z))), 0.0, width);
    float end = clamp(floor(min(high.x, min(high.y, high.z))) + 1.0, first, width);
    return bitfieldInsert(0u, 0xffffffffu, int(first), int(end - first));
}

// Of a rectangle of RASTER_SMALL pixels at the most, in rows of 32 at the most.
uvec2 covered_of(uvec2 size, EdgeLines lines) {
    uint64_t bits = uint64_t(0);
    uint n = 0u;
    for (uint y = 0u; y < size.y; ++y, n += size.x) {
        bits |= uint64_t(covered_of_row(lines, float(y), float(size.x))) << n;
    }
    return unpackUint2x32(bits);
}

#endif
