// The search through a world of instances. A ray goes through the hierarchy over the instances depth-first, the nearer
// child first, with a bit mask as its stack: bit i tells whether the sibling of the node i levels above is still to be
// visited. So its whole state is two words. In each leaf, transformed to the space of the instance's geometry, the ray
// goes through the geometry's own structure. Twin of src/reference/instances.rs. A part of search/accel.glsl.
//
// Watertight: all triangles of a geometry are tested by one ray, as in a scene of that geometry alone. Rounding makes
// it another ray than that of the world. The box of each instance has a margin for that (src/accel/top_level.rs), so
// that an instance is entered whenever the transformed ray can have a hit in it.
//
// Needs scene.glsl, search/suspended_rays.glsl, search/steps.glsl, search/traversal_ray.glsl, grid/grid.glsl,
// TESTS_BLENDED, FROM_CAMERA and in casts MASK_OF_CAST. Provides `TopRay`, `top_ray`, `kind_of_rays`, `find_instance`,
// `in_geometry`, and what top_nodes.glsl does.

#include "instances/top_nodes.glsl"

// A ray of the world as boxes see it, with halved t, as in TraversalRay. It meets a plane at p at p inv_direction +
// bias. pad: by how much boxes are too small for a ray from afar (world units).
struct TopRay {
    vec3 inv_direction;
    vec3 bias;
    float t_min;
    float pad;
};

// The t of a box that the ray misses, above all others.
const float MISSES = 3.0e38;

TopRay top_ray(PathRay ray, float t_min) {
    vec3 tiny = vec3(KD_LEAST_COMPONENT);
    vec3 inv_direction = 0.5 / mix(ray.direction, tiny, lessThan(abs(ray.direction), tiny));
    float farthest = longest_component(ray.origin);
    float pad = farthest > accel.origin_reach ? accel.plane_epsilon * farthest : 0.0;
    return TopRay(inv_direction, -ray.origin * inv_direction, 0.5 * t_min, pad);
}

// The t at which the ray enters a node's box, or MISSES if it misses the box or enters it behind t_best.
float entry_of(TopRay ray, TopNode node, float t_best) {
    precise vec3 t0 = fma(node.box_min - ray.pad, ray.inv_direction, ray.bias);
    precise vec3 t1 = fma(node.box_max + ray.pad, ray.inv_direction, ray.bias);
    vec3 near = min(t0, t1);
    vec3 far = max(t0, t1);
    float t_enter = max(max(near.x, near.y), max(near.z, ray.t_min));
    float t_exit = min(min(far.x, far.y), min(far.z, t_best));
    return t_enter <= t_exit ? t_enter : MISSES;
}

// Goes down to the child of a pair that the ray enters first. Returns false if it meets neither.
bool enter_child(TopRay ray, uint pair, float t_best, inout TopCell at) {
    float t0 = entry_of(ray, top_node_at(2u * pair), t_best);
    float t1 = entry_of(ray, top_node_at(2u * pair + 1u), t_best);
    count_steps(2u);
    if (min(t0, t1) == MISSES) return false;
    at.node_ix = 2u * pair + (t1 < t0 ? 1u : 0u);
    at.pending = (at.pending << 1) | (max(t0, t1) < MISSES ? 1u : 0u);
    return true;
}

// The kind of the invocation's rays: bits of `Instance.flags`, of which an instance that they meet has one.
uint kind_of_rays(bool any_hit) {
#ifdef MASK_OF_CAST
    return MASK_OF_CAST;
#endif
    if (FROM_CAMERA) return INSTANCE_FOR_CAMERA;
    return TESTS_BLENDED && any_hit ? INSTANCE_FOR_SHADOWS : INSTANCE_FOR_OTHERS;
}

// Goes on to the next instance that may have a hit nearer than t_best, and whose flags have a bit of `kind`. Returns
// false if none is left, or if the invocation's loop iterations are spent. instance_ix: the instance.
bool find_instance(TopRay ray, float t_best, uint kind, inout TopCell at, out uint instance_ix) {
    bool found = false;
    bool looks = at.node_ix != NO_TRIANGLE && has_iterations();
    instance_ix = 0u;
    while (looks) {
        count_iteration();
        TopNode node = top_node_at(at.node_ix);
        instance_ix = node.link & ~TOP_LEAF;
        if ((node.link & TOP_LEAF) == 0u) {
            if (!enter_child(ray, node.link, t_best, at)) leave_node(at);
        } else {
            found = entry_of(ray, node, t_best) < MISSES
                && (floatBitsToUint(instance_row(instance_ix, 4u).w) & kind) != 0u;
            if (!found) leave_node(at);
        }
        looks = !found && at.node_ix != NO_TRIANGLE && has_iterations();
        if (!looks) break;
    }
    return found;
}

// Enters an instance: notes which geometry is searched, and returns the ray in its space. The direction is scaled by a
// power of two to about unit length, so that t is scaled without rounding. inv_scale: what t of the world is multiplied
// by. t_max is left as it is.
PathRay in_geometry(uint instance_ix, PathRay ray, out float inv_scale) {
    uint at = enter_geometry(instance_ix);
    if (TRAVERSAL == TRAVERSAL_GRID) {
        vec4 grid = load_instance_rows(at + 3u);
        entered_lattice = Lattice(extent().box_min, grid.w, extent().box_max, floatBitsToUint(grid.xyz));
        entered_cell = floatBitsToUint(load_instance_rows(at + 2u).w);
    }
    precise vec3 offset = ray.origin - instance_row(instance_ix, 3u).xyz;
    ray.origin = local_vector(instance_ix, offset);
    ray.direction = local_vector(instance_ix, ray.direction);
    uint exponent = clamp(exponent_of(ray.direction), 1u, 253u);
    ray.direction *= uintBitsToFloat((254u - exponent) << 23);
    inv_scale = uintBitsToFloat(exponent << 23);
    return ray;
}
