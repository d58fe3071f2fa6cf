#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Primary hit (the paper's section 2.2): one invocation per pixel of the batch intersects the camera ray of its
// sample with the triangle that the rasterizer found there.
// Reads triangle_ids or pixel_nearest, triangles; writes hits and, with COUNT_COSTS, n_rays and n_steps of
// pixel_aovs; updates counters (n_hits).
#include "layout.glsl"
#include "scene.glsl"
#include "rays/rays.glsl"
#include "rays/store.glsl"
#include "counters.glsl"
#include "search/triangle.glsl"

layout(local_size_x = RAY_GROUP_SIZE) in;
layout(set = 0, binding = BIND_TRIANGLE_IDS, r32ui) readonly uniform uimage2D triangle_ids;

layout(std430, set = 0, binding = BIND_PIXEL_NEAREST) readonly buffer PixelNearestBlock { uvec2 pixel_nearest[]; };
layout(std430, set = 0, binding = BIND_PIXEL_AOVS) buffer PixelAovsBlock { PixelAovs pixel_aovs[]; };

// Whether hits are counted.
layout(constant_id = CONSTANT_COUNTS) const bool COUNTS = true;
// Whether the ray's cost is written to pixel_aovs.
layout(constant_id = CONSTANT_COUNT_COSTS) const bool COUNT_COSTS = false;
// Which rasterizer found the triangles. True: the kernels rasterize_*.comp, which wrote pixel_nearest. False: the
// graphics pipeline, which wrote triangle_ids.
layout(constant_id = CONSTANT_SOFTWARE_RASTER) const bool SOFTWARE_RASTER = false;

uint triangle_of(uvec2 pixel) {
    if (SOFTWARE_RASTER) return pixel_nearest[pixel_ix_of(pixel)].x;
    return imageLoad(triangle_ids, ivec2(in_picture(pixel))).x;
}

// The camera ray's hit. The kernels rasterize_*.comp find only triangles that the ray hits. The graphics pipeline may
// find a triangle that the ray just misses. The hit is then moved to the triangle's edge.
Hit hit_of(PathRay ray, uint triangle_ix) {
    Shear shear = shear_of(ray.origin, ray.direction);
    Triangle triangle = triangle_at(triangle_ix);
    Hit hit;
    if (SOFTWARE_RASTER && intersect_triangle(shear, triangle, triangle_ix, hit)) return hit;
    return clamp_to_triangle(shear, triangle, triangle_ix);
}

void main() {
    uint ray_ix = gl_GlobalInvocationID.x;
    bool is_hit = false;
    if (ray_ix < batch.n_pixels) {
        uvec2 pixel = pixel_of_ray(ray_ix);
        PathRay ray = camera_ray(pixel);
        uint triangle_ix = triangle_of(pixel);
        Hit hit = Hit(ray.t_max, NO_TRIANGLE, 0.0, 0.0);
        is_hit = triangle_ix != NO_TRIANGLE;
        if (is_hit) hit = hit_of(ray, triangle_ix);
        store_hit(ray_ix, hit);
        if (COUNT_COSTS) {
            pixel_aovs[ray.pixel_ix].n_rays = 1u;
            pixel_aovs[ray.pixel_ix].n_steps = is_hit ? 1u : 0u;
        }
    }
    if (COUNTS) count_hits(batch.bounce_ix, gl_WorkGroupID.x, is_hit);
}
