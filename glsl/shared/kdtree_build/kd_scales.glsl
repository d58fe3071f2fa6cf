// Scales of triangles and cells. Twin of src/accel/kdtree/scales.rs, with the same results to the last bit.
#ifndef KDRAY_KD_SCALES
#define KDRAY_KD_SCALES

#include "kdtree_build/kd_build.glsl"

// The finest scale whose length is not below `len`, up to `finest`: the exponent of largest / len. The difference of
// the bits of two positive floats has the exponent of their quotient, without the rounding of a division.
uint scale_of_length(float largest, float len, uint finest) {
    int exponent = (int(floatBitsToUint(largest)) - int(floatBitsToUint(len))) >> 23;
    return min(uint(max(exponent, 0)), finest);
}

// 2^-scale, the length of a scale as a multiple of that of scale 0.
float length_of_scale(uint scale) {
    return uintBitsToFloat((127u - scale) << 23);
}

uint scale_of(vec3 least, vec3 greatest) {
    return scale_of_length(build.largest, largest_of(least, greatest), build.finest);
}

// The distance from a cell within which a triangle counts as inside the cell, world units.
float margin_of(Triangle triangle) {
    precise float margin = build.margin * length_of_scale(scale_of(least_of(triangle), greatest_of(triangle)));
    return margin;
}

#endif
