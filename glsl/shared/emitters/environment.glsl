// What rays that leave the scene see: a map, or the background, and the suns. Twin of
// src/reference/emitters/environment.rs.
//
// The map is equirectangular. Its rows go from the zenith, +y, down to -y. Its middle is in the direction -z, and the
// quarter to the right of it is +x. `environment_turn` turns it about +y.
//
// The map is bilinear between the middles of texels, and directions are sampled in proportion to its luminance. Such a
// map is a sum of tents: each texel has one, which falls from the texel's middle to those of its neighbours. A row is
// sampled first, and then a texel of the row, each by an alias table, and at last a place below the texel's tent. The
// pdf in the map is therefore bilinear, too. Per steradian, it is divided by the sine of the polar angle.
//
// Needs the words of textures (shading/texture_words.glsl).
#ifndef KDRAY_ENVIRONMENT
#define KDRAY_ENVIRONMENT

#include "layout.glsl"
#include "tent.glsl"
#include "shading/texture_words.glsl"
#include "emitters/alias.glsl"
#include "emitters/kinds.glsl"
#include "emitters/light_sample.glsl"
#include "emitters/sun.glsl"

// Lower bound of the sine by which the pdf in the map is divided. At the poles, the sine is 0.
const float LEAST_MAP_SINE = 1.0e-6;

// A texel: colour, and the pdf in the map.
vec4 environment_texel(uint x, uint y) {
    uint n_rows = accel.environment_height, n_columns = accel.environment_width;
    uint at = accel.environment_begin + 2u * (n_rows + n_rows * n_columns) + 4u * (y * n_columns + x);
    return vec4(load_float(at), load_float(at + 1u), load_float(at + 2u), load_float(at + 3u));
}

// Where a direction is in the map, texels to the right and down from the middle of the first one.
// aside: the sine of the polar angle.
vec2 environment_place(vec3 direction, float aside) {
    float turns = atan(direction.x, -direction.z) / (2.0 * PI) + 0.5 + accel.environment_turn;
    vec2 place = vec2(turns - floor(turns), atan(aside, direction.y) / PI);
    return place * vec2(accel.environment_width, accel.environment_height) - 0.5;
}

// What the map has in a direction: its colour, and the pdf with which the direction is sampled if the environment
// without the suns is sampled, per steradian.
struct MapValue {
    vec3 radiance;
    float pdf;
};

// The map's value at a place. aside: the sine of the place's polar angle.
MapValue map_value(vec2 place, float aside) {
    uint width = accel.environment_width, height = accel.environment_height;
    ivec2 low = ivec2(floor(place));
    vec2 weight = place - vec2(low);
    vec4 rows[2];
    for (int i = 0; i < 2; ++i) {
        uint y = uint(clamp(low.y + i, 0, int(height) - 1));
        uint left = low.x < 0 ? width - 1u : uint(low.x) < width ? uint(low.x) : 0u;
        uint right = left + 1u < width ? left + 1u : 0u;
        vec4 a = environment_texel(left, y);
        rows[i] = a + (environment_texel(right, y) - a) * weight.x;
    }
    vec4 value = rows[0] + (rows[1] - rows[0]) * weight.y;
    return MapValue(value.rgb, value.a / max(aside, LEAST_MAP_SINE));
}

// What a ray that leaves the scene meets: the environment and its suns. pdf: with which sample_light samples the
// direction because of them, per steradian.
struct SeenEnvironment {
    vec3 radiance;
    float pdf;
};

// Adds the suns to what the environment has in a direction.
SeenEnvironment with_suns(MapValue value, vec3 direction) {
    SeenSuns suns = seen_suns(direction);
    float pdf = accel.environment_probability * value.pdf + suns.pdf;
    return SeenEnvironment(value.radiance + suns.radiance, pdf);
}

// What a ray in this direction meets beyond the scene.
SeenEnvironment seen_environment(vec3 direction) {
    MapValue value = MapValue(accel.background, 1.0 / (4.0 * PI));
    if (HAS_ENVIRONMENT_MAP) {
        float aside = sqrt(direction.x * direction.x + direction.z * direction.z);
        value = map_value(environment_place(direction, aside), aside);
    }
    return with_suns(value, direction);
}

// The radiance that surfaces get from a direction in addition: from the sky or from the ground. Neither the camera nor
// mirrors see it.
vec3 ambient_radiance(vec3 direction) {
    return direction[accel.up_axis] < 0.0 ? accel.ground_ambient : accel.ambient;
}

// A direction of the environment, and what the environment without the suns has there.
struct MapSample {
    vec3 direction;
    MapValue value;
};

// A direction of the map.
MapSample sample_map_direction(vec2 u) {
    uint n_rows = accel.environment_height, n_columns = accel.environment_width;
    AliasSample row = sample_alias(accel.environment_begin, 2u, n_rows, u.x, 0.0);
    uint columns_begin = accel.environment_begin + 2u * (n_rows + row.ix * n_columns);
    AliasSample column = sample_alias(columns_begin, 2u, n_columns, u.y, 0.0);
    // Between a pole and the middle of its row, there is no other row: the tent's half is a rectangle of half a texel.
    bool is_at_pole = row.rest < 0.5 ? row.ix == 0u : row.ix == n_rows - 1u;
    float down = float(row.ix) + (is_at_pole ? row.rest - 0.5 : tent(row.rest));
    float right = float(column.ix) + tent(column.rest);
    // The polar angle is taken from the nearer pole, where sines are exact.
    bool is_upper = down + 0.5 < 0.5 * float(n_rows);
    float half_sine = sin(0.5 * PI / float(n_rows) * (is_upper ? down + 0.5 : float(n_rows) - 0.5 - down));
    float versine = 2.0 * half_sine * half_sine;
    float aside = sqrt(max(versine * (2.0 - versine), 0.0));
    float turns = (right + 0.5) / float(n_columns) - 0.5 - accel.environment_turn;
    float azimuth = 2.0 * PI * turns;
    vec3 direction = vec3(aside * sin(azimuth), is_upper ? 1.0 - versine : versine - 1.0, -aside * cos(azimuth));
    return MapSample(direction, map_value(vec2(right, down), aside));
}

// A direction, uniform on the sphere.
MapSample sample_any_direction(vec2 u) {
    float up = 1.0 - 2.0 * u.x;
    float sine = 2.0 * sqrt(max(u.x * (1.0 - u.x), 0.0));
    float azimuth = 2.0 * PI * u.y;
    vec3 direction = vec3(sine * sin(azimuth), up, -sine * cos(azimuth));
    return MapSample(direction, MapValue(accel.background, 1.0 / (4.0 * PI)));
}

// The sample of a direction beyond the scene.
LightSample sample_beyond(vec3 direction, SeenEnvironment seen) {
    Towards way = Towards(direction, INFINITY);
    return sample_of_point(way, seen.radiance + ambient_radiance(direction), seen.pdf);
}

LightSample sample_environment(vec2 u) {
    MapSample sampled = HAS_ENVIRONMENT_MAP ? sample_map_direction(u) : sample_any_direction(u);
    return sample_beyond(sampled.direction, with_suns(sampled.value, sampled.direction));
}

LightSample sample_sun(uint sun_ix, vec2 u) {
    vec3 direction = sun_direction(sun_ix, u);
    return sample_beyond(direction, seen_environment(direction));
}

#endif
