// Depth-first traversal of the kd-tree (the paper's section 2.3, Algorithm 2), closest hit or any hit.
//
// A cell is a node and the interval [t_enter, t_exit] that the ray spends in it. Children come in the ray's order:
// `first` is the one on the side that the ray comes from. A subtree that is left for later is pending; how pending
// subtrees are kept is the variant (pending_*.glsl).
#ifndef KDRAY_KDTREE
#define KDRAY_KDTREE

#include "layout.glsl"
#include "triangle.glsl"

layout(std140, set = 0, binding = BIND_FRAME) uniform FrameBlock { Frame frame; };
layout(std430, set = 0, binding = BIND_TRIANGLES) readonly buffer TrianglesBlock { Triangle triangles[]; };
layout(std430, set = 0, binding = BIND_KD_NODES) readonly buffer KdNodesBlock { KdNode kd_nodes[]; };
layout(std430, set = 0, binding = BIND_KD_PARENTS) readonly buffer KdParentsBlock { uint kd_parents[]; };
layout(std430, set = 0, binding = BIND_LEAF_TRIANGLES) readonly buffer LeafTrianglesBlock { uint leaf_triangles[]; };

layout(constant_id = 0) const uint TRAVERSAL = TRAVERSAL_MASK;

struct Cell {
    uint node_ix;
    uint depth;
    float t_enter;
    float t_exit;
};

// What the traversal needs of a ray. On each axis it enters the widened plane at x at t = x * inv_direction + bias and
// leaves it width * |inv_direction| later (see traversal_ray). overlap: a pending cell begins at most this far before a
// deeper one.
struct TraversalRay {
    Shear shear;
    vec3 inv_direction;
    vec3 bias;
    float width;
    float t_min;
    float t_enter;
    float t_exit;
    float overlap;
    uint source_triangle;
};

// The hit test's rounding moves a corner across the ray by at most 3 * 2^-24 of its distance, that of a crossing moves
// the plane by 4 * 2^-24 of the coordinates. Planes are widened by 2^-20 of the farthest of these, so that a ray along
// a plane, or through a corner of cells, meets every triangle that touches it there: what brute force finds, the
// traversal visits.
TraversalRay traversal_ray(Ray ray, float t_min) {
    TraversalRay r;
    r.shear = shear_of(ray.origin, ray.direction);
    r.source_triangle = ray.source_triangle;
    r.t_min = t_min;
    // A direction in the plane is taken as all but in it: finite everywhere, and one rule for all ties.
    vec3 tiny = vec3(1e-12);
    vec3 direction = mix(ray.direction, tiny, lessThan(abs(ray.direction), tiny));
    r.inv_direction = 1.0 / direction;
    vec3 reach = max(abs(ray.origin), max(abs(frame.cell_min - ray.origin), abs(frame.cell_max - ray.origin)));
    float slack_world = max(reach.x, max(reach.y, reach.z)) * exp2(-20.0);
    vec3 slack = slack_world * abs(r.inv_direction);
    r.bias = -ray.origin * r.inv_direction - slack;
    r.width = 2.0 * slack_world;
    // Along the ray, planes of one axis come in order, the deepest pending one first; one of another axis may come
    // earlier by as much as both are widened. A chain over the three axes adds up to no more than this.
    r.overlap = 2.0 * (slack.x + slack.y + slack.z);

    vec3 t0 = (frame.cell_min - ray.origin) * r.inv_direction;
    vec3 t1 = (frame.cell_max - ray.origin) * r.inv_direction;
    vec3 near = min(t0, t1) - slack;
    vec3 far = max(t0, t1) + slack;
    r.t_enter = max(max(near.x, near.y), max(near.z, t_min));
    r.t_exit = min(min(far.x, far.y), min(far.z, ray.t_max));
    return r;
}

uint axis_of(KdNode node) {
    return node.axis_and_child & KD_AXIS_MASK;
}

float along(vec3 v, uint axis) {
    return axis == 0u ? v.x : (axis == 1u ? v.y : v.z);
}

// Where the ray enters the second child's side and leaves the first one's, both widened by the slack: [x, y], x <= y.
vec2 crossing(TraversalRay ray, KdNode node) {
    uint axis = axis_of(node);
    float inv_direction = along(ray.inv_direction, axis);
    // `precise`: a traversal that comes the same way again must come to the same bits.
    precise float t_second = fma(uintBitsToFloat(node.split_or_first), inv_direction, along(ray.bias, axis));
    precise float t_first = fma(abs(inv_direction), ray.width, t_second);
    return vec2(t_second, t_first);
}

// The child on the side that the ray comes from; the other is `^ 1`.
uint first_child(TraversalRay ray, KdNode node) {
    uint first_is_above = along(ray.inv_direction, axis_of(node)) < 0.0 ? 1u : 0u;
    return (node.axis_and_child >> KD_CHILD_SHIFT) + first_is_above;
}

#include "pending_mask.glsl"
#include "pending_stack.glsl"
#include "pending_restart.glsl"
#include "pending_short_stack.glsl"
#include "kd_boxes.glsl"
#include "pending_mask_boxes.glsl"
#include "pending_backtrack.glsl"

void clear_pending() {
    pending_mask = uvec2(0u);
    stack_size = 0u;
    short_stack_top = 0u;
    short_stack_size = 0u;
    siblings_done = uvec2(0u);
}

void push_pending(uint second_ix, Cell cell, vec2 t_cross) {
    // These find out on the way back.
    if (TRAVERSAL == TRAVERSAL_MASK_BOXES) return;
    if (TRAVERSAL == TRAVERSAL_BACKTRACK) return;
    if (TRAVERSAL == TRAVERSAL_STACK) stack_push(second_ix, cell);
    else if (TRAVERSAL == TRAVERSAL_SHORT_STACK) short_stack_push(second_ix, cell, t_cross);
    else mask_push(second_ix, cell, t_cross);
}

// The next pending cell that may hold a hit nearer than t_best, or false.
bool pop_pending(TraversalRay ray, float t_best, inout Cell cell) {
    if (TRAVERSAL == TRAVERSAL_STACK) return stack_pop(ray, t_best, cell);
    if (TRAVERSAL == TRAVERSAL_RESTART) return restart_pop(ray, t_best, cell);
    if (TRAVERSAL == TRAVERSAL_SHORT_STACK) return short_stack_pop(ray, t_best, cell);
    if (TRAVERSAL == TRAVERSAL_MASK_BOXES) return mask_boxes_pop(ray, t_best, cell);
    if (TRAVERSAL == TRAVERSAL_BACKTRACK) return backtrack_pop(ray, t_best, cell);
    return mask_pop(ray, t_best, cell);
}

// Down to the leaf where the ray enters the cell. A NaN fails both tests and goes to the first child: it ends.
KdNode descend(TraversalRay ray, inout Cell cell) {
    KdNode node = kd_nodes[cell.node_ix];
    while (axis_of(node) != KD_LEAF) {
        vec2 t_cross = crossing(ray, node);
        uint first_ix = first_child(ray, node);
        bool in_first = t_cross.y >= cell.t_enter;
        bool in_second = t_cross.x <= cell.t_exit;
        cell.depth += 1u;
        cell.node_ix = in_second && !in_first ? first_ix ^ 1u : first_ix;
        if (in_first && in_second) {
            push_pending(first_ix ^ 1u, cell, t_cross);
            cell.t_exit = min(cell.t_exit, t_cross.y);
        }
        node = kd_nodes[cell.node_ix];
    }
    return node;
}

// A triangle against the ray; of two hits at one t the lower index wins, whatever the order of triangles.
void intersect(TraversalRay ray, uint triangle_ix, inout Hit best) {
    Hit hit;
    if (!intersect_triangle(ray.shear, triangles[triangle_ix], triangle_ix, hit)) return;
    bool nearer = hit.t < best.t || (hit.t == best.t && triangle_ix < best.triangle_ix);
    if (hit.t > ray.t_min && nearer && triangle_ix != ray.source_triangle) best = hit;
}

void intersect_leaf(TraversalRay ray, KdNode leaf, inout Hit best) {
    uint end = leaf.split_or_first + (leaf.axis_and_child >> KD_CHILD_SHIFT);
    for (uint i = leaf.split_or_first; i < end; ++i) intersect(ray, leaf_triangles[i], best);
}

bool is_done(bool any_hit, Hit best) {
    return any_hit && best.triangle_ix != NO_TRIANGLE;
}

// All leaves that the ray meets in [t_enter, t_exit], until nothing nearer can follow.
void search(TraversalRay ray, bool any_hit, inout Hit best) {
    if (!(ray.t_enter <= ray.t_exit)) return;
    Cell cell = Cell(0u, 0u, ray.t_enter, ray.t_exit);
    clear_pending();
    do {
        intersect_leaf(ray, descend(ray, cell), best);
    } while (!is_done(any_hit, best) && pop_pending(ray, best.t, cell));
}

#include "brute.glsl"
#include "ropes.glsl"

// The closest hit in (t_min, t_max], or with any_hit one that need not be the closest. A miss keeps t = t_max.
Hit traverse(Ray ray_in, float t_min, bool any_hit) {
    Hit best = Hit(ray_in.t_max, NO_TRIANGLE, 0.0, 0.0);
    TraversalRay ray = traversal_ray(ray_in, t_min);
    if (TRAVERSAL == TRAVERSAL_BRUTE) intersect_all(ray, any_hit, best);
    else if (TRAVERSAL == TRAVERSAL_ROPES) follow_ropes(ray, any_hit, best);
    else search(ray, any_hit, best);
    return best;
}

#endif
