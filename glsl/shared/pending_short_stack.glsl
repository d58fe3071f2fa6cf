// The newest pending subtrees on a short stack, a ring; older ones, which it has lost, by a restart (Horn, Sugerman,
// Houston, Hanrahan: Interactive k-D Tree GPU Raytracing, I3D 2007). Most rays never need one.
//
// The mask counts what is pending, so that nothing is visited twice; the paper restarts where the ray left the leaf.

layout(constant_id = 3) const uint SHORT_STACK_SIZE = 4u;
uint short_stack_node_ix[SHORT_STACK_SIZE];
float short_stack_t_enter[SHORT_STACK_SIZE];
float short_stack_t_exit[SHORT_STACK_SIZE];
// Where the next entry goes, and how many are kept.
uint short_stack_top;
uint short_stack_size;

void short_stack_push(uint second_ix, Cell cell, vec2 t_cross) {
    mask_push(second_ix, cell, t_cross);
    short_stack_node_ix[short_stack_top] = second_ix;
    short_stack_t_enter[short_stack_top] = max(cell.t_enter, t_cross.x);
    short_stack_t_exit[short_stack_top] = cell.t_exit;
    short_stack_top = (short_stack_top + 1u) % SHORT_STACK_SIZE;
    short_stack_size = min(short_stack_size + 1u, SHORT_STACK_SIZE);
}

bool short_stack_pop(TraversalRay ray, float t_best, inout Cell cell) {
    while (short_stack_size > 0u) {
        short_stack_size -= 1u;
        short_stack_top = (short_stack_top + SHORT_STACK_SIZE - 1u) % SHORT_STACK_SIZE;
        uint depth = deepest_pending();
        pending_mask &= ~bit_of(depth);
        cell = Cell(short_stack_node_ix[short_stack_top], depth, short_stack_t_enter[short_stack_top],
                    short_stack_t_exit[short_stack_top]);
        if (cell.t_enter <= t_best) return true;
        // Older ones begin at most ray.overlap before it.
        t_deepest = cell.t_enter;
    }
    return restart_pop(ray, t_best, cell);
}
