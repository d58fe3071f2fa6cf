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

// 1 where fma rounds once: a few instructions then do for what takes a dozen without.
layout(constant_id = 1) const uint FUSED_FMA = 0u;

// What rounding took from the product a * b (Dekker: A floating-point technique for extending the available precision,
// Numerische Mathematik 18, 1971).
float product_error(float a, float b) {
    if (FUSED_FMA == 1u) {
        precise float fused = fma(a, b, -(a * b));
        return fused;
    }
    precise float split_a = 4097.0 * a, split_b = 4097.0 * b;
    precise float a_high = split_a - (split_a - a), b_high = split_b - (split_b - b);
    precise float a_low = a - a_high, b_low = b - b_high;
    precise float error = ((a_high * b_high - a * b) + a_high * b_low + a_low * b_high) + a_low * b_low;
    return error;
}

// The edge function a.x * b.y - a.y * b.x where its products round to one value: now the sign is right, and zero means
// that the ray meets the edge. Without it a needle, seen from its end, is hit at whatever corner.
float exact_edge(vec3 a, vec3 b, float edge) {
    if (edge != 0.0) return edge;
    precise float difference = product_error(a.x, b.y) - product_error(a.y, b.x);
    return difference;
}

bool is_outside(vec3 edges) {
    return any(lessThan(edges, vec3(0.0))) && any(greaterThan(edges, vec3(0.0)));
}

// t and barycentric weights from edge functions whose sum is det (not 0).
Hit weighted_hit(Shear shear, vec3 edges, float det, vec3 z, uint triangle_ix) {
    precise float inv_det = 1.0 / det;
    precise float t = (edges.x * z.x + edges.y * z.y + edges.z * z.z) * shear.z * inv_det;
    precise float u = edges.y * inv_det;
    precise float v = edges.z * inv_det;
    return Hit(t, triangle_ix, u, v);
}

// The corners as the ray sees them, and their edge functions.
vec3 seen_edges(Shear shear, Triangle triangle, out vec3 a, out vec3 b, out vec3 c) {
    a = sheared(shear, triangle.v0);
    b = sheared(shear, triangle.v1);
    c = sheared(shear, triangle.v2);
    return edge_functions(a, b, c);
}

vec3 exact_edges(vec3 edges, vec3 a, vec3 b, vec3 c) {
    return vec3(exact_edge(c, b, edges.x), exact_edge(a, c, edges.y), exact_edge(b, a, edges.z));
}

// Watertight and two-sided (Woop, Benthin, Wald: Watertight Ray/Triangle Intersection, JCGT 2013), edges included.
// False also for a triangle without area and for NaN. t may be negative.
bool intersect_triangle(Shear shear, Triangle triangle, uint triangle_ix, out Hit hit) {
    vec3 a, b, c;
    vec3 edges = seen_edges(shear, triangle, a, b, c);
    if (is_outside(edges)) return false;
    if (any(equal(edges, vec3(0.0)))) {
        edges = exact_edges(edges, a, b, c);
        if (is_outside(edges)) return false;
    }
    precise float det = edges.x + edges.y + edges.z;
    if (!(abs(det) > 0.0)) return false;
    hit = weighted_hit(shear, edges, det, vec3(a.z, b.z, c.z), triangle_ix);
    return true;
}

// Where the ray meets the triangle's plane, moved to the triangle's edge where that lies outside: a rasterizer snaps
// corners to its sub-pixel grid and so covers samples that the exact triangle just misses.
Hit clamp_to_triangle(Shear shear, Triangle triangle, uint triangle_ix) {
    vec3 a, b, c;
    vec3 edges = seen_edges(shear, triangle, a, b, c);
    precise float det = edges.x + edges.y + edges.z;
    vec3 inside = max(det < 0.0 ? -edges : edges, vec3(0.0));
    precise float sum = inside.x + inside.y + inside.z;
    // Seen exactly edge-on the areas say nothing: its middle is the nearest certain point.
    if (!(sum > 0.0)) return weighted_hit(shear, vec3(1.0), 3.0, vec3(a.z, b.z, c.z), triangle_ix);
    return weighted_hit(shear, inside, sum, vec3(a.z, b.z, c.z), triangle_ix);
}

#endif
