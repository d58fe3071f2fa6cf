// Provides the frame's constants, the uniform buffer `frame`, and the kind of its camera.
#ifndef KDRAY_FRAME
#define KDRAY_FRAME

#include "layout.glsl"

// Whether the camera is orthographic: its rays are parallel to `frame.forward`. Otherwise they begin at `frame.eye`.
layout(constant_id = CONSTANT_ORTHOGRAPHIC) const bool ORTHOGRAPHIC = false;

layout(std140, set = 0, binding = BIND_FRAME) uniform FrameBlock { Frame frame; };

#endif
