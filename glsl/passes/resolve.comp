#version 460
#extension GL_GOOGLE_include_directive : require
// Resolve: adds a bounce's radiance to the image. Compaction keeps order, so the rays of a pixel stand together: the
// invocation of its first ray adds up all of them, one writer a pixel, always in the same order.
// Reads rays, ray_radiance, bounces; adds to pixel_radiance (bounce 0: sets it).
#include "layout.glsl"

layout(local_size_x = RAY_GROUP_SIZE) in;
layout(push_constant) uniform BatchBlock { Batch batch; };
layout(std430, set = 0, binding = BIND_RAYS) readonly buffer RaysBlock { Ray rays[]; };
layout(std430, set = 0, binding = BIND_RAY_RADIANCE) readonly buffer RayRadianceBlock { vec4 ray_radiance[]; };
layout(std430, set = 0, binding = BIND_BOUNCES) readonly buffer BouncesBlock { Bounce bounces[]; };
layout(std430, set = 0, binding = BIND_PIXEL_RADIANCE) buffer PixelRadianceBlock { vec4 pixel_radiance[]; };

void main() {
    uint ray_ix = gl_GlobalInvocationID.x;
    uint n_rays = bounces[batch.bounce_ix].n_rays;
    if (ray_ix >= n_rays) return;
    uint pixel_ix = rays[ray_ix].pixel_ix;
    if (ray_ix > 0u && rays[ray_ix - 1u].pixel_ix == pixel_ix) return;
    vec3 sum = batch.depth == 0u ? vec3(0.0) : pixel_radiance[pixel_ix].rgb;
    for (uint i = ray_ix; i < n_rays && rays[i].pixel_ix == pixel_ix; ++i) sum += ray_radiance[i].rgb;
    pixel_radiance[pixel_ix] = vec4(sum, 1.0);
}
