#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Shadow (the paper's section 2.1): one working lane a ray (x) and light (y) tests the segment from the ray's hit to
// the light against the tree; any hit before its end puts the light out.
// Reads rays, hits, lights and the tree; writes light_visibility[light * queue_capacity + ray] (1: lit),
// counters[].n_shadow_rays, pixel_features (n_rays, n_steps).
#include "layout.glsl"

// Whether what segments cost is noted.
layout(constant_id = 3) const bool COUNT_COSTS = false;
#include "kdtree.glsl"
#include "lanes.glsl"
#include "surface.glsl"
#include "light.glsl"

// Whether tested segments are counted.
layout(constant_id = 2) const bool COUNTS = true;

layout(local_size_x = RAY_GROUP_SIZE) in;
layout(push_constant) uniform BatchBlock { Batch batch; };
layout(std430, set = 0, binding = BIND_LIGHTS) readonly buffer LightsBlock { Light lights[]; };
layout(std430, set = 0, binding = BIND_RAYS) readonly buffer RaysBlock { Ray rays[]; };
layout(std430, set = 0, binding = BIND_HITS) readonly buffer HitsBlock { Hit hits[]; };
layout(std430, set = 0, binding = BIND_LIGHT_VISIBILITY) writeonly buffer LightVisibilityBlock { uint light_visibility[]; };
layout(std430, set = 0, binding = BIND_BOUNCES) readonly buffer BouncesBlock { Bounce bounces[]; };
layout(std430, set = 0, binding = BIND_PIXEL_FEATURES) buffer PixelFeaturesBlock { Feature pixel_features[]; };
layout(std430, set = 0, binding = BIND_COUNTERS) buffer CountersBlock { Counters counters[]; };

// The segment to the light, or false where the surface turns its back on it.
bool shadow_segment(Ray ray, Hit hit, Light light, out Ray segment) {
    Surface surface = surface_at(ray, hit, triangle_at(hit.triangle_ix));
    LightSample to_light = sample_light(light, surface.point_world);
    if (!(dot(surface.geometric, to_light.direction) > 0.0)) return false;
    segment = ray_from(surface, to_light.direction, hit.triangle_ix, ray, vec3(0.0));
    segment.t_max = to_light.distance;
    return true;
}

void main() {
    uint ray_ix = ray_of_lane(bounces[batch.bounce_ix].shadow_lanes_log2);
    uint light_ix = gl_GlobalInvocationID.y;
    bool is_tested = false;
    if (ray_ix < bounces[batch.bounce_ix].n_rays) {
        Hit hit = hits[ray_ix];
        Ray segment;
        is_tested = hit.triangle_ix != NO_TRIANGLE && shadow_segment(rays[ray_ix], hit, lights[light_ix], segment);
        bool is_lit = is_tested && traverse(segment, 0.0, true).triangle_ix == NO_TRIANGLE;
        light_visibility[light_ix * frame.queue_capacity + ray_ix] = is_lit ? 1u : 0u;
        if (COUNT_COSTS && is_tested) {
            atomicAdd(pixel_features[rays[ray_ix].pixel_ix].n_rays, 1u);
            atomicAdd(pixel_features[rays[ray_ix].pixel_ix].n_steps, n_steps);
        }
    }
    if (COUNTS) {
        uint n_tested = subgroupAdd(is_tested ? 1u : 0u);
        if (subgroupElect() && n_tested > 0u) atomicAdd(counters[batch.bounce_ix].n_shadow_rays, n_tested);
    }
}
