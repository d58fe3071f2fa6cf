//! Functions that read a whole file of a scene, as text or as bytes.

use std::path::Path;

use super::{error::SceneError, files};

/// Reads text that need not be UTF-8. Invalid bytes become U+FFFD, so that a mesh with comments in an old encoding is
/// not refused.
pub(super) fn read_lossy(path: &Path) -> Result<String, SceneError> {
    read_bytes(path).map(lossy_text)
}

/// Returns bytes as text. Invalid bytes become U+FFFD.
pub(super) fn lossy_text(bytes: Vec<u8>) -> String {
    without_bom(match String::from_utf8(bytes) {
        Ok(text) => text,
        Err(e) => String::from_utf8_lossy(e.as_bytes()).into_owned(),
    })
}

/// Reads text that must be UTF-8.
pub(super) fn read_utf8(path: &Path) -> Result<String, SceneError> {
    let text = String::from_utf8(read_bytes(path)?).map_err(|e| {
        let valid = &e.as_bytes()[..e.utf8_error().valid_up_to()];
        let line = 1 + valid.iter().filter(|byte| **byte == b'\n').count();
        SceneError::line(path, line, "is not UTF-8")
    })?;
    Ok(without_bom(text))
}

/// Reads a regular file.
pub(super) fn read_bytes(path: &Path) -> Result<Vec<u8>, SceneError> {
    files::read(path).map_err(|error| SceneError::file(path, format!("cannot be read: {error}")))
}

fn without_bom(text: String) -> String {
    text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text)
}
