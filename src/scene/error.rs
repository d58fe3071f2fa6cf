//! Why a scene could not be loaded, in one line.

use std::path::Path;

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
        Self { place: one_line(&path.display().to_string()), what: one_line(what.as_ref()) }
    }

    /// About one line of a file, counted from 1.
    pub(super) fn line(path: &Path, line: usize, what: impl AsRef<str>) -> Self {
        Self { place: format!("{}:{line}", one_line(&path.display().to_string())), what: one_line(what.as_ref()) }
    }
}

/// What comes of a check before it is known which file and line it is about.
pub(super) type Checked<T> = Result<T, String>;

/// Text without line breaks and other control characters, of 300 characters at most: it may quote a hostile file.
fn one_line(text: &str) -> String {
    let mut line = String::new();
    for (n, c) in text.trim().chars().enumerate() {
        match c {
            _ if n == 300 => {
                line.push('…');
                break;
            }
            '\n' | '\r' | '\t' => line.push(' '),
            c if c.is_control() => line.extend(c.escape_default()),
            c => line.push(c),
        }
    }
    line
}
