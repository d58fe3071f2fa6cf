//! STL files as text. They are read word by word, since writers break lines where they like, even nowhere, and use
//! small letters or capitals.

use glam::DVec3;

use super::{Facet, REPORTED_FACETS, require_for_facets};
use crate::{
    scene::model::error::Checked,
    util::{
        progress::{Progress, Work},
        text::short_line,
    },
};

/// Least number of bytes of a facet: its keywords, and one digit for each number.
const LEAST_FACET_BYTES: usize = 80;

/// A word and the number of its line, counted from 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Word<'a> {
    pub text: &'a [u8],
    line: usize,
}

/// The words of a text.
#[derive(Clone)]
pub(super) struct Words<'a> {
    rest: &'a [u8],
    line: usize,
}

impl<'a> Words<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes, line: 1 }
    }

    /// Passes over the name of a solid, which may be missing or in any encoding. The name ends with the line, or before
    /// the first facet if the whole file is one line.
    fn skip_name(&mut self) {
        let line = self.line;
        loop {
            let mut ahead = self.clone();
            let Some(word) = ahead.next() else { return };
            let begins_facet = || word.is("facet") && ahead.clone().next().is_some_and(|word| word.is("normal"));
            if word.line != line || begins_facet() || word.is("endsolid") {
                return;
            }
            *self = ahead;
        }
    }
}

impl<'a> Iterator for Words<'a> {
    type Item = Word<'a>;

    fn next(&mut self) -> Option<Word<'a>> {
        let n_blanks = self.rest.iter().position(|byte| !byte.is_ascii_whitespace())?;
        let (blanks, rest) = self.rest.split_at(n_blanks);
        // A line ends in LF, CR LF, or, on old computers, CR.
        let ends = |(ix, byte): &(usize, &u8)| **byte == b'\n' || **byte == b'\r' && blanks.get(ix + 1) != Some(&b'\n');
        self.line += blanks.iter().enumerate().filter(ends).count();
        let n = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.rest = &rest[n..];
        Some(Word { text: &rest[..n], line: self.line })
    }
}

impl Word<'_> {
    fn is(&self, keyword: &str) -> bool {
        self.text.eq_ignore_ascii_case(keyword.as_bytes())
    }

    fn shown(&self) -> String {
        short_line(&String::from_utf8_lossy(self.text))
    }

    /// Returns a coordinate: NaN for what programs write if they could not compute it.
    fn number(&self) -> Checked<f64> {
        let text = std::str::from_utf8(self.text).unwrap_or_default();
        let word = text.trim_start_matches(['+', '-']).to_ascii_lowercase();
        match text.parse() {
            Ok(number) => Ok(number),
            Err(_) if word.starts_with("nan") || word.starts_with("1.#") => Ok(f64::NAN),
            Err(_) if text.replacen(',', ".", 1).parse::<f64>().is_ok() => {
                Err(format!("`{}` is not a number: decimals need a point in place of the comma", self.shown()))
            }
            Err(_) => Err(format!("`{}` is not a number", self.shown())),
        }
    }
}

/// Reads the facets of all solids. Those with a corner that is not finite are left out. `origin` is subtracted from
/// the coordinates.
pub(super) fn facets(bytes: &[u8], origin: DVec3, (n_loaded, progress): (usize, &Progress)) -> Checked<Vec<Facet>> {
    require_for_facets(n_loaded, bytes.len() / LEAST_FACET_BYTES)?;
    let meter = progress.begin(Work::Reading, bytes.len() as u64);
    let (mut facets, mut corners, mut n_read) = (Vec::new(), Vec::new(), 0);
    let mut words = Words::new(bytes);
    while let Some(word) = words.next() {
        let failed = |what: String| format!("line {}: {what}", word.line);
        match () {
            () if word.is("solid") || word.is("endsolid") => words.skip_name(),
            () if word.is("end") && words.clone().next().is_some_and(|next| next.is("solid")) => {}
            () if word.is("facet") => pass_over_normal(&mut words),
            () if word.is("vertex") => corners.push(corner(&mut words, failed)? - origin),
            () if word.is("endfacet") => {
                let n = corners.len();
                let [a, b, c] = corners[..] else { return Err(failed(format!("a facet has {n} corners, not 3"))) };
                facets.push([a, b, c].map(|corner: DVec3| corner.as_vec3()));
                corners.clear();
                if facets.len() % REPORTED_FACETS == 0 {
                    let n_rest = words.rest.len();
                    meter.add((bytes.len() - n_rest - n_read) as u64);
                    n_read = bytes.len() - n_rest;
                }
            }
            () if ["outer", "loop", "endloop"].iter().any(|keyword| word.is(keyword)) => {}
            () => return Err(failed(format!("`{}` is not expected in an STL file", word.shown()))),
        }
    }
    if !corners.is_empty() {
        return Err(format!("line {}: the file ends in the middle of a facet", words.line));
    }
    meter.add((bytes.len() - n_read) as u64);
    facets.retain(|facet: &Facet| facet.iter().all(|corner| corner.is_finite()));
    Ok(facets)
}

/// Passes over the stored normal of a facet, whose numbers need not be numbers.
fn pass_over_normal(words: &mut Words) {
    let mut ahead = words.clone();
    for _ in 0..4 {
        match ahead.next() {
            Some(word) if !word.is("outer") && !word.is("vertex") => *words = ahead.clone(),
            _ => return,
        }
    }
}

fn corner(words: &mut Words, failed: impl Fn(String) -> String) -> Checked<DVec3> {
    let mut corner = [0.0; 3];
    for number in &mut corner {
        let word = words.next().ok_or_else(|| failed("the file ends in the middle of a facet".to_owned()))?;
        *number = word.number().map_err(&failed)?;
    }
    Ok(DVec3::from_array(corner))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FACET: &str = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";

    fn read(text: &str) -> Checked<Vec<Facet>> {
        facets(text.as_bytes(), DVec3::ZERO, (0, &Progress::default()))
    }

    #[test]
    fn lines_may_break_anywhere() {
        let text = format!("solid my facet of normal solid\n{FACET}{FACET}endsolid my facet\nsolid\n{FACET}endsolid");
        let expected = read(&text).unwrap();
        assert_eq!(expected.len(), 3);
        assert_eq!(read(&text.replace('\n', "\r")).unwrap(), expected);
        assert_eq!(read(&text.replace('\n', "\r\n\t ")).unwrap(), expected);
        assert_eq!(read(&text.to_uppercase().replace('0', "+.0E-0")).unwrap(), expected);
        let one_line = format!("solid a b {FACET}endsolid a b solid c {FACET}").replace('\n', " ");
        assert_eq!(read(&one_line).unwrap(), expected[..2]);
        assert_eq!(read(&text.replace("normal 0 0 1", "")).unwrap(), expected);
        assert_eq!(read(&text.replace("endsolid", "end solid")).unwrap(), expected);
        assert_eq!(read(&text.replace("normal 0 0 1", "normal nan -1.#IND x")).unwrap(), expected);
    }

    #[test]
    fn mistakes_have_lines() {
        for (from, to, what) in [
            ("vertex 1 0 0", "vertex 1,5 0 0", "line 5: `1,5` is not a number: decimals need a point"),
            ("vertex 1 0 0", "vertex 1 0", "line 5: `vertex` is not a number"),
            ("vertex 1 0 0", "vertex", "line 5: `vertex` is not a number"),
            ("vertex 1 0 0\n", "", "line 7: a facet has 2 corners, not 3"),
            ("endloop\nendfacet\n", "", "line 6: the file ends in the middle of a facet"),
            ("0 1 0\nendloop\nendfacet\n", "0 1", "line 6: the file ends in the middle of a facet"),
            ("endloop", "end loop", "line 7: `end` is not expected"),
        ] {
            let text = format!("solid\r\n{FACET}").replacen(from, to, 1);
            assert!(read(&text).unwrap_err().starts_with(what), "{to}: {:?}", read(&text));
        }
    }
}
