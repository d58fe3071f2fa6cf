// Provides the frame's constants, the uniform buffer `frame`.
#ifndef KDRAY_FRAME
#define KDRAY_FRAME

#include "layout.glsl"

layout(std140, set = 0, binding = BIND_FRAME) uniform FrameBlock { Frame frame; };

#endif
