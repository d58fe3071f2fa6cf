// Rays against one triangle: the watertight test, and the surface at a hit.
#ifndef KDRAY_TRIANGLE
#define KDRAY_TRIANGLE

#include "layout.glsl"

// A ray's shear: maps the ray onto the z axis of a space in which `axis`, its direction's longest component, is z.
struct Shear {
    vec3 origin;
    float x;
    float y;
    float z;
    uint axis;
};

// v with component `axis` last; cyclic, so that winding is kept.
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

// A corner seen from the ray: xy across it, z along it in units of the direction's longest component.
// `precise` forbids contraction to fma: the same corner lands on the same point from every triangle that shares it.
vec3 sheared(Shear shear, vec3 corner) {
    precise vec3 p = axis_last(corner - shear.origin, shear.axis);
    precise float x = p.x - shear.x * p.z;
    precise float y = p.y - shear.y * p.z;
    return vec3(x, y, p.z);
}

// Twice the signed areas that the ray's axis spans with the edges opposite to v0, v1, v2. A rounded product never
// passes another one, so a sign is right or zero.
vec3 edge_functions(vec3 a, vec3 b, vec3 c) {
    precise float u = c.x * b.y - c.y * b.x;
    precise float v = a.x * c.y - a.y * c.x;
    precise float w = b.x * a.y - b.y * a.x;
    return vec3(u, v, w);
}

// Whether fma rounds once: a few instructions then do for what takes a dozen without.
layout(constant_id = CONSTANT_FUSED_FMA) const bool FUSED_FMA = false;

// What rounding took from the product a * b (Dekker: A floating-point technique for extending the available precision,
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

// What rounding took from the products of the edge function a.x * b.y - a.y * b.x.
float edge_error(vec3 a, vec3 b) {
    precise float error = product_error(a.x, b.y) - product_error(a.y, b.x);
    return error;
}

// The errors of `edge_functions`.
vec3 edge_errors(vec3 a, vec3 b, vec3 c) {
    return vec3(edge_error(c, b), edge_error(a, c), edge_error(b, a));
}

// The edge functions with right signs: where the two products round to one value, their errors are the edge function.
// Zero then means that the ray meets the edge. Without this a needle, seen from its end, is hit at whatever corner.
vec3 with_exact_signs(vec3 edges, vec3 errors) {
    return mix(edges, errors, equal(edges, vec3(0.0)));
}

bool is_outside(vec3 edges) {
    return any(lessThan(edges, vec3(0.0))) && any(greaterThan(edges, vec3(0.0)));
}

float sum_of(vec3 v) {
    precise float sum = v.x + v.y + v.z;
    return sum;
}

// Tells by edge functions with exact signs whether the ray goes through the triangle or its edges. False also for a
// triangle without area and for NaN.
bool is_inside(vec3 edges) {
    return !is_outside(edges) && abs(sum_of(edges)) > 0.0;
}

// Where edge functions have a smaller sum, the errors of their products may underflow.
const float LEAST_EXACT_SUM = 8.077935669e-28; // 2^-90

// Returns the edge functions, each right to 2^-23 of itself (Muller: On the error of computing ab + cd using Cornea,
// Harrison and Tang's method, ACM TOMS 41, 2015). If the triangle is narrow, its rounded products differ by little more
// than their errors: weights made of them would lie anywhere along a needle.
vec3 exact_edges(vec3 edges, vec3 errors) {
    precise vec3 exact = edges + errors;
    return abs(sum_of(exact)) < LEAST_EXACT_SUM ? with_exact_signs(edges, errors) : exact;
}

// Returns t and barycentric weights from edge functions whose sum is not 0. src/reference/triangle.rs proves how far off they
// are.
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

// Watertight and two-sided (Woop, Benthin, Wald: Watertight Ray/Triangle Intersection, JCGT 2013), edges included.
// False also for a triangle without area and for NaN. t may be negative.
bool intersect_triangle(Shear shear, Triangle triangle, uint triangle_ix, out Hit hit) {
    vec3 a, b, c;
    vec3 edges = seen_edges(shear, triangle, a, b, c);
    if (is_outside(edges)) return false;
    vec3 errors = edge_errors(a, b, c);
    if (!is_inside(with_exact_signs(edges, errors))) return false;
    hit = weighted_hit(shear, exact_edges(edges, errors), vec3(a.z, b.z, c.z), triangle_ix);
    return true;
}

// Where the ray meets the triangle's plane, moved to the triangle's edge where that lies outside: a rasterizer snaps
// corners to its sub-pixel grid and so covers samples that the exact triangle just misses.
Hit clamp_to_triangle(Shear shear, Triangle triangle, uint triangle_ix) {
    vec3 a, b, c;
    vec3 edges = seen_edges(shear, triangle, a, b, c);
    edges = exact_edges(edges, edge_errors(a, b, c));
    vec3 inside = max(sum_of(edges) < 0.0 ? -edges : edges, vec3(0.0));
    // Seen exactly edge-on the areas say nothing: its middle is the nearest certain point.
    if (!(sum_of(inside) > 0.0)) inside = vec3(1.0);
    return weighted_hit(shear, inside, vec3(a.z, b.z, c.z), triangle_ix);
}

#endif
