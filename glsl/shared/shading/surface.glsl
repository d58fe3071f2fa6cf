// The surface at a hit, and the rays that leave it. Twin of src/reference/surface.rs.
#ifndef KDRAY_SURFACE
#define KDRAY_SURFACE

#include "layout.glsl"
#include "octahedral.glsl"
#include "scene.glsl"

// The surface of a triangle at a hit, as the ray meets it.
struct Surface {
    vec3 point_world;
    // Unit normals, all on the side that the ray comes from. geometric: the normal of the triangle's plane.
    // interpolated: the normal interpolated from the corners. shading: the same, or what a normal map makes of it.
    vec3 geometric;
    vec3 interpolated;
    vec3 shading;
    // Whether `interpolated` is the reverse of what the corners' normals give.
    bool is_reversed;
    // Distance along `geometric` at which a new ray starts so that it does not hit this surface, world units.
    float origin_offset;
    // Whether the ray meets the triangle's back. The ray then counts as inside a solid.
    bool from_inside;
};

// The interpolated unit normal, or `geometric` if a corner has none or the corners' normals cancel out.
vec3 shading_normal(Triangle t, Hit hit, vec3 geometric) {
    if (t.n0 == FLAT_NORMAL || t.n1 == FLAT_NORMAL || t.n2 == FLAT_NORMAL) return geometric;
    vec3 n = (1.0 - hit.u - hit.v) * decode_normal(t.n0) + hit.u * decode_normal(t.n1) + hit.v * decode_normal(t.n2);
    float squared = dot(n, n);
    return squared > LEAST_NORMAL_SQUARED ? n * inversesqrt(squared) : geometric;
}

// Barycentric weights of the hit, at least LEAST_WEIGHT each before they are normalized, so that the point is not on
// an edge.
vec3 inner_weights(Hit hit) {
    vec3 weights = max(vec3(1.0 - hit.u - hit.v, hit.u, hit.v), vec3(LEAST_WEIGHT));
    return weights / (weights.x + weights.y + weights.z);
}

// The surface of triangle t at a hit. Its point is interpolated from the corners.
Surface surface_at(PathRay ray, Hit hit, Triangle t) {
    vec3 weights = inner_weights(hit);
    vec3 magnitude = abs(weights.x * t.v0) + abs(weights.y * t.v1) + abs(weights.z * t.v2);
    Surface s;
    s.point_world = weights.x * t.v0 + weights.y * t.v1 + weights.z * t.v2;
    // The edges are scaled to about 1, since the cross product of a tiny triangle would underflow.
    vec3 e1 = t.v1 - t.v0, e2 = t.v2 - t.v0;
    vec3 span = max(abs(e1), abs(e2));
    float scale = 1.0 / max(span.x, max(span.y, span.z));
    vec3 outward = normalize(cross(e1 * scale, e2 * scale));
    s.from_inside = dot(outward, ray.direction) > 0.0;
    s.geometric = s.from_inside ? -outward : outward;
    vec3 interpolated = shading_normal(t, hit, outward);
    s.is_reversed = dot(interpolated, s.geometric) < 0.0;
    s.interpolated = s.is_reversed ? -interpolated : interpolated;
    s.shading = s.interpolated;
    float largest = max(magnitude.x, max(magnitude.y, magnitude.z));
    if (INSTANCED) largest = max(largest, placement_error(t, weights));
    s.origin_offset = ORIGIN_OFFSET * max(dot(magnitude, abs(s.geometric)), LEAST_ORIGIN_OFFSET_SHARE * largest);
    return s;
}

// A child ray from the surface, with the parent's t_max. It starts on the side of the surface to which its direction
// points. triangle_ix: the surface's triangle, which the ray does not hit.
PathRay ray_from(Surface s, vec3 direction, uint triangle_ix, PathRay parent, vec3 throughput) {
    float side = dot(direction, s.geometric) < 0.0 ? -s.origin_offset : s.origin_offset;
    return PathRay(
        s.point_world + side * s.geometric, parent.pixel_ix, direction, triangle_ix, throughput, parent.t_max
    );
}

#endif
