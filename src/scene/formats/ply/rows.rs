//! The rows of an element as a binary file has them. Those of a text are translated first (`text.rs`).

use rayon::prelude::*;

use super::header::{Element, Encoding, Number, Property};

/// Types of list lengths and of numbers in a translated text. They are not those of the header, since coordinates of
/// maps have more digits than the single precision that it states.
const OF_TEXT: (Number, Number) = (Number::U32, Number::F64);

/// Where a row has a property, and how.
struct Field {
    /// Offset from the row's start, bytes. `None` if a list precedes the property.
    offset: Option<usize>,
    /// Type of a list's length.
    length: Option<Number>,
    number: Number,
}

/// The rows of an element.
pub struct Rows<'a> {
    pub element: &'a Element,
    fields: Vec<Field>,
    is_big: bool,
    bytes: &'a [u8],
    starts: Starts,
}

/// Where rows start, bytes.
enum Starts {
    /// All rows have this size.
    Every(usize),
    /// Rows with lists.
    At(Vec<usize>),
}

impl<'a> Rows<'a> {
    /// Takes an element's rows, with which `bytes` begin. Also returns the bytes behind them. Returns `None` if the
    /// bytes end before, or if the length of a list is no whole number.
    pub fn take(element: &'a Element, encoding: Encoding, bytes: &'a [u8]) -> Option<(Self, &'a [u8])> {
        let mut offset = Some(0);
        let field = |property: &Property| {
            let (length, number) = match encoding {
                Encoding::Text => (property.length.map(|_| OF_TEXT.0), OF_TEXT.1),
                _ => (property.length, property.number),
            };
            let next = if length.is_none() { offset.map(|offset: usize| offset + number.n_bytes()) } else { None };
            Field { offset: std::mem::replace(&mut offset, next), length, number }
        };
        let fields: Vec<Field> = element.properties.iter().map(field).collect();
        let is_big = encoding == Encoding::BigEndian;
        let mut rows = Self { element, fields, is_big, bytes, starts: Starts::Every(0) };
        let end = match offset {
            Some(n_row_bytes) => {
                rows.starts = Starts::Every(n_row_bytes);
                n_row_bytes.checked_mul(element.n_rows).filter(|end| *end <= bytes.len())?
            }
            None => {
                let (mut starts, mut end) = (Vec::with_capacity(element.n_rows), 0);
                for _ in 0..element.n_rows {
                    starts.push(end);
                    end = rows.fields.iter().try_fold(end, |at, field| rows.end(field, at))?;
                }
                rows.starts = Starts::At(starts);
                end
            }
        };
        Some((rows, &bytes[end..]))
    }

    /// Returns where a property that begins at a place ends, if the bytes do not end before and it has a length.
    fn end(&self, field: &Field, at: usize) -> Option<usize> {
        let n_bytes = match field.length {
            None => field.number.n_bytes(),
            Some(length) => {
                self.bytes.get(at..at + length.n_bytes())?;
                length.n_bytes().checked_add(self.length(length, at)?.checked_mul(field.number.n_bytes())?)?
            }
        };
        at.checked_add(n_bytes).filter(|end| *end <= self.bytes.len())
    }

    fn length(&self, length: Number, at: usize) -> Option<usize> {
        let stated = length.read(&self.bytes[at..], self.is_big);
        let n = stated as usize;
        (n as f64 == stated).then_some(n)
    }

    pub fn len(&self) -> usize {
        self.element.n_rows
    }

    pub fn row(&self, ix: usize) -> Row<'_> {
        let start = match &self.starts {
            Starts::Every(n_bytes) => ix * n_bytes,
            Starts::At(starts) => starts[ix],
        };
        Row { rows: self, start }
    }

    /// Returns a value for each row.
    pub fn map<T: Send>(&self, value: impl Fn(Row) -> T + Sync) -> Vec<T> {
        (0..self.len()).into_par_iter().map(|ix| value(self.row(ix))).collect()
    }

    /// Whether it is so for all rows.
    pub fn all(&self, is_so: impl Fn(Row) -> bool + Sync) -> bool {
        (0..self.len()).into_par_iter().all(|ix| is_so(self.row(ix)))
    }
}

/// A row of an element. Properties are named by their indices.
#[derive(Clone, Copy)]
pub struct Row<'a> {
    rows: &'a Rows<'a>,
    start: usize,
}

impl<'a> Row<'a> {
    /// Returns the number that a property is.
    pub fn number(self, property: usize) -> f64 {
        let Rows { fields, bytes, is_big, .. } = self.rows;
        fields[property].number.read(&bytes[self.place(property)..], *is_big)
    }

    /// Returns the numbers of the list that a property is.
    pub fn list(self, property: usize) -> impl ExactSizeIterator<Item = f64> + Clone + 'a {
        let Rows { fields, bytes, is_big, .. } = self.rows;
        let (at, Field { length, number, .. }) = (self.place(property), &fields[property]);
        let of_list = |length: Number| (length.n_bytes(), self.rows.length(length, at).expect("`take` has read it"));
        let (n_before, n) = length.map_or((0, 1), of_list);
        let n_bytes = number.n_bytes();
        let numbers = &bytes[at + n_before..][..n * n_bytes];
        numbers.chunks_exact(n_bytes).map(|bytes| number.read(bytes, *is_big))
    }

    /// Returns where a property begins.
    fn place(self, property: usize) -> usize {
        let fields = &self.rows.fields;
        let after = |at, field: &Field| self.rows.end(field, at).expect("the bytes have the row");
        fields[property].offset.map_or_else(|| fields[..property].iter().fold(self.start, after), |n| self.start + n)
    }
}
