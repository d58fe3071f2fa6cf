// The camera rays of paths: through a point of the pixel and of the lens that are random. Twin of
// src/reference/path_camera.rs. Needs nothing; it includes frame.glsl.
#ifndef KDRAY_PATH_CAMERA
#define KDRAY_PATH_CAMERA

#include "layout.glsl"
#include "rays/camera.glsl"
#include "rays/noise_tiles.glsl"
#include "sampler.glsl"
#include "tent.glsl"

// The direction of an angle that is the share `turn` of a full turn. Vulkan bounds the errors of sines and cosines only
// between minus and plus half a turn.
vec2 on_circle(float turn) {
    float angle = 6.2831853 * (turn - floor(turn + 0.5));
    return vec2(cos(angle), sin(angle));
}

// The offset of a sample from the centre of its pixel, pixels. Its pdf is the pixel's filter, so all samples have
// the same weight (Ernst, Stamminger, Greiner: Filter Importance Sampling, 2006).
vec2 filter_offset(vec2 u) {
    if (frame.pixel_filter == FILTER_CENTRE) return vec2(0.0);
    if (frame.pixel_filter == FILTER_BOX) return u - 0.5;
    if (frame.pixel_filter == FILTER_TENT) return vec2(tent(u.x), tent(u.y));
    // The distance that a Gaussian of two dimensions gives, cut off at three standard deviations of 0.5 px.
    float within = 1.0 - exp(-4.5);
    return 0.5 * sqrt(-2.0 * log(1.0 - u.x * within)) * on_circle(u.y);
}

// The point of the unit disk, by the concentric map of the square (Shirley, Chiu: A Low Distortion Map Between Disk and
// Square, 1997).
vec2 lens_point(vec2 u) {
    vec2 at = 2.0 * u - 1.0;
    if (at == vec2(0.0)) return vec2(0.0);
    bool is_flat = abs(at.x) > abs(at.y);
    float radius = is_flat ? at.x : at.y;
    float turn = is_flat ? 0.125 * at.y / at.x : 0.25 - 0.125 * at.x / at.y;
    return radius * on_circle(turn);
}

// The camera ray of a sample of the window's pixel. in_pixel, in_lens: random numbers in [0, 1).
PathRay path_camera_ray(uvec2 pixel, vec2 in_pixel, vec2 in_lens) {
    vec2 at_px = vec2(picture_pixel_of(pixel)) + 0.5 + filter_offset(in_pixel);
    vec2 at = at_px / vec2(frame.picture_width, frame.picture_height) * 2.0 - 1.0;
    vec3 in_image = at.x * frame.right - at.y * frame.up;
    vec3 origin = frame.eye;
    vec3 direction = frame.forward;
    if (ORTHOGRAPHIC) origin += in_image;
    else direction += in_image;
    if (frame.aperture > 0.0) {
        vec2 lens = frame.aperture * lens_point(in_lens);
        vec3 aside = lens.x * normalize(frame.right) + lens.y * normalize(frame.up);
        direction = frame.focus * direction - aside;
        origin += aside;
    }
    return PathRay(origin, pixel_ix_of(pixel), normalize(direction), NO_TRIANGLE, vec3(1.0), INFINITY);
}

#endif
