// The kinds of emitters of a scene. What depends on a kind that the scene lacks is left out when the driver compiles
// the kernel, which saves registers, and time on drivers that run both sides of a branch.
//
// Needs nothing. Provides `has_emitters`, `has_shapes` and `HAS_ENVIRONMENT_MAP`.
#ifndef KDRAY_EMITTER_KINDS
#define KDRAY_EMITTER_KINDS

#include "layout.glsl"

layout(constant_id = CONSTANT_EMITTERS) const uint EMITTERS = 0xffffffffu;
const bool HAS_ENVIRONMENT_MAP = (EMITTERS & EMITTERS_MAP) != 0u;

// Whether the scene may have emitters of a kind, `EMITTER_LIGHT` and its like.
bool has_emitters(uint kind) {
    return (EMITTERS & (1u << kind)) != 0u;
}

// Whether the scene may have area lights of a shape, `AREA_RECTANGLE` and its like.
bool has_shapes(uint kind) {
    return (EMITTERS & (EMITTERS_SHAPE << kind)) != 0u;
}

#endif
