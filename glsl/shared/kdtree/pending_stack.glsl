// Pending subtrees on a stack in local memory, without bits and levels. A part of pending.glsl.
//
// Needs local_cells.glsl. Provides `stack_size`, `stack_push` and `stack_pop`.

// Entries on the stack.
uint stack_size;

void stack_push(Cell cell) {
    keep_cell(stack_size, cell);
    stack_size += 1u;
}

void stack_pop(inout Cell cell) {
    stack_size -= 1u;
    take_cell(stack_size, cell);
}
