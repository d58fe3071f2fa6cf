// Pending subtrees on an array in local memory: no bits, no climbing, 8 bytes a level. Where a pending cell begins is
// not kept: it is where the ray has just left the cell before it.

// Node, and the bits of where the ray leaves it.
uvec2 stack[KD_MAX_DEPTH];
uint stack_size;

void stack_push(uint second_ix, Cell cell) {
    stack[stack_size] = uvec2(second_ix, floatBitsToUint(cell.t_exit));
    stack_size += 1u;
}

bool stack_pop(float t_best, inout Cell cell) {
    cell.t_enter = cell.t_exit;
    if (stack_size == 0u || t_best < cell.t_enter) return false;
    stack_size -= 1u;
    cell.node_ix = stack[stack_size].x;
    cell.t_exit = uintBitsToFloat(stack[stack_size].y);
    return true;
}
