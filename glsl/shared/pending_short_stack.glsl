// The newest pending subtrees on a short stack, a ring; older ones, which it has lost, by the mask, down to them from the
// root (Horn, Sugerman, Houston, Hanrahan: Interactive k-D Tree GPU Raytracing, I3D 2007; there the ray restarts where it
// left the leaf). Most rays lose none.

// Node, and the bits of where the ray leaves it.
uvec2 short_stack[SHORT_STACK_SIZE];
// Where the next entry goes, and how many are kept.
uint short_stack_top;
uint short_stack_size;

void short_stack_push(Cell cell) {
    short_stack[short_stack_top % SHORT_STACK_SIZE] = uvec2(cell.node_offset, floatBitsToUint(cell.t_exit));
    short_stack_top += 1u;
    short_stack_size = min(short_stack_size + 1u, SHORT_STACK_SIZE);
}

void short_stack_pop(inout Cell cell) {
    short_stack_size -= 1u;
    short_stack_top -= 1u;
    uvec2 entry = short_stack[short_stack_top % SHORT_STACK_SIZE];
    cell = Cell(sibling_of(entry.x), cell.t_enter, uintBitsToFloat(entry.y));
    trail_length -= mask_up();
}

void marked_down() {
    mask_down();
    trail_length += 1u;
}

void marked_push(Cell cell) {
    mark();
    if (TRAVERSAL != TRAVERSAL_RESTART) short_stack_push(cell);
}

void marked_pop(TraversalRay ray, inout Cell cell) {
    if (short_stack_size > 0u) short_stack_pop(cell);
    else retrace(ray, cell);
}
