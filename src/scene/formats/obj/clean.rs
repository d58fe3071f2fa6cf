//! Checks the text of an OBJ file, statement by statement, and rewrites it into a form that tobj reads correctly.
//!
//! tobj 4.0.5 panics on an overflowing normal index, accepts NaN as a coordinate, uses a neighbour's normal or texture
//! coordinates where a corner has none, ignores `s`, and mixes up colours if some points have none. The rewritten text
//! avoids all of this: its numbers are finite, its indices are absolute and in range, all points have colours or none,
//! and each run of faces of one kind has its own group, named as [`FaceKind::name`] says.

use std::{
    borrow::Cow,
    collections::{BTreeMap, HashSet},
    fmt::Write,
    io::{BufRead, Read},
};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::scene::{meshes::needs::MeshSize, model::error::Checked};

/// How a face is shaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaceShading {
    /// By the normals that all its corners have.
    Normals,
    /// Smoothly, without normals.
    Smooth,
    /// Flat, after `s off`.
    Flat,
}

impl FaceShading {
    /// Returns the shading of a face. `is_flat`: whether it comes after `s off`.
    pub fn of(has_normals: bool, is_flat: bool) -> Self {
        match (has_normals, is_flat) {
            (true, _) => Self::Normals,
            (false, true) => Self::Flat,
            (false, false) => Self::Smooth,
        }
    }
}

/// What the faces of a group have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaceKind {
    pub shading: FaceShading,
    /// Whether all corners have texture coordinates.
    pub has_uvs: bool,
}

impl FaceKind {
    const ALL: [(&str, FaceShading, bool); 6] = [
        ("normals", FaceShading::Normals, false),
        ("smooth", FaceShading::Smooth, false),
        ("flat", FaceShading::Flat, false),
        ("normals_uvs", FaceShading::Normals, true),
        ("smooth_uvs", FaceShading::Smooth, true),
        ("flat_uvs", FaceShading::Flat, true),
    ];

    /// Returns the name of the group of such faces.
    fn name(self) -> &'static str {
        let is_self = |(_, shading, has_uvs): &&_| (*shading, *has_uvs) == (self.shading, self.has_uvs);
        Self::ALL.iter().find(is_self).expect("all kinds have names").0
    }

    /// Returns the kind of the faces in a group.
    pub fn of_group(name: &str) -> Option<Self> {
        let named = Self::ALL.iter().find(|(known, ..)| *known == name);
        named.map(|(_, shading, has_uvs)| Self { shading: *shading, has_uvs: *has_uvs })
    }
}

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

/// Name that `usemtl` without a name gets for tobj, which would go on with the last material.
const NO_MATERIAL: &str = "\u{1}";

/// A checked OBJ file.
#[derive(Debug, Default)]
pub struct CleanObj {
    /// Text for tobj, in parts: all positions with their colours, all texture coordinates, all normals, then the faces.
    text: [String; 4],
    /// Names after `mtllib`, each with its line, counted from 1.
    pub libraries: Vec<(usize, String)>,
    /// Names after `usemtl`, each with the first line that uses it.
    pub used_materials: BTreeMap<String, usize>,
    /// Size of the mesh, if polygons are cut into fans.
    pub size: MeshSize,
    /// The number that stands for 1 in colours.
    pub colour_scale: f32,
    /// Line and keyword of the first statement that is not part of the format, if any.
    pub unknown: Option<(usize, String)>,
    /// Line of the first normal or texture vertex that does not exist, and what is wrong with it, if there is any.
    pub missing: Option<(usize, String)>,
    /// Line of the first face that is left out, and what is wrong with it, if there is any.
    pub left_out: Option<(usize, String)>,
}

impl CleanObj {
    /// Returns all points whose coordinates are finite.
    pub fn points(&self) -> Vec<Vec3> {
        let point = |line: &str| {
            let mut numbers = line.split_ascii_whitespace().skip(1).flat_map(str::parse::<f32>);
            let point = Vec3::new(numbers.next()?, numbers.next()?, numbers.next()?);
            point.is_finite().then_some(point)
        };
        self.text[0].par_lines().filter_map(point).collect()
    }

    /// Returns the text for tobj. Its first line names a material library, so that tobj calls its material loader.
    pub fn text(&self) -> impl BufRead {
        let [positions, texcoords, normals, faces] = self.text.each_ref().map(|part| part.as_bytes());
        b"mtllib all\n".chain(positions).chain(texcoords).chain(normals).chain(faces)
    }
}

/// Checks and rewrites the text of an OBJ file. `origin` is subtracted from its points. The error is a line, counted
/// from 1, and what is wrong with it.
pub fn clean_obj(text: &str, origin: DVec3) -> Result<CleanObj, (usize, String)> {
    let (totals, largest_colour, broken) = count(text);
    // Some writers state colours as 0 to 255.
    let colour_scale = if largest_colour.is_some_and(|largest| largest > 1.0) { 255.0 } else { 1.0 };
    let white = largest_colour.map(|_| colour_scale);
    let mut cleaner = Cleaner { totals, white, broken, origin, ..Cleaner::default() };
    cleaner.out.colour_scale = colour_scale;
    for (line, statement) in statements(text) {
        cleaner.statement(line, &statement).map_err(|what| (line, what))?;
    }
    Ok(cleaner.finish())
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

/// Elements with numbers such as NaN, which programs write for what they could not compute. Indices count from 1.
#[derive(Clone, Debug, Default)]
struct Broken {
    positions: HashSet<usize>,
    texcoords: HashSet<usize>,
    normals: HashSet<usize>,
}

impl Broken {
    /// Adds the element that has been counted last, if a number of it is NaN or infinite by its spelling.
    fn add(&mut self, keyword: &str, rest: &str, counts: &Counts) {
        if !is_broken(rest) {
            return;
        }
        match keyword {
            "v" => drop(self.positions.insert(counts.positions)),
            "vt" => drop(self.texcoords.insert(counts.texcoords)),
            "vn" => drop(self.normals.insert(counts.normals)),
            _ => {}
        }
    }
}

/// Returns whether a number in `rest` is NaN or infinite by its spelling: `nan`, `-nan(ind)`, `inf`, `-1.#IND`.
fn is_broken(rest: &str) -> bool {
    let has_letters = |word: &str| word.bytes().any(|byte| matches!(byte | 0x20, b'n' | b'i'));
    let is_broken = |word: &str| {
        let word = word.trim_start_matches(['+', '-']).to_ascii_lowercase();
        let of_windows = word.strip_prefix("1.#").is_some_and(|rest| rest.starts_with(['i', 'q', 's']));
        of_windows || word == "inf" || word == "infinity" || word.starts_with("nan")
    };
    let words = || rest.split_whitespace().take_while(|word| !word.starts_with('#'));
    has_letters(rest) && words().any(is_broken)
}

/// Returns the numbers of a file's elements, the largest number in a point's colour if a point has one, and the broken
/// elements.
fn count(text: &str) -> (Counts, Option<f32>, Broken) {
    let (mut counts, mut largest_colour, mut broken) = (Counts::default(), None, Broken::default());
    for (_, statement) in statements(text) {
        let (keyword, rest) = split_keyword(&statement);
        counts.add(keyword);
        broken.add(keyword, rest, &counts);
        if keyword == "v" && words(rest).count() >= 6 {
            let colour = words(rest).skip(3).take(3).flat_map(str::parse::<f32>);
            largest_colour = Some(colour.fold(largest_colour.unwrap_or(0.0), f32::max));
        }
    }
    (counts, largest_colour, broken)
}

/// Returns the words before a comment.
pub fn words(rest: &str) -> impl Iterator<Item = &str> {
    rest.split('#').next().unwrap_or_default().split_whitespace()
}

/// A corner of a face: indices of its position, its texture coordinates and its normal, counted from 1.
pub type Corner = (usize, Option<usize>, Option<usize>);

/// Writes the text for tobj, statement by statement.
#[derive(Debug)]
pub struct Cleaner {
    totals: Counts,
    /// The number that stands for 1 in colours, which points without colours get, if a point of the file has a colour.
    white: Option<f32>,
    broken: Broken,
    /// Counts up to the current line, from which negative indices count back.
    seen: Counts,
    /// Point that is subtracted from all points.
    origin: DVec3,
    /// Whether the last `s` statement was `s off`. A file without `s` is smooth except at creases.
    flat: bool,
    /// The kind of the last face.
    kind: Option<FaceKind>,
    positions: String,
    texcoords: String,
    normals: String,
    faces: String,
    corners: Vec<Corner>,
    out: CleanObj,
}

impl Default for Cleaner {
    /// Returns a cleaner of a file without colours.
    fn default() -> Self {
        Self {
            totals: Counts::default(),
            white: None,
            broken: Broken::default(),
            seen: Counts::default(),
            origin: DVec3::ZERO,
            flat: false,
            kind: None,
            positions: String::new(),
            texcoords: String::new(),
            normals: String::new(),
            faces: String::new(),
            corners: Vec::new(),
            out: CleanObj { colour_scale: 1.0, ..CleanObj::default() },
        }
    }
}

impl Cleaner {
    /// Adds a statement. The error says what is wrong with it.
    pub fn statement(&mut self, line: usize, statement: &str) -> Checked<()> {
        let (keyword, rest) = split_keyword(statement);
        match keyword {
            "v" | "vn" | "vt" if is_broken(rest) => self.broken_element(keyword),
            "v" => self.point(rest)?,
            "vn" => vector(&mut self.normals, "vn", rest, 3..=3)?,
            "vt" => self.texcoord(rest)?,
            "f" => self.face(line, words(rest))?,
            "s" => self.flat = matches!(rest, "off" | "0"),
            "usemtl" => {
                push(&mut self.faces, format_args!("usemtl {}\n", if rest.is_empty() { NO_MATERIAL } else { rest }));
                if !self.out.used_materials.contains_key(rest) {
                    self.out.used_materials.insert(rest.to_owned(), line);
                }
            }
            "mtllib" if rest.is_empty() => {}
            "mtllib" => self.out.libraries.push((line, rest.to_owned())),
            _ if IGNORED.contains(&keyword) => {}
            _ if statement.contains('\0') => return Err("this is no text file".to_owned()),
            _ => self.out.unknown = self.out.unknown.take().or(Some((line, keyword.to_owned()))),
        }
        self.seen.add(keyword);
        Ok(())
    }

    /// Adds an element that stands for a broken one, which no face uses.
    fn broken_element(&mut self, keyword: &str) {
        match (keyword, self.white) {
            ("v", Some(white)) => {
                push(&mut self.positions, format_args!("v nan nan nan {white} {white} {white}\n"));
            }
            ("v", None) => self.positions.push_str("v nan nan nan\n"),
            ("vn", _) => self.normals.push_str("vn 0 0 0\n"),
            _ => self.texcoords.push_str("vt 0 0\n"),
        }
    }

    /// Adds a point. A weight (used by curves only) or a colour may follow it, and an opacity, which is ignored.
    fn point(&mut self, rest: &str) -> Checked<()> {
        let moved;
        let rest = if self.origin == DVec3::ZERO {
            rest
        } else {
            moved = moved_point(rest, self.origin);
            &moved
        };
        let n_numbers = words(rest).count();
        if let Some(white) = self.white.filter(|_| n_numbers < 6) {
            let xyz: Vec<&str> = words(rest).take(3).collect();
            vector(&mut String::new(), "v", rest, 3..=7)?;
            push(&mut self.positions, format_args!("v {} {white} {white} {white}\n", xyz.join(" ")));
            return Ok(());
        }
        vector(&mut self.positions, "v", rest, 3..=7)
    }

    /// Adds texture coordinates. v is 0 where there is none, and a third number is ignored.
    fn texcoord(&mut self, rest: &str) -> Checked<()> {
        vector(&mut String::new(), "vt", rest, 1..=3)?;
        let mut numbers = words(rest);
        let (u, v) = (numbers.next().unwrap_or("0"), numbers.next().unwrap_or("0"));
        push(&mut self.texcoords, format_args!("vt {u} {v}\n"));
        Ok(())
    }

    /// Returns whether the next faces without normals are flat.
    pub fn is_flat(&self) -> bool {
        self.flat
    }

    /// Adds a face. It has three or more corners, each of the form `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    fn face<'a>(&mut self, line: usize, words: impl Iterator<Item = &'a str>) -> Checked<()> {
        self.corners.clear();
        for word in words {
            let corner = self.corner(line, word)?;
            self.corners.push(corner);
        }
        let broken = self.corners.iter().find(|(position, ..)| self.broken.positions.contains(position));
        let what = match (self.corners.len(), broken) {
            (0..3, _) => Some(format!("a face of {} corners: it needs 3 or more", self.corners.len())),
            (_, Some((position, ..))) => Some(format!("vertex {position} is not finite")),
            _ => None,
        };
        if let Some(what) = what {
            self.out.left_out.get_or_insert((line, what));
            return Ok(());
        }
        self.out.size.n_triangles += self.corners.len() as u64 - 2;
        let has_normals = self.corners.iter().all(|(.., normal)| normal.is_some());
        let has_uvs = self.corners.iter().all(|(_, texcoord, _)| texcoord.is_some());
        let kind = FaceKind { shading: FaceShading::of(has_normals, self.flat), has_uvs };
        self.out.size.attributes.n_uv_sets |= u64::from(has_uvs);
        if self.kind != Some(kind) {
            push(&mut self.faces, format_args!("g {}\n", kind.name()));
            self.kind = Some(kind);
        }
        self.faces.push('f');
        let mut digits = itoa::Buffer::new();
        for &(position, texcoord, normal) in &self.corners {
            let (texcoord, normal) = (texcoord.filter(|_| has_uvs), normal.filter(|_| has_normals));
            self.faces.push(' ');
            self.faces.push_str(digits.format(position));
            if texcoord.or(normal).is_some() {
                self.faces.push('/');
            }
            if let Some(texcoord) = texcoord {
                self.faces.push_str(digits.format(texcoord));
            }
            if let Some(normal) = normal {
                self.faces.push('/');
                self.faces.push_str(digits.format(normal));
            }
        }
        self.faces.push('\n');
        Ok(())
    }

    /// Returns the rewritten file.
    pub fn finish(self) -> CleanObj {
        let Self { mut out, seen, white, positions, texcoords, normals, faces, .. } = self;
        out.size.n_points = seen.positions as u64;
        out.size.attributes.has_colours = white.is_some();
        out.text = [positions, texcoords, normals, faces];
        out
    }

    /// Reads a corner. A normal or texture vertex that does not exist counts as none.
    fn corner(&mut self, line: usize, word: &str) -> Checked<Corner> {
        let mut parts = word.split('/');
        let position = parts.next().unwrap_or_default();
        let texcoord = parts.next().filter(|part| !part.is_empty());
        let normal = parts.next().filter(|part| !part.is_empty());
        if parts.next().is_some() {
            return Err(format!("`{word}` has more than three indices"));
        }
        let Counts { positions, texcoords, normals } = self.totals;
        let position = index(position, "vertex", self.seen.positions)?.within("vertex", positions)?;
        let mut optional = |word: Option<&str>, what: &str, (seen, total): (usize, usize)| {
            let index = word.map(|word| index(word, what, seen)).transpose()?;
            let found = index.map(|index| index.within(what, total));
            if let Some(Err(what)) = &found {
                self.out.missing.get_or_insert_with(|| (line, what.clone()));
            }
            Ok::<_, String>(found.and_then(Result::ok))
        };
        let texcoord = optional(texcoord, "texture vertex", (self.seen.texcoords, texcoords))?;
        let normal = optional(normal, "normal", (self.seen.normals, normals))?;
        let texcoord = texcoord.filter(|ix| !self.broken.texcoords.contains(ix));
        let normal = normal.filter(|ix| !self.broken.normals.contains(ix));
        Ok((position, texcoord, normal))
    }
}

/// An index as the file states it, and as it counts from 1 if it fits into a number.
struct Index {
    stated: i64,
    absolute: Option<i64>,
}

impl Index {
    /// Returns the index if it is in `1..=total`.
    fn within(&self, what: &str, total: usize) -> Checked<usize> {
        match self.absolute {
            Some(absolute) if (1..=total as i64).contains(&absolute) => Ok(absolute as usize),
            _ => Err(format!("{what} {} is out of range: there are {total}", self.stated)),
        }
    }
}

/// Reads an index. A negative one counts back from the last of the `seen` elements.
fn index(word: &str, what: &str, seen: usize) -> Checked<Index> {
    let stated: i64 = word.parse().map_err(|_| format!("`{word}` is not the index of a {what}"))?;
    let absolute = if stated < 0 { (seen as i64).checked_add(stated).map(|i| i + 1) } else { Some(stated) };
    Ok(Index { stated, absolute })
}

/// Writes the keyword and the first three of the numbers in `rest`, or six if there are that many. Fails if a number is
/// not finite, or if there are more or fewer numbers than `counts` allows.
fn vector(out: &mut String, keyword: &str, rest: &str, counts: std::ops::RangeInclusive<usize>) -> Checked<()> {
    let n_words = words(rest).count();
    let n_written = if n_words < 6 { 3 } else { 6 };
    out.push_str(keyword);
    for (ix, word) in words(rest).enumerate() {
        match word.parse::<f32>() {
            Ok(number) if number.is_finite() => {}
            Ok(_) => return Err(format!("`{word}` is not a finite number of single precision")),
            Err(_) if word.replacen(',', ".", 1).parse::<f32>().is_ok() => {
                return Err(format!("`{word}` is not a number: decimals need a point in place of the comma"));
            }
            Err(_) => return Err(format!("`{word}` is not a number")),
        }
        if ix < n_written {
            out.push(' ');
            out.push_str(word);
        }
    }
    out.push('\n');
    if counts.contains(&n_words) {
        Ok(())
    } else {
        Err(format!("`{keyword}` has {n_words} numbers: it takes {} to {}", counts.start(), counts.end()))
    }
}

/// Returns the words of a point with `origin` subtracted from its coordinates in double precision. Words that are no
/// numbers stay as they are.
fn moved_point(rest: &str, origin: DVec3) -> String {
    let moved = |(ix, word): (usize, &str)| match word.parse::<f64>() {
        Ok(number) if ix < 3 => format!("{:?}", (number - origin[ix]) as f32),
        _ => word.to_owned(),
    };
    words(rest).enumerate().map(moved).collect::<Vec<_>>().join(" ")
}

/// Appends to a `String`, which cannot fail.
fn push(out: &mut String, text: std::fmt::Arguments) {
    out.write_fmt(text).expect("a String takes what it is given");
}
