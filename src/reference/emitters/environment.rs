//! What rays that leave the scene see: a map, or the background, and the suns. Twin of `emitters/environment.glsl`,
//! which describes the map.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::{IVec2, Vec2, Vec3};

use super::{
    alias::pick_alias,
    pick::{LightPick, Towards, pick_of_point},
    sun::{seen_suns, sun_direction},
};
use crate::{
    layout::AreaLight,
    reference::inputs::KernelInputs,
    world::{Emitters, EnvironmentMap},
};

/// Density of directions that are uniform on the sphere.
const UNIFORM: f32 = 1.0 / (4.0 * PI);

/// Where a direction is in the map: to the right and down, both 0 to 1.
fn environment_place(map: &EnvironmentMap, direction: Vec3) -> Vec2 {
    let turns = direction.x.atan2(-direction.z) / TAU + 0.5 + map.turn;
    let aside = (direction.x * direction.x + direction.z * direction.z).sqrt();
    Vec2::new(turns - turns.floor(), aside.atan2(direction.y) / PI)
}

/// The map's colour at a place, bilinear between the middles of texels.
fn map_colour(map: &EnvironmentMap, place: Vec2) -> Vec3 {
    let [width, height] = map.size;
    let at = place * Vec2::new(width as f32, height as f32) - 0.5;
    let low: IVec2 = at.floor().as_ivec2();
    let weight = at - low.as_vec2();
    let row = |i: i32| {
        let y = (low.y + i).clamp(0, height as i32 - 1) as u32;
        let left = if low.x < 0 { width - 1 } else { (low.x as u32).min(width - 1) };
        let right = if left + 1 < width { left + 1 } else { 0 };
        let a = map.colour(left, y);
        a + (map.colour(right, y) - a) * weight.x
    };
    let upper = row(0);
    upper + (row(1) - upper) * weight.y
}

/// The density of the direction at a place if the environment without the suns is picked, per steradian.
fn map_density(map: &EnvironmentMap, place: Vec2) -> f32 {
    let [width, height] = map.size;
    let at = place * Vec2::new(width as f32, height as f32);
    map.density((at.x as u32).min(width - 1), (at.y as u32).min(height - 1))
}

/// What a ray that leaves the scene meets: the environment and its suns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SeenEnvironment {
    pub radiance: Vec3,
    /// Density with which [`pick_light`](super::pick_light) picks the direction because of them, per steradian.
    pub density: f32,
}

/// What a ray in this direction meets beyond the scene.
pub fn seen_environment(inputs: &KernelInputs, direction: Vec3) -> SeenEnvironment {
    inputs.emitters.map_or_else(SeenEnvironment::default, |emitters| seen_beyond(emitters, direction))
}

fn seen_beyond(emitters: &Emitters, direction: Vec3) -> SeenEnvironment {
    let (radiance, density) = match &emitters.environment {
        Some(map) => {
            let place = environment_place(map, direction);
            (map_colour(map, place), map_density(map, place))
        }
        None => (emitters.background, UNIFORM),
    };
    let suns = seen_suns(emitters, direction);
    SeenEnvironment {
        radiance: radiance + suns.radiance,
        density: emitters.environment_probability * density + suns.density,
    }
}

/// The radiance that surfaces get from all directions in addition. Neither the camera nor mirrors see it.
pub fn ambient_radiance(inputs: &KernelInputs, direction: Vec3) -> Vec3 {
    inputs.emitters.map_or(Vec3::ZERO, |emitters| ambient_from(emitters, direction))
}

fn ambient_from(emitters: &Emitters, direction: Vec3) -> Vec3 {
    if direction[emitters.up_axis] < 0.0 { emitters.ground_ambient } else { emitters.ambient }
}

/// A direction of the map, and its density.
fn pick_map_direction(map: &EnvironmentMap, u: Vec2) -> (Vec3, f32) {
    let [n_columns, n_rows] = map.size;
    let row = pick_alias(n_rows, |ix| map.rows[ix as usize].parts(), u.x, 0.0);
    let first_column = row.ix * n_columns;
    let column = pick_alias(n_columns, |ix| map.columns[(first_column + ix) as usize].parts(), u.y, 0.0);
    let is_upper = 2 * row.ix < n_rows;
    // Rows from the nearer pole to both edges of the row. The middle row of an odd number is bounded by the equator's
    // far side, which the formulas allow.
    let first = if is_upper { row.ix as f32 } else { (n_rows - 1 - row.ix) as f32 };
    let sines = [first, first + 1.0].map(|row| (FRAC_PI_2 / n_rows as f32 * row).sin());
    let versines = sines.map(|sine| 2.0 * sine * sine);
    let share = if is_upper { row.rest } else { 1.0 - row.rest };
    let versine = versines[0] + (versines[1] - versines[0]) * share;
    let sine = (versine * (2.0 - versine)).max(0.0).sqrt();
    let turns = (column.ix as f32 + column.rest) / n_columns as f32 - 0.5 - map.turn;
    let azimuth = TAU * turns;
    let up = if is_upper { 1.0 - versine } else { versine - 1.0 };
    (Vec3::new(sine * azimuth.sin(), up, -sine * azimuth.cos()), map.density(column.ix, row.ix))
}

/// A direction that is uniform on the sphere.
fn pick_any_direction(u: Vec2) -> Vec3 {
    let up = 1.0 - 2.0 * u.x;
    let sine = 2.0 * (u.x * (1.0 - u.x)).max(0.0).sqrt();
    let azimuth = TAU * u.y;
    Vec3::new(sine * azimuth.sin(), up, -sine * azimuth.cos())
}

/// The pick of a direction beyond the scene.
fn pick_beyond(emitters: &Emitters, direction: Vec3, seen: SeenEnvironment) -> LightPick {
    let way = Towards { direction, distance: f32::INFINITY };
    pick_of_point(way, seen.radiance + ambient_from(emitters, direction), seen.density)
}

pub(super) fn pick_environment(emitters: &Emitters, u: Vec2) -> LightPick {
    let (direction, radiance, density) = match &emitters.environment {
        Some(map) => {
            // The density is that of the texel that was picked. Rounding may move the direction to its neighbour.
            let (direction, density) = pick_map_direction(map, u);
            (direction, map_colour(map, environment_place(map, direction)), density)
        }
        None => (pick_any_direction(u), emitters.background, UNIFORM),
    };
    let suns = seen_suns(emitters, direction);
    let density = emitters.environment_probability * density + suns.density;
    pick_beyond(emitters, direction, SeenEnvironment { radiance: radiance + suns.radiance, density })
}

pub(super) fn pick_sun(emitters: &Emitters, sun: &AreaLight, u: Vec2) -> LightPick {
    let direction = sun_direction(sun, u);
    pick_beyond(emitters, direction, seen_beyond(emitters, direction))
}
