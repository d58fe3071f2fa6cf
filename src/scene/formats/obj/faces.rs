//! The faces of a part of an OBJ file, by the indices of what their corners name.

use std::ops::Range;

use super::{
    elements::{Elements, kind_of},
    statement::{Fault, split_keyword, statements, words},
};
use crate::scene::model::error::Checked;
use glam::DVec3;

/// Words for what a face's corner names, by kind.
const NAMES: [&str; 3] = ["vertex", "texture vertex", "normal"];

/// Keywords of the format that do not concern polygons or their materials.
const IGNORED: &str = "o g l p vp deg bmat step cstype curv curv2 surf parm trim hole scrv sp end con mg bevel \
    c_interp d_interp lod shadow_obj trace_obj ctech stech maplib usemap call";

/// A part of a file, which begins with a statement.
#[derive(Clone, Copy)]
pub struct Chunk<'a> {
    pub text: &'a str,
    /// Number of lines before it.
    pub first_line: usize,
}

/// What is known of a file when its elements have been read.
pub struct Known<'a> {
    pub elements: &'a Elements,
    /// Numbers of elements up to the current line, from which negative indices count back.
    pub seen: [usize; 3],
}

/// The faces of a chunk, and the statements between them.
#[derive(Debug, Default)]
pub struct Faces {
    /// Indices of what the corners name, counted from 0. Of texture vertices and normals, there are only those of faces
    /// whose corners all have some.
    pub corners: [Vec<u32>; 3],
    /// How many corners each face has.
    pub arities: Vec<u32>,
    pub parts: Vec<Part>,
    /// The first face that is wrong. If the elements of the file are not known, it may be one that needs them.
    pub error: Option<Fault>,
    /// The first normal or texture vertex that does not exist.
    pub missing: Option<Fault>,
    /// The first face that is left out.
    pub left_out: Option<Fault>,
    /// Whether a face names an element with a number beyond single precision.
    pub names_overflow: bool,
    /// The greatest indices, counted from 1.
    greatest: [u32; 3],
    /// The corners of the last face: indices counted from 1, or 0 for none.
    face: Vec<[u32; 3]>,
}

/// A part of a chunk that decides which model the next faces belong to.
#[derive(Debug)]
pub enum Part {
    Faces(Run),
    /// Any other statement that is not ignored, with its line.
    Statement(usize, String),
}

/// Faces that follow each other, as places in the lists of their chunk. All or none of them have texture vertices, and
/// all or none normals.
#[derive(Clone, Debug)]
pub struct Run {
    pub arities: Range<usize>,
    pub corners: [Range<usize>; 3],
}

impl Run {
    /// Returns whether the faces' corners name elements of a kind.
    pub fn has(&self, kind: usize) -> bool {
        !self.corners[kind].is_empty()
    }

    pub fn n_triangles(&self) -> usize {
        self.corners[0].len() - 2 * self.arities.len()
    }
}

impl Chunk<'_> {
    /// Reads the elements and the faces. Indices are checked as far as that needs no other chunk.
    pub fn read(&self, origin: DVec3) -> (Elements, Faces) {
        let (mut elements, mut faces) = (Elements::default(), Faces::default());
        self.for_each(|line, statement| match split_keyword(statement) {
            ("f", rest) => faces.add(line, rest, None),
            (keyword, rest) => match kind_of(keyword) {
                Some(kind) => elements.add(kind, (line, rest), origin),
                None => faces.add_statement(line, statement),
            },
        });
        (elements, faces)
    }

    /// Reads the faces, with all that is known of the elements.
    pub fn faces(&self, mut known: Known) -> Faces {
        let mut faces = Faces::default();
        self.for_each(|line, statement| match split_keyword(statement) {
            ("f", rest) => faces.add(line, rest, Some(&known)),
            (keyword, _) => match kind_of(keyword) {
                Some(kind) => known.seen[kind] += 1,
                None => faces.add_statement(line, statement),
            },
        });
        faces
    }

    fn for_each(&self, mut each: impl FnMut(usize, &str)) {
        statements(self.text).for_each(|(line, statement)| each(self.first_line + line, &statement));
    }
}

impl Faces {
    /// Returns whether the faces are right, whatever elements the file has, if it has so many.
    pub fn are_certain(&self, counts: [usize; 3]) -> bool {
        self.error.is_none() && self.greatest.iter().zip(counts).all(|(greatest, n)| *greatest as usize <= n)
    }

    /// Adds a statement that is neither an element nor a face.
    fn add_statement(&mut self, line: usize, statement: &str) {
        let (keyword, _) = split_keyword(statement);
        if !IGNORED.split(' ').any(|ignored| ignored == keyword) {
            self.parts.push(Part::Statement(line, statement.to_owned()));
        }
    }

    /// Adds a face. It has three or more corners, each of the form `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    fn add(&mut self, line: usize, rest: &str, known: Option<&Known>) {
        if self.error.is_some() {
            return;
        }
        let is_plain = self.read_plain((line, rest.as_bytes()), known).is_some();
        if !is_plain && let Err(what) = self.read((line, rest), known) {
            self.error = Some((line, what));
            return;
        }
        let is_broken = |[ix, ..]: &&[u32; 3]| known.is_some_and(|known| known.is_broken(0, *ix));
        let what = match (self.face.len(), self.face.iter().find(is_broken)) {
            (n @ 0..3, _) => format!("a face of {n} corners: it needs 3 or more"),
            (_, Some([ix, ..])) => format!("vertex {ix} is not finite"),
            _ => return self.push(),
        };
        self.left_out.get_or_insert((line, what));
    }

    /// Adds the face whose corners have been read.
    fn push(&mut self) {
        let has = [0, 1, 2].map(|kind| self.face.iter().all(|corner| corner[kind] > 0));
        let is_like = |run: &Run| (1..3).all(|kind| run.has(kind) == has[kind]);
        if !matches!(self.parts.last(), Some(Part::Faces(run)) if is_like(run)) {
            let end = |n: usize| n..n;
            let corners = self.corners.each_ref().map(|corners| end(corners.len()));
            self.parts.push(Part::Faces(Run { arities: end(self.arities.len()), corners }));
        }
        let Some(Part::Faces(run)) = self.parts.last_mut() else { unreachable!("a run was added") };
        self.arities.push(self.face.len() as u32);
        run.arities.end += 1;
        for kind in (0..3).filter(|kind| has[*kind]) {
            self.corners[kind].extend(self.face.iter().map(|corner| corner[kind] - 1));
            run.corners[kind].end += self.face.len();
        }
    }

    /// Reads the corners of a face of digits, slashes and single gaps, as nearly all programs write it. Returns `None`
    /// for any other face, and for one that is wrong.
    fn read_plain(&mut self, (line, bytes): (usize, &[u8]), known: Option<&Known>) -> Option<()> {
        self.face.clear();
        let mut at = 0;
        while at < bytes.len() {
            let mut corner = [0; 3];
            for (kind, index) in corner.iter_mut().enumerate() {
                at += usize::from(kind > 0);
                if !(kind == 1 && bytes.get(at) == Some(&b'/')) {
                    *index = self.found(kind, (line, plain_index(bytes, &mut at)?), known).ok()?;
                }
                if bytes.get(at) != Some(&b'/') {
                    break;
                }
            }
            self.face.push(corner);
            let is_end = at == bytes.len();
            if !is_end && !matches!(bytes[at], b' ' | b'\t') {
                return None;
            }
            at += 1;
        }
        Some(())
    }

    /// Reads the corners of a face.
    fn read(&mut self, (line, rest): (usize, &str), known: Option<&Known>) -> Checked<()> {
        self.face.clear();
        for word in words(rest) {
            let corner = self.corner((line, word), known).map_err(|what| match word.matches('/').count() {
                0..3 => what,
                _ => format!("`{word}` has more than three indices"),
            })?;
            self.face.push(corner);
        }
        Ok(())
    }

    fn corner(&mut self, (line, word): (usize, &str), known: Option<&Known>) -> Checked<[u32; 3]> {
        let mut corner = [0; 3];
        for (kind, part) in word.split('/').enumerate() {
            match corner.get_mut(kind) {
                Some(_) if kind > 0 && part.is_empty() => {}
                Some(ix) => {
                    let stated = part.parse().map_err(|_| format!("`{part}` is not the index of a {}", NAMES[kind]))?;
                    *ix = self.found(kind, (line, stated), known)?;
                }
                None => return Err(String::new()),
            }
        }
        Ok(corner)
    }

    /// Returns a stated index absolute and counted from 1. A normal or texture vertex that does not exist, or that is
    /// broken, counts as none: 0.
    fn found(&mut self, kind: usize, (line, stated): (usize, i64), known: Option<&Known>) -> Checked<u32> {
        let Some(known) = known else {
            let ix = u32::try_from(stated).ok().filter(|ix| *ix > 0).ok_or_else(String::new)?;
            self.greatest[kind] = self.greatest[kind].max(ix);
            return Ok(ix);
        };
        let absolute = if stated < 0 { known.seen[kind] as i64 + stated + 1 } else { stated };
        let total = known.elements.counts()[kind];
        match u32::try_from(absolute) {
            Ok(ix) if ix > 0 && ix as usize <= total => {
                self.names_overflow |= known.has(kind, ix, f32::is_infinite);
                Ok(if kind > 0 && known.is_broken(kind, ix) { 0 } else { ix })
            }
            _ => {
                let what = format!("{} {stated} is out of range: there are {total}", NAMES[kind]);
                if kind == 0 {
                    return Err(what);
                }
                self.missing.get_or_insert((line, what));
                Ok(0)
            }
        }
    }
}

impl Known<'_> {
    /// Returns whether an element, counted from 1, has a number of some sort.
    fn has(&self, kind: usize, ix: u32, is_it: fn(f32) -> bool) -> bool {
        self.elements.get(kind, ix as usize - 1).iter().any(|number| is_it(*number))
    }

    fn is_broken(&self, kind: usize, ix: u32) -> bool {
        self.has(kind, ix, f32::is_nan)
    }
}

/// Reads an index of up to 18 digits at a place, which is moved behind it.
fn plain_index(bytes: &[u8], at: &mut usize) -> Option<i64> {
    let is_negative = bytes.get(*at) == Some(&b'-');
    *at += usize::from(is_negative);
    let (first, mut value) = (*at, 0_i64);
    while let Some(digit) = bytes.get(*at).map(|byte| byte.wrapping_sub(b'0')).filter(|digit| *digit < 10) {
        value = value.wrapping_mul(10).wrapping_add(i64::from(digit));
        *at += 1;
    }
    (1..=18).contains(&(*at - first)).then_some(if is_negative { value.wrapping_neg() } else { value })
}
