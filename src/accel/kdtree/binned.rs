//! Search for the cheapest split of a large cell. An event is a coordinate at which a triangle's bounds begin or end
//! on an axis. With `exact_planes`, the search finds the same plane as a sweep over all sorted events would, without
//! sorting them all. Otherwise the search ends at the cheapest edge between two bins.
//!
//! Counting events by bins gives the weight (sah.rs) of a split at every edge between two bins, and so an upper bound
//! of the best weight. It also gives a lower bound of every weight within a bin. Only bins whose lower bound does not
//! exceed the upper bound can hold the best plane, so only their events are sorted and swept (the sweep of Wald and
//! Havran 2006). This takes O(n) time in practice.

use rayon::prelude::*;

use super::{
    BuildOptions, counted,
    sah::{ChildAreas, Split},
};
use crate::accel::bounds::{Bounds, Reference};

/// The most bins on an axis. Begins, ends and flags of three axes take 27 KiB, which fits the L1 cache.
const MAX_BINS: usize = 1024;
/// The number of references that one task counts: 900 KB.
const CHUNK: usize = 1 << 15;
/// Factor on lower bounds of weights. It allows for more than their f32 rounding, so that rounding never excludes a
/// bin.
const ROUNDING: f32 = 1.0 - 1e-5;

/// A value for each axis and bin, and one more behind the last bin.
type PerBin<T> = [[T; MAX_BINS + 1]; 3];

/// Buffers of a search, which are used again for the next cell.
pub struct BinnedSearch {
    /// At first the number of begins in each bin, then the number of references that begin before the bin.
    n_below: Box<PerBin<u32>>,
    /// At first the number of ends in each bin, then the number of references that end in the bin or after it.
    n_above: Box<PerBin<u32>>,
    /// Whether each bin is to be swept.
    flags: Box<PerBin<bool>>,
    /// The events in flagged bins, sorted by axis and position.
    events: Vec<Event>,
}

impl Default for BinnedSearch {
    fn default() -> Self {
        Self {
            n_below: Box::new([[0; MAX_BINS + 1]; 3]),
            n_above: Box::new([[0; MAX_BINS + 1]; 3]),
            flags: Box::new([[false; MAX_BINS + 1]; 3]),
            events: Vec::new(),
        }
    }
}

/// The bins of one axis.
#[derive(Clone, Copy)]
struct Bins {
    child_areas: ChildAreas,
    /// Factor from positions to bins: the bin is `(position - min) * scale`, rounded to the nearest integer.
    scale: f32,
}

impl Bins {
    fn new(child_areas: ChildAreas, n_bins: usize) -> Self {
        Self { child_areas, scale: (n_bins - 1) as f32 * child_areas.per_extent }
    }

    /// Returns the bin of a position. A greater position never has a lower bin. Adding 2^23 rounds the scaled
    /// position to an integer and leaves that integer in the lowest bits of the sum.
    #[inline]
    fn bin(&self, position: f32) -> usize {
        ((position - self.child_areas.min) * self.scale + 8_388_608.0).to_bits() as usize & (MAX_BINS - 1)
    }
}

impl BinnedSearch {
    /// Returns the cheapest split of a cell, by the planes of all its references if they are few (counted.rs). Its
    /// weight is infinite if there is none.
    pub fn best_split(&mut self, references: &[Reference], cell: &Bounds, options: &BuildOptions) -> Split {
        if references.len() <= counted::MAX_REFERENCES {
            return counted::best_split(references, cell, options);
        }
        let n_bins = (references.len() / 4).next_power_of_two().clamp(32, MAX_BINS);
        let bins = [0, 1, 2]
            .map(|axis| ChildAreas::new(cell, axis, options).map(|child_areas| Bins::new(child_areas, n_bins)));
        self.count(references, &bins, n_bins);
        let edge = self.best_edge(references.len() as u32, &bins, n_bins);
        if !options.exact_planes
            && let Some(split) = edge.split(references, &bins, n_bins)
        {
            return split;
        }
        let mut limit = edge.weight;
        loop {
            let n_flagged = self.flag(limit, &bins, n_bins);
            if n_flagged == 0 {
                return Split::NONE;
            }
            self.collect(references, &bins);
            let best = self.sweep(&bins);
            // An edge next to the cell's face can have a lower weight than all events. Then a bin that was not
            // flagged may hold the best event, so the search is repeated with the lowest weight that the sweep has
            // found.
            if best.weight <= limit || limit == f32::INFINITY {
                return best;
            }
            limit = best.weight;
        }
    }

    /// Counts begins and ends by bins.
    fn count(&mut self, references: &[Reference], bins: &[Option<Bins>; 3], n_bins: usize) {
        for axis in 0..3 {
            self.n_below[axis][..n_bins].fill(0);
            self.n_above[axis][..n_bins].fill(0);
        }
        if references.len() <= CHUNK {
            return count(references, bins, &mut self.n_below, &mut self.n_above);
        }
        let zeros = || (Box::new([[0; MAX_BINS + 1]; 3]), Box::new([[0; MAX_BINS + 1]; 3]));
        let counted = references.par_chunks(CHUNK).map(|chunk| {
            let (mut begins, mut ends) = zeros();
            count(chunk, bins, &mut begins, &mut ends);
            (begins, ends)
        });
        (self.n_below, self.n_above) = counted.reduce(zeros, |mut sum, other| {
            add(&mut sum.0, &other.0);
            add(&mut sum.1, &other.1);
            sum
        });
    }

    /// Turns the counts into sums, and returns the edge of the least weight.
    fn best_edge(&mut self, n: u32, bins: &[Option<Bins>; 3], n_bins: usize) -> BinBoundary {
        let mut best = BinBoundary { axis: 0, bin: 0, weight: f32::INFINITY };
        for (axis, bins) in bins.iter().enumerate() {
            let Some(Bins { child_areas, .. }) = bins else { continue };
            let (below, above) = (&mut self.n_below[axis], &mut self.n_above[axis]);
            let (mut n_below, mut n_above) = (0, n);
            let per_bin = 1.0 / (n_bins - 1) as f32;
            for bin in 0..n_bins {
                let (begins, ends) = (below[bin], above[bin]);
                (below[bin], above[bin]) = (n_below, n_above);
                (n_below, n_above) = (n_below + begins, n_above - ends);
                let weight = child_areas.weight((bin as f32 + 0.5) * per_bin, n_below as f32, n_above as f32);
                if bin + 1 < n_bins && weight < best.weight {
                    best = BinBoundary { axis, bin, weight };
                }
            }
            (below[n_bins], above[n_bins]) = (n_below, n_above);
        }
        best
    }

    /// Flags the bins that may hold a weight up to `limit`, and returns their number.
    fn flag(&mut self, limit: f32, bins: &[Option<Bins>; 3], n_bins: usize) -> usize {
        let mut n_flagged = 0;
        for (axis, bins) in bins.iter().enumerate() {
            self.flags[axis][..n_bins].fill(false);
            let Some(Bins { child_areas, .. }) = bins else { continue };
            let (below, above) = (&self.n_below[axis], &self.n_above[axis]);
            let per_bin = 1.0 / (n_bins - 1) as f32;
            for bin in 0..n_bins {
                let (n_below, n_above) = (below[bin] as f32, above[bin + 1] as f32);
                let from = (bin as f32 - 0.5).max(0.0) * per_bin;
                let to = ((bin as f32 + 0.5) * per_bin).min(1.0);
                // A bin with a begin or an end changes a sum.
                let has_ends = below[bin + 1] > below[bin] || above[bin + 1] < above[bin];
                let flag = has_ends && child_areas.lower_bound(from, to, n_below, n_above) * ROUNDING <= limit;
                self.flags[axis][bin] = flag;
                n_flagged += usize::from(flag);
            }
        }
        n_flagged
    }

    /// Gathers and sorts the events in flagged bins.
    fn collect(&mut self, references: &[Reference], bins: &[Option<Bins>; 3]) {
        self.events.clear();
        if references.len() <= CHUNK {
            collect(references, bins, &self.flags, &mut self.events);
            self.events.sort_unstable();
            return;
        }
        let flags = &self.flags;
        let collected = references.par_chunks(CHUNK).map(|chunk| {
            let mut events = Vec::new();
            collect(chunk, bins, flags, &mut events);
            events
        });
        self.events = collected.collect::<Vec<_>>().concat();
        self.events.par_sort_unstable();
    }

    /// Returns the cheapest split at a plane through one of the collected events.
    fn sweep(&self, bins: &[Option<Bins>; 3]) -> Split {
        let mut best = Split::NONE;
        for on_axis in self.events.chunk_by(|a, b| a.axis() == b.axis()) {
            let axis = on_axis[0].axis();
            let Some(bins) = bins[axis] else { continue };
            let (mut n_below, mut n_above, mut last_bin) = (0, 0, usize::MAX);
            for in_plane in on_axis.chunk_by(|a, b| a.position() == b.position()) {
                let position = in_plane[0].position();
                let bin = bins.bin(position);
                if bin != last_bin {
                    (n_below, n_above, last_bin) = (self.n_below[axis][bin], self.n_above[axis][bin], bin);
                }
                let n_begins = in_plane.iter().filter(|event| event.is_begin()).count() as u32;
                n_above -= in_plane.len() as u32 - n_begins;
                if position > bins.child_areas.min && position < bins.child_areas.max {
                    let split = bins.child_areas.split(position, [n_below, n_above]);
                    best = if split.weight < best.weight { split } else { best };
                }
                n_below += n_begins;
            }
        }
        best
    }
}

/// The edge between `bin` and the next bin, and the weight of a split there.
struct BinBoundary {
    axis: usize,
    bin: usize,
    weight: f32,
}

impl BinBoundary {
    /// Returns the split at the edge, or none if its plane is not inside the cell.
    fn split(&self, references: &[Reference], bins: &[Option<Bins>; 3], n_bins: usize) -> Option<Split> {
        let child_areas = bins[self.axis]?.child_areas;
        let fraction = (self.bin as f32 + 0.5) / (n_bins - 1) as f32;
        let position = child_areas.min + fraction / child_areas.per_extent;
        let is_inside = self.weight < f32::INFINITY && position > child_areas.min && position < child_areas.max;
        // Binning rounds a position, so the references are counted again, against the plane itself.
        is_inside.then(|| child_areas.split(position, count_sides(references, self.axis, position)))
    }
}

/// Returns how many references reach below and how many reach above a plane.
fn count_sides(references: &[Reference], axis: usize, position: f32) -> [u32; 2] {
    let count = |references: &[Reference]| {
        references.iter().fold([0; 2], |[below, above], Reference { bounds, .. }| {
            [below + u32::from(bounds.min[axis] < position), above + u32::from(bounds.max[axis] > position)]
        })
    };
    if references.len() <= CHUNK {
        return count(references);
    }
    references.par_chunks(CHUNK).map(count).reduce(|| [0; 2], |a, b| [a[0] + b[0], a[1] + b[1]])
}

/// An event: the begin or end of a triangle's bounds on an axis, as an integer that sorts by axis and position.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Event(u64);

impl Event {
    #[inline]
    fn new(axis: usize, position: f32, is_begin: bool) -> Self {
        // Adding 0.0 turns -0.0, which is the same plane, into 0.0. Then comes the usual map of floats to integers of
        // the same order.
        let bits = (position + 0.0).to_bits();
        let ordered = bits ^ if bits >> 31 == 1 { u32::MAX } else { 1 << 31 };
        Self((axis as u64) << 33 | u64::from(ordered) << 1 | u64::from(is_begin))
    }

    fn axis(self) -> usize {
        (self.0 >> 33) as usize
    }

    fn position(self) -> f32 {
        let ordered = (self.0 >> 1) as u32;
        f32::from_bits(ordered ^ if ordered >> 31 == 0 { u32::MAX } else { 1 << 31 })
    }

    fn is_begin(self) -> bool {
        self.0 & 1 == 1
    }
}

/// Counts begins and ends by bins.
fn count(references: &[Reference], bins: &[Option<Bins>; 3], begins: &mut PerBin<u32>, ends: &mut PerBin<u32>) {
    for axis in 0..3 {
        let Some(bins) = bins[axis] else { continue };
        let (begins, ends) = (&mut begins[axis], &mut ends[axis]);
        for Reference { bounds, .. } in references {
            begins[bins.bin(bounds.min[axis])] += 1;
            ends[bins.bin(bounds.max[axis])] += 1;
        }
    }
}

fn add(sum: &mut PerBin<u32>, other: &PerBin<u32>) {
    sum.as_flattened_mut().iter_mut().zip(other.as_flattened()).for_each(|(sum, n)| *sum += n);
}

/// Appends the events in flagged bins.
fn collect(references: &[Reference], bins: &[Option<Bins>; 3], flags: &PerBin<bool>, events: &mut Vec<Event>) {
    for axis in 0..3 {
        let Some(bins) = bins[axis] else { continue };
        for Reference { bounds, .. } in references {
            let (min, max) = (bounds.min[axis], bounds.max[axis]);
            if flags[axis][bins.bin(min)] {
                events.push(Event::new(axis, min, true));
            }
            if flags[axis][bins.bin(max)] {
                events.push(Event::new(axis, max, false));
            }
        }
    }
}
