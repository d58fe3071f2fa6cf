// Point, spot and directional lights without a size. Scene files state them for surfaces that show the irradiance as
// radiance, so that the irradiance of the physical light is pi times as large. Twin of
// src/reference/emitters/punctual.rs.
#ifndef KDRAY_PUNCTUAL
#define KDRAY_PUNCTUAL

#include "layout.glsl"
#include "shading/light.glsl"
#include "emitters/light_sample.glsl"

// probability: with which this light is sampled.
LightSample sample_punctual(Light light, vec3 point_world, float probability) {
    IncidentLight arriving = incident_light(light, point_world);
    // Not `<=`: at the light itself, there are NaNs.
    if (!(arriving.distance > 0.0)) return no_sample();
    return LightSample(arriving.direction, arriving.distance, arriving.irradiance * (PI / probability), 0.0);
}

#endif
