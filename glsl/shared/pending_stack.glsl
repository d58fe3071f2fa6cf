// Pending subtrees on a stack in local memory (local_cells.glsl): no bits, no levels.

uint stack_size;

void stack_push(Cell cell) {
    keep_cell(stack_size, cell);
    stack_size += 1u;
}

void stack_pop(inout Cell cell) {
    stack_size -= 1u;
    take_cell(stack_size, cell);
}
