//! What rays that leave the scene see: a map, or the background, and the suns. Twin of `emitters/environment.glsl`,
//! which describes the map.

use std::f32::consts::{PI, TAU};

use glam::{IVec2, Vec2, Vec3};

use super::{
    alias::sample_alias,
    light_sample::{LightSample, Towards, sample_of_point},
    sun::{seen_suns, sun_direction},
};
use crate::{
    layout::AreaLight,
    reference::{inputs::KernelInputs, tent::tent, turns::sin_cos_of_turns},
    world::{Emitters, EnvironmentMap},
};

/// Pdf of directions that are uniform on the sphere.
const UNIFORM: f32 = 1.0 / (4.0 * PI);
/// Lower bound of the sine by which the pdf in the map is divided. At the poles, the sine is 0.
const LEAST_MAP_SINE: f32 = 1.0e-6;

/// Where a direction is in the map, texels to the right and down from the middle of the first one. `aside`: the sine of
/// the polar angle.
fn environment_place(map: &EnvironmentMap, direction: Vec3, aside: f32) -> Vec2 {
    let turns = direction.x.atan2(-direction.z) / TAU + 0.5 + map.turn;
    let place = Vec2::new(turns - turns.floor(), aside.atan2(direction.y) / PI);
    let [width, height] = map.size;
    place * Vec2::new(width as f32, height as f32) - 0.5
}

/// What the map has in a direction.
#[derive(Clone, Copy)]
struct MapValue {
    radiance: Vec3,
    /// Pdf with which the direction is sampled if the environment without the suns is sampled, per steradian.
    pdf: f32,
}

/// The map's value at a place. `aside`: the sine of the place's polar angle.
fn map_value(map: &EnvironmentMap, place: Vec2, aside: f32) -> MapValue {
    let [width, height] = map.size;
    let low = place.floor();
    let weight = place - low;
    let low: IVec2 = low.as_ivec2();
    let row = |i: i32| {
        let y = (low.y + i).clamp(0, height as i32 - 1) as u32;
        let left = match low.x {
            ..0 => width - 1,
            x if (x as u32) < width => x as u32,
            _ => 0,
        };
        let right = if left + 1 < width { left + 1 } else { 0 };
        let a = map.texel(left, y);
        a + (map.texel(right, y) - a) * weight.x
    };
    let upper = row(0);
    let value = upper + (row(1) - upper) * weight.y;
    MapValue { radiance: value.truncate(), pdf: value.w / aside.max(LEAST_MAP_SINE) }
}

/// What a ray that leaves the scene meets: the environment and its suns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SeenEnvironment {
    pub radiance: Vec3,
    /// Pdf with which [`sample_light`](super::sample_light) samples the direction because of them, per steradian.
    pub pdf: f32,
}

/// What a ray in this direction meets beyond the scene.
pub fn seen_environment(inputs: &KernelInputs, direction: Vec3) -> SeenEnvironment {
    inputs.emitters.map_or_else(SeenEnvironment::default, |emitters| seen_beyond(emitters, direction))
}

fn seen_beyond(emitters: &Emitters, direction: Vec3) -> SeenEnvironment {
    let value = match &emitters.environment {
        Some(map) => {
            let aside = (direction.x * direction.x + direction.z * direction.z).sqrt();
            map_value(map, environment_place(map, direction, aside), aside)
        }
        None => MapValue { radiance: emitters.background, pdf: UNIFORM },
    };
    with_suns(emitters, value, direction)
}

/// Adds the suns to what the environment has in a direction.
fn with_suns(emitters: &Emitters, value: MapValue, direction: Vec3) -> SeenEnvironment {
    let suns = seen_suns(emitters, direction);
    SeenEnvironment {
        radiance: value.radiance + suns.radiance,
        pdf: emitters.environment_probability * value.pdf + suns.pdf,
    }
}

/// The radiance that surfaces get from all directions in addition. Neither the camera nor mirrors see it.
pub fn ambient_radiance(inputs: &KernelInputs, direction: Vec3) -> Vec3 {
    inputs.emitters.map_or(Vec3::ZERO, |emitters| ambient_from(emitters, direction))
}

fn ambient_from(emitters: &Emitters, direction: Vec3) -> Vec3 {
    if direction[emitters.up_axis] < 0.0 { emitters.ground_ambient } else { emitters.ambient }
}

fn sample_in_map(emitters: &Emitters, map: &EnvironmentMap, u: Vec2) -> LightSample {
    let [n_columns, n_rows] = map.size;
    let row = sample_alias(n_rows, |ix| map.rows[ix as usize].parts(), u.x, 0.0);
    let first_column = row.ix * n_columns;
    let column = sample_alias(n_columns, |ix| map.columns[(first_column + ix) as usize].parts(), u.y, 0.0);
    // Between a pole and the middle of its row, there is no other row: the tent's half is a rectangle of half a texel.
    let is_at_pole = if row.rest < 0.5 { row.ix == 0 } else { row.ix == n_rows - 1 };
    let down = row.ix as f32 + if is_at_pole { row.rest - 0.5 } else { tent(row.rest) };
    let right = column.ix as f32 + tent(column.rest);
    // The polar angle is taken from the nearer pole, where sines are exact.
    let is_upper = down + 0.5 < 0.5 * n_rows as f32;
    let from_pole = if is_upper { down + 0.5 } else { n_rows as f32 - 0.5 - down };
    let (half_sine, _) = sin_cos_of_turns(0.25 / n_rows as f32 * from_pole);
    let versine = 2.0 * half_sine * half_sine;
    let aside = (versine * (2.0 - versine)).max(0.0).sqrt();
    let turns = (right + 0.5) / n_columns as f32 - 0.5 - map.turn;
    let (sine, cosine) = sin_cos_of_turns(turns);
    let up = if is_upper { 1.0 - versine } else { versine - 1.0 };
    let direction = Vec3::new(aside * sine, up, -aside * cosine);
    sample_at_place(emitters, map, direction, Vec2::new(right, down), aside)
}

/// A direction that is uniform on the sphere.
fn sample_any_direction(u: Vec2) -> Vec3 {
    let up = 1.0 - 2.0 * u.x;
    let aside = 2.0 * (u.x * (1.0 - u.x)).max(0.0).sqrt();
    let (sine, cosine) = sin_cos_of_turns(u.y);
    Vec3::new(aside * sine, up, -aside * cosine)
}

/// The sample of a direction beyond the scene.
fn sample_beyond(emitters: &Emitters, direction: Vec3, seen: SeenEnvironment) -> LightSample {
    let way = Towards { direction, distance: f32::INFINITY };
    sample_of_point(way, seen.radiance + ambient_from(emitters, direction), seen.pdf)
}

/// The sample of a direction whose place in the map is known. `aside`: the sine of the place's polar angle.
pub fn sample_at_place(
    emitters: &Emitters,
    map: &EnvironmentMap,
    direction: Vec3,
    place: Vec2,
    aside: f32,
) -> LightSample {
    sample_beyond(emitters, direction, with_suns(emitters, map_value(map, place, aside), direction))
}

/// Samples a direction of the environment. `u`: in [0, 1).
pub fn sample_environment(emitters: &Emitters, u: Vec2) -> LightSample {
    if let Some(map) = &emitters.environment {
        return sample_in_map(emitters, map, u);
    }
    let (direction, value) = (sample_any_direction(u), MapValue { radiance: emitters.background, pdf: UNIFORM });
    sample_beyond(emitters, direction, with_suns(emitters, value, direction))
}

pub(super) fn sample_sun(emitters: &Emitters, sun: &AreaLight, u: Vec2) -> LightSample {
    let direction = sun_direction(sun, u);
    sample_beyond(emitters, direction, seen_beyond(emitters, direction))
}
