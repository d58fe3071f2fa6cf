// Depth-first traversal of the kd-tree (the paper's section 2.3, Algorithm 2), closest hit or any hit.
//
// A cell is a node and the interval [t_enter, t_exit] that the ray spends in it. Children come in the ray's order:
// `first` is the one on the side that the ray comes from. A subtree that is left for later is pending; how pending
// subtrees are kept is the variant (pending_*.glsl). A part of accel.glsl, which calls `search_kdtree`.

layout(constant_id = CONSTANT_TRAVERSAL) const uint TRAVERSAL = TRAVERSAL_MASK;

#include "kd_nodes.glsl"
#include "local_cells.glsl"
#include "slab.glsl"
#include "pending.glsl"
#include "leaf.glsl"
#include "resume.glsl"

// From a split to the child where the ray enters the cell. A NaN fails both tests and goes to the first child: it ends.
KdNode step_down(TraversalRay ray, KdNode node, inout Cell cell) {
    float t_cross = crossing(ray, node);
    bool only_second = t_cross < cell.t_enter;
    go_down();
    cell.node_offset = child_of(ray, node, only_second);
    node = kd_node(cell.node_offset);
    if (!only_second && t_cross <= cell.t_exit) {
        push_pending(cell);
        cell.t_exit = t_cross;
    }
    return node;
}

// Down to the leaf where the ray enters the cell, or to a slab that it keeps clear of, as if that were an empty leaf.
KdNode descend(TraversalRay ray, float t_best, inout Cell cell) {
    KdNode node = kd_node(cell.node_offset);
    for (;;) {
        while (is_open_split(node)) node = step_down(ray, node, cell);
        if (!has_slab(node)) return node;
        node = enter_slab(ray, t_best, cell, node);
    }
}

// Down to the leaf where the ray enters the cell, for lockstep.glsl.
KdNode descend_in_step(TraversalRay ray, inout Cell cell) {
    KdNode node = kd_node(cell.node_offset);
    while (!is_leaf(node)) {
        node = step_down(ray, node, cell);
        if (is_leaf(node)) break;
    }
    return node;
}

Visit next_leaf(TraversalRay ray, float t_best, inout Cell cell) {
    KdNode leaf;
    if (TRAVERSAL == TRAVERSAL_ROPES) leaf = descend_to_rope(ray, t_best, cell);
    else if (PREDICATES_BRANCHES) leaf = descend_in_step(ray, cell);
    else leaf = descend(ray, t_best, cell);
    return visit_leaf(leaf, cell.t_enter, min(cell.t_exit, t_best));
}

// Turn by turn, each a test or a leaf: lanes that test and lanes that go on each keep together. Of two loops in one another
// the outer waits, for all lanes' leaves or for each lane's tests. Returns 0, or the mark of a ray that has stalled.
uint search_by_turns(TraversalRay ray, bool any_hit, inout Nearest best) {
    if (!is_in(ray)) return 0u;
    Cell cell = whole(ray);
    Visit visit;
    if (is_resumed()) resume(ray, cell, visit, best);
    else visit = next_leaf(ray, best.t, cell);
    uint mark = 0u;
    bool goes_on = true;
    do {
        count_turn();
        uint entry_ix;
        if (find_candidate(ray, visit, entry_ix)) {
            LeafTriangle entry = leaf_triangle_at(entry_ix);
            intersect(ray, corners_of(entry), entry.triangle_ix, best);
            goes_on = !is_done(any_hit, best);
        } else if (has_turns()) {
            goes_on = find_pending(ray, best.t, cell);
            if (goes_on) {
                take_pending(ray, cell);
                visit = next_leaf(ray, best.t, cell);
            }
        }
        if (goes_on && !has_turns()) {
            mark = stall_at(cell, visit, best);
            goes_on = false;
        }
    } while (goes_on);
    return mark;
}

#include "lockstep.glsl"
#include "brute.glsl"

// Goes through all leaves that the ray meets in [t_enter, t_exit], until nothing nearer can follow. Returns 0, or the mark of
// a ray that has stalled.
uint search_kdtree(TraversalRay ray, bool any_hit, inout Nearest best) {
    if (TRAVERSAL == TRAVERSAL_BRUTE) return intersect_all(ray, any_hit, best);
    clear_pending();
    if (PREDICATES_BRANCHES) return search_in_step(ray, any_hit, best);
    return search_by_turns(ray, any_hit, best);
}
