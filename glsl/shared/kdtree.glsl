// Depth-first traversal of the kd-tree (the paper's section 2.3, Algorithm 2), closest hit or any hit.
//
// A cell is a node and the interval [t_enter, t_exit] that the ray spends in it. Children come in the ray's order:
// `first` is the one on the side that the ray comes from. A subtree that is left for later is pending; how pending
// subtrees are kept is the variant (pending_*.glsl).
#ifndef KDRAY_KDTREE
#define KDRAY_KDTREE

#include "layout.glsl"
#include "scene.glsl"
#include "steps.glsl"
#include "triangle.glsl"

layout(std140, set = 0, binding = BIND_FRAME) uniform FrameBlock { Frame frame; };

layout(constant_id = 0) const uint TRAVERSAL = TRAVERSAL_MASK;
// Whether the device runs both sides of a branch for all lanes, as software drivers do. A slab, looked at before what is in
// it, or a triangle's plane then spare nothing, and tests are best done leaf by leaf.
layout(constant_id = 4) const bool RUNS_BOTH_SIDES = false;

struct Cell {
    uint node_ix;
    uint depth;
    float t_enter;
    float t_exit;
};

// What the traversal needs of a ray. It meets the plane at x on an axis at t = x * inv_direction + bias.
//
// This t is rounded, and taken as exact: that is the same as if the plane lay a little off, and a leaf has all triangles
// that come so near to it (kdtree/bounds.rs). The hit test's rounding is allowed for there too. So what brute force
// finds, the traversal finds, along planes and through corners of cells as elsewhere.
struct TraversalRay {
    Shear shear;
    vec3 direction;
    vec3 inv_direction;
    vec3 bias;
    float t_min;
    float t_enter;
    float t_exit;
    uint source_triangle;
};

TraversalRay traversal_ray(Ray ray, float t_min) {
    TraversalRay r;
    r.shear = shear_of(ray.origin, ray.direction);
    r.direction = ray.direction;
    r.source_triangle = ray.source_triangle;
    r.t_min = t_min;
    // A direction in the plane is taken as all but in it: finite everywhere, and one rule for all ties.
    vec3 tiny = vec3(1e-12);
    r.inv_direction = 1.0 / mix(ray.direction, tiny, lessThan(abs(ray.direction), tiny));
    r.bias = -ray.origin * r.inv_direction;
    precise vec3 t0 = fma(frame.cell_min, r.inv_direction, r.bias);
    precise vec3 t1 = fma(frame.cell_max, r.inv_direction, r.bias);
    vec3 near = min(t0, t1);
    vec3 far = max(t0, t1);
    r.t_enter = max(max(near.x, near.y), max(near.z, t_min));
    r.t_exit = min(min(far.x, far.y), min(far.z, ray.t_max));
    return r;
}

float largest_coordinate() {
    vec3 largest = max(abs(frame.cell_min), abs(frame.cell_max));
    return max(largest.x, max(largest.y, largest.z));
}

// The ray with its origin moved along it to lie within KD_ORIGIN_REACH. t_start: how far; 0 for all but cameras far away.
Ray near_scene(Ray ray, out float t_start) {
    vec3 away = abs(ray.origin);
    t_start = 0.0;
    if (max(away.x, max(away.y, away.z)) <= KD_ORIGIN_REACH * largest_coordinate()) return ray;
    t_start = max(traversal_ray(ray, 0.0).t_enter, 0.0);
    precise vec3 origin = ray.origin + t_start * ray.direction;
    ray.origin = origin;
    ray.t_max -= t_start;
    return ray;
}

KdNode kd_node(uint node_ix) {
    count_steps(1u);
    return kd_node_at(node_ix);
}

uint axis_of(KdNode node) {
    return node.axis_and_child & KD_AXIS_MASK;
}

float along(vec3 v, uint axis) {
    return axis == 0u ? v.x : (axis == 1u ? v.y : v.z);
}

// Where the ray meets the split plane. `precise`: a traversal that comes the same way again must come to the same bits.
float crossing(TraversalRay ray, KdNode node) {
    uint axis = axis_of(node);
    precise float t = fma(uintBitsToFloat(node.split_or_first), along(ray.inv_direction, axis), along(ray.bias, axis));
    return t;
}

// The child on the side that the ray comes from, or the other one.
uint child_of(TraversalRay ray, KdNode node, bool second) {
    bool is_above = (along(ray.inv_direction, axis_of(node)) < 0.0) != second;
    return (node.axis_and_child >> KD_CHILD_SHIFT) + (is_above ? 1u : 0u);
}

uint first_child(TraversalRay ray, KdNode node) {
    return child_of(ray, node, false);
}

#include "slab.glsl"
#include "pending_mask.glsl"
#include "pending_stack.glsl"
#include "pending_restart.glsl"
#include "pending_short_stack.glsl"
#include "kd_boxes.glsl"
#include "pending_mask_boxes.glsl"
#include "pending_backtrack.glsl"
#include "ropes.glsl"

void clear_pending() {
    pending_mask = uvec2(0u);
    stack_size = 0u;
    short_stack_top = 0u;
    short_stack_size = 0u;
    siblings_done = uvec2(0u);
}

void push_pending(uint second_ix, Cell cell) {
    // These find out on the way back.
    if (TRAVERSAL == TRAVERSAL_MASK_BOXES) return;
    if (TRAVERSAL == TRAVERSAL_BACKTRACK) return;
    if (TRAVERSAL == TRAVERSAL_MASK) mask_push(second_ix, cell);
    else if (TRAVERSAL == TRAVERSAL_STACK) stack_push(second_ix, cell);
    else marked_push(second_ix, cell);
}

// The next pending cell that may hold a hit nearer than t_best, or false.
bool pop_pending(TraversalRay ray, float t_best, inout Cell cell) {
    if (TRAVERSAL == TRAVERSAL_MASK) return mask_pop(t_best, cell);
    if (TRAVERSAL == TRAVERSAL_STACK) return stack_pop(t_best, cell);
    if (TRAVERSAL == TRAVERSAL_MASK_BOXES) return mask_boxes_pop(ray, t_best, cell);
    if (TRAVERSAL == TRAVERSAL_BACKTRACK) return backtrack_pop(ray, t_best, cell);
    if (TRAVERSAL == TRAVERSAL_ROPES) return follow_rope(t_best, cell);
    return marked_pop(ray, t_best, cell);
}

// Down to the leaf where the ray enters the cell, or to a slab that it keeps clear of, as if that were an empty leaf. A NaN
// fails both tests and goes to the first child: it ends.
KdNode descend(TraversalRay ray, float t_best, inout Cell cell) {
    KdNode node = kd_node(cell.node_ix);
    for (;;) {
        while (is_open_split(node)) {
            float t_cross = crossing(ray, node);
            bool in_first = t_cross >= cell.t_enter;
            bool in_second = t_cross <= cell.t_exit;
            cell.depth += 1u;
            cell.node_ix = child_of(ray, node, in_second && !in_first);
            node = kd_node(cell.node_ix);
            if (in_first && in_second) {
                push_pending(cell.node_ix ^ 1u, cell);
                cell.t_exit = t_cross;
            }
        }
        if (!has_slab(node)) return node;
        node = enter_slab(ray, t_best, cell, node);
    }
}

// A triangle against the ray; of two hits at one t the lower index wins, whatever the order of triangles.
void intersect(TraversalRay ray, uint triangle_ix, inout Hit best) {
    Hit hit;
    if (!intersect_triangle(ray.shear, triangle_at(triangle_ix), triangle_ix, hit)) return;
    bool nearer = hit.t < best.t || (hit.t == best.t && triangle_ix < best.triangle_ix);
    if (hit.t > ray.t_min && nearer && triangle_ix != ray.source_triangle) best = hit;
}

// A ray's way through a leaf, with the entries that are still to be looked at.
struct Visit {
    uint entry_ix;
    uint end_ix;
    Stretch way;
};

Visit visit_leaf(KdNode leaf, float t_enter, float t_exit) {
    uint n_entries = leaf.axis_and_child >> KD_CHILD_SHIFT;
    count_steps(n_entries);
    return Visit(leaf.split_or_first, leaf.split_or_first + n_entries, stretch(t_enter, t_exit));
}

// On to the leaf's next triangle whose plane the ray meets on its way. It may meet the others' planes elsewhere, in leaves
// that have those triangles too: most are in several, so most tests are spared.
bool find_candidate(TraversalRay ray, inout Visit visit, out uint entry_ix) {
    while (visit.entry_ix < visit.end_ix) {
        entry_ix = visit.entry_ix;
        visit.entry_ix += 1u;
        if (RUNS_BOTH_SIDES) return true;
        if (!is_clear(ray, visit.way, leaf_plane_at(entry_ix), frame.plane_reach)) return true;
    }
    return false;
}

void intersect_rest(TraversalRay ray, inout Visit visit, inout Hit best) {
    uint entry_ix;
    while (find_candidate(ray, visit, entry_ix)) intersect(ray, leaf_triangle_at(entry_ix), best);
}

bool is_done(bool any_hit, Hit best) {
    return any_hit && best.triangle_ix != NO_TRIANGLE;
}

Visit next_leaf(TraversalRay ray, float t_best, inout Cell cell) {
    KdNode leaf;
    if (TRAVERSAL == TRAVERSAL_ROPES) leaf = descend_to_rope(ray, t_best, cell);
    else leaf = descend(ray, t_best, cell);
    return visit_leaf(leaf, cell.t_enter, min(cell.t_exit, t_best));
}

// Leaf by leaf, each with all its tests.
void search_by_leaves(TraversalRay ray, bool any_hit, Cell cell, inout Hit best) {
    do {
        Visit visit = next_leaf(ray, best.t, cell);
        intersect_rest(ray, visit, best);
    } while (!is_done(any_hit, best) && pop_pending(ray, best.t, cell));
}

// Turn by turn, each a test or a leaf: lanes that test and lanes that go on each keep together. Of two loops in one another
// the outer waits, for all lanes' leaves or for each lane's tests.
void search_by_turns(TraversalRay ray, bool any_hit, Cell cell, inout Hit best) {
    Visit visit = next_leaf(ray, best.t, cell);
    bool goes_on = true;
    do {
        uint entry_ix;
        if (find_candidate(ray, visit, entry_ix)) {
            intersect(ray, leaf_triangle_at(entry_ix), best);
            goes_on = !is_done(any_hit, best);
        } else {
            goes_on = pop_pending(ray, best.t, cell);
            if (goes_on) visit = next_leaf(ray, best.t, cell);
        }
    } while (goes_on);
}

// All leaves that the ray meets in [t_enter, t_exit], until nothing nearer can follow.
void search(TraversalRay ray, bool any_hit, inout Hit best) {
    if (!(ray.t_enter <= ray.t_exit)) return;
    Cell cell = Cell(0u, 0u, ray.t_enter, ray.t_exit);
    clear_pending();
    if (RUNS_BOTH_SIDES) search_by_leaves(ray, any_hit, cell, best);
    else search_by_turns(ray, any_hit, cell, best);
}

#include "brute.glsl"

// The closest hit in (t_min, t_max], or with any_hit one that need not be the closest. A miss keeps t = t_max.
Hit traverse(Ray ray_in, float t_min, bool any_hit) {
    float t_start;
    Ray ray_near = near_scene(ray_in, t_start);
    TraversalRay ray = traversal_ray(ray_near, t_min - t_start);
    Hit best = Hit(ray_near.t_max, NO_TRIANGLE, 0.0, 0.0);
    if (TRAVERSAL == TRAVERSAL_BRUTE) intersect_all(ray, any_hit, best);
    else search(ray, any_hit, best);
    best.t = best.triangle_ix == NO_TRIANGLE ? ray_in.t_max : best.t + t_start;
    return best;
}

#endif
