// Depth-first traversal of the kd-tree (the paper's section 2.3, Algorithm 2), closest hit or any hit. A part of
// search/accel.glsl.
//
// A `Cell` is a node and the interval [t_enter, t_exit] that the ray spends in the node's box. "A node's cell", which
// other files use, is that box. Children are visited in the ray's order: the first child is the one on the side that
// the ray comes from, the second child is the other one. A subtree that is left for later is pending. The variants of
// the traversal differ in how they keep pending subtrees (pending_*.glsl).
//
// Needs scene.glsl, search/suspended_rays.glsl, search/steps.glsl, search/traversal_ray.glsl, search/local_memory.glsl,
// search/candidate.glsl and PREDICATES_BRANCHES, and the macro TRAVERSAL. Provides `search_kdtree`, and with
// search/leaf.glsl the `Visit` that grid/grid.glsl uses, too.

#include "kdtree/kd_nodes.glsl"
#include "kdtree/local_cells.glsl"
#include "kdtree/slab.glsl"
#include "kdtree/pending.glsl"
#include "search/leaf.glsl"
#include "kdtree/resume.glsl"

// Steps from a split to the child in which the ray enters the cell. If t_cross is NaN, both comparisons fail and the
// ray goes to the first child alone, so that the traversal ends.
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

// Descends to the leaf in which the ray enters the cell. If the ray keeps clear of a node's slab on the way, returns
// an empty leaf in place of that node.
KdNode descend(TraversalRay ray, float t_best, inout Cell cell) {
    KdNode node = kd_node(cell.node_offset);
    for (;;) {
        while (is_open_split(node)) node = step_down(ray, node, cell);
        if (!has_slab(node)) return node;
        node = enter_slab(ray, t_best, cell, node);
    }
}

// Descends to the leaf in which the ray enters the cell, for lockstep.glsl. Ignores slabs.
KdNode descend_in_step(TraversalRay ray, inout Cell cell) {
    KdNode node = kd_node(cell.node_offset);
    while (!is_leaf(node)) {
        node = step_down(ray, node, cell);
        if (is_leaf(node)) break;
    }
    return node;
}

// Descends from the cell to a leaf, as the traversal and the device require, and begins the visit to it.
Visit next_leaf(TraversalRay ray, float t_best, inout Cell cell) {
    KdNode leaf;
    if (TRAVERSAL == TRAVERSAL_ROPES) leaf = descend_to_rope(ray, t_best, cell);
    else if (PREDICATES_BRANCHES) leaf = descend_in_step(ray, cell);
    else leaf = descend(ray, t_best, cell);
    return visit_leaf(leaf, cell.t_enter, min(cell.t_exit, t_best));
}

// Searches in one loop, each of whose iterations either tests a triangle or goes on to the next leaf. So lanes that
// test stay together, and so do lanes that go on. If an iteration tested all triangles of a leaf instead, lanes with
// few triangles would wait for lanes with many. If an iteration went from leaf to leaf until it has a triangle to test,
// lanes that have one would wait for lanes that still seek. Returns 0, or the mark of a ray that was suspended.
uint search_in_one_loop(TraversalRay ray, bool any_hit, inout Nearest best) {
    if (!is_in(ray)) return 0u;
    Cell cell = root_cell(ray);
    Visit visit;
    if (is_resumed()) resume(ray, cell, visit, best);
    else visit = next_leaf(ray, best.t, cell);
    uint mark = 0u;
    bool goes_on = true;
    do {
        count_iteration();
        uint entry_ix;
        if (find_candidate(ray, visit, entry_ix)) {
            LeafTriangle entry = leaf_triangle_at(entry_ix);
            intersect(ray, corners_of(entry), entry.triangle_ix, best);
            goes_on = !is_done(any_hit, best);
        } else if (has_iterations()) {
            goes_on = find_pending(ray, best.t, cell);
            if (goes_on) {
                take_pending(ray, cell);
                visit = next_leaf(ray, best.t, cell);
            }
        }
        if (goes_on && !has_iterations()) {
            mark = suspend_at(cell, visit, best);
            goes_on = false;
        }
    } while (goes_on);
    return mark;
}

#include "kdtree/lockstep.glsl"
#include "search/brute.glsl"

// Visits all leaves that the ray meets in [t_enter, t_exit], until no nearer hit can follow. With any_hit, the first
// hit ends the search. TRAVERSAL_BRUTE tests all triangles instead. Returns 0, or the mark of a ray that was suspended.
uint search_kdtree(TraversalRay ray, bool any_hit, inout Nearest best) {
    if (TRAVERSAL == TRAVERSAL_BRUTE) return intersect_all(ray, any_hit, best);
    clear_pending();
    if (PREDICATES_BRANCHES) return search_in_step(ray, any_hit, best);
    return search_in_one_loop(ray, any_hit, best);
}
