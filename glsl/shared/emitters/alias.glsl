// Alias tables: sample one of n entries, each with its own probability, in constant time (Walker: An Efficient Method
// for Generating Discrete Random Variables With General Distributions, ACM TOMS 1977). The host builds the tables
// (src/world/alias.rs). Twin of src/reference/emitters/alias.rs.
//
// Needs load_texture_words(uint) -> uint and load_float(uint) -> float.
#ifndef KDRAY_ALIAS
#define KDRAY_ALIAS

#include "layout.glsl"

// The largest float below 1.
const float ALMOST_ONE = 0.99999994;

// The entry that is sampled, and what is left of the random number: uniform in [0, 1), independent of the entry.
struct AliasSample {
    uint ix;
    float rest;
};

// Samples an entry of a table. Each entry begins with its threshold and its alias.
// begin: index of the table's first word. stride: words of an entry. u: in [0, 1).
// more: in [0, 1), continues u below the 24 bits that a float has.
AliasSample sample_alias(uint begin, uint stride, uint n, float u, float more) {
    float scaled = u * float(n);
    uint ix = min(uint(scaled), n - 1u);
    float rest = min(scaled - float(ix) + more * float(n) * (1.0 / 16777216.0), ALMOST_ONE);
    uint at = begin + stride * ix;
    float threshold = load_float(at);
    if (rest < threshold) return AliasSample(ix, min(rest / threshold, ALMOST_ONE));
    return AliasSample(load_texture_words(at + 1u), min((rest - threshold) / (1.0 - threshold), ALMOST_ONE));
}

#endif
