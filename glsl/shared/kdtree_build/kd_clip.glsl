// Clipping of triangles to cells, in f32. Twin of src/accel/kdtree/clip.rs, with more room for rounding.
//
// The pieces contain those that exact arithmetic would find within the margin of the cell and of the plane. Proof: let
// m be the triangle's largest coordinate, e its greatest extent on an axis, and u = 2^-24. Each computed corner stands
// for an exact point of the triangle: a crossing of the edge from a to b stands for the point that the computed t gives
// between the points of a and b. Computing the crossing adds an error of at most u (m + 2 e) to the greater one of
// those of a and b: m from the sum, e each from the difference and the product. So after six faces and a plane, bounds
// are off by at most u (7 m + 14 e). Division is right to 2.5 units in the last place, so t, which is off by at most
// 7 u of itself, puts the exact crossing off the face by at most 7 u e, and the errors of a and b put it off by at most
// u (6 m + 12 e) more. What a face cuts off is then beyond the face less u (6 m + 19 e). All faces are cut, and all
// bounds grown, by u (9 m + 20 e) more than the margin, which leaves room for the rounding of faces and bounds.
#ifndef KDRAY_KD_CLIP
#define KDRAY_KD_CLIP

#include "kdtree_build/kd_scales.glsl"

// A triangle that six faces cut has nine corners at most. A polygon that rounding has bent may need more, and is then
// not clipped. Polygons are in memory, and larger ones make all slower.
const uint MAX_CORNERS = 9u;
// The range of margins with which no product of coordinates overflows, and none that matters is denormal.
const float LEAST_MARGIN_TO_CLIP = 8.0779357e-28; // 2^-90
const float GREATEST_MARGIN_TO_CLIP = 1.2980742e33; // 2^110

// What rounding may take away from a clipped triangle, as multiples of its largest coordinate and of its extent.
const float SLACK = 9.0 / 16777216.0;
const float SLACK_OF_EXTENT = 20.0 / 16777216.0;

struct Polygon {
    vec3 corners[MAX_CORNERS];
    uint n;
};

// Whether a point is beyond a plane, on the side of greater (1) or lower (-1) coordinates.
bool is_beyond(vec3 point, uint axis, float side, float position) {
    return side > 0.0 ? point[axis] > position : point[axis] < position;
}

// The point where the edge from a to b crosses a plane.
vec3 crossing(vec3 a, vec3 b, uint axis, float position) {
    precise float along = b[axis] - a[axis];
    precise float t = abs(along) < 7.8886091e-31 ? 0.5 : (position - a[axis]) / along;
    t = clamp(t, 0.0, 1.0);
    precise vec3 point = a + t * (b - a);
    return point;
}

// Cuts off the piece beyond a plane. What is kept overwrites corners that have been read. Of a convex polygon, it is
// never more than one corner longer than what has been read. If a bent polygon is longer, or has too many corners, n
// becomes MAX_CORNERS + 1.
void cut(inout Polygon polygon, uint axis, float side, float position) {
    bool is_cut = false;
    for (uint i = 0u; i < polygon.n; ++i) {
        is_cut = is_cut || is_beyond(polygon.corners[i], axis, side, position);
    }
    if (!is_cut) return;
    vec3 a = polygon.corners[polygon.n - 1u], b = polygon.corners[0];
    uint n_kept = 0u;
    for (uint i = 0u; i < polygon.n; ++i) {
        vec3 next = polygon.corners[min(i + 1u, MAX_CORNERS - 1u)];
        bool is_a_out = is_beyond(a, axis, side, position), is_b_out = is_beyond(b, axis, side, position);
        uint n_new = (is_a_out != is_b_out ? 1u : 0u) + (is_b_out ? 0u : 1u);
        if (n_kept + n_new > min(i + 2u, MAX_CORNERS)) {
            n_kept = MAX_CORNERS + 1u;
            break;
        }
        if (is_a_out != is_b_out) polygon.corners[n_kept++] = crossing(a, b, axis, position);
        if (!is_b_out) polygon.corners[n_kept++] = b;
        a = b;
        b = next;
    }
    polygon.n = n_kept;
}

// The bounds of the piece of a polygon that is not beyond a plane; least exceeds greatest if it is empty.
void bounds_in(Polygon polygon, uint axis, float side, float position, out vec3 least, out vec3 greatest) {
    least = vec3(3.4028235e38);
    greatest = vec3(-3.4028235e38);
    if (polygon.n == 0u) return;
    vec3 a = polygon.corners[polygon.n - 1u];
    for (uint i = 0u; i < polygon.n; ++i) {
        vec3 b = polygon.corners[i];
        bool is_a_out = is_beyond(a, axis, side, position), is_b_out = is_beyond(b, axis, side, position);
        if (is_a_out != is_b_out) {
            vec3 point = crossing(a, b, axis, position);
            least = min(least, point);
            greatest = max(greatest, point);
        }
        if (!is_b_out) {
            least = min(least, b);
            greatest = max(greatest, b);
        }
        a = b;
    }
}

// How far a triangle reaches beyond faces and bounds: its margin, and room for rounding.
float reach_of(Triangle triangle) {
    vec3 least = least_of(triangle), greatest = greatest_of(triangle);
    precise vec3 extent = greatest - least;
    float longest = max(extent.x, max(extent.y, extent.z));
    precise float reach = margin_of(triangle) + (SLACK * largest_of(least, greatest) + SLACK_OF_EXTENT * longest);
    return reach;
}

// Narrows the bounds of a reference's piece on one side of a plane to the bounds of the polygon there.
void narrow(Polygon polygon, uint axis, float side, float position, float reach, inout KdReference piece) {
    precise float limit = position + side * reach;
    vec3 least, greatest;
    bounds_in(polygon, axis, side, limit, least, greatest);
    if (any(greaterThan(least, greatest))) {
        piece.box_min = vec3(1.0);
        piece.box_max = vec3(-1.0);
        return;
    }
    precise vec3 low = least - reach;
    precise vec3 high = greatest + reach;
    piece.box_min = max(piece.box_min, low);
    piece.box_max = min(piece.box_max, high);
}

bool is_empty(KdReference piece) {
    return any(greaterThan(piece.box_min, piece.box_max));
}

// Splits a reference that its cell's plane cuts. A piece that is empty has a corner box_min beyond box_max.
void split_reference(Triangle triangle, KdCell cell, inout KdReference below, out KdReference above) {
    above = below;
    below.box_max[cell.axis] = cell.position;
    above.box_min[cell.axis] = cell.position;
    if (build.margin < LEAST_MARGIN_TO_CLIP || build.margin > GREATEST_MARGIN_TO_CLIP) return;
    float reach = reach_of(triangle);
    Polygon polygon;
    polygon.corners[0] = triangle.v0;
    polygon.corners[1] = triangle.v1;
    polygon.corners[2] = triangle.v2;
    polygon.n = 3u;
    for (uint axis = 0u; axis < 3u; ++axis) {
        precise float low = cell.box_min[axis] - reach;
        precise float high = cell.box_max[axis] + reach;
        if (polygon.n > 0u && polygon.n <= MAX_CORNERS) cut(polygon, axis, -1.0, low);
        if (polygon.n > 0u && polygon.n <= MAX_CORNERS) cut(polygon, axis, 1.0, high);
    }
    if (polygon.n > MAX_CORNERS) return;
    narrow(polygon, cell.axis, 1.0, cell.position, reach, below);
    narrow(polygon, cell.axis, -1.0, cell.position, reach, above);
}

#endif
