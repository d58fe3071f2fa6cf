// Values in an invocation's local memory: pending subtrees, and values that are not needed before the end of the
// search. The latter would lower the occupancy if they were in registers: an H200 would run fewer rays at a time, and
// diffuse rays would be a twentieth slower (docs/experiments.md). Software drivers have enough registers and pay
// for each store, so there these values stay in registers. A part of accel.glsl.
//
// Needs layout.glsl and PREDICATES_BRANCHES. Provides `local_memory`, `spill_pair`, `spilled_pair`, `spill_words`,
// `spilled_words` and their slots, and with STOCHASTIC_ALPHA `spill_seed` and `spilled_seed`.

// Slots for spill_pair: the barycentric weights u and v of the nearest hit; the ray's t_start and t_max.
const uint WEIGHTS_SLOT = KD_MAX_DEPTH;
const uint LENGTHS_SLOT = KD_MAX_DEPTH + 1u;
// While a ray is in an instance: the ray of the world in three pairs, its place in the hierarchy, and the t of its
// nearest hit with the scale of t in the instance (accel.glsl).
const uint WORLD_RAY_SLOT = KD_MAX_DEPTH + 2u;
const uint TOP_CELL_SLOT = KD_MAX_DEPTH + 5u;
const uint TOP_LENGTHS_SLOT = KD_MAX_DEPTH + 6u;
#ifdef WITH_INSTANCES
const uint N_SPILLED_PAIRS = 7u;
#else
const uint N_SPILLED_PAIRS = 2u;
#endif

// A pair of words for each level of a kd-tree (kdtree/local_cells.glsl), then those of spill_pair, and in kernels that
// decide at random a pair for the seed.
#ifdef STOCHASTIC_ALPHA
uvec2 local_memory[KD_MAX_DEPTH + N_SPILLED_PAIRS + 1u];
#else
uvec2 local_memory[KD_MAX_DEPTH + N_SPILLED_PAIRS];
#endif

// The pairs of spill_pair on devices that keep them in registers.
uvec2 unspilled_pairs[N_SPILLED_PAIRS];

void spill_words(uint slot, uvec2 words) {
    if (PREDICATES_BRANCHES) unspilled_pairs[slot - KD_MAX_DEPTH] = words;
    else local_memory[slot] = words;
}

uvec2 spilled_words(uint slot) {
    return PREDICATES_BRANCHES ? unspilled_pairs[slot - KD_MAX_DEPTH] : local_memory[slot];
}

void spill_pair(uint slot, float x, float y) {
    spill_words(slot, floatBitsToUint(vec2(x, y)));
}

vec2 spilled_pair(uint slot) {
    return uintBitsToFloat(spilled_words(slot));
}

#ifdef STOCHASTIC_ALPHA
const uint SEED_SLOT = KD_MAX_DEPTH + N_SPILLED_PAIRS;
uint unspilled_seed;

void spill_seed(uint seed) {
    if (PREDICATES_BRANCHES) unspilled_seed = seed;
    else local_memory[SEED_SLOT].x = seed;
}

uint spilled_seed() {
    return PREDICATES_BRANCHES ? unspilled_seed : local_memory[SEED_SLOT].x;
}
#endif
