#version 460
#extension GL_GOOGLE_include_directive : require
// Grid, descend: the only invocation makes the pairs of the upper level the items of the lower one and prepares the
// first attempt.
// Reads and writes build.
#include "grid/grid_attempt.glsl"

layout(local_size_x = 1) in;

void main() {
    build.n_items = build.n_pairs;
    build.n_attempts = 0u;
    build.counts = GRID_COUNTS_CELLS;
    size_dispatches();
}
