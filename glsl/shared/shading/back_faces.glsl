// Back faces: camera rays pass through those of single-sided materials. No other rays do, so a mirror shows both sides
// of a surface, and both sides cast shadows.
//
// Needs scene.glsl and search/triangle.glsl. Provides `CULLS_BACK_FACES`, `is_single_sided` and `is_culled`.
#ifndef KDRAY_BACK_FACES
#define KDRAY_BACK_FACES

#include "layout.glsl"
#include "shading/materials.glsl"

layout(constant_id = CONSTANT_CULLS_BACK_FACES) const bool CULLS_BACK_FACES = false;

bool is_single_sided(uint triangle_ix) {
    return (materials[material_ix_of(triangle_ix)].flags & MATERIAL_SINGLE_SIDED) != 0u;
}

// Whether a camera ray passes through a triangle that it hits.
bool is_culled(Shear shear, Triangle triangle, uint triangle_ix) {
    return is_back_face(shear, triangle) && is_single_sided(triangle_ix);
}

#endif
