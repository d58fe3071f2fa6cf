//! The cheapest split of a small cell, by counting the triangles on either side of every plane.
//!
//! n references make up to 2 n planes an axis, so this is 4 n^2 comparisons, but without a branch that depends on them
//! and eight planes at a time: quicker than sorting so few.

use super::{
    BuildOptions,
    sah::{Shares, Split},
};
use crate::accel::bounds::{Bounds, Reference};

/// More references than this are binned.
pub const MAX_REFERENCES: usize = 32;
/// Planes that are counted together: two SSE registers.
const LANES: usize = 8;

/// The cheapest split of a cell with at most [`MAX_REFERENCES`]; its weight is infinite where there is none.
pub fn best_split(references: &[Reference], cell: &Bounds, options: &BuildOptions) -> Split {
    let mut best = Split::NONE;
    for axis in 0..3 {
        let Some(shares) = Shares::new(cell, axis, options) else { continue };
        let split = Planes::new(references, &shares).best(&shares);
        if split.weight < best.weight {
            best = split;
        }
    }
    best
}

/// The ends of the references on one axis.
struct Planes {
    min: [f32; MAX_REFERENCES],
    max: [f32; MAX_REFERENCES],
    n_references: usize,
    /// Ends strictly inside the cell, padded with NaN, which no comparison counts and no weight beats.
    positions: [f32; 2 * MAX_REFERENCES + LANES],
    n_positions: usize,
}

impl Planes {
    fn new(references: &[Reference], shares: &Shares) -> Self {
        let mut planes = Self {
            min: [0.0; MAX_REFERENCES],
            max: [0.0; MAX_REFERENCES],
            n_references: references.len(),
            positions: [f32::NAN; 2 * MAX_REFERENCES + LANES],
            n_positions: 0,
        };
        let mut n_positions = 0;
        for (ix, reference) in references.iter().enumerate() {
            let (min, max) = (reference.bounds.min[shares.axis], reference.bounds.max[shares.axis]);
            planes.min[ix] = min;
            planes.max[ix] = max;
            // Written always, kept where inside: no branch.
            planes.positions[n_positions] = min;
            n_positions += usize::from(min > shares.min && min < shares.max);
            planes.positions[n_positions] = max;
            n_positions += usize::from(max > shares.min && max < shares.max);
        }
        planes.positions[n_positions..][..LANES].fill(f32::NAN);
        planes.n_positions = n_positions;
        planes
    }

    /// The cheapest plane.
    fn best(&self, shares: &Shares) -> Split {
        let mut best = Split::NONE;
        for first in (0..self.n_positions).step_by(LANES) {
            let positions: &[f32; LANES] = self.positions[first..][..LANES].try_into().expect("padded");
            let (mut below, mut above) = ([0u32; LANES], [0u32; LANES]);
            for (&min, &max) in self.min[..self.n_references].iter().zip(&self.max[..self.n_references]) {
                for lane in 0..LANES {
                    below[lane] += u32::from(min < positions[lane]);
                    above[lane] += u32::from(max > positions[lane]);
                }
            }
            let mut weights = [0.0; LANES];
            for lane in 0..LANES {
                let fraction = shares.fraction(positions[lane]);
                weights[lane] = shares.weight(fraction, below[lane] as f32, above[lane] as f32);
            }
            for lane in 0..LANES {
                if weights[lane] < best.weight {
                    best = shares.split(positions[lane], [below[lane], above[lane]]);
                }
            }
        }
        best
    }
}
