// Bins of a cell: on each axis, KD_BINS ranges of the same length. A bin has four words, each 0 at first: the numbers
// of references that begin and that end in it, the inverse of the least begin, and the greatest end, as integers of the
// order of floats.
#ifndef KDRAY_KD_BINS
#define KDRAY_KD_BINS

#include "kdtree_build/kd_areas.glsl"

#define BIN_BEGINS 0u
#define BIN_ENDS 1u
#define BIN_LEAST 2u
#define BIN_GREATEST 3u

shared uint bins[KD_BIN_WORDS];

uint word_of(uint axis, uint kind, uint bin) {
    return (axis * 4u + kind) * KD_BINS + bin;
}

// The bin of a position. A greater position never has a lower bin.
uint bin_of(Areas areas, float position) {
    precise float at = fraction_of(areas, position) * float(KD_BINS);
    return uint(clamp(at, 0.0, float(KD_BINS - 1u)));
}

void clear_bins() {
    for (uint i = gl_LocalInvocationIndex; i < KD_BIN_WORDS; i += SCAN_GROUP_SIZE) bins[i] = 0u;
}

void count_in_bins(Areas areas[3], vec3 low, vec3 high) {
    for (uint axis = 0u; axis < 3u; ++axis) {
        if (areas[axis].slope < 0.0) continue;
        uint begin = bin_of(areas[axis], low[axis]), end = bin_of(areas[axis], high[axis]);
        atomicAdd(bins[word_of(axis, BIN_BEGINS, begin)], 1u);
        atomicAdd(bins[word_of(axis, BIN_ENDS, end)], 1u);
        atomicMax(bins[word_of(axis, BIN_LEAST, begin)], ~ordered(low[axis]));
        atomicMax(bins[word_of(axis, BIN_GREATEST, end)], ordered(high[axis]));
    }
}

#endif
