//! The rows of a PLY file that is a text, translated to those of a binary file.

use super::header::{Header, Property};
use crate::{scene::model::error::Checked, util::progress::Meter};

/// Number of bytes between two reports of progress.
const REPORTED_BYTES: usize = 1 << 20;

/// The words of rows.
struct Words<'a, L> {
    /// The lines that are not blank, each with its number.
    lines: L,
    line: usize,
    /// The rest of the line.
    rest: &'a [u8],
    /// Number of bytes of the lines so far.
    n_bytes: usize,
    /// Whether a row is a line, whatever else the line has. Otherwise rows follow each other, and lines do not count.
    row_is_line: bool,
}

/// Translates the rows of all elements, `text`. Also returns what is to be warned of. `meter` is told of the bytes that
/// have been read.
pub fn binary_rows(header: &Header, text: &[u8], meter: &Meter) -> Checked<(Vec<u8>, Option<String>)> {
    let lines = || {
        let lines = text.split(|byte| *byte == header.line_end).zip(header.n_lines + 1..);
        lines.filter(|(line, _)| !line.trim_ascii().is_empty())
    };
    let n_rows = header.elements.iter().fold(0, |n: usize, element| n.saturating_add(element.n_rows));
    let row_is_line = lines().count() == n_rows;
    let mut words = Words { lines: lines(), line: header.n_lines, rest: &[], n_bytes: 0, row_is_line };
    let (mut binary, mut longer, mut n_reported) = (Vec::new(), None, 0);
    for element in &header.elements {
        for row_ix in 0..element.n_rows {
            if row_is_line {
                words.go_on();
            }
            for property in &element.properties {
                let added = words.translate(property, &mut binary);
                added.map_err(|what| format!("element `{}`: {what}", element.name.escape_debug()))?;
            }
            if row_is_line && !words.rest.is_empty() {
                longer.get_or_insert(words.line);
            }
            if words.n_bytes - n_reported >= REPORTED_BYTES || row_ix + 1 == element.n_rows {
                meter.add((words.n_bytes - n_reported) as u64);
                n_reported = words.n_bytes;
            }
        }
    }
    let warning = longer.map(|line| format!("line {line} has more numbers than its row, which are not read"));
    let is_rest = !row_is_line && words.next().is_some();
    let of_rest = || is_rest.then(|| format!("what follows the last row is not read: line {}", words.line));
    Ok((binary, warning.or_else(of_rest)))
}

impl<'a, L: Iterator<Item = (&'a [u8], usize)>> Words<'a, L> {
    /// Goes on to the next line, if there is one.
    fn go_on(&mut self) -> Option<()> {
        let (line, number) = self.lines.next()?;
        (self.rest, self.line) = (line.trim_ascii(), number);
        self.n_bytes += line.len() + 1;
        Some(())
    }

    fn next(&mut self) -> Option<&'a [u8]> {
        while self.rest.is_empty() && !self.row_is_line {
            self.go_on()?;
        }
        let n = self.rest.iter().position(u8::is_ascii_whitespace).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(n);
        self.rest = rest.trim_ascii_start();
        (n > 0).then_some(word)
    }

    fn number(&mut self) -> Checked<f64> {
        match self.next() {
            Some(word) => {
                let number = str::from_utf8(word).ok().and_then(|word| word.parse().ok());
                number.ok_or_else(|| format!("line {}: `{}` is not a number", self.line, word.escape_ascii()))
            }
            None if self.row_is_line => Err(format!("line {} has fewer numbers than the row", self.line)),
            None => Err("the file ends too early".to_owned()),
        }
    }

    /// Translates a property of a row.
    fn translate(&mut self, property: &Property, binary: &mut Vec<u8>) -> Checked<()> {
        let mut n = 1;
        if property.length.is_some() {
            let length = self.number()?;
            n = length as u32;
            if f64::from(n) != length {
                return Err(format!("line {}: {length} is no length of a list", self.line));
            }
            binary.extend(n.to_le_bytes());
        }
        for _ in 0..n {
            binary.extend(self.number()?.to_le_bytes());
        }
        Ok(())
    }
}
