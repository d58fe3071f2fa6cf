// The pixels of the window that a triangle may cover in the picture of an orthographic camera. All points are relative
// to the eye, with world axes and units. Needs `EdgeHeights` and `Rectangle` (footprint.glsl).
#ifndef KDRAY_PARALLEL
#define KDRAY_PARALLEL

#include "layout.glsl"
#include "frame.glsl"
#include "rays/camera.glsl"

// A bound of how far rounding moves a ray off a triangle a, b, c (world units). Rounding takes 2^-24 of the largest
// magnitude in each operation: of a corner, of the point where the ray begins, and of the eye, to which this point is
// added. The projection, the ray and the triangle test take less than 32 such operations.
float parallel_slack(vec3 a, vec3 b, vec3 c) {
    float image = length(abs(frame.right) + abs(frame.up));
    return exp2(-19.0) * (length(frame.eye) + image + max(length(a), max(length(b), length(c))));
}

// The same bound in pixels.
float parallel_slack_px(vec3 a, vec3 b, vec3 c) {
    return parallel_slack(a, b, c) * 0.5 * float(frame.picture_height) / length(frame.up);
}

// Whether a triangle is certainly behind the eye. ahead: the depths of its corners.
bool is_behind(vec3 a, vec3 b, vec3 c, vec3 ahead) {
    return all(lessThan(ahead, vec3(-parallel_slack(a, b, c))));
}

// Projects a point to pixels of the window; (0, 0) is the first pixel's sample.
vec2 projected_in_parallel(vec3 point) {
    mat4 m = frame.clip_from_world;
    vec2 clip = vec2(dot(point, vec3(m[0].x, m[1].x, m[2].x)), dot(point, vec3(m[0].y, m[1].y, m[2].y)));
    vec2 at = (clip * 0.5 + 0.5) * vec2(frame.picture_width, frame.picture_height);
    return at - vec2(frame.sample_x, frame.sample_y) - vec2(frame.window_x, frame.window_y);
}

// The heights of the rays of a rectangle's pixels above three planes, each of which contains an edge of the triangle
// and is parallel to the rays. If the triangle is seen edge-on, rounding may flip the planes' normals. Then all heights
// are set to the slack, and no pixel is excluded.
EdgeHeights parallel_heights(vec3 a, vec3 b, vec3 c, Rectangle rectangle) {
    vec3 across_a = c - b, across_b = a - c, across_c = b - a;
    float longest = max(length(across_a), max(length(across_b), length(across_c)));
    float slack = parallel_slack(a, b, c) * longest;
    float doubled_area = dot(frame.forward, cross(across_b, across_c));
    mat3 normals = mat3(cross(across_a, frame.forward), cross(across_b, frame.forward), cross(across_c, frame.forward));
    normals *= abs(doubled_area) > 2.0 * slack ? -sign(doubled_area) : 0.0;
    vec2 pixel = 2.0 / vec2(frame.picture_width, frame.picture_height);
    vec3 first = sample_beside_eye(rectangle.first);
    vec3 at_first = vec3(dot(first - b, normals[0]), dot(first - c, normals[1]), dot(first - a, normals[2])) + slack;
    return EdgeHeights(at_first, pixel.x * frame.right * normals, -pixel.y * frame.up * normals);
}

#endif
