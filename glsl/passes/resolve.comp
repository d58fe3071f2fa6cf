#version 460
#extension GL_GOOGLE_include_directive : require
// Resolve: the light of all rays of a pixel. Compaction keeps order, so those of a bounce stand together, and one invocation a
// primary ray goes from bounce to bounce by the places of their children: one writer a pixel, always in the same order.
// Reads ray_radiance, first_children, bounces; writes pixel_radiance.
#include "layout.glsl"
#include "rays.glsl"

layout(local_size_x = RAY_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_RAY_RADIANCE) readonly buffer RayRadianceBlock { vec4 ray_radiance[]; };
layout(std430, set = 0, binding = BIND_FIRST_CHILDREN) readonly buffer FirstChildrenBlock { uint first_children[]; };
layout(std430, set = 0, binding = BIND_BOUNCES) readonly buffer BouncesBlock { Bounce bounces[]; };
layout(std430, set = 0, binding = BIND_PIXEL_RADIANCE) writeonly buffer PixelRadianceBlock { vec4 pixel_radiance[]; };

// The rays of a pixel in one bounce.
struct Span {
    uint begin;
    uint end;
};

// Their children, which are in the bounce of the row.
Span children_of(Span rays_of_pixel, uint bounce_ix) {
    uint first_ray = bounces[bounce_ix].first_ray;
    uint end = first_ray + bounces[bounce_ix].n_rays;
    // Behind the last ray of a bounce stands none of it.
    if (rays_of_pixel.end < first_ray) end = first_children[rays_of_pixel.end];
    return Span(first_children[rays_of_pixel.begin], end);
}

void main() {
    uint ray_ix = gl_GlobalInvocationID.x;
    if (ray_ix >= batch.n_pixels) return;
    vec3 sum = vec3(0.0);
    Span span = Span(ray_ix, ray_ix + 1u);
    for (uint depth = 0u; span.begin < span.end; ++depth) {
        for (uint i = span.begin; i < span.end; ++i) sum += ray_radiance[i].rgb;
        uint next_ix = batch.bounce_ix + depth + 1u;
        if (depth + 1u == frame.max_depth || bounces[next_ix].n_rays == 0u) break;
        span = children_of(span, next_ix);
    }
    pixel_radiance[pixel_ix_of(pixel_of_ray(ray_ix))] = vec4(sum, 1.0);
}
