// What waits in an invocation's local memory: subtrees that are left for later, and what is not needed before the end. In
// registers the latter would cost: fewer rays run at a time on an H200, diffuse ones a twentieth slower (benches/EXPERIMENTS.md).
// Software drivers have registers enough, and pay for each store: there it stays in them. A part of
// accel.glsl.

// One pair of words for each level of a kd-tree (local_cells.glsl), then the two of keep_pair.
uvec2 local_memory[KD_MAX_DEPTH + 2u];
// Places of keep_pair: the bits of the nearest hit's weights u and v, and of two lengths of the ray's.
const uint WEIGHTS_PLACE = KD_MAX_DEPTH;
const uint LENGTHS_PLACE = KD_MAX_DEPTH + 1u;

vec2 pairs_in_registers[2];

void keep_pair(uint place, float x, float y) {
    if (RUNS_BOTH_SIDES) pairs_in_registers[place - KD_MAX_DEPTH] = vec2(x, y);
    else local_memory[place] = floatBitsToUint(vec2(x, y));
}

vec2 kept_pair(uint place) {
    return RUNS_BOTH_SIDES ? pairs_in_registers[place - KD_MAX_DEPTH] : uintBitsToFloat(local_memory[place]);
}
