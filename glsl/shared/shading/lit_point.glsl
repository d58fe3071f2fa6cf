// The start of rays to lights. Twin of `lit_point` in src/reference/surface.rs.
//
// Needs nothing: it includes scene.glsl. Provides `lit_point`.
#ifndef KDRAY_LIT_POINT
#define KDRAY_LIT_POINT

#include "layout.glsl"
#include "scene.glsl"
#include "shading/surface.glsl"

layout(constant_id = CONSTANT_SMOOTH) const bool SMOOTH = true;

// The part of p, relative to a corner, that is not below the plane through the corner with the normal of that corner.
vec3 above_corner(vec3 p, vec3 corner, uint normal, vec3 interpolated) {
    vec3 n = decode_normal(normal);
    n = dot(n, interpolated) < 0.0 ? -n : n;
    return p - min(dot(p - corner, n), 0.0) * n;
}

// The point at which a ray to a light starts. If the light is near the horizon of the triangle's plane, it is the
// surface's point, moved up to the curved surface that the corners' normals suggest, if that is above the triangle
// (Hanika: Hacking the Shadow Terminator, Ray Tracing Gems II, 2021). From a point of a coarse mesh itself, the light
// would be hidden by the neighbouring triangles, one triangle earlier or later than the shading ends. Where the light
// is higher, the point stays, so that what is near it casts its shadow.
//
// Corners are loaded one after the other: all three at once would take registers, which shadow rays need.
vec3 lit_point(Surface s, Hit hit, vec3 to_light) {
    float span = PLANE_START_COSINE - CURVED_START_COSINE;
    float share = SMOOTH ? clamp((PLANE_START_COSINE - dot(s.geometric, to_light)) / span, 0.0, 1.0) : 0.0;
    if (!(share > 0.0)) return s.point_world;
    place(hit.triangle_ix);
    vec3 weights = inner_weights(hit);
    vec3 curved = vec3(0.0);
    for (uint corner = 0u; corner < 3u; ++corner) {
        vec4 row = corner_at(hit.triangle_ix, corner);
        uint normal = floatBitsToUint(row.w);
        if (normal == FLAT_NORMAL) return s.point_world;
        curved += weights.x * above_corner(s.point_world, row.xyz, normal, s.interpolated);
        weights = weights.yzx;
    }
    return s.point_world + share * (curved - s.point_world);
}

#endif
