//! The bytes of a file as text.

/// The characters of the bytes 0x80 to 0x9F in Windows-1252. Those above are characters of the same number.
const WINDOWS_1252: [char; 32] = [
    '€', '\u{81}', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', '\u{8d}', 'Ž', '\u{8f}', '\u{90}', '‘', '’',
    '“', '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', '\u{9d}', 'ž', 'Ÿ',
];

/// Returns bytes as text. UTF-16 is told by its byte order mark. What is not UTF-8 is read as Windows-1252, as old
/// programs of Europe and America write names of files and materials. Where lines end in CR alone, as on old computers,
/// they end in LF here.
pub(crate) fn lossy_text(bytes: Vec<u8>) -> String {
    let text = match &bytes[..] {
        [0xff, 0xfe, rest @ ..] => of_utf16(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => of_utf16(rest, u16::from_be_bytes),
        _ => of_bytes(bytes),
    };
    if text.contains('\r') && !text.contains('\n') { text.replace('\r', "\n") } else { text }
}

fn of_utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> String {
    let units = bytes.as_chunks().0.iter().map(|pair| unit(*pair));
    char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
}

/// Returns bytes as text. Bytes that are not UTF-8 are read as Windows-1252.
fn of_bytes(bytes: Vec<u8>) -> String {
    let of_byte = |byte: &u8| match byte {
        0x80..=0x9f => WINDOWS_1252[usize::from(byte - 0x80)],
        _ => char::from(*byte),
    };
    match String::from_utf8(without_bom(bytes)) {
        Ok(text) => text,
        Err(e) => {
            let mut text = String::with_capacity(e.as_bytes().len());
            for chunk in e.as_bytes().utf8_chunks() {
                text.push_str(chunk.valid());
                text.extend(chunk.invalid().iter().map(of_byte));
            }
            text
        }
    }
}

/// Returns bytes as text that must be UTF-8, without a byte order mark. An error is the first line that is not.
pub fn utf8(bytes: Vec<u8>) -> Result<String, usize> {
    String::from_utf8(without_bom(bytes)).map_err(|e| {
        let valid = &e.as_bytes()[..e.utf8_error().valid_up_to()];
        1 + valid.iter().filter(|byte| **byte == b'\n').count()
    })
}

/// Takes the byte order mark of UTF-8 from the beginning of bytes.
pub(crate) fn without_bom(mut bytes: Vec<u8>) -> Vec<u8> {
    if bytes.starts_with(b"\xef\xbb\xbf") {
        bytes.drain(..3);
    }
    bytes
}
