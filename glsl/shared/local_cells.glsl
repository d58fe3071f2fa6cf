// Pending cells in local memory. A part of kdtree.glsl.
//
// A pending cell is kept as the node whose sibling it is, and the bits of where the ray leaves it. Where it begins is not
// kept: it is where the ray has just left the cell before.

void keep_cell(uint place, Cell cell) {
    local_memory[place] = uvec2(cell.node_offset, floatBitsToUint(cell.t_exit));
}

void take_cell(uint place, inout Cell cell) {
    // By its index: so a compiler knows that its lowest bits are zero.
    cell.node_offset = offset_of(node_ix_of(sibling_of(local_memory[place].x)));
    cell.t_exit = uintBitsToFloat(local_memory[place].y);
}
