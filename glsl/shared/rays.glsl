// The batch's rays: the queue. The camera's come first, one a pixel. They follow from their places, and are made where they are
// looked at: to store and load them would take longer.
#ifndef KDRAY_RAYS
#define KDRAY_RAYS

#include "layout.glsl"
#include "camera.glsl"

layout(push_constant) uniform BatchBlock { Batch batch; };
layout(std430, set = 0, binding = BIND_RAYS) readonly buffer RaysBlock { PathRay rays[]; };

// The window's pixel that a ray of the camera goes through.
uvec2 pixel_of_ray(uint ray_ix) {
    return pixel_of(batch.first_pixel + ray_ix, frame.width, frame.height);
}

PathRay ray_at(uint ray_ix) {
    if (ray_ix < batch.n_pixels) return camera_ray(pixel_of_ray(ray_ix));
    return rays[ray_ix];
}

#endif
