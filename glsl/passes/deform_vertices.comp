#version 460
#extension GL_GOOGLE_include_directive : require
// Deformation of a mesh, 1 of 2: moves a vertex by morph targets, then by its joints, whose transforms are blended. One
// invocation per vertex. `precise`: results have the bits of src/scene/model/deformation.rs, the twin.
// Reads rest_vertices, deltas, influences, joints and weights; writes deformed and tangents.
#include "deform.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_DEFORM_VERTICES) readonly buffer VerticesBlock { RestVertex rest_vertices[]; };
layout(std430, set = 0, binding = BIND_DEFORM_DELTAS) readonly buffer DeltasBlock { MorphDelta deltas[]; };
layout(std430, set = 0, binding = BIND_DEFORM_INFLUENCES) readonly buffer SharesBlock { JointInfluence influences[]; };
layout(std430, set = 0, binding = BIND_DEFORM_JOINTS) readonly buffer JointsBlock { JointRow joints[]; };
layout(std430, set = 0, binding = BIND_DEFORM_WEIGHTS) readonly buffer WeightsBlock { float weights[]; };
layout(std430, set = 0, binding = BIND_DEFORM_DEFORMED) writeonly buffer DeformedBlock { DeformedVertex deformed[]; };
layout(std430, set = 0, binding = BIND_DEFORM_TANGENTS) writeonly buffer TangentsBlock { uint tangents[]; };

// An affine map: the images of the unit vectors, and that of the origin.
struct Affine {
    vec3 x, y, z, translation;
};

// The power of two that scales a positive number to at least 1 and below 2.
float scale_to_one(float largest) {
    return uintBitsToFloat((254u - clamp(floatBitsToUint(largest) >> 23, 1u, 253u)) << 23);
}

float largest_of(vec3 v) {
    return max(abs(v.x), max(abs(v.y), abs(v.z)));
}

vec3 combined(vec3 x, vec3 y, vec3 z, vec3 v) {
    precise vec3 sum = x * v.x + y * v.y + z * v.z;
    return sum;
}

vec3 crossed(vec3 a, vec3 b) {
    precise vec3 product = a.yzx * b.zxy - b.yzx * a.zxy;
    return product;
}

float dot_in_order(vec3 a, vec3 b) {
    precise float sum = a.x * b.x + a.y * b.y + a.z * b.z;
    return sum;
}

// The octahedral code of a direction of any length, without a division: devices round those differently. Newton's
// iteration begins with a reciprocal that is off by an eighth. On the border of the square, where two codes stand for
// each direction, the one with the larger other half is returned. Twin of src/layout/normal.rs.
uint encode_exactly(vec3 v) {
    float largest = largest_of(v);
    precise vec3 scaled = v * scale_to_one(largest);
    precise float sum = abs(scaled.x) + abs(scaled.y) + abs(scaled.z);
    // Smaller vectors, of less than 2^-100, may have parts that the device flushes to zero.
    const float least = uintBitsToFloat(27u << 23), infinity = uintBitsToFloat(0x7f800000u);
    if (!(largest >= least && sum < infinity)) return FLAT_NORMAL;
    precise float reciprocal = uintBitsToFloat(0x7ef311c7u - floatBitsToUint(sum));
    for (uint i = 0u; i < 4u; ++i) {
        precise float next = reciprocal * (2.0 - sum * reciprocal);
        reciprocal = next;
    }
    precise vec2 p = scaled.xy * reciprocal;
    precise vec2 folded = (1.0 - abs(p.yx)) * vec2(p.x < 0.0 ? -1.0 : 1.0, p.y < 0.0 ? -1.0 : 1.0);
    const float epsilon = uintBitsToFloat(0x34000000u);
    precise vec2 steps = floor(clamp(scaled.z < -epsilon ? folded : p, -1.0, 1.0) * 32767.0 + 0.5);
    ivec2 code = ivec2(steps), positive = abs(code);
    code = mix(code, positive, equal(positive.yx, ivec2(32767)));
    return uint(code.x) & 0xffffu | uint(code.y) << 16;
}

// The sum of the transforms of a vertex's joints, each times its weight.
Affine blended(uint vertex_ix) {
    precise vec3 x = vec3(0.0), y = vec3(0.0), z = vec3(0.0), translation = vec3(0.0);
    for (uint i = 0u; i < mesh.n_influences; ++i) {
        JointInfluence it = influences[vertex_ix * mesh.n_influences + i];
        JointRow joint = joints[it.joint];
        x += it.weight * joint.axis_x;
        y += it.weight * joint.axis_y;
        z += it.weight * joint.axis_z;
        translation += it.weight * vec3(joint.translation_x, joint.translation_y, joint.translation_z);
    }
    return Affine(x, y, z, translation);
}

// Moves a vertex. Normals are multiplied by the cofactors of the linear map, which is scaled so that nothing overflows.
void skin(Affine map, inout vec3 position, inout vec3 normal, inout vec3 tangent, inout float side) {
    float scale = scale_to_one(max(largest_of(map.x), max(largest_of(map.y), largest_of(map.z))));
    precise vec3 x = map.x * scale, y = map.y * scale, z = map.z * scale;
    vec3 yz = crossed(y, z), zx = crossed(z, x), xy = crossed(x, y);
    bool mirrors = dot_in_order(x, yz) < 0.0;
    precise vec3 moved = combined(map.x, map.y, map.z, position) + map.translation;
    position = moved;
    normal = mirrors ? combined(-yz, -zx, -xy, normal) : combined(yz, zx, xy, normal);
    tangent = combined(map.x, map.y, map.z, tangent);
    // The cross product of reflected vectors is the reverse of their reflected cross product.
    side = mirrors ? -side : side;
}

uint tangent_code(vec3 tangent, float side) {
    uint code = encode_exactly(tangent);
    return code == FLAT_NORMAL ? code : code & ~1u | (side > 0.0 ? 1u : 0u);
}

void main() {
    uint vertex_ix = invocation_ix();
    if (vertex_ix >= mesh.n_vertices) return;
    RestVertex rest = rest_vertices[vertex_ix];
    precise vec3 position = rest.position, normal = rest.normal, tangent = rest.tangent;
    for (uint i = 0u; i < rest.n_deltas; ++i) {
        MorphDelta delta = deltas[rest.first_delta + i];
        float weight = weights[delta.target];
        if (weight != 0.0) {
            position += weight * delta.position;
            normal += weight * delta.normal;
            tangent += weight * delta.tangent;
        }
    }
    float side = rest.side;
    if (mesh.n_influences > 0u) skin(blended(vertex_ix), position, normal, tangent, side);
    deformed[vertex_ix] = DeformedVertex(position, encode_exactly(normal));
    if (mesh.has_tangents != 0u) tangents[vertex_ix] = tangent_code(tangent, side);
}
