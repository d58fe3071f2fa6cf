//! What the corners of faces name: points (`v`), texture vertices (`vt`) and normals (`vn`). A kind of elements is an
//! index into arrays of three, in this order.

use std::ops::RangeInclusive;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::statement::{Fault, words};

/// How many numbers of an element are kept, by kind, and of a colour.
const N_NUMBERS: [usize; 4] = [3, 2, 3, 3];
/// The index of the colours of points in lists of four.
const COLOURS: usize = 3;
/// How many numbers an element may have. A point may have a weight, which only curves use, or a colour, and then an
/// opacity. A texture vertex without v has 0, and its third number is ignored.
const COUNTS: [RangeInclusive<usize>; 3] = [3..=7, 1..=3, 3..=3];
const KEYWORDS: [&str; 3] = ["v", "vt", "vn"];

/// Returns the kind of the elements with a keyword.
pub fn kind_of(keyword: &str) -> Option<usize> {
    KEYWORDS.iter().position(|known| *known == keyword)
}

/// The elements of a file or of a part of it.
#[derive(Debug, Default)]
pub struct Elements {
    /// The numbers of all elements by kind, and the colours of points. An element with a number that is NaN or infinite
    /// by its spelling, which programs write for what they could not compute, has NaN alone. Until the parts of a file
    /// are joined, the colours end with that of the last point that has one, and points without have NaN.
    numbers: [Vec<f32>; 4],
    largest_colour: f32,
    /// The first element that is wrong.
    pub error: Option<Fault>,
    /// The first element with a number beyond single precision, which is infinite in `numbers`.
    pub overflow: Option<Fault>,
}

impl Elements {
    /// Adds an element. `origin` is subtracted from points.
    pub fn add(&mut self, kind: usize, (line, rest): (usize, &str), origin: DVec3) {
        let origin = if kind == 0 { origin } else { DVec3::ZERO };
        // Without a comment, and if only spaces of ASCII separate words, they are found in less time.
        let plain = numbers(rest.split_ascii_whitespace(), origin);
        let plain = plain.filter(|(numbers, n)| COUNTS[kind].contains(n) && are_finite(numbers));
        let (numbers, n) = plain.unwrap_or_else(|| self.odd(kind, (line, rest), origin));
        if kind == 0 && n >= 6 {
            let (n_before, colour) = (self.numbers[0].len(), &numbers[3..6]);
            self.numbers[COLOURS].resize(n_before, f32::NAN);
            self.numbers[COLOURS].extend_from_slice(colour);
            self.largest_colour = colour.iter().copied().fold(self.largest_colour, f32::max);
        }
        self.numbers[kind].extend_from_slice(&numbers[..N_NUMBERS[kind]]);
    }

    /// Returns the numbers of an element, which may be wrong.
    fn odd(&mut self, kind: usize, (line, rest): (usize, &str), origin: DVec3) -> ([f32; 7], usize) {
        let read = numbers(words(rest), origin).filter(|(_, n)| COUNTS[kind].contains(n));
        match read {
            _ if is_broken(rest) => ([f32::NAN; 7], read.map_or(0, |(_, n)| n)),
            Some(read) if are_finite(&read.0) => read,
            Some(read) if are_finite(&read.0[N_NUMBERS[kind]..]) => {
                self.overflow.get_or_insert_with(|| (line, fault(kind, rest, origin)));
                read
            }
            _ => {
                self.error.get_or_insert_with(|| (line, fault(kind, rest, origin)));
                ([f32::NAN; 7], 0)
            }
        }
    }

    /// Joins the elements of the parts of a file.
    pub fn joined(mut parts: Vec<Self>) -> Self {
        if parts.iter().any(Self::has_colours) {
            parts.iter_mut().for_each(|part| part.numbers[COLOURS].resize(part.numbers[0].len(), f32::NAN));
        }
        let numbers = [0, 1, 2, COLOURS].map(|list| {
            let lists = parts.iter_mut().map(|part| std::mem::take(&mut part.numbers[list]));
            lists.collect::<Vec<_>>().concat()
        });
        let mut joined = Self {
            numbers,
            largest_colour: parts.iter().map(|part| part.largest_colour).fold(0.0, f32::max),
            error: parts.iter_mut().find_map(|part| part.error.take()),
            overflow: parts.iter_mut().find_map(|part| part.overflow.take()),
        };
        let white = joined.colour_scale();
        joined.numbers[COLOURS].iter_mut().filter(|number| number.is_nan()).for_each(|number| *number = white);
        joined
    }

    /// Returns the number that stands for 1 in colours. Some writers state colours as 0 to 255.
    pub fn colour_scale(&self) -> f32 {
        if self.largest_colour > 1.0 { 255.0 } else { 1.0 }
    }

    pub fn has_colours(&self) -> bool {
        !self.numbers[COLOURS].is_empty()
    }

    /// Returns the colour of a point. A point without one is white if another point has one.
    pub fn colour(&self, ix: usize) -> &[f32] {
        if self.has_colours() { self.get(COLOURS, ix) } else { &[] }
    }

    /// Returns the numbers of elements by kind.
    pub fn counts(&self) -> [usize; 3] {
        [0, 1, 2].map(|kind| self.numbers[kind].len() / N_NUMBERS[kind])
    }

    /// Returns the numbers of an element, which is counted from 0.
    pub fn get(&self, kind: usize, ix: usize) -> &[f32] {
        &self.numbers[kind][ix * N_NUMBERS[kind]..][..N_NUMBERS[kind]]
    }

    /// Returns whether all numbers are finite.
    pub fn are_finite(&self) -> bool {
        self.numbers.iter().all(|list| list.par_chunks(1 << 12).all(are_finite))
    }

    pub fn points(&self) -> &[Vec3] {
        bytemuck::cast_slice(&self.numbers[0])
    }
}

fn are_finite(numbers: &[f32]) -> bool {
    numbers.iter().all(|number| number.is_finite())
}

/// Reads up to seven numbers, and returns how many there are. `origin` is subtracted from the first three in double
/// precision.
fn numbers<'a>(words: impl Iterator<Item = &'a str>, origin: DVec3) -> Option<([f32; 7], usize)> {
    let (mut numbers, mut n) = ([0.0; 7], 0);
    for word in words {
        *numbers.get_mut(n)? = number((n, word), origin)?;
        n += 1;
    }
    Some((numbers, n))
}

fn number((ix, word): (usize, &str), origin: DVec3) -> Option<f32> {
    match origin == DVec3::ZERO || ix >= 3 {
        true => word.parse().ok(),
        false => Some((word.parse::<f64>().ok()? - origin[ix]) as f32),
    }
}

/// Returns whether a number in `rest` is NaN or infinite by its spelling: `nan`, `-nan(ind)`, `inf`, `-1.#IND`.
fn is_broken(rest: &str) -> bool {
    let is_broken = |word: &str| {
        let word = word.trim_start_matches(['+', '-']).to_ascii_lowercase();
        let of_windows = word.strip_prefix("1.#").is_some_and(|rest| rest.starts_with(['i', 'q', 's']));
        of_windows || word == "inf" || word == "infinity" || word.starts_with("nan")
    };
    rest.split_whitespace().take_while(|word| !word.starts_with('#')).any(is_broken)
}

/// Says what is wrong with an element.
fn fault(kind: usize, rest: &str, origin: DVec3) -> String {
    let of_word = |(ix, word): (usize, &str)| match number((ix, word), origin) {
        Some(number) if number.is_finite() => None,
        Some(_) => Some(format!("`{word}` is not a finite number of single precision")),
        None if word.replacen(',', ".", 1).parse::<f32>().is_ok() => {
            Some(format!("`{word}` is not a number: decimals need a point in place of the comma"))
        }
        None => Some(format!("`{word}` is not a number")),
    };
    words(rest).enumerate().find_map(of_word).unwrap_or_else(|| {
        let (keyword, n, allowed) = (KEYWORDS[kind], words(rest).count(), &COUNTS[kind]);
        let allowed = match (allowed.start(), allowed.end()) {
            (least, most) if least == most => least.to_string(),
            (least, most) => format!("{least} to {most}"),
        };
        format!("`{keyword}` has {n} numbers: it takes {allowed}")
    })
}
