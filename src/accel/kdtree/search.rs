//! Search for the cheapest split of a cell.

use super::{BuildOptions, binned::BinnedSearch, counted, sah::Split};
use crate::accel::bounds::{Bounds, Reference};

/// Buffers of a search, which are used again for the next cell.
#[derive(Default)]
pub struct Search {
    binned: BinnedSearch,
}

impl Search {
    /// Returns the cheapest split. Its weight is infinite if there is none.
    pub fn best_split(&mut self, references: &[Reference], cell: &Bounds, options: &BuildOptions) -> Split {
        if references.len() <= counted::MAX_REFERENCES {
            counted::best_split(references, cell, options)
        } else {
            self.binned.best_split(references, cell, options)
        }
    }
}
