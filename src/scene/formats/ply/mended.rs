//! PLY files as the reader of any PLY file accepts them.

use std::borrow::Cow;

use super::quick::header_bytes;
use crate::scene::files::read::lossy_text;

/// Returns a file without what the reader of PLY files does not accept: lines that end in CR alone, blank lines in a
/// text, a last line that does not end, and names in the header that are not UTF-8.
pub fn mended(bytes: &[u8]) -> Cow<'_, [u8]> {
    let mut mended = Cow::Borrowed(bytes);
    if bytes.starts_with(b"ply\r") && !bytes.starts_with(b"ply\r\n") {
        const END: &[u8] = b"\rend_header\r";
        let end = bytes.windows(END.len()).position(|part| part == END).map_or(bytes.len(), |at| at + END.len());
        let is_text = bytes[..end].windows(5).any(|part| part == b"ascii");
        let end = if is_text { bytes.len() } else { end };
        mended.to_mut()[..end].iter_mut().filter(|byte| **byte == b'\r').for_each(|byte| *byte = b'\n');
    }
    let Some(n_header) = header_bytes(&mended) else { return mended };
    let (header, rows) = mended.split_at(n_header);
    let is_text = header.windows(12).any(|part| part == b"format ascii");
    let is_blank = |line: &[u8]| line.trim_ascii().is_empty();
    let has_blanks = is_text && rows.split(|byte| *byte == b'\n').rev().skip(1).any(is_blank);
    let ends = !is_text || rows.ends_with(b"\n");
    if str::from_utf8(header).is_ok() && !has_blanks && ends {
        return mended;
    }
    let mut whole = lossy_text(header.to_vec()).into_bytes();
    match has_blanks {
        true => rows
            .split_inclusive(|byte| *byte == b'\n')
            .filter(|line| !is_blank(line))
            .for_each(|line| whole.extend(line)),
        false => whole.extend(rows),
    }
    if !ends {
        whole.push(b'\n');
    }
    Cow::Owned(whole)
}

/// Returns a file in two parts, the first of which is the header or empty. In a text, coordinates may have more digits
/// than single precision holds, whatever their type, as maps have. So the header declares them as double precision.
pub fn widened(bytes: &[u8]) -> (Cow<'_, [u8]>, &[u8]) {
    let as_it_is = (Cow::Borrowed(&bytes[..0]), bytes);
    let Some(header) = header_bytes(bytes).and_then(|n| str::from_utf8(&bytes[..n]).ok()) else { return as_it_is };
    let is_text = header.lines().any(|line| line.split_ascii_whitespace().take(2).eq(["format", "ascii"]));
    if !is_text {
        return as_it_is;
    }
    let widened = |line: &str| {
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words[..] {
            ["property", kind @ ("float" | "float32"), "x" | "y" | "z"] => line.replacen(kind, "double", 1),
            _ => line.to_owned(),
        }
    };
    let head: String = header.split_inclusive('\n').map(widened).collect();
    (Cow::Owned(head.into_bytes()), &bytes[header.len()..])
}
