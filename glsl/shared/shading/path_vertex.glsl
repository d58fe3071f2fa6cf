// One vertex of a path: the light at its hit, and the way on. Twin of src/reference/path_vertex.rs.
//
// Light reaches a hit in two ways: a sampled light is seen from it, or the direction in which the path goes on meets a
// light. Each way gets the share of the power heuristic (Veach: Robust Monte Carlo Methods for Light Transport
// Simulation, 1997, section 9.2.4), so that the sum of both is the light, and each counts where it is good.
//
// Needs nothing. Provides `scatter_path`.
#ifndef KDRAY_PATH_VERTEX
#define KDRAY_PATH_VERTEX

#include "layout.glsl"
#include "frame.glsl"
#include "sampler.glsl"
#include "shading/studio.glsl"
#include "scene.glsl"
#include "shading/surface.glsl"
#include "shading/material.glsl"
#include "shading/maps.glsl"
#include "shading/lit_point.glsl"
#include "bsdf/bsdf.glsl"

layout(std430, set = 0, binding = BIND_LIGHTS) readonly buffer LightsBlock { Light lights[]; };
#include "shading/light.glsl"
#include "emitters/emitters.glsl"

// The number of pairs of random numbers that come before those of the first hit: in the pixel and in the lens.
#define PAIRS_OF_CAMERA 2u
// The number of pairs for each hit.
#define PAIRS_OF_HIT 4u

// Power-heuristic weight of the strategy with pdf `pdf_a` against one with pdf `pdf_b` (Veach and Guibas 1995).
float power_heuristic(float pdf_a, float pdf_b) {
    // Divided by the larger one, since their squares could overflow.
    float largest = max(pdf_a, pdf_b);
    float a = pdf_a / largest, b = pdf_b / largest;
    return a * a / (a * a + b * b);
}

// MIS weight of light that the path's ray meets. light_pdf: pdf with which sample_light samples the ray's direction.
float mis_weight(PathState state, float light_pdf) {
    return state.pdf > 0.0 ? power_heuristic(state.pdf, light_pdf) : 1.0;
}

// Light that is added to the path: bounded, after the first hit as the options say, and nothing if it is not finite.
vec3 added_light(vec3 light, uint depth) {
    if (depth > 0u) light = min(light, vec3(frame.clamp));
    bool is_finite = all(lessThan(light, vec3(INFINITY)));
    return is_finite ? clamp(light, 0.0, MOST_ADDED_LIGHT) : vec3(0.0);
}

// The light of an environment that a ray meets. The camera and perfectly smooth surfaces do not see the ambient light.
// The studio is no light that is sampled, so all of it is met. Only narrow lobes see it: it is there to be mirrored,
// and wide ones would make noise of it.
vec3 met_environment(PathRay ray, PathState state, uint depth) {
    SeenEnvironment seen = seen_environment(ray.direction);
    vec3 radiance = seen.radiance;
    if (state.pdf > 0.0) radiance += ambient_radiance(ray.direction);
    vec3 met = radiance * mis_weight(state, seen.pdf);
    bool mirrors = depth > 0u && (state.pdf == 0.0 || state.pdf > STUDIO_LEAST_PDF);
    return mirrors ? met + studio_radiance(ray.direction) : met;
}

// The vector from a hit to the start of a ray in a direction to which lobes with a pdf scatter light. What a bent
// normal reflects is above the interpolated surface, so its ray starts there.
vec3 to_start(Surface surface, Hit hit, vec3 direction) {
    bool is_mapped = is_bent(surface);
    bool is_below = dot(direction, is_mapped ? surface.interpolated : surface.geometric) < 0.0;
    vec3 offset = (is_below ? -surface.origin_offset : surface.origin_offset) * surface.geometric;
    if (is_mapped && !is_below) offset += lit_point(surface, hit, direction) - surface.point_world;
    return offset;
}

// The shadow ray to a light that is sampled at a hit.
ShadowRay shadow_ray_to_light(uint depth, vec3 u, Surface surface, BsdfTerms terms, Hit hit, vec3 throughput) {
    ShadowRay shadow_ray;
    shadow_ray.state = SHADOW_RAY_NONE;
    if (is_smooth(terms.material)) return shadow_ray;
    LightSample light_sample = sample_light(surface.point_world, u);
    if (light_sample.light == vec3(0.0)) return shadow_ray;
    BsdfEval scattered = eval_bsdf(terms, surface, light_sample.direction);
    if (!any(greaterThan(scattered.value, vec3(0.0)))) return shadow_ray;
    float weight = light_sample.pdf > 0.0 ? power_heuristic(light_sample.pdf, scattered.pdf) : 1.0;
    vec3 light = added_light(throughput * scattered.value * light_sample.light * weight, depth + 1u);
    if (!any(greaterThan(light, vec3(0.0)))) return shadow_ray;
    vec3 offset = to_start(surface, hit, light_sample.direction);
    vec3 origin = surface.point_world + offset;
    uint source = hit.triangle_ix;
    shadow_ray = ShadowRay(origin, SHADOW_RAY_WAITS, light_sample.direction, source, light, light_sample.distance);
    if (isinf(light_sample.distance)) return shadow_ray;
    // From its start beside the surface, the shadow ray still goes to the point that was sampled.
    vec3 to_light = light_sample.distance * light_sample.direction - offset;
    float distance = length(to_light);
    shadow_ray.direction = to_light / distance;
    shadow_ray.t_max = SHADOW_RAY_SHARE * distance;
    return shadow_ray;
}

// Whether a path survives Russian roulette. Its throughput is then larger, by the reciprocal of the probability.
bool survives(uint depth, float u, inout vec3 throughput) {
    if (depth < ROULETTE_DEPTH) return true;
    float survival = clamp(largest_of(throughput), LEAST_SURVIVAL, 1.0);
    throughput /= survival;
    return u < survival;
}

// Adds the light that the path's ray meets to its state, samples a light at the hit, and replaces the ray by the one
// with which the path goes on. Returns whether it does.
bool scatter_path(
    SampleKey key, uint depth, Hit hit, inout PathRay ray, inout PathState state, out ShadowRay shadow_ray
) {
    shadow_ray.state = SHADOW_RAY_NONE;
    bool is_miss = hit.triangle_ix == NO_TRIANGLE;
    SeenLight seen = seen_light(ray.origin, ray.direction, is_miss ? INFINITY : hit.t);
    if (seen.t < INFINITY) {
        vec3 light = seen.radiance * mis_weight(state, seen.pdf);
        state.radiance += added_light(ray.throughput * light, depth);
        return false;
    }
    if (is_miss) {
        state.radiance += added_light(ray.throughput * met_environment(ray, state, depth), depth);
        return false;
    }
    Surface surface;
    Material material;
    shaded_at(ray, hit, surface, material);
    vec3 throughput = ray.throughput * transmittance(material, surface, hit.t);
    if (is_unlit(material) || any(greaterThan(material.ke, vec3(0.0)))) {
        vec3 light = is_unlit(material) ? emitted(material) : emission_at(hit.triangle_ix, hit.u, hit.v);
        float weight = mis_weight(state, emission_pdf(hit.triangle_ix, ray.origin, ray.direction, hit.t));
        state.radiance += added_light(throughput * light * weight, depth);
    }
    // The last ray of a path only meets light.
    if (is_unlit(material) || depth + 1u >= frame.max_depth) return false;
    BsdfTerms terms = bsdf_terms(material, surface, -ray.direction);
    uint first_pair = PAIRS_OF_CAMERA + PAIRS_OF_HIT * depth;
    vec2 to_light = random_pair(key, first_pair), choices = random_pair(key, first_pair + 1u);
    vec2 to_next = random_pair(key, first_pair + 2u), lobe = random_pair(key, first_pair + 3u);
    shadow_ray = shadow_ray_to_light(depth, vec3(to_light, choices.x), surface, terms, hit, throughput);
    BsdfSample next = sample_bsdf(terms, surface, vec3(to_next, lobe.x));
    throughput *= next.weight;
    if (!any(greaterThan(throughput, vec3(0.0))) || !survives(depth, choices.y, throughput)) return false;
    ray = ray_from(surface, next.direction, hit.triangle_ix, ray, throughput);
    if (is_bent(surface) && !next.is_delta) ray.origin = surface.point_world + to_start(surface, hit, next.direction);
    state.pdf = next.is_delta ? 0.0 : next.pdf;
    return true;
}

#endif
