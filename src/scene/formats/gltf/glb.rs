//! GLB files: a header of 12 bytes, and chunks, each of which begins with its length and its kind.

use std::ops::Range;

use super::document::part;
use crate::scene::model::error::Checked;

/// Returns where the JSON of a file is, and the binary chunk if it has one. Chunks of other kinds, and bytes behind the
/// length that the header states, are skipped.
pub(super) fn split(bytes: &[u8]) -> Checked<(Range<usize>, Option<Range<usize>>)> {
    if !bytes.starts_with(b"glTF") {
        return Ok((0..bytes.len(), None));
    }
    let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..)?.first_chunk().copied()?) as usize);
    match word(4) {
        Some(2) => {}
        Some(version) => return Err(format!("is a GLB file of version {version}, and only version 2 is read")),
        None => return Err("the header ends too early".to_owned()),
    }
    let chunk = |at: usize, name: &str| {
        let n_bytes = word(at).ok_or_else(|| format!("the header of the chunk {name} ends too early"))?;
        let found = part(bytes, at as u64 + 8, n_bytes as u64);
        found.map(|part| at + 8..at + 8 + part.len()).map_err(|what| format!("the chunk {name}: {what}"))
    };
    let kind_at = |at: usize| bytes.get(at + 4..at + 8);
    let json = chunk(12, "JSON")?;
    if kind_at(12) != Some(b"JSON") {
        return Err("there is no chunk JSON at byte 12".to_owned());
    }
    let mut at = json.end;
    // Some writers fill the chunk up with zeros in place of blanks.
    let n_zeros = bytes[json.clone()].iter().rev().take_while(|byte| **byte == 0).count();
    let json = json.start..json.end - n_zeros;
    // A few bytes behind the last chunk are padding.
    let end = word(8).unwrap_or(0).min(bytes.len());
    while at + 8 <= end {
        if kind_at(at) == Some(b"BIN\0") {
            return Ok((json, Some(chunk(at, "BIN")?)));
        }
        at = chunk(at, &format!("at byte {at}"))?.end;
    }
    Ok((json, None))
}
