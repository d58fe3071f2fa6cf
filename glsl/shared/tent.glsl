// A tent, which falls from its middle to both sides. The pixel's filter `tent` and the places in an environment's map
// are sampled by it. Twin of src/reference/tent.rs. Needs nothing.
#ifndef KDRAY_TENT
#define KDRAY_TENT

// The offset from the middle of a tent of radius 1 that has the share `u` of the tent to its left. u: in [0, 1).
float tent(float u) {
    return u < 0.5 ? sqrt(2.0 * u) - 1.0 : 1.0 - sqrt(2.0 * (1.0 - u));
}

#endif
