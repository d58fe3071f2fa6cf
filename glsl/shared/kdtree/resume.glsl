// Stores the state of a suspended ray's traversal, and resumes the traversal where it stopped. A part of kdtree.glsl.
//
// Needs search/suspended_rays.glsl, search/steps.glsl, search/local_memory.glsl, search/candidate.glsl, kd_nodes.glsl,
// pending.glsl and search/leaf.glsl. Provides `suspend_at` and `resume`.

// Stores the state of the ray, and returns the mark for its result.
uint suspend_at(Cell cell, Visit visit, Nearest best) {
    vec2 weights = spilled_pair(WEIGHTS_SLOT);
    return suspend(SuspendedRay(
        cell.node_offset, cell.t_enter, cell.t_exit, visit.entry_ix, visit.end_ix,
        best.t, best.triangle_ix, weights.x, weights.y, steps_so_far(), siblings_done,
        outer.top_node, outer.top_pending, outer.t, outer.triangle_ix
    ));
}

// Walks from the root to a node, so that the same subtrees are pending as when the ray first came to the node. The
// path is found by the links to parents. Every crossing is computed by the same operations as the first time, so it
// has the same bits.
void walk_to(TraversalRay ray, uint node_offset) {
    // Bit i, counted over both words, belongs to the node on the path that is i levels above node_offset. It tells
    // whether this node is its parent's upper child, on the positive side of the split plane.
    uvec2 path = uvec2(0u);
    uint n_levels = 0u;
    for (uint at = node_offset; at != root_offset(); at = offset_of(kd_parent_of(node_ix_of(at)))) {
        uint bit = (node_ix_of(at) & 1u) << (n_levels % 32u);
        if (n_levels < 32u) path.x |= bit;
        else path.y |= bit;
        n_levels += 1u;
    }
    Cell cell = root_cell(ray);
    while (n_levels > 0u) {
        n_levels -= 1u;
        uint is_above = ((n_levels < 32u ? path.x : path.y) >> (n_levels % 32u)) & 1u;
        KdNode node = kd_node_at(node_ix_of(cell.node_offset));
        float t_cross = crossing(ray, node);
        bool meets_both = !(t_cross < cell.t_enter) && t_cross <= cell.t_exit;
        go_down();
        uint first_at = first_child(ray, node);
        cell.node_offset = (first_at & ~KD_NODE_BYTES) | (is_above * KD_NODE_BYTES);
        if (!meets_both) continue;
        if (cell.node_offset == first_at) {
            push_pending(cell);
            cell.t_exit = t_cross;
        } else {
            cell.t_enter = t_cross;
        }
    }
}

// Loads the ray's stored state.
void resume(TraversalRay ray, out Cell cell, out Visit visit, out Nearest best) {
    SuspendedRay state = suspended_rays[resumed_slot];
    cell = Cell(state.node_offset, state.t_enter, state.t_exit);
    best = Nearest(state.t_best, state.triangle_ix);
    spill_pair(WEIGHTS_SLOT, state.u, state.v);
    visit = Visit(state.entry_ix, state.end_ix, interval_of(cell.t_enter, min(cell.t_exit, best.t)));
    count_steps(state.n_steps);
    siblings_done = state.siblings_done;
    resumes = false;
    // These methods find pending subtrees on the way back up, or by a rope, so nothing has to be rebuilt.
    if (TRAVERSAL == TRAVERSAL_MASK_BOXES) return;
    if (TRAVERSAL == TRAVERSAL_BACKTRACK) return;
    if (TRAVERSAL == TRAVERSAL_ROPES) return;
    walk_to(ray, cell.node_offset);
}
