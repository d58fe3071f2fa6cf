// Values in an invocation's local memory: pending subtrees, and values that are not needed before the end of the
// search. The latter would lower the occupancy if they were in registers: an H200 would run fewer rays at a time, and
// diffuse rays would be a twentieth slower (docs/experiments.md). Software drivers have enough registers and pay
// for each store, so there these values stay in registers. A part of accel.glsl.
//
// Needs layout.glsl and PREDICATES_BRANCHES. Provides `local_memory`, `spill_pair`, `spilled_pair` and their slots,
// and with STOCHASTIC_ALPHA `spill_seed` and `spilled_seed`.

// A pair of words for each level of a kd-tree (kdtree/local_cells.glsl), then two pairs for spill_pair, and in kernels
// that decide at random a pair for the seed.
#ifdef STOCHASTIC_ALPHA
uvec2 local_memory[KD_MAX_DEPTH + 3u];
#else
uvec2 local_memory[KD_MAX_DEPTH + 2u];
#endif
// Slots for spill_pair: the barycentric weights u and v of the nearest hit; the ray's t_start and t_max.
const uint WEIGHTS_SLOT = KD_MAX_DEPTH;
const uint LENGTHS_SLOT = KD_MAX_DEPTH + 1u;

// The pairs of spill_pair on devices that keep them in registers.
vec2 unspilled_pairs[2];

void spill_pair(uint slot, float x, float y) {
    if (PREDICATES_BRANCHES) unspilled_pairs[slot - KD_MAX_DEPTH] = vec2(x, y);
    else local_memory[slot] = floatBitsToUint(vec2(x, y));
}

vec2 spilled_pair(uint slot) {
    return PREDICATES_BRANCHES ? unspilled_pairs[slot - KD_MAX_DEPTH] : uintBitsToFloat(local_memory[slot]);
}

#ifdef STOCHASTIC_ALPHA
const uint SEED_SLOT = KD_MAX_DEPTH + 2u;
uint unspilled_seed;

void spill_seed(uint seed) {
    if (PREDICATES_BRANCHES) unspilled_seed = seed;
    else local_memory[SEED_SLOT].x = seed;
}

uint spilled_seed() {
    return PREDICATES_BRANCHES ? unspilled_seed : local_memory[SEED_SLOT].x;
}
#endif
