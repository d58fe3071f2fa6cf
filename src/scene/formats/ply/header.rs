//! The header of a PLY file, which names the elements and what each of their rows has.

use crate::scene::{files::lossy_text, model::error::Checked};

/// How the numbers of rows are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    Text,
    LittleEndian,
    BigEndian,
}

/// Type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Number {
    fn of(name: &str) -> Checked<Self> {
        Ok(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return Err(format!("`{}` is not a type of number", name.escape_debug())),
        })
    }

    /// Returns the size in binary files, bytes.
    pub fn n_bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Returns the number with which `bytes` begin.
    ///
    /// # Panics
    /// There are fewer bytes than the number has.
    pub fn read(self, bytes: &[u8], is_big: bool) -> f64 {
        match self {
            Self::I8 => f64::from(bytes[0] as i8),
            Self::U8 => f64::from(bytes[0]),
            Self::I16 => i16::from_le_bytes(little(bytes, is_big)).into(),
            Self::U16 => u16::from_le_bytes(little(bytes, is_big)).into(),
            Self::I32 => i32::from_le_bytes(little(bytes, is_big)).into(),
            Self::U32 => u32::from_le_bytes(little(bytes, is_big)).into(),
            Self::F32 => f32::from_le_bytes(little(bytes, is_big)).into(),
            Self::F64 => f64::from_le_bytes(little(bytes, is_big)),
        }
    }
}

/// Returns the little-endian bytes of the number at the start of `bytes`.
fn little<const N: usize>(bytes: &[u8], is_big: bool) -> [u8; N] {
    let mut number: [u8; N] = *bytes.first_chunk().expect("the bytes have the number");
    if is_big {
        number.reverse();
    }
    number
}

/// A number or a list of numbers that each row of an element has.
#[derive(Debug)]
pub struct Property {
    pub name: String,
    /// Type of a list's length. `None` for a single number.
    pub length: Option<Number>,
    pub number: Number,
}

#[derive(Debug)]
pub struct Element {
    pub name: String,
    pub n_rows: usize,
    pub properties: Vec<Property>,
}

impl Element {
    /// Returns the index of the property that is a single number and has the first of these names, or the next ones.
    pub fn number(&self, names: &[&str]) -> Option<usize> {
        self.find(names, |property| property.length.is_none())
    }

    /// Returns the index of the property that is a list and has the first of these names, or the next ones.
    pub fn list(&self, names: &[&str]) -> Option<usize> {
        self.find(names, |property| property.length.is_some())
    }

    fn find(&self, names: &[&str], is_like: fn(&Property) -> bool) -> Option<usize> {
        let find = |name: &&str| self.properties.iter().position(|it| it.name == *name && is_like(it));
        names.iter().find_map(find)
    }
}

#[derive(Debug)]
pub struct Header {
    pub encoding: Encoding,
    pub elements: Vec<Element>,
    pub comments: Vec<String>,
    /// The character that ends lines: LF, or CR in files of old computers.
    pub line_end: u8,
    pub n_lines: usize,
    /// Size of the header, behind which the rows begin.
    pub n_bytes: usize,
}

impl Header {
    /// Reads the header of a file.
    pub fn read(bytes: &[u8]) -> Checked<Self> {
        let has_cr_alone = bytes.starts_with(b"ply\r") && bytes.get(4) != Some(&b'\n');
        let line_end = if has_cr_alone { b'\r' } else { b'\n' };
        let (mut encoding, mut elements, mut comments) = (None, Vec::<Element>::new(), Vec::new());
        let (mut n_lines, mut n_bytes) = (0, 0);
        loop {
            let rest = &bytes[n_bytes..];
            let n = rest.iter().position(|byte| *byte == line_end).ok_or("its header does not end")?;
            (n_lines, n_bytes) = (n_lines + 1, n_bytes + n + 1);
            let line = lossy_text(rest[..n].to_vec());
            let words: Vec<&str> = line.split_whitespace().collect();
            let failed = |what: String| format!("line {n_lines}: {what}");
            match words[..] {
                ["ply"] if n_lines == 1 => {}
                _ if n_lines == 1 => return Err("it does not begin with `ply`".to_owned()),
                [] | ["obj_info", ..] => {}
                ["comment", ..] => comments.push(line.trim()["comment".len()..].trim().to_owned()),
                ["format", "ascii", ..] => encoding = Some(Encoding::Text),
                ["format", "binary_little_endian", ..] => encoding = Some(Encoding::LittleEndian),
                ["format", "binary_big_endian", ..] => encoding = Some(Encoding::BigEndian),
                ["element", name, n_rows] => {
                    let n_rows = n_rows
                        .parse()
                        .map_err(|_| failed(format!("`{}` is no number of rows", words[2].escape_debug())))?;
                    elements.push(Element { name: name.to_owned(), n_rows, properties: Vec::new() });
                }
                ["property", ref types @ .., name] if (1..=3).contains(&types.len()) && !elements.is_empty() => {
                    let (length, number) = match types {
                        ["list", length, number] => (Some(Number::of(length).map_err(failed)?), number),
                        [number] => (None, number),
                        _ => return Err(failed(format!("`{}` is not expected", line.trim().escape_debug()))),
                    };
                    let property =
                        Property { name: name.to_owned(), length, number: Number::of(number).map_err(failed)? };
                    elements.last_mut().expect("there is one").properties.push(property);
                }
                ["end_header"] => break,
                _ => return Err(failed(format!("`{}` is not expected", line.trim().escape_debug()))),
            }
        }
        let encoding = encoding.ok_or("its header has no line `format`")?;
        Ok(Self { encoding, elements, comments, line_end, n_lines, n_bytes })
    }
}
