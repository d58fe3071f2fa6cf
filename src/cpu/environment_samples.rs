//! The samples of sixteen directions of the environment's map. They are those of the reference's `sample_environment`,
//! bit for bit.

use fearless_simd::{Level, Simd, dispatch, f32x16, prelude::*};
use glam::{Vec2, vec3};

use super::{
    lanes::LANES,
    turns::sin_cos_of_turns,
    vec3x16::{greater, lesser},
};
use crate::{
    reference::emitters::{LightSample, alias::ALMOST_ONE, environment::sample_at_place},
    world::{AliasEntry, Emitters, EnvironmentMap},
};

/// The results of sixteen samples from alias tables.
struct AliasSamples<S: Simd> {
    /// The indices of the entries, as floats.
    ix: f32x16<S>,
    rest: f32x16<S>,
}

/// Samples from the tables of sixteen lanes, each of which has `n` entries. `first`: where each lane's table begins in
/// `entries`.
#[inline(always)]
fn sample_alias<S: Simd>(entries: &[AliasEntry], first: &[u32; LANES], n: u32, u: f32x16<S>) -> AliasSamples<S> {
    let simd = u.simd;
    let almost_one = f32x16::splat(simd, ALMOST_ONE);
    let scaled = u * n as f32;
    let ix = lesser(scaled.floor(), f32x16::splat(simd, (n - 1) as f32));
    let rest = lesser(scaled - ix, almost_one);
    let (mut thresholds, mut aliases, ixs) = ([0.0; LANES], [0.0; LANES], ix.to_array());
    for lane in 0..LANES {
        let (threshold, alias_ix) = entries[first[lane] as usize + ixs[lane] as usize].parts();
        (thresholds[lane], aliases[lane]) = (threshold, alias_ix as f32);
    }
    let (threshold, alias) = (f32x16::load_array(simd, thresholds), f32x16::load_array(simd, aliases));
    let is_own = rest.simd_lt(threshold);
    let rest = is_own.select(rest / threshold, (rest - threshold) / (1.0 - threshold));
    AliasSamples { ix: is_own.select(ix, alias), rest: lesser(rest, almost_one) }
}

/// Does what the reference's `tent` does.
#[inline(always)]
fn tent<S: Simd>(u: f32x16<S>) -> f32x16<S> {
    u.simd_lt(0.5).select((u * 2.0).sqrt() - 1.0, 1.0 - ((1.0 - u) * 2.0).sqrt())
}

/// Sixteen places in the map, and the directions that belong to them.
struct Places {
    right: [f32; LANES],
    down: [f32; LANES],
    aside: [f32; LANES],
    direction: [[f32; LANES]; 3],
}

#[inline(always)]
fn places<S: Simd>(simd: S, map: &EnvironmentMap, [ux, uy]: [&[f32; LANES]; 2]) -> Places {
    let [n_columns, n_rows] = map.size;
    let row = sample_alias(&map.rows, &[0; LANES], n_rows, f32x16::load_array_ref(simd, ux));
    let mut first_columns = [0; LANES];
    for (first, row_ix) in first_columns.iter_mut().zip(row.ix.to_array()) {
        *first = row_ix as u32 * n_columns;
    }
    let column = sample_alias(&map.columns, &first_columns, n_columns, f32x16::load_array_ref(simd, uy));
    let is_above = row.rest.simd_lt(0.5);
    let is_last = row.ix.simd_eq((n_rows - 1) as f32);
    let is_at_pole = (is_above & row.ix.simd_eq(0.0)) | (!is_above & is_last);
    let down = row.ix + is_at_pole.select(row.rest - 0.5, tent(row.rest));
    let right = column.ix + tent(column.rest);
    let is_upper = (down + 0.5).simd_lt(0.5 * n_rows as f32);
    let from_pole = is_upper.select(down + 0.5, (n_rows as f32 - 0.5) - down);
    let (half_sine, _) = sin_cos_of_turns(from_pole * (0.25 / n_rows as f32));
    let versine = half_sine * 2.0 * half_sine;
    let aside = greater(versine * (2.0 - versine), f32x16::splat(simd, 0.0)).sqrt();
    let turns = (right + 0.5) / n_columns as f32 - 0.5 - map.turn;
    let (sine, cosine) = sin_cos_of_turns(turns);
    let up = is_upper.select(1.0 - versine, versine - 1.0);
    Places {
        right: right.to_array(),
        down: down.to_array(),
        aside: aside.to_array(),
        direction: [(aside * sine).to_array(), up.to_array(), (-aside * cosine).to_array()],
    }
}

/// Returns the samples for sixteen pairs of random numbers.
pub fn environment_samples(
    simd_level: Level,
    emitters: &Emitters,
    map: &EnvironmentMap,
    u: [&[f32; LANES]; 2],
) -> [LightSample; LANES] {
    let Places { right, down, aside, direction: [x, y, z] } = dispatch!(simd_level, simd => places(simd, map, u));
    std::array::from_fn(|lane| {
        let (place, direction) = (Vec2::new(right[lane], down[lane]), vec3(x[lane], y[lane], z[lane]));
        sample_at_place(emitters, map, direction, place, aside[lane])
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use glam::Vec3;

    use super::*;
    use crate::{
        accel::kdtree::BuildOptions,
        reference::{chi_square::Uniform, emitters::sample_environment},
        scene::{Environment, Light, Scene},
        world::{FlatScene, World},
    };

    /// Returns a world with an environment map of random and black texels, and with a sun if `has_sun` is set.
    fn world(size: [u32; 2], has_sun: bool, random: &mut Uniform) -> World {
        let colour = |i: u32| if i % 5 == 2 { Vec3::ZERO } else { 3.0 * random.point() };
        let colours = (0..size[0] * size[1]).map(colour).collect();
        let (environment, _) = Environment::new(size, colours, (70.0, 1.0)).expect("an environment");
        let (towards, irradiance) = (vec3(0.3, 1.0, 0.2).normalize(), vec3(1.0, 2.0, 3.0));
        let sun = Light::Sun { towards, irradiance, angle_degrees: 20.0 };
        let lights = if has_sun { vec![sun] } else { Vec::new() };
        let scene = Scene { environment: Some(environment), lights, ..Scene::empty(Path::new("scene")) };
        World::of_flat(FlatScene::new(&scene).expect("a scene"), &BuildOptions::default()).expect("a world")
    }

    #[test]
    fn samples_are_those_of_the_reference() {
        let mut random = Uniform(4);
        for (size, has_sun) in [([1, 1], false), ([2, 1], true), ([7, 5], false), ([64, 33], true)] {
            let world = world(size, has_sun, &mut random);
            let emitters = world.emitters();
            let map = emitters.environment.as_ref().expect("a map");
            for group in 0..500 {
                let mut u = [[0.0; LANES]; 2];
                for lane in 0..LANES {
                    // Some numbers are at the bounds of [0, 1).
                    let at_bound = |u: f32, which: usize| [u, 0.0, ALMOST_ONE][(group + lane + which) % 7 / 3];
                    let point = random.point();
                    (u[0][lane], u[1][lane]) = (at_bound(point.x, 0), at_bound(point.y, 2));
                }
                for simd_level in [Level::new(), Level::baseline()] {
                    let samples = environment_samples(simd_level, emitters, map, [&u[0], &u[1]]);
                    for (lane, sample) in samples.iter().enumerate() {
                        let at = Vec2::new(u[0][lane], u[1][lane]);
                        assert_eq!(*sample, sample_environment(emitters, at), "{size:?} {at}");
                    }
                }
            }
        }
    }
}
