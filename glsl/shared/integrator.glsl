// Needs nothing. Provides `PATHS`.
#ifndef KDRAY_INTEGRATOR
#define KDRAY_INTEGRATOR

#include "layout.glsl"

// Whether the frame traces paths, and not the ray trees of the paper.
layout(constant_id = CONSTANT_PATHS) const bool PATHS = false;

#endif
