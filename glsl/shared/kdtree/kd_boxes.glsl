// The cells of nodes as boxes, one for each node, for traversals that use them. A part of pending.glsl.
//
// Needs scene.glsl and search/traversal_ray.glsl. Provides `interval_in`.

// The t at which the ray meets the planes of a node's cell on each axis: the near plane, which it meets first, and
// the far plane.
struct BoxPlanes {
    vec3 near;
    vec3 far;
};

BoxPlanes box_planes_of(TraversalRay ray, uint node_ix) {
    KdBox box = kd_box_of(node_ix);
    precise vec3 t0 = fma(vec3(box.min_x, box.min_y, box.min_z), ray.inv_direction, ray.bias);
    precise vec3 t1 = fma(vec3(box.max_x, box.max_y, box.max_z), ray.inv_direction, ray.bias);
    return BoxPlanes(min(t0, t1), max(t0, t1));
}

// The ray's interval in a node's cell, as (t_enter, t_exit). The planes of the cell are those of the root's box and
// of the splits above the node. Their t are computed as on the way down to the node, so they have the same bits.
vec2 interval_in(TraversalRay ray, uint node_ix) {
    BoxPlanes slabs = box_planes_of(ray, node_ix);
    return vec2(max(max(slabs.near.x, slabs.near.y), max(slabs.near.z, ray.t_enter)),
                min(min(slabs.far.x, slabs.far.y), min(slabs.far.z, ray.t_exit)));
}
