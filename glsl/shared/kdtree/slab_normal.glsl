// The mean normal of a surface: the main axis of the sum of a a^T / |a| over the area vectors a of its pieces. The sum
// does not depend on the triangles' winding, and a piece counts by its area. Needs nothing before it; includes
// slab_build.glsl.
#ifndef KDRAY_SLAB_NORMAL
#define KDRAY_SLAB_NORMAL

#include "kdtree/slab_build.glsl"

layout(std430, set = 0, binding = BIND_KD_SLAB_AREAS) readonly buffer AreasBlock { vec4 areas[]; };

// A symmetric matrix: its diagonal, and the elements yz, zx and xy.
struct Tensor {
    vec3 diagonal;
    vec3 mixed;
};

// A length below which an area vector or a tensor counts as 0: squares of smaller numbers may be denormal.
const float LEAST_AREA = 1.0e-18;
// Each squaring squares the ratio of the main axis to the others: after 6, it is the 64th power.
const uint N_SQUARINGS = 6u;

Tensor sum_of(Tensor a, Tensor b) {
    return Tensor(a.diagonal + b.diagonal, a.mixed + b.mixed);
}

// Adds an entry's area vector to a tensor.
void add_entry(inout Tensor sum, uint entry_ix) {
    vec3 area = areas[entry_ix].xyz;
    float size = length(area);
    if (!(size > LEAST_AREA)) return;
    vec3 share = area / size;
    sum.diagonal += area * share;
    sum.mixed += area.yzx * share.zxy;
}

float trace_of(vec3 diagonal) {
    return diagonal.x + diagonal.y + diagonal.z;
}

// The axis of the largest eigenvalue, of unit length, or 0 if the tensor is 0.
vec3 main_axis(Tensor tensor) {
    float trace = trace_of(tensor.diagonal);
    if (!(trace > LEAST_AREA)) return vec3(0.0);
    vec3 d = tensor.diagonal / trace, m = tensor.mixed / trace;
    for (uint i = 0u; i < N_SQUARINGS; ++i) {
        // m.x is the element yz, so m.zxy are xy, yz, zx, and m.yzx are zx, xy, yz: the others of rows x, y, z.
        vec3 squared = d * d + m.zxy * m.zxy + m.yzx * m.yzx;
        m = m * (d.yzx + d.zxy) + m.yzx * m.zxy;
        trace = trace_of(squared);
        d = squared / trace;
        m = m / trace;
    }
    vec3 column = vec3(d.x, m.z, m.y);
    if (d.y > d.x) column = vec3(m.z, d.y, m.x);
    if (d.z > max(d.x, d.y)) column = vec3(m.y, m.x, d.z);
    return normalize(column);
}

#endif
