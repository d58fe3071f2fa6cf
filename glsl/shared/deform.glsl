// What the kernels share that deform a mesh (src/passes/deform.rs): push constants, and the place of an invocation.
#ifndef KDRAY_DEFORM
#define KDRAY_DEFORM

#include "layout.glsl"

layout(push_constant) uniform DeformBlock { DeformMesh mesh; };

// The index of the invocation's vertex or face. In the last row of workgroups, it may be beyond the last one.
uint invocation_ix() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    return group * SCAN_GROUP_SIZE + gl_LocalInvocationIndex;
}

#endif
