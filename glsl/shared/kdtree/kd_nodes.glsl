// Nodes of the kd-tree and the cells that a ray goes through. A part of kdtree.glsl.
//
// Needs scene.glsl, search/suspended_rays.glsl, search/steps.glsl, search/traversal_ray.glsl and PREDICATES_BRANCHES.
// Provides `Cell`, `kd_node`, the offsets of children, siblings and indices, and `crossing`.

// A node and the interval that the ray spends in it, in the traversal's t.
struct Cell {
    // Offset of the node in kd_nodes, in bytes. A split stores the same kind of offset for its children.
    uint node_offset;
    float t_enter;
    float t_exit;
};

// The root, and the ray's whole interval.
Cell root_cell(TraversalRay ray) {
    return Cell(root_offset(), ray.t_enter, ray.t_exit);
}

uint node_ix_of(uint node_offset) {
    return node_offset / KD_NODE_BYTES;
}

uint offset_of(uint node_ix) {
    return KD_NODE_BYTES * node_ix;
}

uint sibling_of(uint node_offset) {
    return node_offset ^ KD_NODE_BYTES;
}

// Reads a node. Counts the read and a loop iteration.
KdNode kd_node(uint node_offset) {
    count_steps(1u);
    count_iteration();
    return kd_node_at(node_ix_of(node_offset));
}

bool is_leaf(KdNode node) {
    return (node.axis_and_child & KD_LEAF) != 0u;
}

float along(vec3 v, uint axis) {
    return axis == 0u ? v.x : (axis == 1u ? v.y : v.z);
}

// The component along a split's axis. The two bits of the axis are tested directly.
float along_split(vec3 v, KdNode node) {
    return (node.axis_and_child & 2u) != 0u ? v.z : ((node.axis_and_child & 1u) != 0u ? v.y : v.x);
}

// Position of a split's plane on its axis. In a leaf, this word is an index, which is a denormal float. On lavapipe,
// idle lanes that hold a leaf still compute with the word, and products of denormals took a sixth of the kernel's
// time. So on devices that predicate branches, the word of a leaf is masked to zero. The mask is computed from the
// node's bits, not by a comparison: where a branch has already tested for a leaf, the compiler removes comparisons.
float plane_of(KdNode node) {
    const int LEAF_BIT = findMSB(KD_LEAF);
    uint bits = node.split_or_first;
    if (PREDICATES_BRANCHES) bits &= ~uint(bitfieldExtract(int(node.axis_and_child), LEAF_BIT, 1));
    return uintBitsToFloat(bits);
}

// The t at which the ray meets the split plane. `precise`: a traversal that takes the same path again must compute
// the same bits.
float crossing(TraversalRay ray, KdNode node) {
    precise float t = fma(plane_of(node), along_split(ray.inv_direction, node), along_split(ray.bias, node));
    return t;
}

// Offset of a split's child: of the second child if `second` is true, otherwise of the first one. The first child is
// on the side that the ray comes from.
uint child_of(TraversalRay ray, KdNode node, bool second) {
    bool is_above = (along_split(ray.inv_direction, node) < 0.0) != second;
    uint pair_at = node.axis_and_child & ~((1u << KD_PAIR_SHIFT) - 1u);
    return pair_at | (is_above ? KD_NODE_BYTES : 0u);
}

uint first_child(TraversalRay ray, KdNode node) {
    return child_of(ray, node, false);
}
