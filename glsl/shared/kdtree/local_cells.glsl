// Pending cells in local memory. A part of kdtree.glsl.
//
// An entry holds the offset of the node whose sibling is pending, and the bits of the t at which the ray leaves that
// sibling. The t at which it enters is not stored: it is the t at which the ray has just left the cell before.
//
// Needs kd_nodes.glsl and search/local_memory.glsl. Provides `keep_cell` and `take_cell`. slot: index below
// KD_MAX_DEPTH.

void keep_cell(uint slot, Cell cell) {
    local_memory[slot] = uvec2(cell.node_offset, floatBitsToUint(cell.t_exit));
}

void take_cell(uint slot, inout Cell cell) {
    // The offset is computed from the node's index, so that a compiler knows that its lowest bits are zero.
    cell.node_offset = offset_of(node_ix_of(sibling_of(local_memory[slot].x)));
    cell.t_exit = uintBitsToFloat(local_memory[slot].y);
}
