//! Search for the cheapest split of a small cell. It counts the triangles on either side of every plane.
//!
//! n references give up to 2 n planes on each axis, so there are 4 n^2 comparisons per axis. No branch depends on
//! their results, and eight planes are compared at a time, which is faster than sorting so few references.

use super::{
    BuildOptions,
    sah::{ChildAreas, Split},
};
use crate::accel::bounds::{Bounds, Reference};

/// The most references of a small cell. Cells with more are searched by bins (binned.rs).
pub const MAX_REFERENCES: usize = 32;
/// The number of planes that are counted together: two SSE registers.
const LANES: usize = 8;

/// Returns the cheapest split of a cell with at most [`MAX_REFERENCES`] references. Its weight is infinite if there
/// is none.
pub fn best_split(references: &[Reference], cell: &Bounds, options: &BuildOptions) -> Split {
    let mut best = Split::NONE;
    for axis in 0..3 {
        let Some(child_areas) = ChildAreas::new(cell, axis, options) else { continue };
        let split = Planes::new(references, &child_areas).best(&child_areas);
        if split.weight < best.weight {
            best = split;
        }
    }
    best
}

/// The sides of the references' bounds on one axis, and the planes through those sides that are inside the cell.
struct Planes {
    min: [f32; MAX_REFERENCES],
    max: [f32; MAX_REFERENCES],
    n_references: usize,
    /// Sides strictly inside the cell, padded with NaN. Every comparison with NaN is false, so padding is never the
    /// cheapest.
    positions: [f32; 2 * MAX_REFERENCES + LANES],
    n_positions: usize,
}

impl Planes {
    fn new(references: &[Reference], child_areas: &ChildAreas) -> Self {
        let mut planes = Self {
            min: [0.0; MAX_REFERENCES],
            max: [0.0; MAX_REFERENCES],
            n_references: references.len(),
            positions: [f32::NAN; 2 * MAX_REFERENCES + LANES],
            n_positions: 0,
        };
        let mut n_positions = 0;
        for (ix, reference) in references.iter().enumerate() {
            let (min, max) = (reference.bounds.min[child_areas.axis], reference.bounds.max[child_areas.axis]);
            planes.min[ix] = min;
            planes.max[ix] = max;
            // Each side is written in any case and kept only if it is inside the cell, so there is no branch.
            planes.positions[n_positions] = min;
            n_positions += usize::from(min > child_areas.min && min < child_areas.max);
            planes.positions[n_positions] = max;
            n_positions += usize::from(max > child_areas.min && max < child_areas.max);
        }
        planes.positions[n_positions..][..LANES].fill(f32::NAN);
        planes.n_positions = n_positions;
        planes
    }

    /// Returns the split at the cheapest plane.
    fn best(&self, child_areas: &ChildAreas) -> Split {
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
                let fraction = child_areas.fraction(positions[lane]);
                weights[lane] = child_areas.weight(fraction, below[lane] as f32, above[lane] as f32);
            }
            for lane in 0..LANES {
                if weights[lane] < best.weight {
                    best = child_areas.split(positions[lane], [below[lane], above[lane]]);
                }
            }
        }
        best
    }
}
