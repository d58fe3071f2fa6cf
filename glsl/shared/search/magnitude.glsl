// Magnitudes of floats as integers. Needs nothing. Provides `magnitude_bits`, `longest_bits` and `exponent_of`.
#ifndef KDRAY_MAGNITUDE
#define KDRAY_MAGNITUDE

// The bits of a magnitude, which have the order of the magnitudes. Integers are used since a device may flush
// denormals and need not tell a NaN from a number.
uint magnitude_bits(float x) {
    return floatBitsToUint(x) & 0x7fffffffu;
}

uint longest_bits(vec3 v) {
    return max(max(magnitude_bits(v.x), magnitude_bits(v.y)), magnitude_bits(v.z));
}

// The biased exponent of the component of largest magnitude, 1..254. It is 0 if that component is zero or denormal,
// and 255 if it is infinite or NaN.
uint exponent_of(vec3 direction) {
    return longest_bits(direction) >> 23;
}

#endif
