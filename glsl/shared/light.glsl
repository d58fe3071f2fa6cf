// Point and directional lights, as a surface point sees them.
#ifndef KDRAY_LIGHT
#define KDRAY_LIGHT

#include "layout.glsl"

struct LightSample {
    // Unit vector to the light, and how far it is (infinity for a directional one).
    vec3 direction;
    float distance;
    // On a surface that faces the light.
    vec3 irradiance;
};

LightSample sample_light(Light light, vec3 point_world) {
    if (light.kind == LIGHT_DIRECTIONAL) {
        return LightSample(light.position, uintBitsToFloat(0x7f800000u), light.intensity);
    }
    vec3 to_light = light.position - point_world;
    float squared = dot(to_light, to_light);
    float distance = sqrt(squared);
    return LightSample(to_light / distance, distance, light.intensity / squared);
}

#endif
