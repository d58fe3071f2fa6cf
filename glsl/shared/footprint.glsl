// Where a triangle may lie in the window. All corners are given from the eye.
#ifndef KDRAY_FOOTPRINT
#define KDRAY_FOOTPRINT

#include "layout.glsl"
#include "frame.glsl"
#include "camera.glsl"

// Pixels from `first` on, `size` of them each way.
struct Rectangle {
    uvec2 first;
    uvec2 size;
};

uint area_of(Rectangle rectangle) {
    return rectangle.size.x * rectangle.size.y;
}

// Three planes stand on a triangle's edges and meet in the eye. How high above them, towards the triangle, the direction through
// a rectangle's pixel points: at its first one, and with each step. Not below 0 where a ray meets the triangle, whatever has been
// rounded.
struct EdgeHeights {
    vec3 at_first;
    vec3 step_x;
    vec3 step_y;
};

// Longer than the direction through any pixel.
float longest_in_image() {
    return length(abs(frame.forward) + abs(frame.right) + abs(frame.up));
}

// Where the triangle is seen edge-on, the planes say nothing.
EdgeHeights edge_heights(vec3 a, vec3 b, vec3 c, Rectangle rectangle) {
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

// Whether no ray through the rectangle's pixels meets the triangle: all of them lie beyond one edge.
bool misses(EdgeHeights heights, Rectangle rectangle) {
    vec2 last = vec2(rectangle.size) - 1.0;
    vec3 highest = heights.at_first + last.x * max(heights.step_x, vec3(0.0)) + last.y * max(heights.step_y, vec3(0.0));
    return any(lessThan(highest, vec3(0.0)));
}

// As `misses`, of one of its pixels.
bool misses_pixel(EdgeHeights heights, uvec2 offset) {
    vec3 height = heights.at_first + float(offset.x) * heights.step_x + float(offset.y) * heights.step_y;
    return any(lessThan(height, vec3(0.0)));
}

// Of the picture's longer side: what a projected corner is off at the most, if it is not steeper than STEEPEST.
const float SLACK = exp2(-15.0);
// How far to the side of the way ahead a point may be, in that way's lengths. Twice as steep ones lie outside every window.
const float STEEPEST = 20.0;

// Where a point is projected to, pixels of the window, where 0 is the first pixel's sample. ahead: its way along `forward`.
vec2 projected(vec3 point, float ahead) {
    mat4 m = frame.clip_from_world;
    vec2 clip = vec2(dot(point, vec3(m[0].x, m[1].x, m[2].x)), dot(point, vec3(m[0].y, m[1].y, m[2].y)));
    vec2 at = (clip / ahead * 0.5 + 0.5) * vec2(frame.picture_width, frame.picture_height) - 0.5;
    return at - vec2(frame.window_x, frame.window_y);
}

bool is_steep(vec3 corner, float ahead) {
    return !(ahead > 0.0) || ahead * ahead * STEEPEST * STEEPEST < dot(corner, corner);
}

// A box in the picture, and how far beyond it what is in it may lie.
struct Bounds {
    vec2 low;
    vec2 high;
    float slack;
};

float least_slack() {
    return SLACK * float(max(frame.picture_width, frame.picture_height));
}

// The window's pixels whose samples lie within; none where the bounds fall between samples.
Rectangle rectangle_of(Bounds bounds) {
    vec2 window = vec2(frame.width, frame.height);
    vec2 first = clamp(ceil(bounds.low - bounds.slack), vec2(0.0), window);
    vec2 end = clamp(floor(bounds.high + bounds.slack) + 1.0, first, window);
    return Rectangle(uvec2(first), uvec2(end - first));
}

// reach: the largest length that the point was reckoned from.
void include(inout Bounds bounds, vec3 point, float ahead, float reach) {
    vec2 at = projected(point, ahead);
    bounds.low = min(bounds.low, at);
    bounds.high = max(bounds.high, at);
    bounds.slack = max(bounds.slack, least_slack() / STEEPEST * reach / ahead);
}

// What of the edge lies as far ahead as `nearest`, but for its end q.
void include_edge(inout Bounds bounds, vec3 p, vec3 q, vec2 ahead, float nearest) {
    if (ahead.x >= nearest) include(bounds, p, ahead.x, length(p));
    if (ahead.x >= nearest == ahead.y >= nearest) return;
    vec3 between = mix(p, q, (nearest - ahead.x) / (ahead.y - ahead.x));
    include(bounds, between, nearest, max(length(p), length(q)));
}

// Of a triangle that lies beside the eye in part: cut off there, where it is too steep for the window. It keeps a distance from
// the eye, so what is less far ahead than a fraction of that is steep.
Rectangle rectangle_beside_eye(vec3 a, vec3 b, vec3 c, vec3 ahead) {
    Rectangle window = Rectangle(uvec2(0u), uvec2(frame.width, frame.height));
    vec3 normal = cross(b - a, c - a);
    float distance = abs(dot(a, normal)) / length(normal) - exp2(-18.0) * max(length(a), max(length(b), length(c)));
    if (!(distance > 0.0) || longest_in_image() > STEEPEST) return window;
    float nearest = distance / (2.0 * STEEPEST);
    Bounds bounds = Bounds(vec2(frame.width, frame.height), vec2(-1.0), least_slack());
    include_edge(bounds, a, b, ahead.xy, nearest);
    include_edge(bounds, b, c, ahead.yz, nearest);
    include_edge(bounds, c, a, ahead.zx, nearest);
    return rectangle_of(bounds);
}

#endif
