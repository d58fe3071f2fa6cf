// The light tree: samples one of many lights by what they may send to a point (Conty Estevez, Kulla: Importance
// Sampling of Many Lights with Adaptive Tree Splitting, HPG 2018). The host builds it (src/world/light_tree.rs). Twin
// of src/reference/emitters/tree.rs.
//
// Needs the words of textures (shading/texture_words.glsl).
#ifndef KDRAY_LIGHT_TREE
#define KDRAY_LIGHT_TREE

#include "layout.glsl"
#include "shading/texture_words.glsl"
#include "emitters/alias.glsl"

// The least squared distance from a light, square world units, which bounds what lights without a size send.
const float LEAST_SQUARED = 1.0e-30;
// The step of a random number from which on the digits of another one continue it.
const float COARSE_STEP = 1.0 / 4096.0;

// A light that is sampled, and the probability with which the tree samples it at this point.
struct TreeSample {
    uint emitter_ix;
    float probability;
};

uint node_words_begin(uint node_ix) {
    return accel.light_nodes_begin + 12u * node_ix;
}

LightNode light_node_at(uint node_ix) {
    uint at = node_words_begin(node_ix);
    return LightNode(
        vec3(load_float(at), load_float(at + 1u), load_float(at + 2u)), load_float(at + 3u),
        vec3(load_float(at + 4u), load_float(at + 5u), load_float(at + 6u)), load_float(at + 7u),
        load_float(at + 8u), load_float(at + 9u), load_texture_words(at + 10u), load_texture_words(at + 11u)
    );
}

// The cosine of the angle a - b, or 1 if a is less than b. Both are between 0 and pi.
float cos_beyond(float cos_a, float cos_b) {
    if (cos_a > cos_b) return 1.0;
    return cos_a * cos_b + sqrt(max((1.0 - cos_a * cos_a) * (1.0 - cos_b * cos_b), 0.0));
}

// What the lights of a node may send to a point: an estimate, which is 0 only if none of them shines there.
float importance(LightNode node, vec3 point_world) {
    vec3 way = point_world - node.centre;
    float squared = dot(way, way), radius_squared = node.radius * node.radius;
    float largest = max(max(squared, radius_squared), LEAST_SQUARED);
    float cosine = squared > 0.0 ? clamp(dot(node.axis, way) / sqrt(squared), -1.0, 1.0) : 1.0;
    if ((node.flags & LIGHT_NODE_TWO_SIDED) != 0u) cosine = abs(cosine);
    // The angle in which the node's sphere is seen: from inside it is obtuse, and grows to the centre.
    float seen = sqrt(max(1.0 - min(squared, radius_squared) / largest, 0.0));
    float cos_seen = squared < radius_squared ? -seen : seen;
    cosine = cos_beyond(cos_beyond(cosine, node.cos_spread), cos_seen);
    return cosine > node.cos_end ? node.intensity * cosine / largest : 0.0;
}

// The probability with which the left child of a node is sampled.
float share_of_left(uint left_ix, uint right_ix, vec3 point_world) {
    float left = importance(light_node_at(left_ix), point_world);
    float sum = left + importance(light_node_at(right_ix), point_world);
    return sum > 0.0 ? left / sum : 0.5;
}

// Samples a light. u: in [0, 1). more: in [0, 1), continues u below the 24 bits that a float has.
TreeSample sample_in_tree(vec3 point_world, float u, float more) {
    uint ix = 0u;
    float probability = 1.0, smallest = 1.0 / 16777216.0;
    while ((load_texture_words(node_words_begin(ix) + 11u) & LIGHT_NODE_LEAF) == 0u) {
        uint right_ix = load_texture_words(node_words_begin(ix) + 10u);
        float left = share_of_left(ix + 1u, right_ix, point_world);
        bool is_left = u < left;
        float share = is_left ? left : 1.0 - left;
        ix = is_left ? ix + 1u : right_ix;
        u = (is_left ? u : u - left) / share;
        smallest /= share;
        if (smallest > COARSE_STEP) {
            u += more * smallest;
            more = 0.0;
        }
        u = min(u, ALMOST_ONE);
        probability *= share;
    }
    return TreeSample(load_texture_words(node_words_begin(ix) + 10u), probability);
}

// The probability with which sample_in_tree samples the light of a leaf at a point.
float tree_probability(vec3 point_world, uint leaf_ix) {
    uint ix = 0u;
    float probability = 1.0;
    while (ix != leaf_ix) {
        uint right_ix = load_texture_words(node_words_begin(ix) + 10u);
        float left = share_of_left(ix + 1u, right_ix, point_world);
        // Nodes are in preorder.
        bool is_left = leaf_ix < right_ix;
        ix = is_left ? ix + 1u : right_ix;
        probability *= is_left ? left : 1.0 - left;
    }
    return probability;
}

#endif
