//! Writes counts or lists of hits to a NumPy archive, with the names that Open3D's `list_intersections` uses.

use std::path::{Path, PathBuf};

use super::{
    AllHits, Hit,
    write::{Spool, write_archive, write_hits},
};
use crate::{output::OutputError, world::FlatScene};

/// Writes a `.npz` file of counts or of lists, through temporary files.
///
/// The array of counts is `hit_counts` (uint32 K). The arrays of lists are `ray_splits` (uint64 K + 1: the hits of ray
/// i are those from `ray_splits[i]` up to, but not including, `ray_splits[i + 1]`) and those that [`super::HitWriter`]
/// writes for the closest hits, here with a row for each hit.
pub struct HitListWriter {
    path: PathBuf,
    counts: Spool<u32>,
    hits: Spool<Hit>,
}

impl HitListWriter {
    /// Creates a writer without rays.
    ///
    /// # Errors
    /// No file can be written at this path.
    pub fn new(path: &Path) -> Result<Self, OutputError> {
        Ok(Self { path: path.to_owned(), counts: Spool::new(path)?, hits: Spool::new(path)? })
    }

    /// Appends the counts of the next rays.
    ///
    /// # Errors
    /// The disk is full, or a write fails.
    pub fn push_counts(&mut self, counts: &[u32]) -> Result<(), OutputError> {
        self.counts.push(&self.path, counts)
    }

    /// Appends the lists of the next rays.
    ///
    /// # Errors
    /// The disk is full, or a write fails.
    pub fn push_lists(&mut self, lists: &AllHits) -> Result<(), OutputError> {
        let counts: Vec<_> = lists.ray_splits.windows(2).map(|ends| (ends[1] - ends[0]) as u32).collect();
        self.push_counts(&counts)?;
        self.hits.push(&self.path, &lists.hits)
    }

    /// Writes the counts, the whole file or nothing.
    ///
    /// # Errors
    /// The disk is full, or a write fails.
    pub fn finish_counts(mut self) -> Result<(), OutputError> {
        write_archive(&self.path, |archive| self.counts.write(archive, "hit_counts", |count| [*count]))
    }

    /// Writes the lists, the whole file or nothing. The hits are of triangles of the scene.
    ///
    /// # Errors
    /// The disk is full, or a write fails.
    pub fn finish_lists(mut self, scene: &FlatScene) -> Result<(), OutputError> {
        write_archive(&self.path, |archive| {
            let mut end = 0u64;
            let ends = |count: &u32| {
                end += u64::from(*count);
                [end]
            };
            self.counts.write_after(archive, "ray_splits", Some([0u64]), ends)?;
            write_hits(archive, &mut self.hits, scene)
        })
    }
}
