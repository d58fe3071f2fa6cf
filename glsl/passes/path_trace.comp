#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Path trace: finds the closest hits of the paths that are alive, and tests the shadow rays to lights of the bounce
// before. One dispatch does both: it lasts as long as its longest ray, and so waits for such a ray once a bounce, not
// twice. There are 2^trace_lanes_log2 invocations per ray and shadow ray, the first of which works (rays/lanes.glsl).
// The shadow rays follow the rays. Rays pass through blended surfaces at random (shading/alpha_test.glsl). Reads rays,
// live_paths, bounces and the acceleration structure; updates hits and shadow rays, in which suspended rays and shadow
// rays leave their mark (search/suspended_rays.glsl), path_states (light that arrives is added), counters and, with
// COUNT_COSTS, n_rays and n_steps of pixel_aovs, which are about the first sample of the frame.
#include "layout.glsl"

// Whether the cost of the rays of each pixel's first sample is added to pixel_aovs.
layout(constant_id = CONSTANT_COUNT_COSTS) const bool COUNT_COSTS = false;
const bool TESTS_BLENDED = true;
// Whether the rays are the camera's, which pass through back faces. They have no shadow rays of a bounce before.
layout(constant_id = CONSTANT_FROM_CAMERA) const bool FROM_CAMERA = false;
#define STOCHASTIC_ALPHA
#include "search/accel.glsl"
#include "rays/paths.glsl"
#include "rays/lanes.glsl"
#include "rays/store.glsl"
#include "counters.glsl"

// Whether hits and shadow rays are counted.
layout(constant_id = CONSTANT_COUNTS) const bool COUNTS = true;

layout(local_size_x = RAY_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_LIVE_PATHS) readonly buffer LivePathsBlock { uint live_paths[]; };
layout(std430, set = 0, binding = BIND_RAYS) readonly buffer RaysBlock { PathRay rays[]; };
layout(std430, set = 0, binding = BIND_HITS) readonly buffer HitsBlock { Hit hits[]; };
layout(std430, set = 0, binding = BIND_BOUNCES) readonly buffer BouncesBlock { Bounce bounces[]; };
layout(std430, set = 0, binding = BIND_PATH_STATES) buffer PathStatesBlock { vec4 path_states[]; };
layout(std430, set = 0, binding = BIND_SHADOW_RAYS) buffer ShadowRaysBlock { ShadowRay shadow_rays[]; };
layout(std430, set = 0, binding = BIND_PIXEL_AOVS) buffer PixelAovsBlock { PixelAovs pixel_aovs[]; };

PathRay ray_of(ShadowRay ray, uint pixel_ix) {
    return PathRay(ray.origin, pixel_ix, ray.direction, ray.source_triangle, vec3(0.0), ray.t_max);
}

// Stores the result of a path's shadow ray, whose traversal has found this triangle, none, or a mark.
void end_shadow_ray(uint path_ix, uint found) {
    shadow_rays[path_ix].state = is_suspended(found) ? found : SHADOW_RAY_NONE;
    if (found == NO_TRIANGLE) path_states[path_ix].xyz += shadow_rays[path_ix].light;
}

void count(PathRay ray) {
    atomicAdd(pixel_aovs[ray.pixel_ix].n_rays, 1u);
    atomicAdd(pixel_aovs[ray.pixel_ix].n_steps, n_steps);
}

// Traces a ray, or a shadow ray. Returns whether it has a hit; or of a shadow ray, whether it was traced to its end.
bool traced(uint path_ix, bool is_shadow_ray) {
    PathRay ray = rays[path_ix];
    if (is_shadow_ray) ray = ray_of(shadow_rays[path_ix], ray.pixel_ix);
    if (has_alpha_test()) {
        seed_alpha_test(key_of_path(path_ix, pixel_of_path(path_ix)), batch.depth, is_shadow_ray);
    }
    Hit hit = traverse(ray, 0.0, is_shadow_ray);
    bool ends = !is_suspended(hit.triangle_ix);
    if (COUNT_COSTS && ends && sample_of_path(path_ix) == 0u) count(ray);
    if (is_shadow_ray) end_shadow_ray(path_ix, hit.triangle_ix);
    else store_hit(path_ix, hit);
    return ends && (is_shadow_ray || hit.triangle_ix != NO_TRIANGLE);
}

void main() {
    uint place = ray_of_lane(gl_GlobalInvocationID.x, bounces[batch.bounce_ix].trace_lanes_log2);
    uint n_rays = bounces[batch.bounce_ix].n_rays;
    uint n_shadow_rays = batch.depth > 0u ? bounces[batch.bounce_ix - 1u].n_shadow_rays : 0u;
    bool is_shadow_ray = place >= n_rays;
    bool counts = false;
    // The index of a lane that does not work is beyond both, also after the subtraction.
    uint in_list = is_shadow_ray ? place - n_rays : place;
    if (in_list < (is_shadow_ray ? n_shadow_rays : n_rays)) {
        uint path_ix = live_paths[(is_shadow_ray ? list_of_shadow_rays() : list_of(batch.depth)) + in_list];
        uint mark = is_shadow_ray ? shadow_rays[path_ix].state : hits[path_ix].triangle_ix;
        if (runs_in_pass(batch.resume_pass, mark)) counts = traced(path_ix, is_shadow_ray);
    }
    if (COUNTS) {
        count_hits(batch.bounce_ix, gl_WorkGroupID.x, counts && !is_shadow_ray);
        uint before = batch.depth > 0u ? batch.bounce_ix - 1u : batch.bounce_ix;
        count_shadow_rays(before, gl_WorkGroupID.x, counts && is_shadow_ray ? 1u : 0u);
    }
}
