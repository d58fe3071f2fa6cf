// The watertight test of a ray against one triangle.
//
// Needs nothing: it includes layout.glsl. Provides `Shear`, `shear_of`, `intersect_triangle`, `is_back_face` and
// `clamp_to_triangle`. kdtree/lockstep.glsl also calls the steps of the test.
#ifndef KDRAY_TRIANGLE
#define KDRAY_TRIANGLE

#include "layout.glsl"

// A ray's shear. Space is permuted so that the axis of the direction's longest component, `axis`, becomes z. The
// shear then maps the ray onto the z axis. origin: the ray's origin, not permuted. x, y: the direction's two other
// components, divided by the longest one. z: the inverse of the longest component.
struct Shear {
    vec3 origin;
    float x;
    float y;
    float z;
    uint axis;
};

// v with component `axis` last. The components are permuted cyclically, so that winding is kept.
vec3 axis_last(vec3 v, uint axis) {
    return axis == 2u ? v : (axis == 0u ? v.yzx : v.zxy);
}

uint longest_axis(vec3 v) {
    vec3 a = abs(v);
    return a.x >= a.y && a.x >= a.z ? 0u : (a.y >= a.z ? 1u : 2u);
}

Shear shear_of(vec3 origin, vec3 direction) {
    uint axis = longest_axis(direction);
    vec3 d = axis_last(direction, axis);
    return Shear(origin, d.x / d.z, d.y / d.z, 1.0 / d.z, axis);
}

// A corner as seen from the ray, in world units. xy: sheared, so that the ray is at (0, 0). z: offset from the ray's
// origin along `axis`. Times `shear.z`, it is a t.
// `precise` forbids contraction to fma, so that a corner is mapped to the same point for every triangle that shares
// it.
vec3 sheared(Shear shear, vec3 corner) {
    precise vec3 p = axis_last(corner - shear.origin, shear.axis);
    precise float x = p.x - shear.x * p.z;
    precise float y = p.y - shear.y * p.z;
    return vec3(x, y, p.z);
}

// The edge functions: in the xy plane, twice the signed areas of the triangles between the ray, which is at (0, 0),
// and the edges opposite to v0, v1, v2. Rounding never reverses the order of two products, so each sign is right or
// the value is zero.
vec3 edge_functions(vec3 a, vec3 b, vec3 c) {
    precise float u = c.x * b.y - c.y * b.x;
    precise float v = a.x * c.y - a.y * c.x;
    precise float w = b.x * a.y - b.y * a.x;
    return vec3(u, v, w);
}

// Whether fma rounds once. The error of a product then takes a few instructions, and otherwise a dozen.
layout(constant_id = CONSTANT_FUSED_FMA) const bool FUSED_FMA = false;

// The rounding error of the product a * b (Dekker: A floating-point technique for extending the available precision,
// Numerische Mathematik 18, 1971).
float product_error(float a, float b) {
    if (FUSED_FMA) {
        precise float fused = fma(a, b, -(a * b));
        return fused;
    }
    precise float split_a = 4097.0 * a, split_b = 4097.0 * b;
    precise float a_high = split_a - (split_a - a), b_high = split_b - (split_b - b);
    precise float a_low = a - a_high, b_low = b - b_high;
    precise float error = ((a_high * b_high - a * b) + a_high * b_low + a_low * b_high) + a_low * b_low;
    return error;
}

// The rounding error of the products of the edge function a.x * b.y - a.y * b.x.
float edge_error(vec3 a, vec3 b) {
    precise float error = product_error(a.x, b.y) - product_error(a.y, b.x);
    return error;
}

// The rounding errors of the products in `edge_functions`.
vec3 edge_errors(vec3 a, vec3 b, vec3 c) {
    return vec3(edge_error(c, b), edge_error(a, c), edge_error(b, a));
}

// The edge functions with right signs. If the two products round to the same value, the edge function is the
// difference of their errors. Zero then means that the ray meets the edge. Without this, a needle that is seen from
// its end would be hit at an arbitrary corner.
vec3 with_exact_signs(vec3 edges, vec3 errors) {
    return mix(edges, errors, equal(edges, vec3(0.0)));
}

// Whether edge functions of both signs occur: the ray passes outside of the triangle.
bool is_outside(vec3 edges) {
    return any(lessThan(edges, vec3(0.0))) && any(greaterThan(edges, vec3(0.0)));
}

float sum_of(vec3 v) {
    precise float sum = v.x + v.y + v.z;
    return sum;
}

// Returns whether the ray goes through the triangle or its edges, by edge functions with exact signs. Returns false
// also for a triangle without area and for NaN.
bool is_inside(vec3 edges) {
    return !is_outside(edges) && abs(sum_of(edges)) > 0.0;
}

// If the sum of the edge functions is smaller than this, the errors of their products may underflow.
const float LEAST_EXACT_SUM = 8.077935669e-28; // 2^-90

// Returns the edge functions, each right to 2^-23 of itself (Muller: On the error of computing ab + cd using Cornea,
// Harrison and Tang's method, ACM TOMS 41, 2015). In a narrow triangle, the two products differ by little more
// than their rounding errors. Weights without this correction would give an arbitrary point along a needle.
vec3 exact_edges(vec3 edges, vec3 errors) {
    precise vec3 exact = edges + errors;
    return abs(sum_of(exact)) < LEAST_EXACT_SUM ? with_exact_signs(edges, errors) : exact;
}

// Returns t and barycentric weights from edge functions whose sum is not 0. src/reference/triangle.rs proves bounds
// of their errors.
Hit weighted_hit(Shear shear, vec3 edges, vec3 z, uint triangle_ix) {
    precise float inv_det = 1.0 / sum_of(edges);
    precise float u = edges.y * inv_det;
    precise float v = edges.z * inv_det;
    precise float t = (z.x + (u * (z.y - z.x) + v * (z.z - z.x))) * shear.z;
    return Hit(t, triangle_ix, u, v);
}

// The corners as the ray sees them, and their edge functions.
vec3 seen_edges(Shear shear, Triangle triangle, out vec3 a, out vec3 b, out vec3 c) {
    a = sheared(shear, triangle.v0);
    b = sheared(shear, triangle.v1);
    c = sheared(shear, triangle.v2);
    return edge_functions(a, b, c);
}

// Tests a triangle. The test is watertight, two-sided and includes edges (Woop, Benthin, Wald: Watertight
// Ray/Triangle Intersection, JCGT 2013). Returns false also for a triangle without area and for NaN. The hit's t may
// be negative.
bool intersect_triangle(Shear shear, Triangle triangle, uint triangle_ix, out Hit hit) {
    vec3 a, b, c;
    vec3 edges = seen_edges(shear, triangle, a, b, c);
    if (is_outside(edges)) return false;
    vec3 errors = edge_errors(a, b, c);
    if (!is_inside(with_exact_signs(edges, errors))) return false;
    hit = weighted_hit(shear, exact_edges(edges, errors), vec3(a.z, b.z, c.z), triangle_ix);
    return true;
}

// Whether a ray that hits a triangle comes from behind it: from the side from which its corners turn clockwise. The
// edge functions have exact signs, so the answer is right for needles, too.
bool is_back_face(Shear shear, Triangle triangle) {
    vec3 a, b, c;
    vec3 edges = seen_edges(shear, triangle, a, b, c);
    return (sum_of(with_exact_signs(edges, edge_errors(a, b, c))) < 0.0) == (shear.z > 0.0);
}

// Returns the point at which the ray meets the triangle's plane, moved to the triangle's edge if it is outside. A
// rasterizer snaps corners to its sub-pixel grid, and so covers samples that the exact triangle just misses.
Hit clamp_to_triangle(Shear shear, Triangle triangle, uint triangle_ix) {
    vec3 a, b, c;
    vec3 edges = seen_edges(shear, triangle, a, b, c);
    edges = exact_edges(edges, edge_errors(a, b, c));
    vec3 inside = max(sum_of(edges) < 0.0 ? -edges : edges, vec3(0.0));
    // If the triangle is seen exactly edge-on, all areas are 0 and tell nothing about the point. The triangle's
    // middle is used.
    if (!(sum_of(inside) > 0.0)) inside = vec3(1.0);
    return weighted_hit(shear, inside, vec3(a.z, b.z, c.z), triangle_ix);
}

#endif
