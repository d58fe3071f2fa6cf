// The binding of the scene's materials, `materials`.
#ifndef KDRAY_MATERIALS
#define KDRAY_MATERIALS

#include "layout.glsl"

layout(std430, set = 0, binding = BIND_MATERIALS) readonly buffer MaterialsBlock { Material materials[]; };

#endif
