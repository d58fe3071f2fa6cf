// Extents of surfaces along their normals, which atomics find. Minima and maxima of integers are the same in every
// order.
#ifndef KDRAY_SLAB_EXTENT
#define KDRAY_SLAB_EXTENT

// Maps floats to integers of the same order: a negative number has all bits inverted, any other only its sign bit.
uint ordered(float x) {
    uint bits = floatBitsToUint(x);
    return bits ^ (bits > 0x7fffffffu ? 0xffffffffu : 0x80000000u);
}

// Inverse of `ordered`.
float from_ordered(uint bits) {
    return uintBitsToFloat(bits ^ (bits > 0x7fffffffu ? 0x80000000u : 0xffffffffu));
}

#endif
