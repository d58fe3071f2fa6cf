// The rays of the batch, in the queue. Camera rays come first, one per pixel. They are not stored: their indices
// define them, and to compute them is faster than to load them. In frames of paths, all rays are stored, and a pixel
// has 2^samples_log2 of them. Needs nothing before it; provides `pixel_of_ray`, `first_ray_of`, `ray_at`
// and the push constants `batch`.
#ifndef KDRAY_RAYS
#define KDRAY_RAYS

#include "layout.glsl"
#include "rays/camera.glsl"
#include "integrator.glsl"

layout(push_constant) uniform BatchBlock { Batch batch; };
layout(std430, set = 0, binding = BIND_RAYS) readonly buffer RaysBlock { PathRay rays[]; };

// The window's pixel that a camera ray goes through.
uvec2 pixel_of_ray(uint ray_ix) {
    return pixel_of(batch.first_pixel + ray_ix, frame.width, frame.height);
}

// The index in the queue of a pixel's first camera ray, by the pixel's place in the batch.
uint first_ray_of(uint place) {
    return PATHS ? place << frame.samples_log2 : place;
}

// Any ray of the batch, by its index in the queue.
PathRay ray_at(uint ray_ix) {
    // Paths store their camera rays, too.
    bool is_stored = PATHS ? true : ray_ix >= batch.n_pixels;
    if (!is_stored) return camera_ray(pixel_of_ray(ray_ix));
    return rays[ray_ix];
}

#endif
