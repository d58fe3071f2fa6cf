#version 460
#extension GL_GOOGLE_include_directive : require
// Deformation of a mesh, 2 of 2: writes a triangle of the deformed vertices, and the tangents of its corners. One
// invocation per face. The colours of corners stay as they are.
// Reads faces, deformed and tangents; writes some rows of triangles, and words of texture_words.
#include "deform.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_DEFORM_DEFORMED) readonly buffer DeformedBlock { DeformedVertex deformed[]; };
layout(std430, set = 0, binding = BIND_DEFORM_TANGENTS) readonly buffer TangentsBlock { uint tangents[]; };
layout(std430, set = 0, binding = BIND_DEFORM_FACES) readonly buffer FacesBlock { uint faces[]; };
layout(std430, set = 0, binding = BIND_DEFORM_TRIANGLES) writeonly buffer TrianglesBlock { Triangle triangles[]; };
layout(std430, set = 0, binding = BIND_DEFORM_TEXTURE_WORDS) writeonly buffer WordsBlock { uint texture_words[]; };

void main() {
    uint face_ix = invocation_ix();
    if (face_ix >= mesh.n_faces) return;
    uvec3 face = uvec3(faces[3u * face_ix], faces[3u * face_ix + 1u], faces[3u * face_ix + 2u]);
    DeformedVertex a = deformed[face.x], b = deformed[face.y], c = deformed[face.z];
    triangles[mesh.first_row + face_ix] = Triangle(a.position, a.normal, b.position, b.normal, c.position, c.normal);
    if (mesh.first_corner_word == NO_WORDS) return;
    // A `CornerSurface` has two words, of which the tangent is the first one.
    uint word = mesh.first_corner_word + 6u * face_ix;
    texture_words[word] = tangents[face.x];
    texture_words[word + 2u] = tangents[face.y];
    texture_words[word + 4u] = tangents[face.z];
}
