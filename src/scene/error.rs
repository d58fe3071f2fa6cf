//! Why a scene could not be loaded, in one line.

use std::path::Path;

use crate::util::text::one_line;

/// A scene file that cannot be read, understood or drawn. Displays as one line: `FILE:LINE: what` or `FILE: object: what`.
#[derive(Debug, thiserror::Error)]
#[error("{place}: {what}")]
pub struct SceneError {
    place: String,
    what: String,
}

impl SceneError {
    /// About a file as a whole.
    pub(super) fn file(path: &Path, what: impl AsRef<str>) -> Self {
        Self { place: quoted(&path.display().to_string()), what: quoted(what.as_ref()) }
    }

    /// About one line of a file, counted from 1.
    pub(super) fn line(path: &Path, line: usize, what: impl AsRef<str>) -> Self {
        Self { place: format!("{}:{line}", quoted(&path.display().to_string())), what: quoted(what.as_ref()) }
    }
}

/// What comes of a check before it is known which file and line it is about.
pub(super) type Checked<T> = Result<T, String>;

/// Text on one line, of some 300 characters at most: it may quote a hostile file.
fn quoted(text: &str) -> String {
    let line = one_line(text);
    match line.char_indices().nth(300) {
        Some((end, _)) => format!("{}…", &line[..end]),
        None => line,
    }
}
