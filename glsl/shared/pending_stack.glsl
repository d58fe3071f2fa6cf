// Pending subtrees on an array in local memory: no bits, no climbing, 12 bytes a level.

uint stack_node_ix[KD_MAX_DEPTH];
float stack_t_enter[KD_MAX_DEPTH];
float stack_t_exit[KD_MAX_DEPTH];
uint stack_size;

void stack_push(uint second_ix, Cell cell, vec2 t_cross) {
    stack_node_ix[stack_size] = second_ix;
    stack_t_enter[stack_size] = max(cell.t_enter, t_cross.x);
    stack_t_exit[stack_size] = cell.t_exit;
    stack_size += 1u;
}

bool stack_pop(float t_best, inout Cell cell) {
    while (stack_size > 0u) {
        stack_size -= 1u;
        cell.node_ix = stack_node_ix[stack_size];
        cell.t_enter = stack_t_enter[stack_size];
        cell.t_exit = min(stack_t_exit[stack_size], t_best);
        if (cell.t_enter <= t_best) return true;
    }
    return false;
}
