#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Primary hit (the paper's section 2.2): one invocation a pixel of the batch makes the ray of its sample and intersects it
// with the plane of the triangle that the rasterizer found there.
// Reads triangle_ids, triangles; writes rays, hits, counters (n_hits), pixel_features (n_rays, n_steps).
#include "layout.glsl"
#include "scene.glsl"
#include "camera.glsl"
#include "store.glsl"
#include "counters.glsl"
#include "triangle.glsl"

layout(local_size_x = RAY_GROUP_SIZE) in;
layout(push_constant) uniform BatchBlock { Batch batch; };
layout(set = 0, binding = BIND_TRIANGLE_IDS, r32ui) readonly uniform uimage2D triangle_ids;

layout(std430, set = 0, binding = BIND_PIXEL_FEATURES) buffer PixelFeaturesBlock { Feature pixel_features[]; };

// Whether hits are counted.
layout(constant_id = 2) const bool COUNTS = true;
// Whether what the ray costs is noted.
layout(constant_id = 3) const bool COUNT_COSTS = false;

void main() {
    uint ray_ix = gl_GlobalInvocationID.x;
    bool is_hit = false;
    if (ray_ix < batch.n_pixels) {
        uvec2 pixel = pixel_of(batch.first_pixel + ray_ix, frame.width, frame.height);
        Ray ray = camera_ray(pixel);
        store_ray(ray_ix, ray);
        uint triangle_ix = imageLoad(triangle_ids, ivec2(in_picture(pixel))).x;
        Hit hit = Hit(ray.t_max, NO_TRIANGLE, 0.0, 0.0);
        is_hit = triangle_ix != NO_TRIANGLE;
        if (is_hit) hit = clamp_to_triangle(shear_of(ray.origin, ray.direction), triangle_at(triangle_ix), triangle_ix);
        store_hit(ray_ix, hit);
        if (COUNT_COSTS) {
            pixel_features[ray.pixel_ix].n_rays = 1u;
            pixel_features[ray.pixel_ix].n_steps = is_hit ? 1u : 0u;
        }
    }
    if (COUNTS) count_hits(batch.bounce_ix, is_hit);
}
