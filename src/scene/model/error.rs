//! The error of loading a scene, a message of one line.

use std::path::Path;

use crate::util::text::short_line;

/// A scene file that cannot be read, understood or drawn. It displays as one line: `FILE:LINE: what` or
/// `FILE: object: what`.
#[derive(Debug, thiserror::Error)]
#[error("{place}: {what}")]
pub struct SceneError {
    place: String,
    what: String,
}

impl SceneError {
    /// An error that concerns a file as a whole.
    pub(crate) fn file(path: &Path, what: impl AsRef<str>) -> Self {
        Self { place: short_line(&path.display().to_string()), what: short_line(what.as_ref()) }
    }

    /// An error that concerns one line of a file. Lines count from 1.
    pub(crate) fn line(path: &Path, line: usize, what: impl AsRef<str>) -> Self {
        Self { place: format!("{}:{line}", short_line(&path.display().to_string())), what: short_line(what.as_ref()) }
    }
}

/// Result of a check that does not know the file and the line of what it checks. The error is a message for people.
pub(crate) type Checked<T> = Result<T, String>;
