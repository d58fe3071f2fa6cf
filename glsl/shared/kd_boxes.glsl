// The cells of nodes as boxes, one a node, for traversals that ask for them.

layout(std430, set = 0, binding = BIND_KD_BOXES) readonly buffer KdBoxesBlock { KdBox kd_boxes[]; };

// Where the ray enters and leaves a node's cell on each axis.
struct Slabs {
    vec3 enter;
    vec3 exit;
};

Slabs slabs_of(TraversalRay ray, uint node_ix) {
    KdBox box = kd_boxes[node_ix];
    vec3 t0 = (vec3(box.min_x, box.min_y, box.min_z) - ray.origin) * ray.inv_direction;
    vec3 t1 = (vec3(box.max_x, box.max_y, box.max_z) - ray.origin) * ray.inv_direction;
    return Slabs(min(t0, t1), max(t0, t1));
}

// The ray's interval in a node's cell, widened by the slack: the very planes that `descend` meets on the way there.
vec2 interval_in(TraversalRay ray, uint node_ix) {
    Slabs slabs = slabs_of(ray, node_ix);
    vec3 enter = slabs.enter - ray.slack;
    vec3 exit = slabs.exit + ray.slack;
    return vec2(max(max(enter.x, enter.y), max(enter.z, ray.t_enter)),
                min(min(exit.x, exit.y), min(exit.z, ray.t_exit)));
}
