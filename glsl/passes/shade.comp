#version 460
#extension GL_GOOGLE_include_directive : require
// Shade (the paper's section 2.1): one invocation a ray adds up ambient, diffuse, specular and emitted light at its
// hit and makes the next level's rays, scattered: up to two, in places 2 i and 2 i + 1.
// Reads rays, hits, light_visibility and the scene; writes ray_radiance (weighted by throughput), child_rays,
// child_counts.
#include "layout.glsl"
#include "scene.glsl"
#include "surface.glsl"
#include "light.glsl"
#include "material.glsl"

layout(local_size_x = RAY_GROUP_SIZE) in;
layout(push_constant) uniform BatchBlock { Batch batch; };
layout(std140, set = 0, binding = BIND_FRAME) uniform FrameBlock { Frame frame; };
layout(std430, set = 0, binding = BIND_MATERIALS) readonly buffer MaterialsBlock { Material materials[]; };
layout(std430, set = 0, binding = BIND_LIGHTS) readonly buffer LightsBlock { Light lights[]; };
layout(std430, set = 0, binding = BIND_BOUNCES) readonly buffer BouncesBlock { Bounce bounces[]; };
layout(std430, set = 0, binding = BIND_RAYS) readonly buffer RaysBlock { Ray rays[]; };
layout(std430, set = 0, binding = BIND_HITS) readonly buffer HitsBlock { Hit hits[]; };
layout(std430, set = 0, binding = BIND_LIGHT_VISIBILITY) readonly buffer LightVisibilityBlock { uint light_visibility[]; };
layout(std430, set = 0, binding = BIND_CHILD_RAYS) writeonly buffer ChildRaysBlock { Ray child_rays[]; };
layout(std430, set = 0, binding = BIND_CHILD_COUNTS) writeonly buffer ChildCountsBlock { uint child_counts[]; };
layout(std430, set = 0, binding = BIND_RAY_RADIANCE) writeonly buffer RayRadianceBlock { vec4 ray_radiance[]; };

vec3 local_radiance(Ray ray, uint ray_ix, Surface surface, Material material) {
    vec3 radiance = material.ke + material.ka * frame.ambient;
    for (uint light_ix = 0u; light_ix < frame.n_lights; ++light_ix) {
        if (light_visibility[light_ix * frame.queue_capacity + ray_ix] == 0u) continue;
        LightSample to_light = sample_light(lights[light_ix], surface.point_world);
        radiance += phong(material, surface.shading, -ray.direction, to_light.direction) * to_light.irradiance;
    }
    return radiance * local_weight(material);
}

// Stores the child if it carries light; returns how many that makes.
uint add_child(uint ray_ix, uint n_children, Surface surface, vec3 direction, uint triangle_ix, Ray parent, vec3 weight) {
    vec3 throughput = parent.throughput * weight;
    if (!any(greaterThan(throughput, vec3(0.0)))) return n_children;
    child_rays[2u * ray_ix + n_children] = ray_from(surface, direction, triangle_ix, parent, throughput);
    return n_children + 1u;
}

void main() {
    uint ray_ix = gl_GlobalInvocationID.x;
    if (ray_ix >= bounces[batch.bounce_ix].n_rays) return;
    Ray ray = rays[ray_ix];
    Hit hit = hits[ray_ix];
    if (hit.triangle_ix == NO_TRIANGLE) {
        ray_radiance[ray_ix] = vec4(ray.throughput * frame.background, 0.0);
        child_counts[ray_ix] = 0u;
        return;
    }
    Surface surface = surface_at(ray, hit, triangle_at(hit.triangle_ix));
    Material material = materials[triangle_material_at(hit.triangle_ix)];
    ray_radiance[ray_ix] = vec4(ray.throughput * local_radiance(ray, ray_ix, surface, material), 0.0);

    uint n_children = 0u;
    if (batch.depth + 1u < frame.max_depth) {
        Scattering next = scatter(material, surface, ray.direction);
        n_children = add_child(ray_ix, n_children, surface, next.reflected, hit.triangle_ix, ray, next.reflected_weight);
        n_children = add_child(ray_ix, n_children, surface, next.transmitted, hit.triangle_ix, ray, next.transmitted_weight);
    }
    child_counts[ray_ix] = n_children;
}
