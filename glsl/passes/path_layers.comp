#version 460
#extension GL_GOOGLE_include_directive : require
// Path layers: one invocation per pixel of the batch sums one layer of the light of the pixel's paths. There are three:
// emission, which the camera sees directly, direct light, which reaches it after one bounce, and indirect light, the
// rest. The first is complete after bounce 0, the second after bounce 1, and the third after the last bounce. A layer
// is what the radiance of a path has gained since the layer before, and a snapshot of the radiance is kept for that.
// Reads path_states; updates path_snapshots; writes the layer's part of pixel_radiance.
#include "layout.glsl"
#include "rays/paths.glsl"
#include "picture/sample_sums.glsl"

layout(local_size_x = RAY_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_PATH_STATES) readonly buffer PathStatesBlock { vec4 path_states[]; };
layout(std430, set = 0, binding = BIND_PATH_SNAPSHOTS) buffer PathSnapshotsBlock { vec4 path_snapshots[]; };
layout(std430, set = 0, binding = BIND_PIXEL_RADIANCE) writeonly buffer PixelRadianceBlock { vec4 pixel_radiance[]; };

void main() {
    uint place = gl_GlobalInvocationID.x;
    if (place >= batch.n_pixels) return;
    uint layer_ix = min(batch.depth, LIGHT_LAYERS - 1u);
    uint n_samples = 1u << frame.samples_log2;
    for (uint sample_ix = 0u; sample_ix < n_samples; ++sample_ix) {
        uint path_ix = path_of(place, sample_ix);
        vec3 radiance = path_states[path_ix].xyz;
        vec3 before = layer_ix == 0u ? vec3(0.0) : path_snapshots[path_ix].xyz;
        add_sample(sample_ix, vec4(radiance - before, 1.0));
        path_snapshots[path_ix] = vec4(radiance, 0.0);
    }
    uint n_pixels = frame.width * frame.height;
    uint layer_begin = (1u + layer_ix) * n_pixels;
    pixel_radiance[layer_begin + pixel_ix_of(pixel_at(place))] = sample_sums[frame.samples_log2];
}
