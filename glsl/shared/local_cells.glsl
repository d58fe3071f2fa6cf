// What waits in an invocation's local memory: subtrees that are left for later, and what is not needed before the end. In
// registers the latter would cost: fewer rays run at a time on an H200, diffuse ones a twentieth slower (benches/EXPERIMENTS.md).
// Software drivers have registers enough, and pay for each store: there it stays in them.

// A pending cell: the node whose sibling it is, and the bits of where the ray leaves it. Where it begins is not kept: it is
// where the ray has just left the cell before.
uvec2 local_cells[KD_MAX_DEPTH + 2u];
// Behind the cells: the bits of the nearest hit's weights u and v, and of two lengths of the ray's.
const uint WEIGHTS_PLACE = KD_MAX_DEPTH;
const uint LENGTHS_PLACE = KD_MAX_DEPTH + 1u;

vec2 pairs_in_registers[2];

void keep_pair(uint place, float x, float y) {
    if (RUNS_BOTH_SIDES) pairs_in_registers[place - KD_MAX_DEPTH] = vec2(x, y);
    else local_cells[place] = floatBitsToUint(vec2(x, y));
}

vec2 kept_pair(uint place) {
    return RUNS_BOTH_SIDES ? pairs_in_registers[place - KD_MAX_DEPTH] : uintBitsToFloat(local_cells[place]);
}

void keep_cell(uint place, Cell cell) {
    local_cells[place] = uvec2(cell.node_at, floatBitsToUint(cell.t_exit));
}

void take_cell(uint place, inout Cell cell) {
    // By its index: so a compiler knows that its lowest bits are zero.
    cell.node_at = place_of(index_of(sibling_of(local_cells[place].x)));
    cell.t_exit = uintBitsToFloat(local_cells[place].y);
}
