// Depth-first traversal of the kd-tree (the paper's section 2.3, Algorithm 2), closest hit or any hit.
//
// A cell is a node and the interval [t_enter, t_exit] that the ray spends in it. Children come in the ray's order:
// `first` is the one on the side that the ray comes from. A subtree that is left for later is pending; how pending
// subtrees are kept is the variant (pending_*.glsl).
#ifndef KDRAY_KDTREE
#define KDRAY_KDTREE

#include "layout.glsl"
#include "scene.glsl"
#include "stalls.glsl"
#include "steps.glsl"
#include "triangle.glsl"

layout(constant_id = CONSTANT_TRAVERSAL) const uint TRAVERSAL = TRAVERSAL_MASK;
// Whether the device runs both sides of a branch for all lanes, as software drivers do: lockstep.glsl.
layout(constant_id = CONSTANT_RUNS_BOTH_SIDES) const bool RUNS_BOTH_SIDES = false;

struct Cell {
    // The node's place in kd_nodes, in bytes: what a split names its children by.
    uint node_at;
    float t_enter;
    float t_exit;
};

// What the traversal needs of a ray. It meets the plane at x on an axis at t = x * inv_direction + bias.
//
// All t of the traversal are half of the ray's own: the middle of an interval then is the sum of its ends, and half its length
// their difference (slab.glsl). Halving loses no bits.
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
    r.t_min = 0.5 * t_min;
    r.shear.z *= 0.5;
    // A direction in the plane is taken as all but in it: finite everywhere, and one rule for all ties.
    vec3 tiny = vec3(KD_LEAST_COMPONENT);
    r.inv_direction = 0.5 / mix(ray.direction, tiny, lessThan(abs(ray.direction), tiny));
    r.bias = -ray.origin * r.inv_direction;
    precise vec3 t0 = fma(accel.cell_min, r.inv_direction, r.bias);
    precise vec3 t1 = fma(accel.cell_max, r.inv_direction, r.bias);
    vec3 near = min(t0, t1);
    vec3 far = max(t0, t1);
    r.t_enter = max(max(near.x, near.y), max(near.z, 0.5 * t_min));
    r.t_exit = min(min(far.x, far.y), min(far.z, 0.5 * ray.t_max));
    return r;
}

// Whether the ray comes into the root's cell at all.
bool is_in(TraversalRay ray) {
    return ray.t_enter <= ray.t_exit;
}

// The root.
Cell whole(TraversalRay ray) {
    return Cell(0u, ray.t_enter, ray.t_exit);
}

float largest_coordinate() {
    vec3 largest = max(abs(accel.cell_min), abs(accel.cell_max));
    return max(largest.x, max(largest.y, largest.z));
}

// The ray with its origin moved along it to lie within KD_ORIGIN_REACH. t_start: how far; 0 for all but cameras far away.
Ray near_scene(Ray ray, out float t_start) {
    vec3 away = abs(ray.origin);
    t_start = 0.0;
    if (max(away.x, max(away.y, away.z)) <= KD_ORIGIN_REACH * largest_coordinate()) return ray;
    t_start = 2.0 * max(traversal_ray(ray, 0.0).t_enter, 0.0);
    precise vec3 origin = ray.origin + t_start * ray.direction;
    ray.origin = origin;
    ray.t_max -= t_start;
    return ray;
}

// The nearest hit so far; where it lies in its triangle is in local memory.
struct Nearest {
    float t;
    uint triangle_ix;
};

uint index_of(uint node_at) {
    return node_at / KD_NODE_BYTES;
}

uint place_of(uint node_ix) {
    return KD_NODE_BYTES * node_ix;
}

uint sibling_of(uint node_at) {
    return node_at ^ KD_NODE_BYTES;
}

KdNode kd_node(uint node_at) {
    count_steps(1u);
    count_turn();
    return kd_node_at(index_of(node_at));
}

bool is_leaf(KdNode node) {
    return (node.axis_and_child & KD_LEAF) != 0u;
}

float along(vec3 v, uint axis) {
    return axis == 0u ? v.x : (axis == 1u ? v.y : v.z);
}

// Along a split's axis, whose two bits choose at once.
float along_split(vec3 v, KdNode node) {
    return (node.axis_and_child & 2u) != 0u ? v.z : ((node.axis_and_child & 1u) != 0u ? v.y : v.x);
}

// Where a split's plane meets its axis. A leaf's number of an entry, which lanes that wait hold in lockstep, is no number to
// compute with: it is denormal as a float, and lavapipe's kernels spent a sixth of their time on its products. Its mask is made of its bits, since a
// compiler takes away what asks for a leaf where a branch has asked before.
float plane_of(KdNode node) {
    const int LEAF_BIT = findMSB(KD_LEAF);
    uint bits = node.split_or_first;
    if (RUNS_BOTH_SIDES) bits &= ~uint(bitfieldExtract(int(node.axis_and_child), LEAF_BIT, 1));
    return uintBitsToFloat(bits);
}

// Where the ray meets the split plane. `precise`: a traversal that comes the same way again must come to the same bits.
float crossing(TraversalRay ray, KdNode node) {
    precise float t = fma(plane_of(node), along_split(ray.inv_direction, node), along_split(ray.bias, node));
    return t;
}

// The child on the side that the ray comes from, or the other one.
uint child_of(TraversalRay ray, KdNode node, bool second) {
    bool is_above = (along_split(ray.inv_direction, node) < 0.0) != second;
    uint pair_at = node.axis_and_child & ~((1u << KD_PAIR_SHIFT) - 1u);
    return pair_at | (is_above ? KD_NODE_BYTES : 0u);
}

uint first_child(TraversalRay ray, KdNode node) {
    return child_of(ray, node, false);
}

#include "local_cells.glsl"
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
    if (TRAVERSAL == TRAVERSAL_ROPES) return has_time && cell.node_at != 0u;
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

// From a split to the child where the ray enters the cell. A NaN fails both tests and goes to the first child: it ends.
KdNode step_down(TraversalRay ray, KdNode node, inout Cell cell) {
    float t_cross = crossing(ray, node);
    bool only_second = t_cross < cell.t_enter;
    go_down();
    cell.node_at = child_of(ray, node, only_second);
    node = kd_node(cell.node_at);
    if (!only_second && t_cross <= cell.t_exit) {
        push_pending(cell);
        cell.t_exit = t_cross;
    }
    return node;
}

// Down to the leaf where the ray enters the cell, or to a slab that it keeps clear of, as if that were an empty leaf.
KdNode descend(TraversalRay ray, float t_best, inout Cell cell) {
    KdNode node = kd_node(cell.node_at);
    for (;;) {
        while (is_open_split(node)) node = step_down(ray, node, cell);
        if (!has_slab(node)) return node;
        node = enter_slab(ray, t_best, cell, node);
    }
}

// Down to the leaf where the ray enters the cell, for lockstep.glsl.
KdNode descend_in_step(TraversalRay ray, inout Cell cell) {
    KdNode node = kd_node(cell.node_at);
    while (!is_leaf(node)) {
        node = step_down(ray, node, cell);
        if (is_leaf(node)) break;
    }
    return node;
}

// Whether a hit is the ray's, and nearer than the best; of two hits at one t the lower index wins, whatever the order of triangles.
bool is_better(TraversalRay ray, float t, uint triangle_ix, Nearest best) {
    bool nearer = t < best.t || (t == best.t && triangle_ix < best.triangle_ix);
    return t > ray.t_min && nearer && triangle_ix != ray.source_triangle;
}

// A triangle against the ray.
void intersect(TraversalRay ray, Triangle triangle, uint triangle_ix, inout Nearest best) {
    Hit hit;
    if (!intersect_triangle(ray.shear, triangle, triangle_ix, hit)) return;
    if (is_better(ray, hit.t, triangle_ix, best)) {
        best = Nearest(hit.t, triangle_ix);
        keep_pair(WEIGHTS_PLACE, hit.u, hit.v);
    }
}

// A ray's way through a leaf, with the entries that are still to be looked at.
struct Visit {
    uint entry_ix;
    uint end_ix;
    Stretch way;
};

Visit visit_leaf(KdNode leaf, float t_enter, float t_exit) {
    uint n_entries = leaf.axis_and_child >> KD_PAIR_SHIFT;
    count_steps(n_entries);
    return Visit(leaf.split_or_first, leaf.split_or_first + n_entries, stretch(t_enter, t_exit));
}

// On to the leaf's next triangle whose plane the ray meets on its way. It may meet the others' planes elsewhere, in leaves
// that have those triangles too: most are in several, so most tests are spared.
bool find_candidate(TraversalRay ray, inout Visit visit, out uint entry_ix) {
    // What is left undefined is kept from turn to turn, in a register.
    entry_ix = 0u;
    while (visit.entry_ix < visit.end_ix && has_turns()) {
        count_turn();
        entry_ix = visit.entry_ix;
        visit.entry_ix += 1u;
        if (!is_clear(ray, visit.way, load_leaf_planes(entry_ix), accel.plane_epsilon)) return true;
    }
    return false;
}

bool is_done(bool any_hit, Nearest best) {
    return any_hit && best.triangle_ix != NO_TRIANGLE;
}

Visit next_leaf(TraversalRay ray, float t_best, inout Cell cell) {
    KdNode leaf;
    if (TRAVERSAL == TRAVERSAL_ROPES) leaf = descend_to_rope(ray, t_best, cell);
    else if (RUNS_BOTH_SIDES) leaf = descend_in_step(ray, cell);
    else leaf = descend(ray, t_best, cell);
    return visit_leaf(leaf, cell.t_enter, min(cell.t_exit, t_best));
}

#include "resume.glsl"

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

// All leaves that the ray meets in [t_enter, t_exit], until nothing nearer can follow. Returns 0, or the mark of a ray that
// has stalled.
uint search(TraversalRay ray, bool any_hit, inout Nearest best) {
    clear_pending();
    if (RUNS_BOTH_SIDES) return search_in_step(ray, any_hit, best);
    return search_by_turns(ray, any_hit, best);
}

#include "brute.glsl"

// The closest hit in (t_min, t_max], or with any_hit one that need not be the closest. A miss keeps t = t_max. Where the
// ray has stalled, the hit's triangle_ix is its mark.
Hit traverse(Ray ray_in, float t_min, bool any_hit) {
    float t_start;
    Ray ray_near = near_scene(ray_in, t_start);
    TraversalRay ray = traversal_ray(ray_near, t_min - t_start);
    keep_pair(LENGTHS_PLACE, t_start, ray_in.t_max);
    Nearest best = Nearest(0.5 * ray_near.t_max, NO_TRIANGLE);
    uint mark;
    if (TRAVERSAL == TRAVERSAL_BRUTE) mark = intersect_all(ray, any_hit, best);
    else mark = search(ray, any_hit, best);
    if (CAN_STALL && mark != 0u) return Hit(0.0, mark, 0.0, 0.0);
    vec2 lengths = kept_pair(LENGTHS_PLACE);
    if (best.triangle_ix == NO_TRIANGLE) return Hit(lengths.y, NO_TRIANGLE, 0.0, 0.0);
    vec2 weights = kept_pair(WEIGHTS_PLACE);
    return Hit(2.0 * best.t + lengths.x, best.triangle_ix, weights.x, weights.y);
}

#endif
