// Point, spot and directional lights, as seen from a point of a surface. Twin of src/reference/light.rs.
#ifndef KDRAY_LIGHT
#define KDRAY_LIGHT

#include "layout.glsl"
#include "constants.glsl"

// What arrives from a light at a point.
struct IncidentLight {
    // Unit vector to the light, and the light's distance in world units (infinity for a directional light).
    vec3 direction;
    float distance;
    // Irradiance on a surface that faces the light.
    vec3 irradiance;
};

// The share of a spot light's intensity in a direction, whose opposite is `direction` (glTF's KHR_lights_punctual).
float spot_share(Light light, vec3 direction) {
    float cosine = dot(light.axis, -direction);
    float share = clamp((cosine - light.outer_cos) / max(light.inner_cos - light.outer_cos, 1.0e-3), 0.0, 1.0);
    return share * share;
}

// Returns what arrives from a light at a point.
IncidentLight incident_light(Light light, vec3 point_world) {
    if (light.kind == LIGHT_DIRECTIONAL) {
        return IncidentLight(light.position, INFINITY, light.intensity);
    }
    vec3 to_light = light.position - point_world;
    float squared = dot(to_light, to_light);
    float distance = sqrt(squared);
    vec3 direction = to_light / distance;
    float cone = light.kind == LIGHT_SPOT ? spot_share(light, direction) : 1.0;
    return IncidentLight(direction, distance, light.intensity * cone / squared);
}

#endif
