//! Checks the text of an OBJ file, statement by statement, and rewrites it into a form that tobj reads correctly.
//!
//! tobj 4.0.5 panics on an overflowing normal index, accepts NaN as a coordinate, uses a neighbour's normal where a
//! corner has none, and ignores `s`. The rewritten text avoids all of this: its numbers are finite, its indices are
//! absolute and in range, and each run of faces that are shaded alike has its own group, named [`NORMALS`],
//! [`SMOOTH`] or [`FLAT`].

use std::{borrow::Cow, collections::BTreeMap, fmt::Write};

use crate::scene::error::Checked;

/// Group of faces whose corners all have normals.
pub const NORMALS: &str = "normals";
/// Group of faces without normals that are shaded smoothly.
pub const SMOOTH: &str = "smooth";
/// Group of faces without normals after `s off`.
pub const FLAT: &str = "flat";

/// Keywords of the format that do not concern polygons or their materials.
const IGNORED: [&str; 31] = [
    "o",
    "g",
    "l",
    "p",
    "vp",
    "deg",
    "bmat",
    "step",
    "cstype",
    "curv",
    "curv2",
    "surf",
    "parm",
    "trim",
    "hole",
    "scrv",
    "sp",
    "end",
    "con",
    "mg",
    "bevel",
    "c_interp",
    "d_interp",
    "lod",
    "shadow_obj",
    "trace_obj",
    "ctech",
    "stech",
    "maplib",
    "usemap",
    "call",
];

/// A checked OBJ file.
#[derive(Debug, Default)]
pub struct CleanObj {
    /// Text for tobj: all positions, all normals, then the faces. The first line names a material library, so that
    /// tobj calls its material loader.
    pub text: String,
    /// Names after `mtllib`, each with its line, counted from 1.
    pub libraries: Vec<(usize, String)>,
    /// Names after `usemtl`, each with the first line that uses it.
    pub used_materials: BTreeMap<String, usize>,
    /// Number of triangles after polygons are cut into fans.
    pub n_triangles: u64,
    /// Line and keyword of the first statement that is not part of the format, if any.
    pub unknown: Option<(usize, String)>,
}

/// Checks and rewrites the text of an OBJ file. The error is a line, counted from 1, and what is wrong with it.
pub fn clean_obj(text: &str) -> Result<CleanObj, (usize, String)> {
    let mut cleaner = Cleaner { totals: count(text), ..Cleaner::default() };
    for (line, statement) in statements(text) {
        cleaner.statement(line, &statement).map_err(|what| (line, what))?;
    }
    let Cleaner { mut out, positions, normals, faces, .. } = cleaner;
    out.text = ["mtllib all\n", &positions, &normals, &faces].concat();
    Ok(out)
}

/// Returns the statements of a file, each with the number of its first line. Comments and blank lines are left out;
/// continued lines (`\` at the end) are joined.
pub fn statements(text: &str) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    let mut lines = text.lines().enumerate();
    let next = move || {
        let (ix, line) = lines.next()?;
        let mut statement = Cow::Borrowed(line.trim());
        while let Some(head) = statement.strip_suffix('\\') {
            let Some((_, tail)) = lines.next() else { break };
            statement = Cow::Owned(format!("{head} {}", tail.trim()));
        }
        Some((ix + 1, statement))
    };
    std::iter::from_fn(next).filter(|(_, statement)| !statement.is_empty() && !statement.starts_with('#'))
}

/// Returns a statement's keyword and the rest, trimmed.
pub fn split_keyword(statement: &str) -> (&str, &str) {
    let (keyword, rest) = statement.split_once(char::is_whitespace).unwrap_or((statement, ""));
    (keyword, rest.trim())
}

/// Numbers of the elements that a face can refer to.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    positions: usize,
    texcoords: usize,
    normals: usize,
}

impl Counts {
    fn add(&mut self, keyword: &str) {
        match keyword {
            "v" => self.positions += 1,
            "vt" => self.texcoords += 1,
            "vn" => self.normals += 1,
            _ => {}
        }
    }
}

fn count(text: &str) -> Counts {
    let mut counts = Counts::default();
    statements(text).for_each(|(_, statement)| counts.add(split_keyword(&statement).0));
    counts
}

#[derive(Debug, Default)]
struct Cleaner {
    totals: Counts,
    /// Counts up to the current line, from which negative indices count back.
    seen: Counts,
    /// Whether the last `s` statement was `s off`. A file without `s` is smooth except at creases.
    flat: bool,
    /// The group of the last face.
    group: &'static str,
    positions: String,
    normals: String,
    faces: String,
    corners: Vec<(usize, Option<usize>)>,
    out: CleanObj,
}

impl Cleaner {
    fn statement(&mut self, line: usize, statement: &str) -> Checked<()> {
        let (keyword, rest) = split_keyword(statement);
        let words = || rest.split('#').next().unwrap_or_default().split_whitespace();
        match keyword {
            // A weight (used by curves only) or a colour may follow the point.
            "v" => vector(&mut self.positions, "v", words(), 3..=7)?,
            "vn" => vector(&mut self.normals, "vn", words(), 3..=3)?,
            "vt" => vector(&mut String::new(), "vt", words(), 1..=3)?,
            "f" => self.face(words())?,
            "s" => self.flat = matches!(rest, "off" | "0"),
            "usemtl" if rest.is_empty() => return Err("usemtl names no material".to_owned()),
            "usemtl" => {
                push(&mut self.faces, format_args!("usemtl {rest}\n"));
                if !self.out.used_materials.contains_key(rest) {
                    self.out.used_materials.insert(rest.to_owned(), line);
                }
            }
            "mtllib" if rest.is_empty() => return Err("mtllib names no file".to_owned()),
            "mtllib" => self.out.libraries.push((line, rest.to_owned())),
            _ if IGNORED.contains(&keyword) => {}
            _ if statement.contains('\0') => return Err("this is no text file".to_owned()),
            _ => self.out.unknown = self.out.unknown.take().or(Some((line, keyword.to_owned()))),
        }
        self.seen.add(keyword);
        Ok(())
    }

    /// Adds a face. It has three or more corners, each of the form `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    fn face<'a>(&mut self, words: impl Iterator<Item = &'a str>) -> Checked<()> {
        self.corners.clear();
        for word in words {
            let corner = self.corner(word)?;
            self.corners.push(corner);
        }
        if self.corners.len() < 3 {
            return Err(format!("a face of {} corners: it needs 3 or more", self.corners.len()));
        }
        self.out.n_triangles += self.corners.len() as u64 - 2;
        let has_normals = self.corners.iter().all(|(_, normal)| normal.is_some());
        let group = if has_normals {
            NORMALS
        } else if self.flat {
            FLAT
        } else {
            SMOOTH
        };
        if group != self.group {
            push(&mut self.faces, format_args!("g {group}\n"));
            self.group = group;
        }
        self.faces.push('f');
        for (position, normal) in &self.corners {
            match normal {
                Some(normal) if has_normals => push(&mut self.faces, format_args!(" {position}//{normal}")),
                _ => push(&mut self.faces, format_args!(" {position}")),
            }
        }
        self.faces.push('\n');
        Ok(())
    }

    /// Returns the indices of one corner's position and normal, counted from 1.
    fn corner(&self, word: &str) -> Checked<(usize, Option<usize>)> {
        let mut parts = word.split('/');
        let position = parts.next().unwrap_or_default();
        let texcoord = parts.next().filter(|part| !part.is_empty());
        let normal = parts.next().filter(|part| !part.is_empty());
        if parts.next().is_some() {
            return Err(format!("`{word}` has more than three indices"));
        }
        let (seen, totals) = (&self.seen, &self.totals);
        let position = index(position, "vertex", seen.positions, totals.positions)?;
        if let Some(texcoord) = texcoord {
            index(texcoord, "texture vertex", seen.texcoords, totals.texcoords)?;
        }
        let normal = normal.map(|word| index(word, "normal", seen.normals, totals.normals)).transpose()?;
        Ok((position, normal))
    }
}

/// Returns an absolute index in `1..=total`. A negative index counts back from the last of the `seen` elements.
fn index(word: &str, what: &str, seen: usize, total: usize) -> Checked<usize> {
    let index: i64 = word.parse().map_err(|_| format!("`{word}` is not the index of a {what}"))?;
    let absolute = if index < 0 { (seen as i64).checked_add(index).map(|i| i + 1) } else { Some(index) };
    match absolute {
        Some(absolute) if (1..=total as i64).contains(&absolute) => Ok(absolute as usize),
        _ => Err(format!("{what} {index} is out of range: there are {total}")),
    }
}

/// Writes the keyword and the first three of the numbers in `words`. Fails if a number is not finite, or if there are
/// more or fewer numbers than `counts` allows.
fn vector<'a>(
    out: &mut String,
    keyword: &str,
    words: impl Iterator<Item = &'a str>,
    counts: std::ops::RangeInclusive<usize>,
) -> Checked<()> {
    let mut n_words = 0;
    out.push_str(keyword);
    for word in words {
        match word.parse::<f32>() {
            Ok(number) if number.is_finite() => {}
            Ok(_) => return Err(format!("`{word}` is not a finite number of single precision")),
            Err(_) => return Err(format!("`{word}` is not a number")),
        }
        if n_words < 3 {
            out.push(' ');
            out.push_str(word);
        }
        n_words += 1;
    }
    out.push('\n');
    if counts.contains(&n_words) {
        Ok(())
    } else {
        Err(format!("`{keyword}` has {n_words} numbers: it takes {} to {}", counts.start(), counts.end()))
    }
}

/// Appends to a `String`, which cannot fail.
fn push(out: &mut String, text: std::fmt::Arguments) {
    out.write_fmt(text).expect("a String takes what it is given");
}
