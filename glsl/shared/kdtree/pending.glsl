// Pending subtrees, which the ray visits later. The macro TRAVERSAL selects the method by which they are kept.
// Each method has its own file. A part of kdtree.glsl.
//
// Needs TRAVERSAL, kd_nodes.glsl, local_cells.glsl and slab.glsl. Provides `clear_pending`, `go_down`,
// `push_pending`, `find_pending` and `take_pending`, and `descend_to_rope` of ropes.glsl.

#include "kdtree/kd_boxes.glsl"
#include "kdtree/pending_mask.glsl"
#include "kdtree/pending_stack.glsl"
#include "kdtree/pending_restart.glsl"
#include "kdtree/pending_short_stack.glsl"
#include "kdtree/pending_mask_boxes.glsl"
#include "kdtree/pending_backtrack.glsl"
#include "kdtree/ropes.glsl"

// Forgets all pending subtrees: a new ray begins.
void clear_pending() {
    pending_mask = uvec2(0u);
    stack_size = 0u;
    short_stack_top = 0u;
    short_stack_size = 0u;
    trail_length = 0u;
    siblings_done = uvec2(0u);
}

// Notes that the ray goes one level down. Only methods that keep a bit for each level do anything.
void go_down() {
    if (TRAVERSAL == TRAVERSAL_MASK_BOXES) siblings_done = mask_shifted_down(siblings_done);
    if (TRAVERSAL == TRAVERSAL_MASK) mask_down();
    if (TRAVERSAL == TRAVERSAL_RESTART) trail_down();
    if (TRAVERSAL == TRAVERSAL_SHORT_STACK) trail_down();
}

// Makes the sibling of the cell's node pending. The ray leaves that sibling at the cell's t_exit.
void push_pending(Cell cell) {
    // These methods store nothing here: they find pending subtrees on the way back up.
    if (TRAVERSAL == TRAVERSAL_MASK_BOXES) return;
    if (TRAVERSAL == TRAVERSAL_BACKTRACK) return;
    if (TRAVERSAL == TRAVERSAL_MASK) mask_push(cell);
    else if (TRAVERSAL == TRAVERSAL_STACK) stack_push(cell);
    else trail_push(cell);
}

// Returns whether there is a pending cell that may hold a hit nearer than t_best. Methods that have to search for
// that cell (TRAVERSAL_MASK_BOXES and TRAVERSAL_BACKTRACK) write it to `cell`.
bool find_pending(TraversalRay ray, float t_best, inout Cell cell) {
    // Every cell that has not been visited begins where the leaf ends, or later.
    bool has_time = !(t_best < cell.t_exit);
    if (TRAVERSAL == TRAVERSAL_STACK) return has_time && stack_size > 0u;
    if (TRAVERSAL == TRAVERSAL_MASK_BOXES) return has_time && climb_by_boxes(ray, t_best, cell);
    if (TRAVERSAL == TRAVERSAL_BACKTRACK) return has_time && backtrack(ray, t_best, cell);
    if (TRAVERSAL == TRAVERSAL_ROPES) return has_time && cell.node_offset != 0u;
    return has_time && pending_mask != uvec2(0u);
}

// Takes the pending cell that was found, unless `find_pending` has already done so. The cell begins at the t where
// the ray left the last one.
void take_pending(TraversalRay ray, inout Cell cell) {
    if (TRAVERSAL == TRAVERSAL_MASK_BOXES) return;
    if (TRAVERSAL == TRAVERSAL_BACKTRACK) return;
    cell.t_enter = cell.t_exit;
    if (TRAVERSAL == TRAVERSAL_ROPES) return;
    if (TRAVERSAL == TRAVERSAL_MASK) mask_pop(cell);
    else if (TRAVERSAL == TRAVERSAL_STACK) stack_pop(cell);
    else trail_pop(ray, cell);
}
