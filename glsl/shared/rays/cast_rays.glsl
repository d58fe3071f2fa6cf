// Rays that a caller gives, of which some are invalid.
//
// Needs search/accel.glsl. Provides `is_ray` and `bounded_ray`.
#ifndef KDRAY_CAST_RAYS
#define KDRAY_CAST_RAYS

const uint INFINITY_BITS = 0x7f800000u;
const float GREATEST = 3.40282347e38;

// Whether a ray can hit anything: it has no NaN, a finite origin, and a direction that is finite and neither zero nor
// denormal.
bool is_ray(Ray ray) {
    uint exponent = exponent_of(ray.direction);
    return exponent > 0u && exponent < 255u && longest_bits(ray.origin) < INFINITY_BITS
        && magnitude_bits(ray.t_min) <= INFINITY_BITS && magnitude_bits(ray.t_max) <= INFINITY_BITS;
}

// A valid ray as `traverse_any_length` takes it. Clamps t_max to the greatest finite number, so a hit with an infinite
// t is a miss.
PathRay bounded_ray(Ray ray) {
    return PathRay(ray.origin, 0u, ray.direction, NO_TRIANGLE, vec3(0.0), min(ray.t_max, GREATEST));
}

#endif
