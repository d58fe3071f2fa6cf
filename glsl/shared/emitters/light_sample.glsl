// What `sample_light` returns, whichever kind of emitter was sampled. Twin of src/reference/emitters/light_sample.rs.
#ifndef KDRAY_PICK
#define KDRAY_PICK

#include "layout.glsl"
#include "constants.glsl"

// A number beyond which a pdf or a weight counts as infinite.
const float MOST_LIGHT = 1.0e30;

// A direction from which light may come.
struct LightSample {
    // Unit vector from the point, and the distance up to which the way must be free, world units (infinity for what is
    // beyond the scene).
    vec3 direction;
    float distance;
    // Radiance divided by `pdf`. Of lights without a size: irradiance on a facing surface, divided by the
    // probability of the sample. Either is multiplied by f |cos| to give the reflected radiance. 0: there is no light.
    vec3 light;
    // Pdf of the direction, per steradian, the probability of the emitter included. It is 0 for lights without a
    // size, which no ray can hit.
    float pdf;
};

LightSample no_sample() {
    return LightSample(vec3(0.0), 0.0, vec3(0.0), 0.0);
}

// Unit vector and distance to a point; the distance is 0 if there is no direction.
struct Towards {
    vec3 direction;
    float distance;
};

Towards towards(vec3 from, vec3 to) {
    vec3 way = to - from;
    float distance = sqrt(dot(way, way));
    if (!(distance > 0.0)) return Towards(vec3(0.0), 0.0);
    return Towards(way / distance, distance);
}

// The sample of a point from which light of this radiance comes.
LightSample sample_of_point(Towards way, vec3 radiance, float pdf) {
    if (!(pdf > 0.0 && pdf < MOST_LIGHT)) return no_sample();
    return LightSample(way.direction, way.distance, radiance / pdf, pdf);
}

// A vector that is `cosine` along the axis, and `sine` aside of it at an azimuth in turns. The three axes are
// orthonormal. Drivers may compute sines and cosines with errors of 2^-11. They are scaled so that the vector has unit
// length nevertheless: distances along it are compared to 1e-4.
vec3 around(vec3 axis, vec3 aside_u, vec3 aside_v, vec3 cosine_sine_turns) {
    float azimuth = 2.0 * PI * cosine_sine_turns.z;
    vec2 aside = normalize(vec2(cos(azimuth), sin(azimuth)));
    return cosine_sine_turns.x * axis + cosine_sine_turns.y * (aside.x * aside_u + aside.y * aside_v);
}

#endif
