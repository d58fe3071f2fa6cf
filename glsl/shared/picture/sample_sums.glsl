// The sum of a pixel's samples of a frame, as a binary tree over the samples, so that it does not depend on how many
// samples a frame draws (path_accumulate.comp). Twin of src/reference/sample_sums.rs. Needs nothing. Provides
// `add_sample` and `sample_sums`.
#ifndef KDRAY_SAMPLE_SUMS
#define KDRAY_SAMPLE_SUMS

#include "layout.glsl"

// One sum for each level of the tree. After 2^level samples, the element `level` is the sum of all of them.
vec4 sample_sums[MOST_SAMPLES_LOG2 + 1u];

// Adds the value of the next sample. sample_ix: counted from 0.
void add_sample(uint sample_ix, vec4 value) {
    precise vec4 sum = value;
    // Two sums of 2^level samples make one of the next level.
    uint level = 0u;
    for (; ((sample_ix >> level) & 1u) != 0u; ++level) sum = sample_sums[level] + sum;
    sample_sums[level] = sum;
}

#endif
