// The pixels of the window that a triangle may cover. All points are relative to the eye, with world axes and units.
// "Depth" is the distance along the camera's `forward`.
#ifndef KDRAY_FOOTPRINT
#define KDRAY_FOOTPRINT

#include "layout.glsl"
#include "frame.glsl"
#include "rays/camera.glsl"

// A rectangle of the window's pixels.
struct Rectangle {
    uvec2 first;
    uvec2 size;
};

uint area_of(Rectangle rectangle) {
    return rectangle.size.x * rectangle.size.y;
}

// Heights of the rays through a rectangle's pixels above three planes, positive towards the triangle. Each plane
// contains one edge of the triangle and, of a perspective camera, the eye. Heights are linear in the pixel: at_first is
// that of the rectangle's first pixel, step_x and step_y are the changes per pixel. at_first includes a slack above all
// rounding errors, so no height of a ray that meets the triangle is below 0.
struct EdgeHeights {
    vec3 at_first;
    vec3 step_x;
    vec3 step_y;
};

#include "rasterize/parallel.glsl"

// A bound of the length of the directions through pixels before they are normalized.
float longest_in_image() {
    return length(abs(frame.forward) + abs(frame.right) + abs(frame.up));
}

// The heights for a triangle a, b, c. If the triangle is seen edge-on, rounding may flip the planes' normals. Then
// all heights are set to the slack, and no pixel is excluded.
EdgeHeights edge_heights(vec3 a, vec3 b, vec3 c, Rectangle rectangle) {
    if (ORTHOGRAPHIC) return parallel_heights(a, b, c, rectangle);
    vec3 across_a = cross(b, c), across_b = cross(c, a), across_c = cross(a, b);
    float volume = dot(a, across_a);
    vec3 far = vec3(length(a), length(b), length(c));
    bool is_certain = abs(volume) > exp2(-18.0) * far.x * far.y * far.z;
    mat3 normals = (is_certain ? (volume < 0.0 ? -1.0 : 1.0) : 0.0) * mat3(across_a, across_b, across_c);
    vec3 slack = exp2(-19.0) * longest_in_image() * far.yzx * far.zxy;
    vec2 pixel = 2.0 / vec2(frame.picture_width, frame.picture_height);
    vec3 at_first = sample_in_image(rectangle.first) * normals + slack;
    return EdgeHeights(at_first, pixel.x * frame.right * normals, -pixel.y * frame.up * normals);
}

// Whether certainly no ray through the rectangle's pixels meets the triangle: all of them pass outside one edge.
bool misses(EdgeHeights heights, Rectangle rectangle) {
    vec2 last = vec2(rectangle.size) - 1.0;
    vec3 highest = heights.at_first + last.x * max(heights.step_x, vec3(0.0)) + last.y * max(heights.step_y, vec3(0.0));
    return any(lessThan(highest, vec3(0.0)));
}

// Whether certainly the ray through one of the rectangle's pixels does not meet the triangle.
bool misses_pixel(EdgeHeights heights, uvec2 offset) {
    vec3 height = heights.at_first + float(offset.x) * heights.step_x + float(offset.y) * heights.step_y;
    return any(lessThan(height, vec3(0.0)));
}

// The largest error of a projected corner that is not steeper than STEEPEST, as a fraction of the picture's longer
// side.
const float SLACK = exp2(-15.0);
// The steepness of a point is its distance from the eye divided by its depth. Up to this steepness, SLACK bounds the
// error of the projection. If longest_in_image() is at most STEEPEST, points of twice this steepness are outside the
// window.
const float STEEPEST = 20.0;

// Projects a point to pixels of the window; (0, 0) is the first pixel's sample. ahead: the point's depth.
vec2 projected(vec3 point, float ahead) {
    mat4 m = frame.clip_from_world;
    vec2 clip = vec2(dot(point, vec3(m[0].x, m[1].x, m[2].x)), dot(point, vec3(m[0].y, m[1].y, m[2].y)));
    vec2 at = (clip / ahead * 0.5 + 0.5) * vec2(frame.picture_width, frame.picture_height) - 0.5;
    return at - vec2(frame.window_x, frame.window_y);
}

// Whether a corner is steeper than STEEPEST, or not in front of the eye. ahead: its depth.
bool is_steep(vec3 corner, float ahead) {
    return !(ahead > 0.0) || ahead * ahead * STEEPEST * STEEPEST < dot(corner, corner);
}

// A box of projected points, in pixels of the window. slack: how far outside the box the exact points may be because
// of rounding.
struct Footprint {
    vec2 low;
    vec2 high;
    float slack;
};

// The slack of points that are not steep, pixels.
float least_slack() {
    return SLACK * float(max(frame.picture_width, frame.picture_height));
}

// The window's pixels whose samples are within the bounds. It is empty if the bounds fall between samples.
Rectangle rectangle_of(Footprint bounds) {
    vec2 window = vec2(frame.width, frame.height);
    vec2 first = clamp(ceil(bounds.low - bounds.slack), vec2(0.0), window);
    vec2 end = clamp(floor(bounds.high + bounds.slack) + 1.0, first, window);
    return Rectangle(uvec2(first), uvec2(end - first));
}

// Extends the bounds by a point of depth `ahead`. reach: the largest distance from the eye of the corners from which
// the point was computed.
void include(inout Footprint bounds, vec3 point, float ahead, float reach) {
    vec2 at = projected(point, ahead);
    bounds.low = min(bounds.low, at);
    bounds.high = max(bounds.high, at);
    bounds.slack = max(bounds.slack, least_slack() / STEEPEST * reach / ahead);
}

// Extends the bounds by the part of the edge from p to q whose depth is at least `nearest`. The corner q itself is
// left to the next edge, which begins there. ahead: the depths of p and q.
void include_edge(inout Footprint bounds, vec3 p, vec3 q, vec2 ahead, float nearest) {
    if (ahead.x >= nearest) include(bounds, p, ahead.x, length(p));
    if (ahead.x >= nearest == ahead.y >= nearest) return;
    vec3 between = mix(p, q, (nearest - ahead.x) / (ahead.y - ahead.x));
    include(bounds, between, nearest, max(length(p), length(q)));
}

// The rectangle of a triangle that is partly beside or behind the eye. Only the part of the triangle whose depth is
// at least 1 / (2 * STEEPEST) of its plane's distance from the eye is projected. No point of the triangle is nearer
// to the eye than its plane, so the points of smaller depth are at least twice as steep as STEEPEST and outside the
// window. ahead: the depths of a, b and c.
Rectangle rectangle_beside_eye(vec3 a, vec3 b, vec3 c, vec3 ahead) {
    Rectangle window = Rectangle(uvec2(0u), uvec2(frame.width, frame.height));
    vec3 normal = cross(b - a, c - a);
    // A lower bound of the plane's distance from the eye: what rounding may have added is subtracted.
    float distance = abs(dot(a, normal)) / length(normal) - exp2(-18.0) * max(length(a), max(length(b), length(c)));
    if (!(distance > 0.0) || longest_in_image() > STEEPEST) return window;
    float nearest = distance / (2.0 * STEEPEST);
    Footprint bounds = Footprint(vec2(frame.width, frame.height), vec2(-1.0), least_slack());
    include_edge(bounds, a, b, ahead.xy, nearest);
    include_edge(bounds, b, c, ahead.yz, nearest);
    include_edge(bounds, c, a, ahead.zx, nearest);
    return rectangle_of(bounds);
}

#endif
