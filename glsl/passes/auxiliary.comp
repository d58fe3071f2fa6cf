#version 460
#extension GL_GOOGLE_include_directive : require
// Auxiliary buffers: one invocation per pixel of the batch adds the first hits of its samples to what the noise filter
// `edge` knows of the pixel. Samples are added in the order of their indices, so that the means do not depend on how
// many samples a frame draws. A sample that is drawn again is not added again. Reads hits, path_states after bounce 0,
// and the scene; updates pixel_aux.
#include "layout.glsl"
#include "rays/paths.glsl"
#include "rays/path_camera.glsl"
#include "shading/path_vertex.glsl"
#include "picture/noise.glsl"

layout(local_size_x = RAY_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_HITS) readonly buffer HitsBlock { Hit hits[]; };
layout(std430, set = 0, binding = BIND_PATH_STATES) readonly buffer PathStatesBlock { vec4 path_states[]; };
layout(std430, set = 0, binding = BIND_PIXEL_AUX) buffer PixelAuxBlock { Auxiliary pixel_aux[]; };

// Adds the surface at a sample's hit.
void add_surface(inout Auxiliary aux, Surface surface, float gloss) {
    aux.n_hits += 1u;
    float weight = 1.0 / float(aux.n_hits);
    aux.position_world += weight * (surface.point_world - aux.position_world);
    aux.normal_world += weight * (surface.shading - aux.normal_world);
    aux.gloss += weight * (gloss - aux.gloss);
}

// Adds a path.
void add_path(inout Auxiliary aux, uvec2 pixel, uint path_ix) {
    Hit hit = hits[path_ix];
    SampleKey key = key_of_path(path_ix, pixel);
    PathRay ray = path_camera_ray(pixel, random_pair(key, 0u), random_pair(key, 1u));
    vec3 albedo = vec3(0.0);
    // A lamp in front of the hit ends the path.
    if (hit.triangle_ix != NO_TRIANGLE && isinf(seen_light(ray.origin, ray.direction, hit.t).t)) {
        Surface surface;
        Material material;
        shaded_at(ray, hit, surface, material);
        add_surface(aux, surface, surface_gloss(material));
        if (!is_unlit(material)) albedo = surface_albedo(material);
    }
    aux.n_samples += 1u;
    float weight = 1.0 / float(aux.n_samples);
    vec3 seen = path_states[path_ix].xyz;
    aux.albedo += weight * (albedo - aux.albedo);
    aux.seen += weight * (seen - aux.seen);
    aux.seen_squared += weight * (squared_luminance(seen) - aux.seen_squared);
}

void main() {
    uint place = gl_GlobalInvocationID.x;
    if (place >= batch.n_pixels) return;
    uvec2 pixel = pixel_at(place);
    uint pixel_ix = pixel_ix_of(pixel), n_of_frame = 1u << frame.samples_log2;
    uint n_earlier = frame.n_samples - n_of_frame;
    Auxiliary aux = Auxiliary(vec3(0.0), 0u, vec3(0.0), 0.0, vec3(0.0), 0.0, vec3(0.0), 0u);
    if (n_earlier > 0u) aux = pixel_aux[pixel_ix];
    for (uint sample_ix = 0u; sample_ix < n_of_frame; ++sample_ix) {
        bool is_new = n_earlier + sample_ix >= aux.n_samples;
        if (is_new) add_path(aux, pixel, path_of(place, sample_ix));
    }
    pixel_aux[pixel_ix] = aux;
}
