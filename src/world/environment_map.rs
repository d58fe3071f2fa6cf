//! The map of the environment with the tables that pick its directions (glsl/shared/emitters/environment.glsl).

use std::f64::consts::PI;

use glam::Vec3;
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
    /// Linear colours, row by row from the zenith; and densities with which directions are picked, per steradian.
    pub texels: Vec<[f32; 4]>,
    /// The table of the rows.
    pub rows: Vec<AliasEntry>,
    /// For each row, the table of its texels.
    pub columns: Vec<AliasEntry>,
    mean_luminance: f64,
}

impl EnvironmentMap {
    /// Makes the tables on the current rayon pool. Directions are picked by the luminance of the map and of the ambient
    /// light together.
    pub(super) fn new(environment: &Environment, ambient: Vec3) -> Self {
        let [width, height] = environment.size();
        let (n_columns, n_rows) = (width as usize, height as usize);
        let colours = environment.colours();
        let luminances: Vec<f64> = colours.par_iter().map(|colour| luminance(*colour)).collect();
        let ambient = luminance(ambient);
        // The solid angle of a texel of each row.
        let solid_angle = |row: usize| {
            let [above, below] = [row, row + 1].map(|row| (PI * row as f64 / n_rows as f64).cos());
            2.0 * PI * (above - below) / n_columns as f64
        };
        let weights: Vec<f64> = (0..n_rows * n_columns)
            .into_par_iter()
            .map(|ix| mean_of_texel(&luminances, [n_columns, n_rows], [ix % n_columns, ix / n_columns]) + ambient)
            .collect();
        let columns: Vec<AliasEntry> = weights.par_chunks(n_columns).flat_map_iter(alias_table).collect();
        let of_rows: Vec<f64> = weights
            .par_chunks(n_columns)
            .enumerate()
            .map(|(row, weights)| weights.iter().sum::<f64>() * solid_angle(row))
            .collect();
        let sum: f64 = of_rows.iter().sum();
        let texel = |(colour, weight): (&Vec3, &f64)| {
            let density = if sum > 0.0 { weight / sum } else { 1.0 / (4.0 * PI) };
            [colour.x, colour.y, colour.z, density as f32]
        };
        Self {
            size: [width, height],
            turn: environment.turn(),
            texels: colours.par_iter().zip(&weights).map(texel).collect(),
            rows: alias_table(&of_rows),
            columns,
            mean_luminance: sum / (4.0 * PI) - ambient,
        }
    }

    /// Returns the mean luminance of all directions.
    pub fn mean_luminance(&self) -> f64 {
        self.mean_luminance.max(0.0)
    }

    /// Returns the colour of a texel.
    pub fn colour(&self, x: u32, y: u32) -> Vec3 {
        let [r, g, b, _] = self.texels[(y * self.size[0] + x) as usize];
        Vec3::new(r, g, b)
    }

    /// Returns the density with which a direction in a texel is picked, per steradian.
    pub fn density(&self, x: u32, y: u32) -> f32 {
        self.texels[(y * self.size[0] + x) as usize][3]
    }
}

/// Returns the mean over a texel of the luminance that is bilinear between the middles of texels. So a texel has weight
/// wherever light comes from any of its directions.
fn mean_of_texel(luminances: &[f64], [n_columns, n_rows]: [usize; 2], [x, y]: [usize; 2]) -> f64 {
    let columns = [(x + n_columns - 1) % n_columns, x, (x + 1) % n_columns];
    let rows = [y.saturating_sub(1), y, (y + 1).min(n_rows - 1)];
    const SHARES: [f64; 3] = [0.125, 0.75, 0.125];
    let of_row = |row: usize| -> f64 {
        columns.iter().zip(SHARES).map(|(column, share)| share * luminances[row * n_columns + column]).sum()
    };
    rows.iter().zip(SHARES).map(|(row, share)| share * of_row(*row)).sum()
}
