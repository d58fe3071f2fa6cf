#version 460
#extension GL_GOOGLE_include_directive : require
// Resolve: one invocation per primary ray of the batch sums the radiance of all rays of its pixel. Compaction keeps
// the order of rays, so a pixel's rays are contiguous in each bounce, and the invocation follows them from bounce to
// bounce by first_children. Each pixel has one writer, which always sums in the same order.
// Reads ray_radiance, first_children, bounces; writes pixel_radiance.
#include "layout.glsl"
#include "rays/rays.glsl"

layout(local_size_x = RAY_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_RAY_RADIANCE) readonly buffer RayRadianceBlock { vec4 ray_radiance[]; };
layout(std430, set = 0, binding = BIND_FIRST_CHILDREN) readonly buffer FirstChildrenBlock { uint first_children[]; };
layout(std430, set = 0, binding = BIND_BOUNCES) readonly buffer BouncesBlock { Bounce bounces[]; };
layout(std430, set = 0, binding = BIND_PIXEL_RADIANCE) writeonly buffer PixelRadianceBlock { vec4 pixel_radiance[]; };

// The rays of a pixel in one bounce, [begin, end) in the queue.
struct Span {
    uint begin;
    uint end;
};

// The children of a pixel's rays. bounce_ix: the row of the bounce that the children are in.
Span children_of(Span rays_of_pixel, uint bounce_ix) {
    uint first_ray = bounces[bounce_ix].first_ray;
    uint end = first_ray + bounces[bounce_ix].n_rays;
    // The children end where those of the next ray begin. After a bounce's last ray there is no such ray.
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
