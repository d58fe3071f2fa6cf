// Pending subtrees, kept as the constant TRAVERSAL says: one file for each way. A part of kdtree.glsl.

#include "kd_boxes.glsl"
#include "pending_mask.glsl"
#include "pending_stack.glsl"
#include "pending_restart.glsl"
#include "pending_short_stack.glsl"
#include "pending_mask_boxes.glsl"
#include "pending_backtrack.glsl"
#include "ropes.glsl"

void clear_pending() {
    pending_mask = uvec2(0u);
    stack_size = 0u;
    short_stack_top = 0u;
    short_stack_size = 0u;
    trail_length = 0u;
    siblings_done = uvec2(0u);
}

// A level down, where a bit is kept for each.
void go_down() {
    if (TRAVERSAL == TRAVERSAL_MASK_BOXES) siblings_done = below(siblings_done);
    if (TRAVERSAL == TRAVERSAL_MASK) mask_down();
    if (TRAVERSAL == TRAVERSAL_RESTART) marked_down();
    if (TRAVERSAL == TRAVERSAL_SHORT_STACK) marked_down();
}

// The sibling of the cell's node, to which the ray comes later, until it leaves the cell.
void push_pending(Cell cell) {
    // These find out on the way back.
    if (TRAVERSAL == TRAVERSAL_MASK_BOXES) return;
    if (TRAVERSAL == TRAVERSAL_BACKTRACK) return;
    if (TRAVERSAL == TRAVERSAL_MASK) mask_push(cell);
    else if (TRAVERSAL == TRAVERSAL_STACK) stack_push(cell);
    else marked_push(cell);
}

// Whether a pending cell may hold a hit nearer than t_best. Ways that have to look for it are in it then.
bool find_pending(TraversalRay ray, float t_best, inout Cell cell) {
    // What has not been visited begins where the leaf ends, or later.
    bool has_time = !(t_best < cell.t_exit);
    if (TRAVERSAL == TRAVERSAL_STACK) return has_time && stack_size > 0u;
    if (TRAVERSAL == TRAVERSAL_MASK_BOXES) return has_time && climb_by_boxes(ray, t_best, cell);
    if (TRAVERSAL == TRAVERSAL_BACKTRACK) return has_time && backtrack(ray, t_best, cell);
    if (TRAVERSAL == TRAVERSAL_ROPES) return has_time && cell.node_offset != 0u;
    return has_time && pending_mask != uvec2(0u);
}

// To the pending cell that was found, but for those that are there. It begins where the ray has left the last one.
void take_pending(TraversalRay ray, inout Cell cell) {
    if (TRAVERSAL == TRAVERSAL_MASK_BOXES) return;
    if (TRAVERSAL == TRAVERSAL_BACKTRACK) return;
    cell.t_enter = cell.t_exit;
    if (TRAVERSAL == TRAVERSAL_ROPES) return;
    if (TRAVERSAL == TRAVERSAL_MASK) mask_pop(cell);
    else if (TRAVERSAL == TRAVERSAL_STACK) stack_pop(cell);
    else marked_pop(ray, cell);
}
