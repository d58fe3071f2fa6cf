// Exact reflectance of a smooth metal in air for unpolarized light (Born, Wolf: Principles of Optics, 14.2). Twin of
// src/reference/bsdf/conductor.rs.
#ifndef KDRAY_BSDF_CONDUCTOR
#define KDRAY_BSDF_CONDUCTOR

// eta + i k: the metal's index of refraction, by colour.
vec3 conductor_reflectance(float cosine, vec3 eta, vec3 k) {
    float cos_squared = clamp(cosine * cosine, 0.0, 1.0), sin_squared = 1.0 - cos_squared;
    vec3 difference = eta * eta - k * k - sin_squared;
    // a^2 + b^2 and a: of the complex root a + i b of the squared index less the squared sine.
    vec3 sum = sqrt(difference * difference + 4.0 * eta * eta * k * k);
    vec3 a = sqrt(max(0.5 * (sum + difference), 0.0));
    vec3 perpendicular = (sum + cos_squared - 2.0 * a * cosine) / (sum + cos_squared + 2.0 * a * cosine);
    vec3 even = cos_squared * sum + sin_squared * sin_squared, odd = 2.0 * a * (cosine * sin_squared);
    vec3 parallel = perpendicular * (even - odd) / max(even + odd, 1.0e-20);
    return clamp(0.5 * (perpendicular + parallel), 0.0, 1.0);
}

#endif
