#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Trace (the paper's section 2.3): finds the closest hit of each ray of the bounce. There are 2^trace_lanes_log2
// invocations per ray, the first of which works (rays/lanes.glsl).
// Reads rays, bounces and the acceleration structure; updates hits, in which a suspended ray leaves its mark
// (search/suspended_rays.glsl), counters (n_hits) and, with COUNT_COSTS, n_rays and n_steps of pixel_aovs.
#include "layout.glsl"

// Whether the rays' cost is added to pixel_aovs.
layout(constant_id = CONSTANT_COUNT_COSTS) const bool COUNT_COSTS = false;
const bool TESTS_BLENDED = false;
// Whether the rays are the camera's, which are computed here, not loaded.
layout(constant_id = CONSTANT_FROM_CAMERA) const bool FROM_CAMERA = false;
#include "search/accel.glsl"
#include "rays/rays.glsl"
#include "rays/lanes.glsl"
#include "rays/store.glsl"
#include "counters.glsl"

// Whether hits are counted.
layout(constant_id = CONSTANT_COUNTS) const bool COUNTS = true;

layout(local_size_x = RAY_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_BOUNCES) readonly buffer BouncesBlock { Bounce bounces[]; };
layout(std430, set = 0, binding = BIND_HITS) readonly buffer HitsBlock { Hit hits[]; };
layout(std430, set = 0, binding = BIND_PIXEL_AOVS) buffer PixelAovsBlock { PixelAovs pixel_aovs[]; };

void main() {
    uint place = ray_of_lane(gl_GlobalInvocationID.x, bounces[batch.bounce_ix].trace_lanes_log2);
    bool is_hit = false;
    uint ray_ix = bounces[batch.bounce_ix].first_ray + place;
    if (place < bounces[batch.bounce_ix].n_rays && runs_in_pass(batch.resume_pass, hits[ray_ix].triangle_ix)) {
        PathRay ray;
        if (FROM_CAMERA) ray = camera_ray(pixel_of_ray(ray_ix));
        else ray = rays[ray_ix];
        Hit hit = traverse(ray, 0.0, false);
        store_hit(ray_ix, hit);
        bool ends = !is_suspended(hit.triangle_ix);
        if (COUNT_COSTS && ends) {
            atomicAdd(pixel_aovs[ray.pixel_ix].n_rays, 1u);
            atomicAdd(pixel_aovs[ray.pixel_ix].n_steps, n_steps);
        }
        is_hit = ends && hit.triangle_ix != NO_TRIANGLE;
    }
    if (COUNTS) count_hits(batch.bounce_ix, 0u, is_hit);
}
