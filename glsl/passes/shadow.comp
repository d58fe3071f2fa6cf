#version 460
#extension GL_GOOGLE_include_directive : require
// Shadow (the paper's section 2.1): tests the shadow rays. They go from the hits of all rays of the batch, in all
// bounces, to each light that the surface could show. A light is hidden if its shadow ray hits anything.
// There are 2^shadow_lanes_log2 invocations per ray and light, the first of which works (rays/lanes.glsl).
// Reads rays, hits, bounces and the scene; updates light_visibility[light * queue_capacity + ray], in which a suspended
// shadow ray leaves its mark (search/suspended_rays.glsl), and, with COUNT_COSTS, n_rays and n_steps of pixel_aovs.
#include "layout.glsl"

// Whether the shadow rays' cost is added to pixel_aovs.
layout(constant_id = CONSTANT_COUNT_COSTS) const bool COUNT_COSTS = false;
const bool TESTS_BLENDED = true;
const bool FROM_CAMERA = false;
#include "search/accel.glsl"
#include "rays/rays.glsl"
#include "rays/lanes.glsl"
#include "shading/surface.glsl"
#include "shading/light.glsl"
#include "shading/material.glsl"
#include "shading/maps.glsl"
#include "shading/lit_point.glsl"

layout(local_size_x = RAY_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_LIGHTS) readonly buffer LightsBlock { Light lights[]; };
layout(std430, set = 0, binding = BIND_HITS) readonly buffer HitsBlock { Hit hits[]; };
layout(std430, set = 0, binding = BIND_LIGHT_VISIBILITY) buffer LightVisibilityBlock { uint light_visibility[]; };
layout(std430, set = 0, binding = BIND_BOUNCES) readonly buffer BouncesBlock { Bounce bounces[]; };
layout(std430, set = 0, binding = BIND_PIXEL_AOVS) buffer PixelAovsBlock { PixelAovs pixel_aovs[]; };

// Computes the shadow ray to the light. Returns false if the surface faces away from the light or would not show it.
bool shadow_ray_of(PathRay ray, Hit hit, Light light, out PathRay shadow_ray) {
    Triangle t = triangle_at(hit.triangle_ix);
    Surface surface = surface_at(ray, hit, t);
    IncidentLight to_light = incident_light(light, surface.point_world);
    if (!(dot(surface.interpolated, to_light.direction) > 0.0)) return false;
    Material material = material_at(ray, hit, t, surface);
    if (!can_show(material, surface.shading, -ray.direction, to_light.direction)) return false;
    vec3 origin = lit_point(surface, hit, to_light.direction);
    origin += surface.origin_offset * surface.geometric;
    // The shadow ray ends where the light is seen from the surface's own point.
    float t_max = to_light.distance - dot(origin - surface.point_world, to_light.direction);
    shadow_ray = PathRay(origin, ray.pixel_ix, to_light.direction, hit.triangle_ix, vec3(0.0), t_max);
    return true;
}

// Returns the light's visibility from the ray's hit, one of LIGHT_*, or the mark of a suspended shadow ray.
uint visibility_of(Light light, uint ray_ix) {
    Hit hit = hits[ray_ix];
    PathRay shadow_ray;
    if (hit.triangle_ix == NO_TRIANGLE || !shadow_ray_of(ray_at(ray_ix), hit, light, shadow_ray)) return LIGHT_UNTESTED;
    uint found = traverse(shadow_ray, 0.0, true).triangle_ix;
    if (is_suspended(found)) return found;
    if (COUNT_COSTS) {
        atomicAdd(pixel_aovs[shadow_ray.pixel_ix].n_rays, 1u);
        atomicAdd(pixel_aovs[shadow_ray.pixel_ix].n_steps, n_steps);
    }
    return found == NO_TRIANGLE ? LIGHT_LIT : LIGHT_SHADOWED;
}

void main() {
    uint last_ix = batch.bounce_ix + frame.max_depth - 1u;
    // Consecutive workgroups take the same rays and different lights. So the rays at the queue's front start early
    // for every light.
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint light_ix = group % frame.n_lights;
    uint lane = (group / frame.n_lights) * RAY_GROUP_SIZE + gl_LocalInvocationIndex;
    uint ray_ix = ray_of_lane(lane, bounces[last_ix].shadow_lanes_log2);
    if (ray_ix >= bounces[last_ix].first_ray + bounces[last_ix].n_rays) return;
    uint place = light_ix * frame.queue_capacity + ray_ix;
    if (!runs_in_pass(batch.resume_pass, light_visibility[place])) return;
    light_visibility[place] = visibility_of(lights[light_ix], ray_ix);
}
