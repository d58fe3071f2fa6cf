//! A buffer that the kernels read, whose reads can be counted at no cost where nobody counts.

use std::{
    cell::Cell,
    ops::{Index, Range},
};

/// Who is told of reads.
pub trait ReadCounter: Copy {
    /// `n` elements are read.
    fn read(self, n: usize);
}

/// Nobody.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoCounter;

impl ReadCounter for NoCounter {
    #[inline(always)]
    fn read(self, _: usize) {}
}

/// A number that reads are added to.
#[derive(Clone, Copy, Debug)]
pub struct Counted<'c>(pub &'c Cell<u64>);

impl ReadCounter for Counted<'_> {
    #[inline(always)]
    fn read(self, n: usize) {
        self.0.set(self.0.get() + n as u64);
    }
}

/// Reads of a tree by a thread.
#[derive(Clone, Debug, Default)]
pub struct ReadCounts {
    /// And slabs.
    pub n_nodes: Cell<u64>,
    /// Links to parents, and ropes.
    pub n_links: Cell<u64>,
    pub n_boxes: Cell<u64>,
    /// Leaves' entries: each is a triangle that is tested.
    pub n_triangles: Cell<u64>,
}

/// A slice and who is told of its reads.
#[derive(Clone, Copy, Debug)]
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
    /// The same slice, with another told of reads.
    pub fn with_counter<S>(self, reads: S) -> CountedSlice<'a, T, S> {
        CountedSlice { items: self.items, reads }
    }
}

impl<'a, T, R: ReadCounter> CountedSlice<'a, T, R> {
    /// The element, if there is one: only then it is read.
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
