//! The map of the environment with the tables that sample its directions (glsl/shared/emitters/environment.glsl).

use std::f64::consts::PI;

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use super::{
    alias::{AliasEntry, alias_table},
    emitters::luminance,
};
use crate::scene::Environment;

/// An equirectangular map, and the alias tables of its rows and of the texels in each row.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentMap {
    /// Width and height, texels.
    pub size: [u32; 2],
    /// By which the map is turned about +y, in turns, counter-clockwise as seen from above.
    pub turn: f32,
    /// Linear colours, row by row from the zenith. The fourth number is the pdf with which the middle of the texel
    /// is sampled, per steradian, times the sine of the polar angle there.
    pub texels: Vec<[f32; 4]>,
    /// The table by which rows are sampled.
    pub rows: Vec<AliasEntry>,
    /// For each row, the table by which its texels are sampled.
    pub columns: Vec<AliasEntry>,
    mean_luminance: f64,
}

impl EnvironmentMap {
    /// Makes the tables on the current rayon pool. Directions are sampled by the luminance of the map and of the
    /// ambient light together.
    pub(super) fn new(environment: &Environment, ambient: Vec3) -> Self {
        let [width, height] = environment.size();
        let (n_columns, n_rows) = (width as usize, height as usize);
        let colours = environment.colours();
        let ambient = luminance(ambient);
        let brightness: Vec<f64> = colours.par_iter().map(|colour| luminance(*colour) + ambient).collect();
        // A black map is sampled evenly.
        let is_dark = !brightness.par_iter().any(|brightness| *brightness > 0.0);
        let sine = |row: usize| (PI * (row as f64 + 0.5) / n_rows as f64).sin();
        let weight = |ix: usize| sine(ix / n_columns) * if is_dark { 1.0 } else { brightness[ix] };
        let weights: Vec<f64> = (0..n_rows * n_columns).into_par_iter().map(weight).collect();
        let of_rows: Vec<f64> = weights.par_chunks(n_columns).map(|weights| weights.iter().sum()).collect();
        let sum: f64 = of_rows.iter().sum();
        let sum_of_sines = (0..n_rows).map(sine).sum::<f64>() * n_columns as f64;
        // A texel's width and height are angles. Their product is its solid angle, apart from the sine.
        let of_texel = 2.0 * PI * PI / (n_rows * n_columns) as f64;
        let texel = |(colour, weight): (&Vec3, &f64)| colour.extend((weight / sum / of_texel) as f32).to_array();
        Self {
            size: [width, height],
            turn: environment.turn(),
            texels: colours.par_iter().zip(&weights).map(texel).collect(),
            rows: alias_table(&of_rows),
            columns: weights.par_chunks(n_columns).flat_map_iter(alias_table).collect(),
            mean_luminance: if is_dark { 0.0 } else { sum / sum_of_sines - ambient },
        }
    }

    /// Returns the mean luminance of all directions.
    pub fn mean_luminance(&self) -> f64 {
        self.mean_luminance.max(0.0)
    }

    /// Returns a texel: its colour, and its pdf.
    pub fn texel(&self, x: u32, y: u32) -> Vec4 {
        Vec4::from_array(self.texels[(y * self.size[0] + x) as usize])
    }
}
