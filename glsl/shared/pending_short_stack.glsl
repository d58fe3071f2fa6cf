// The newest pending subtrees on a short stack, a ring; older ones, which it has lost, by a restart (Horn, Sugerman,
// Houston, Hanrahan: Interactive k-D Tree GPU Raytracing, I3D 2007). Most rays never need one.
//
// The mask counts what is pending, so that nothing is visited twice; the paper restarts where the ray left the leaf.

layout(constant_id = 3) const uint SHORT_STACK_SIZE = 4u;
// Node, and the bits of where the ray leaves it.
uvec2 short_stack[SHORT_STACK_SIZE];
// Where the next entry goes, and how many are kept.
uint short_stack_top;
uint short_stack_size;

void short_stack_push(uint second_ix, Cell cell, vec2 t_cross) {
    mask_push(second_ix, cell, t_cross);
    short_stack[short_stack_top] = uvec2(second_ix, floatBitsToUint(cell.t_exit));
    short_stack_top = (short_stack_top + 1u) % SHORT_STACK_SIZE;
    short_stack_size = min(short_stack_size + 1u, SHORT_STACK_SIZE);
}

bool short_stack_pop(TraversalRay ray, float t_best, inout Cell cell) {
    if (short_stack_size == 0u) return restart_pop(ray, t_best, cell);
    cell.t_enter = cell.t_exit - ray.overlap;
    if (t_best < cell.t_enter) return false;
    short_stack_size -= 1u;
    short_stack_top = (short_stack_top + SHORT_STACK_SIZE - 1u) % SHORT_STACK_SIZE;
    cell.node_ix = short_stack[short_stack_top].x;
    cell.t_exit = uintBitsToFloat(short_stack[short_stack_top].y);
    cell.depth = deepest_pending();
    pending_mask &= ~bit_of(cell.depth);
    return true;
}
