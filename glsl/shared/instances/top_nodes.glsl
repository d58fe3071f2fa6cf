// A place in the hierarchy over the instances, and the way from an instance to its geometry. A part of
// instances/hierarchy.glsl and instances/closest.glsl.
//
// Needs scene.glsl, search/suspended_rays.glsl and search/traversal_ray.glsl. Provides `TopCell`, `top_node_at`,
// `leave_node`, `local_vector` and `enter_geometry`.

// A node, and the pending siblings above it. NO_TRIANGLE in place of the node: nothing is left.
struct TopCell {
    uint node_ix;
    uint pending;
};

TopNode top_node_at(uint node_ix) {
    vec4 low = load_instance_rows(accel.top_nodes_begin + TOP_NODE_ROWS * node_ix);
    vec4 high = load_instance_rows(accel.top_nodes_begin + TOP_NODE_ROWS * node_ix + 1u);
    return TopNode(low.xyz, floatBitsToUint(low.w), high.xyz, floatBitsToUint(high.w));
}

// Goes up to the nearest pending sibling.
void leave_node(inout TopCell at) {
    if (at.pending == 0u) {
        at.node_ix = NO_TRIANGLE;
        return;
    }
    uint n_levels = uint(findLSB(at.pending));
    for (uint i = 0u; i < n_levels; ++i) {
        count_iteration();
        at.node_ix = top_node_at(at.node_ix).parent;
    }
    at.node_ix ^= 1u;
    at.pending = (at.pending >> n_levels) & ~1u;
}

// v by the rows of the inverse linear map.
vec3 local_vector(uint instance_ix, vec3 v) {
    vec3 x = instance_row(instance_ix, 4u).xyz, y = instance_row(instance_ix, 5u).xyz;
    vec3 z = instance_row(instance_ix, 6u).xyz;
    precise float local_x = x.x * v.x + x.y * v.y + x.z * v.z;
    precise float local_y = y.x * v.x + y.y * v.y + y.z * v.z;
    precise float local_z = z.x * v.x + z.y * v.y + z.z * v.z;
    return vec3(local_x, local_y, local_z);
}

// Notes which instance's geometry is searched. Returns the geometry's first row in `instance_rows`.
uint enter_geometry(uint instance_ix) {
    set_instance(instance_ix);
    uint geometry_ix = floatBitsToUint(instance_row(instance_ix, 1u).w);
    uint at = accel.geometries_begin + GEOMETRY_ROWS * geometry_ix;
    vec4 low = load_instance_rows(at), high = load_instance_rows(at + 1u), rest = load_instance_rows(at + 2u);
    entered = Extent(
        low.xyz, low.w, high.xyz, high.w, floatBitsToUint(rest.x), floatBitsToUint(rest.y), floatBitsToUint(rest.z)
    );
    return at;
}
