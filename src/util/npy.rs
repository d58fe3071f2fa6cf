//! Headers of NumPy's files, read with bounds on what a file may ask for.

use std::io::{self, Read};

use npyz::NpyHeader;

/// Greatest accepted size of a header in bytes. Headers of plain arrays are smaller. The reader allocates as many
/// bytes as the file claims, so the size is checked first.
const MAX_HEADER: u32 = 1024;
/// Deepest accepted nesting of brackets in a header. That of an array of structures is 3, of plain numbers 2. The time
/// in which the reader parses a header grows exponentially with it: 30 take more than ten seconds.
const MAX_NESTING: usize = 4;

/// Reads the header of a file, from the file's first byte on. Refuses one that is no plain array's before it is parsed:
/// see `MAX_HEADER` and `MAX_NESTING`. `rule`: what the file has to hold, for messages. Every `.npy` file is longer
/// than 12 bytes. A pipe may deliver them one by one.
pub(crate) fn read_header(file: &mut impl Read, rule: &str) -> Result<NpyHeader, String> {
    let mut read = |bytes: &mut [u8]| {
        file.read_exact(bytes).map_err(|e| match e.kind() {
            io::ErrorKind::UnexpectedEof => "is no .npy file".to_owned(),
            _ => format!("cannot be read: {e}"),
        })
    };
    let mut header = vec![0; 12];
    read(&mut header)?;
    let (begin, size) = match header[..] {
        [0x93, b'N', b'U', b'M', b'P', b'Y', 1, _, a, b, ..] => (10, u32::from_le_bytes([a, b, 0, 0])),
        [0x93, b'N', b'U', b'M', b'P', b'Y', _, _, a, b, c, d] => (12, u32::from_le_bytes([a, b, c, d])),
        _ => return Err("is no .npy file".to_owned()),
    };
    if size > MAX_HEADER {
        return Err(format!("has a header of {size} bytes: {rule}"));
    }
    header.resize((begin + size as usize).max(12), 0);
    read(&mut header[12..])?;
    if nesting(&header[begin..]) > MAX_NESTING {
        return Err(format!("has a header of nested brackets: {rule}"));
    }
    // The reader multiplies the numbers of the shape in 64 bits.
    let text = String::from_utf8_lossy(&header[begin..]);
    let shape = text.split_once("shape").and_then(|(_, rest)| rest.split_once(')')).map_or("", |(shape, _)| shape);
    let numbers = shape.split(|c: char| !c.is_ascii_digit()).filter(|number| !number.is_empty());
    let product = numbers.clone().try_fold(1_u64, |product, number| product.checked_mul(number.parse().ok()?));
    if product.is_none() {
        let numbers: Vec<&str> = numbers.collect();
        return Err(format!("has the shape {}, too many numbers for a file: {rule}", numbers.join(" x ")));
    }
    NpyHeader::from_reader(header.as_slice()).map_err(|e| format!("is no .npy file: {e}"))
}

/// Returns how deep brackets are nested in a text.
fn nesting(text: &[u8]) -> usize {
    let (mut depth, mut deepest) = (0_usize, 0);
    for byte in text {
        match byte {
            b'(' | b'[' | b'{' => depth += 1,
            b')' | b']' | b'}' => depth = depth.saturating_sub(1),
            _ => {}
        }
        deepest = deepest.max(depth);
    }
    deepest
}
