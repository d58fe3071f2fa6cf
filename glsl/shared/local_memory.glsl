// What waits in an invocation's local memory: subtrees that are left for later, and what is not needed before the end. In
// registers the latter would cost: fewer rays run at a time on an H200, diffuse ones a twentieth slower (benches/EXPERIMENTS.md).
// Software drivers have registers enough, and pay for each store: there it stays in them. A part of
// accel.glsl.

// One pair of words for each level of a kd-tree (local_cells.glsl), then the two of spill_pair.
uvec2 local_memory[KD_MAX_DEPTH + 2u];
// Places of spill_pair: the bits of the nearest hit's weights u and v, and of two lengths of the ray's.
const uint WEIGHTS_SLOT = KD_MAX_DEPTH;
const uint LENGTHS_SLOT = KD_MAX_DEPTH + 1u;

vec2 unspilled_pairs[2];

void spill_pair(uint place, float x, float y) {
    if (PREDICATES_BRANCHES) unspilled_pairs[place - KD_MAX_DEPTH] = vec2(x, y);
    else local_memory[place] = floatBitsToUint(vec2(x, y));
}

vec2 spilled_pair(uint place) {
    return PREDICATES_BRANCHES ? unspilled_pairs[place - KD_MAX_DEPTH] : uintBitsToFloat(local_memory[place]);
}
