// Pending subtrees on a short stack, which is a ring and keeps the newest ones (Horn, Sugerman, Houston, Hanrahan:
// Interactive k-D Tree GPU Raytracing, I3D 2007). Older ones, which the ring has lost, are found from the root by the
// mask (pending_restart.glsl). The paper finds them by a restart at the t where the ray left the leaf. Most rays lose
// no entry, so they never restart. A part of pending.glsl.
//
// Needs kd_nodes.glsl, pending_mask.glsl and pending_restart.glsl. Provides `trail_down`, `trail_push` and
// `trail_pop`, which serve both TRAVERSAL_SHORT_STACK and TRAVERSAL_RESTART: the latter never pushes to the ring.

// Each entry: offset of the node whose sibling is pending, and the bits of the t at which the ray leaves the sibling.
uvec2 short_stack[SHORT_STACK_SIZE];
// Number of the next entry. An entry's slot is its number modulo SHORT_STACK_SIZE.
uint short_stack_top;
// Number of entries that the ring holds.
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

void trail_down() {
    mask_down();
    trail_length += 1u;
}

void trail_push(Cell cell) {
    mask_mark();
    if (TRAVERSAL != TRAVERSAL_RESTART) short_stack_push(cell);
}

void trail_pop(TraversalRay ray, inout Cell cell) {
    if (short_stack_size > 0u) short_stack_pop(cell);
    else retrace(ray, cell);
}
