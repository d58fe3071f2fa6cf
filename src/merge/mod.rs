//! Joins parts of a picture, which were rendered apart, to the whole: crops of its pixels and ranges of its samples.
//!
//! A crop has the bits that the whole picture has there, and sums of aligned blocks of samples are nodes of the tree in
//! which all samples are added ([`SampleSums`](crate::frame::SampleSums)). So the joined picture has the same bits as
//! one that is rendered at once on a device of the same kind. Two layers differ: `variance` is estimated from the
//! blocks of samples, and `cost` depends on the structure that each part was rendered with.
//!
//! ```text
//! part      file -> pixels, sums and record
//! coverage  checks that the parts are those of one picture, and that no sample of a pixel is missing or there twice
//! join      parts -> picture
//! ```

mod coverage;
mod join;
mod part;

use std::path::{Path, PathBuf};

pub use self::{join::Merged, part::Part};

/// The reason why files are not the parts of one picture.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MergeError {
    /// A file cannot be read, or is no part of a picture.
    #[error("{path}: {message}")]
    Part {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        message: String,
    },
    /// Two files belong to different pictures.
    #[error("{path} and {other} are not parts of one picture, {difference}")]
    Other {
        /// A file.
        path: PathBuf,
        /// A file that does not fit.
        other: PathBuf,
        /// The property in which they differ.
        difference: String,
    },
    /// A pixel or one of its samples is in two files.
    #[error("{path} and {other} overlap: both have {common}")]
    Overlap {
        /// A file.
        path: PathBuf,
        /// A file that overlaps it.
        other: PathBuf,
        /// What both have.
        common: String,
    },
    /// Pixels or samples are in no file. The text names the files and the gaps.
    #[error("{0}")]
    Missing(String),
}

/// Joins the parts in the files, which may be in any order.
///
/// # Errors
/// A file is no part, two files are of different pictures or overlap, or a part is missing.
pub fn merge(paths: &[impl AsRef<Path>]) -> Result<Merged, MergeError> {
    let parts = paths.iter().map(|path| Part::read(path.as_ref())).collect::<Result<Vec<_>, _>>()?;
    let tiles = coverage::tiles(parts)?;
    Ok(join::join(tiles))
}
