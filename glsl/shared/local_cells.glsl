// What waits in an invocation's local memory: subtrees that are left for later, and of the nearest hit what is not needed before
// the end.

// A pending cell: the node whose sibling it is, and the bits of where the ray leaves it. Where it begins is not kept: it is
// where the ray has just left the cell before. The last place holds the bits of the nearest hit's weights u and v: in registers
// they would cost rays 1 % of their speed on an H200.
uvec2 local_cells[KD_MAX_DEPTH + 1u];
const uint WEIGHTS_PLACE = KD_MAX_DEPTH;

void keep_cell(uint place, Cell cell) {
    local_cells[place] = uvec2(cell.node_at, floatBitsToUint(cell.t_exit));
}

void take_cell(uint place, inout Cell cell) {
    cell.node_at = sibling_of(local_cells[place].x);
    cell.t_exit = uintBitsToFloat(local_cells[place].y);
}
