#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Shade (the paper's section 2.1): one invocation per ray of the batch, of all bounces, sums the ambient, diffuse,
// specular and emitted light at the ray's hit. A ray that hits nothing gets the background's light.
// Reads rays, hits, light_visibility, bounces and the scene; writes ray_radiance (weighted by throughput); updates
// counters (n_shadow_rays).
#include "layout.glsl"
#include "rays/rays.glsl"
#include "scene.glsl"
#include "shading/surface.glsl"
#include "shading/light.glsl"
#include "shading/material.glsl"
#include "shading/maps.glsl"
#include "counters.glsl"
#include "shading/studio.glsl"

// Whether shadow rays are counted.
layout(constant_id = CONSTANT_COUNTS) const bool COUNTS = true;

layout(local_size_x = RAY_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_LIGHTS) readonly buffer LightsBlock { Light lights[]; };
layout(std430, set = 0, binding = BIND_BOUNCES) readonly buffer BouncesBlock { Bounce bounces[]; };
layout(std430, set = 0, binding = BIND_HITS) readonly buffer HitsBlock { Hit hits[]; };
layout(std430, set = 0, binding = BIND_LIGHT_VISIBILITY) readonly buffer LightVisibilityBlock {
    uint light_visibility[];
};
layout(std430, set = 0, binding = BIND_RAY_RADIANCE) writeonly buffer RayRadianceBlock { vec4 ray_radiance[]; };

// The irradiance of the ambient light on a surface. Between facing up and facing down it is blended by the normal's
// coordinate along the up axis. Without a tilt it is `frame.ambient`, bit for bit.
vec3 ambient_at(vec3 normal) {
    float height = normal[frame.up_axis];
    // A triangle of a shape that has no normal counts as upright.
    return frame.ambient + frame.ambient_tilt * (abs(height) <= 1.0 ? height : 0.0);
}

// The radiance that the surface itself emits and reflects towards the viewer, from the ambient light and all lights
// that it sees.
vec3 local_radiance(PathRay ray, uint ray_ix, Surface surface, Material material) {
    vec3 radiance = emitted(material);
    radiance += ambient_share(material, surface.shading, -ray.direction) * ambient_at(surface.shading);
    for (uint light_ix = 0u; light_ix < frame.n_lights; ++light_ix) {
        if (light_visibility[light_ix * frame.queue_capacity + ray_ix] != LIGHT_LIT) continue;
        IncidentLight to_light = incident_light(lights[light_ix], surface.point_world);
        vec3 reflectance = reflectance_of(material, surface.shading, -ray.direction, to_light.direction);
        radiance += reflectance * bump_shadowing(surface, to_light.direction) * to_light.irradiance;
    }
    return radiance * local_weight(material);
}

// The radiance that a ray adds to its pixel, its throughput included.
vec3 radiance_of(PathRay ray, uint ray_ix) {
    Hit hit = hits[ray_ix];
    if (hit.triangle_ix == NO_TRIANGLE) {
        // Of a batch, the camera's rays come first.
        bool is_of_camera = ray_ix < bounces[batch.bounce_ix].first_ray + bounces[batch.bounce_ix].n_rays;
        if (is_of_camera) return ray.throughput * frame.background;
        return ray.throughput * (frame.background + studio_radiance(ray.direction));
    }
    Surface surface;
    Material material;
    shaded_at(ray, hit, surface, material);
    vec3 throughput = ray.throughput * transmittance(material, surface, hit.t);
    return throughput * local_radiance(ray, ray_ix, surface, material);
}

// Adds the number of the ray's shadow rays to the counter of its bounce.
void count_shadow_rays(uint ray_ix) {
    uint n_shadow_rays = 0u;
    for (uint light_ix = 0u; light_ix < frame.n_lights; ++light_ix) {
        n_shadow_rays += light_visibility[light_ix * frame.queue_capacity + ray_ix] == LIGHT_UNTESTED ? 0u : 1u;
    }
    for (uint depth = 0u; depth < frame.max_depth; ++depth) {
        uint bounce_ix = batch.bounce_ix + depth;
        // Then all later bounces have no rays either.
        if (bounces[bounce_ix].n_rays == 0u) break;
        bool is_of_bounce = ray_ix - bounces[bounce_ix].first_ray < bounces[bounce_ix].n_rays;
        count_shadow_rays(bounce_ix, gl_WorkGroupID.x, is_of_bounce ? n_shadow_rays : 0u);
    }
}

void main() {
    uint ray_ix = gl_GlobalInvocationID.x;
    uint last_ix = batch.bounce_ix + frame.max_depth - 1u;
    if (ray_ix >= bounces[last_ix].first_ray + bounces[last_ix].n_rays) return;
    ray_radiance[ray_ix] = vec4(radiance_of(ray_at(ray_ix), ray_ix), 0.0);
    if (COUNTS) count_shadow_rays(ray_ix);
}
