//! Slices that stand for the kernels' buffers and whose reads can be counted. Slices without a counter cost nothing.

use std::{
    cell::Cell,
    ops::{Index, Range},
};

/// Counts reads of a slice.
pub trait ReadCounter: Copy {
    /// Counts a read of `n` elements.
    fn read(self, n: usize);
}

/// Counts nothing, and is compiled away.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoCounter;

impl ReadCounter for NoCounter {
    #[inline(always)]
    fn read(self, _: usize) {}
}

/// Adds reads to a number.
#[derive(Clone, Copy, Debug)]
pub struct Counted<'c>(pub &'c Cell<u64>);

impl ReadCounter for Counted<'_> {
    #[inline(always)]
    fn read(self, n: usize) {
        self.0.set(self.0.get() + n as u64);
    }
}

/// Reads of an acceleration structure by one thread.
#[derive(Clone, Debug, Default)]
pub struct ReadCounts {
    /// Nodes, slabs, and cells of a grid.
    pub n_nodes: Cell<u64>,
    /// Links to parents, and ropes.
    pub n_links: Cell<u64>,
    /// Boxes of nodes.
    pub n_boxes: Cell<u64>,
    /// Entries of leaves: each is a triangle.
    pub n_triangles: Cell<u64>,
}

/// A slice and the counter of its reads.
#[derive(Clone, Copy, Debug, Default)]
pub struct CountedSlice<'a, T, R = NoCounter> {
    items: &'a [T],
    reads: R,
}

impl<'a, T> From<&'a [T]> for CountedSlice<'a, T> {
    fn from(items: &'a [T]) -> Self {
        Self { items, reads: NoCounter }
    }
}

impl<'a, T, R> CountedSlice<'a, T, R> {
    /// Returns the same slice with another counter.
    pub fn with_counter<S>(self, reads: S) -> CountedSlice<'a, T, S> {
        CountedSlice { items: self.items, reads }
    }

    /// Returns another slice with the same counter.
    pub fn with_items(self, items: &'a [T]) -> Self {
        Self { items, ..self }
    }

    /// Returns a range of the slice, or of an empty slice nothing.
    pub fn slice(self, range: Range<usize>) -> Self {
        Self { items: self.items.get(range).unwrap_or_default(), ..self }
    }
}

impl<'a, T, R: ReadCounter> CountedSlice<'a, T, R> {
    /// Counts reads of what stands for elements elsewhere.
    #[inline(always)]
    pub fn count(&self, n: usize) {
        self.reads.read(n);
    }

    /// Returns the element if there is one. Only then is a read counted.
    #[inline(always)]
    pub fn get(&self, ix: usize) -> Option<&'a T> {
        let item = self.items.get(ix)?;
        self.reads.read(1);
        Some(item)
    }
}

impl<T, R: ReadCounter> Index<usize> for CountedSlice<'_, T, R> {
    type Output = T;

    #[inline(always)]
    fn index(&self, ix: usize) -> &T {
        self.reads.read(1);
        &self.items[ix]
    }
}

impl<T, R: ReadCounter> Index<Range<usize>> for CountedSlice<'_, T, R> {
    type Output = [T];

    #[inline(always)]
    fn index(&self, range: Range<usize>) -> &[T] {
        let items = &self.items[range];
        self.reads.read(items.len());
        items
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_element_that_is_read_counts_once() {
        let n = Cell::new(0);
        let table = CountedSlice::from(&[5, 6, 7, 8][..]).with_counter(Counted(&n));
        assert_eq!((table[1], &table[1..4], n.get()), (6, &[6, 7, 8][..], 4));
        assert_eq!((table[2..2].len(), n.get()), (0, 4));
        assert_eq!((table.get(3), table.get(4), n.get()), (Some(&8), None, 5));
    }
}
