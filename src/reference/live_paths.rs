//! Work on the paths of a list by several threads.

/// The slice of an array that a chunk of a list of paths needs. The array has an element for each path.
pub struct PathSlice<'a, T> {
    first_path: usize,
    elements: &'a mut [T],
}

impl<T> PathSlice<'_, T> {
    /// Returns the element of a path.
    ///
    /// # Panics
    /// The path is not in the chunk's range.
    pub fn of_path(&mut self, path_ix: u32) -> &mut T {
        &mut self.elements[path_ix as usize - self.first_path]
    }
}

/// Splits an array into the slices that the chunks of a list of paths need. `live`: indices of paths, in ascending
/// order. `chunk_size`: number of paths of each chunk but the last.
///
/// # Panics
/// The indices do not ascend from chunk to chunk, or the array is too short for one.
pub fn path_slices<'a, T>(mut array: &'a mut [T], live: &[u32], chunk_size: usize) -> Vec<PathSlice<'a, T>> {
    let mut n_before = 0;
    let slice_of = |chunk: &[u32]| {
        let (first, last) = (chunk[0] as usize, chunk[chunk.len() - 1] as usize);
        let (_, rest) = std::mem::take(&mut array).split_at_mut(first - n_before);
        let (elements, rest) = rest.split_at_mut(last + 1 - first);
        (array, n_before) = (rest, last + 1);
        PathSlice { first_path: first, elements }
    };
    live.chunks(chunk_size).map(slice_of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_chunk_reaches_its_paths() {
        let mut array = [0; 12];
        let live = [1, 2, 5, 6, 9];
        for (chunk, mut slice) in live.chunks(2).zip(path_slices(&mut array, &live, 2)) {
            chunk.iter().for_each(|&path_ix| *slice.of_path(path_ix) += path_ix);
        }
        assert_eq!(array, [0, 1, 2, 0, 0, 5, 6, 0, 0, 9, 0, 0]);
        assert!(path_slices(&mut array, &[], 2).is_empty());
    }

    #[test]
    #[should_panic(expected = "out of bounds")]
    fn a_chunk_does_not_reach_beyond_its_range() {
        path_slices(&mut [0; 12], &[1, 2, 5, 6], 2)[0].of_path(5);
    }
}
