//! The quick way to read an OBJ file, by all threads. It takes what nearly all programs write: points without colours,
//! and indices in range. Whatever else a file has is left to [`clean`](super::clean) and tobj. The former also says
//! what is wrong with a file.

use std::borrow::Cow;

use glam::Vec3;
use rayon::prelude::*;

use super::{
    clean::{CleanObj, Cleaner, Corner, FaceKind, FaceShading, split_keyword, statements},
    model::Model,
};
use crate::util::progress::{Meter, Progress, Work};

/// Least number of bytes of the text that one thread reads at a time.
const CHUNK_BYTES: usize = 1 << 20;

/// Greatest index of a corner, counted from 1. Lists hold indices of 32 bits.
const MAX_INDEX: usize = u32::MAX as usize;

/// The content of an OBJ file.
pub struct QuickObj {
    /// What [`clean_obj`](super::clean::clean_obj) finds, without the text for tobj.
    pub clean: CleanObj,
    positions: Vec<f32>,
    texcoords: Vec<f32>,
    normals: Vec<f32>,
    /// Whether all numbers are finite, also those that no face names.
    is_finite: bool,
    chunks: Vec<Chunk>,
    /// The faces and the names of materials in the order of the file.
    items: Vec<Item>,
}

/// A part of a file that decides which model the next faces belong to.
enum Item {
    /// Faces of one kind, all from one chunk.
    Faces { chunk_ix: usize, run: Run, kind: FaceKind },
    /// The name after `usemtl`.
    Material(String),
}

/// Reads the text of an OBJ file, or returns `None` for a file that has anything else than is usual.
/// `progress` is told of the bytes that have been read.
pub fn quick_obj(text: &str, progress: &Progress) -> Option<QuickObj> {
    quick_obj_in_chunks(text, CHUNK_BYTES, &progress.begin(Work::Reading, text.len() as u64))
}

fn quick_obj_in_chunks(text: &str, chunk_bytes: usize, meter: &Meter) -> Option<QuickObj> {
    let texts = chunks_of(text, chunk_bytes);
    let chunks = read_chunks(&texts, None, meter).or_else(|stop| match stop {
        Stop::Unusual => Err(stop),
        Stop::Relative => {
            let n_elements: Vec<_> = texts.par_iter().map(|text| n_elements(text)).collect();
            read_chunks(&texts, Some(&n_elements), meter)
        }
    });
    joined(chunks.ok()?)
}

/// Cuts a text into chunks of about `chunk_bytes` or more, each of which begins with a statement.
fn chunks_of(mut text: &str, chunk_bytes: usize) -> Vec<&str> {
    let mut chunks = Vec::new();
    while text.len() > chunk_bytes {
        // A line that ends in `\\` is continued by the next one.
        let is_end = |at: &usize| text.as_bytes()[*at] == b'\n' && !text[..*at].trim_end().ends_with('\\');
        let Some(end) = (chunk_bytes..text.len() - 1).find(is_end) else { break };
        let (chunk, rest) = text.split_at(end + 1);
        chunks.push(chunk);
        text = rest;
    }
    chunks.push(text);
    chunks
}

/// Why a chunk is not read.
enum Stop {
    /// It is left to the careful way.
    Unusual,
    /// It has indices that count back, and the numbers of elements before it are not known.
    Relative,
}

/// Reads all chunks. `n_elements`: the numbers of positions, texture coordinates and normals of each one, if they are
/// known.
fn read_chunks(texts: &[&str], n_elements: Option<&[[usize; 3]]>, meter: &Meter) -> Result<Vec<Chunk>, Stop> {
    let before = |ix: usize| {
        let counts = n_elements?[..ix].iter();
        Some(counts.fold([0; 3], |sum, counts| [0, 1, 2].map(|kind| sum[kind] + counts[kind])))
    };
    let read = |(ix, text): (usize, &&str)| {
        let chunk = Chunk::new(text, if ix == 0 { Some([0; 3]) } else { before(ix) })?;
        meter.add(text.len() as u64);
        Ok(chunk)
    };
    texts.par_iter().enumerate().map(read).collect()
}

/// Returns the numbers of positions, of texture coordinates and of normals in a text.
fn n_elements(text: &str) -> [usize; 3] {
    let mut counts = [0; 3];
    for (_, statement) in statements(text) {
        if let Some(kind) = ["v", "vt", "vn"].iter().position(|keyword| split_keyword(&statement).0 == *keyword) {
            counts[kind] += 1;
        }
    }
    counts
}

/// The content of a part of a file.
#[derive(Default)]
struct Chunk {
    positions: Vec<f32>,
    texcoords: Vec<f32>,
    normals: Vec<f32>,
    /// Indices of the positions of all corners, of the texture coordinates of faces whose corners all have some, and
    /// of the normals of faces whose corners all have one, counted from 0.
    corners: [Vec<u32>; 3],
    /// Numbers of the faces' corners.
    arities: Vec<u32>,
    parts: Vec<Part>,
    n_lines: usize,
    /// The greatest indices of corners, counted from 1: of a position, texture coordinates and a normal.
    greatest: [usize; 3],
}

/// A part of a chunk.
enum Part {
    Faces(Run),
    /// Any statement that is neither an element nor a face, with its line in the chunk.
    Statement(usize, String),
}

/// Faces that follow each other. All or none of them have texture coordinates, and all or none normals.
#[derive(Clone, Copy, Default)]
struct Run {
    first_face: usize,
    n_faces: usize,
    n_triangles: usize,
    /// First elements in the lists of the chunk's corners.
    first: [usize; 3],
    n_corners: usize,
    has_uvs: bool,
    has_normals: bool,
}

impl Chunk {
    /// Reads a text. `seen`: the numbers of elements before it, if they are known.
    fn new(text: &str, seen: Option<[usize; 3]>) -> Result<Self, Stop> {
        let mut chunk = Self::default();
        let mut face = Vec::new();
        for (line, statement) in statements(text) {
            let (keyword, rest) = split_keyword(&statement);
            match keyword {
                "v" => numbers(&mut chunk.positions, rest, 3)?,
                "vn" => numbers(&mut chunk.normals, rest, 3)?,
                "vt" => texcoords(&mut chunk.texcoords, rest)?,
                "f" => {
                    let own = [chunk.positions.len() / 3, chunk.texcoords.len() / 2, chunk.normals.len() / 3];
                    let seen = seen.map(|seen| [0, 1, 2].map(|kind| seen[kind] + own[kind]));
                    corners(&mut face, rest.as_bytes(), seen)?;
                    chunk.add_face(&face)?;
                }
                _ => chunk.parts.push(Part::Statement(line, statement.into_owned())),
            }
        }
        chunk.n_lines = text.bytes().filter(|byte| *byte == b'\n').count();
        Ok(chunk)
    }

    fn add_face(&mut self, face: &[Corner]) -> Result<(), Stop> {
        if face.len() < 3 {
            return Err(Stop::Unusual);
        }
        let (mut has_uvs, mut has_normals) = (true, true);
        for (position, texcoord, normal) in face {
            has_uvs &= texcoord.is_some();
            has_normals &= normal.is_some();
            let indices = [*position, texcoord.unwrap_or(0), normal.unwrap_or(0)];
            self.greatest.iter_mut().zip(indices).for_each(|(greatest, ix)| *greatest = (*greatest).max(ix));
        }
        if self.greatest.iter().any(|greatest| *greatest > MAX_INDEX) {
            return Err(Stop::Unusual);
        }
        let is_like = |run: &Run| (run.has_uvs, run.has_normals) == (has_uvs, has_normals);
        if !matches!(self.parts.last(), Some(Part::Faces(run)) if is_like(run)) {
            let first = self.corners.each_ref().map(Vec::len);
            let first_face = self.arities.len();
            self.parts.push(Part::Faces(Run { first_face, first, has_uvs, has_normals, ..Run::default() }));
        }
        let Some(Part::Faces(run)) = self.parts.last_mut() else { unreachable!("a run was added") };
        run.n_faces += 1;
        run.n_triangles += face.len() - 2;
        run.n_corners += face.len();
        self.arities.push(face.len() as u32);
        let [positions, texcoords, normals] = &mut self.corners;
        positions.extend(face.iter().map(|(position, ..)| (*position - 1) as u32));
        if has_uvs {
            texcoords.extend(face.iter().flat_map(|(_, texcoord, _)| *texcoord).map(|ix| (ix - 1) as u32));
        }
        if has_normals {
            normals.extend(face.iter().flat_map(|(.., normal)| *normal).map(|ix| (ix - 1) as u32));
        }
        Ok(())
    }
}

/// Reads `n_numbers` numbers, which need not be finite.
fn numbers(out: &mut Vec<f32>, rest: &str, n_numbers: usize) -> Result<(), Stop> {
    let first = out.len();
    for word in rest.split_ascii_whitespace() {
        out.push(word.parse().map_err(|_| Stop::Unusual)?);
    }
    if out.len() == first + n_numbers { Ok(()) } else { Err(Stop::Unusual) }
}

/// Reads texture coordinates: two numbers. A third number, which is finite, is ignored.
fn texcoords(out: &mut Vec<f32>, rest: &str) -> Result<(), Stop> {
    let first = out.len();
    for word in rest.split_ascii_whitespace() {
        out.push(word.parse().map_err(|_| Stop::Unusual)?);
    }
    match &out[first..] {
        [_, _] => Ok(()),
        [_, _, third] if third.is_finite() => {
            out.pop();
            Ok(())
        }
        _ => Err(Stop::Unusual),
    }
}

/// Reads the corners of a face. `seen`: the numbers of elements so far, if they are known.
fn corners(face: &mut Vec<Corner>, bytes: &[u8], seen: Option<[usize; 3]>) -> Result<(), Stop> {
    face.clear();
    let mut at = 0;
    while at < bytes.len() {
        face.push(corner(bytes, &mut at, seen)?);
        while at < bytes.len() && matches!(bytes[at], b' ' | b'\t') {
            at += 1;
        }
    }
    Ok(())
}

/// Reads a corner of a face: `v`, `v/vt`, `v//vn` or `v/vt/vn`, up to a gap or the end.
fn corner(bytes: &[u8], at: &mut usize, seen: Option<[usize; 3]>) -> Result<Corner, Stop> {
    let seen_of = |kind: usize| seen.map(|seen| seen[kind]);
    let position = index(bytes, at, seen_of(0))?;
    let (mut texcoord, mut normal) = (None, None);
    if bytes.get(*at) == Some(&b'/') {
        *at += 1;
        if bytes.get(*at) != Some(&b'/') {
            texcoord = Some(index(bytes, at, seen_of(1))?);
        }
        if bytes.get(*at) == Some(&b'/') {
            *at += 1;
            normal = Some(index(bytes, at, seen_of(2))?);
        }
    }
    let is_end = matches!(bytes.get(*at), None | Some(b' ' | b'\t'));
    if is_end { Ok((position, texcoord, normal)) } else { Err(Stop::Unusual) }
}

/// Reads an index, and returns it absolute and counted from 1.
fn index(bytes: &[u8], at: &mut usize, seen: Option<usize>) -> Result<usize, Stop> {
    let is_negative = bytes.get(*at) == Some(&b'-');
    *at += usize::from(is_negative);
    let first = *at;
    let mut value = 0;
    while let Some(digit) = bytes.get(*at).map(|byte| byte.wrapping_sub(b'0')).filter(|digit| *digit < 10) {
        // More digits could overflow.
        if *at - first >= 18 {
            return Err(Stop::Unusual);
        }
        value = 10 * value + usize::from(digit);
        *at += 1;
    }
    let index = match is_negative {
        true => (seen.ok_or(Stop::Relative)? + 1).checked_sub(value).filter(|_| value > 0).ok_or(Stop::Unusual)?,
        false => value,
    };
    if index > 0 && *at > first { Ok(index) } else { Err(Stop::Unusual) }
}

/// Joins the chunks of a file. Returns `None` if a statement is wrong, if there are no faces, or if a face names an
/// element that the file does not have.
fn joined(mut chunks: Vec<Chunk>) -> Option<QuickObj> {
    let mut cleaner = Cleaner::default();
    let (mut items, mut first_line, mut n_triangles, mut has_any_uvs) = (Vec::new(), 0, 0, false);
    for (chunk_ix, chunk) in chunks.iter_mut().enumerate() {
        for part in std::mem::take(&mut chunk.parts) {
            match part {
                Part::Faces(run) => {
                    let shading = FaceShading::of(run.has_normals, cleaner.is_flat());
                    n_triangles += run.n_triangles as u64;
                    has_any_uvs |= run.has_uvs;
                    items.push(Item::Faces { chunk_ix, run, kind: FaceKind { shading, has_uvs: run.has_uvs } });
                }
                Part::Statement(line, statement) => {
                    cleaner.statement(first_line + line, &statement).ok()?;
                    if let ("usemtl", name) = split_keyword(&statement) {
                        items.push(Item::Material(name.to_owned()));
                    }
                }
            }
        }
        first_line += chunk.n_lines;
    }
    let take = |of: fn(&mut Chunk) -> Vec<f32>, chunks: &mut [Chunk]| {
        let parts: Vec<Vec<f32>> = chunks.iter_mut().map(of).collect();
        parts.concat()
    };
    let positions = take(|chunk| std::mem::take(&mut chunk.positions), &mut chunks);
    let texcoords = take(|chunk| std::mem::take(&mut chunk.texcoords), &mut chunks);
    let normals = take(|chunk| std::mem::take(&mut chunk.normals), &mut chunks);
    let n_elements = [positions.len() / 3, texcoords.len() / 2, normals.len() / 3];
    let are_there = |chunk: &Chunk| chunk.greatest.iter().zip(n_elements).all(|(greatest, n)| *greatest <= n);
    if n_triangles == 0 || !chunks.iter().all(are_there) {
        return None;
    }
    let is_finite = [&positions, &texcoords, &normals].iter().all(|list| list.par_iter().all(|it| it.is_finite()));
    let mut clean = cleaner.finish();
    clean.size.n_triangles = n_triangles;
    clean.size.n_points = n_elements[0] as u64;
    clean.size.attributes.n_uv_sets = u64::from(has_any_uvs);
    Some(QuickObj { clean, positions, texcoords, normals, is_finite, chunks, items })
}

impl QuickObj {
    /// Returns all points.
    pub fn points(&self) -> &[Vec3] {
        bytemuck::cast_slice(&self.positions)
    }

    /// Returns the models of the file, as tobj divides it: faces that follow each other, of one kind and one material.
    /// `material_ix` returns the index of a named material. Returns `None` if a face names a number that is not finite.
    pub fn models(&self, material_ix: impl Fn(&str) -> Option<usize>) -> Option<Vec<Model<'_>>> {
        let mut models: Vec<Model> = Vec::new();
        let mut joiner = Joiner { file: self, indices: vec![(u32::MAX, 0); self.positions.len() / 3] };
        let (mut material, mut begins) = (None, true);
        for item in &self.items {
            match item {
                Item::Material(name) => {
                    let next = material_ix(name);
                    begins |= next != material;
                    material = next;
                }
                Item::Faces { chunk_ix, run, kind } => {
                    if begins || models.last().is_none_or(|model| model.kind != *kind) {
                        models.push(self.model(*kind, material));
                        begins = false;
                    }
                    let model_ix = models.len() as u32 - 1;
                    joiner.add(models.last_mut()?, model_ix, (&self.chunks[*chunk_ix], run));
                }
            }
        }
        (self.is_finite || models.iter().all(Model::is_finite)).then_some(models)
    }

    /// Returns a model without faces.
    fn model(&self, kind: FaceKind, material_ix: Option<usize>) -> Model<'_> {
        Model {
            kind,
            material_ix,
            positions: Cow::default(),
            texcoords: Cow::Borrowed(&self.texcoords),
            normals: Cow::Borrowed(&self.normals),
            colours: Cow::default(),
            corners: [Cow::default(), Cow::default(), Cow::default()],
            arities: Cow::default(),
        }
    }
}

/// Adds faces to models. Each model has its own positions, in the order in which its faces name them first.
struct Joiner<'a> {
    file: &'a QuickObj,
    /// For each position of the file the last model that has it, and its index there.
    indices: Vec<(u32, u32)>,
}

impl Joiner<'_> {
    fn add(&mut self, model: &mut Model, model_ix: u32, (chunk, run): (&Chunk, &Run)) {
        let arities = model.arities.to_mut();
        arities.extend(&chunk.arities[run.first_face..run.first_face + run.n_faces]);
        let of_run = |kind: usize| &chunk.corners[kind][run.first[kind]..run.first[kind] + run.n_corners];
        if run.has_uvs {
            model.corners[1].to_mut().extend(of_run(1));
        }
        if run.has_normals {
            model.corners[2].to_mut().extend(of_run(2));
        }
        let positions = model.positions.to_mut();
        model.corners[0].to_mut().extend(of_run(0).iter().map(|ix| {
            let known = &mut self.indices[*ix as usize];
            if known.0 != model_ix {
                *known = (model_ix, (positions.len() / 3) as u32);
                positions.extend_from_slice(&self.file.positions[*ix as usize * 3..][..3]);
            }
            known.1
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{
        formats::obj::{clean::clean_obj, model::mesh, parse},
        meshes::smooth::Shading,
        model::Mesh,
    };

    const MATERIALS: [&str; 3] = ["red", "blue", "green"];

    fn material_ix(name: &str) -> Option<usize> {
        MATERIALS.iter().position(|known| *known == name)
    }

    /// Returns the mesh that tobj reads from the careful way's text.
    fn by_tobj(text: &str) -> Mesh {
        let by_name = MATERIALS.iter().enumerate().map(|(ix, name)| ((*name).to_owned(), ix)).collect();
        let models = parse(&clean_obj(text, glam::DVec3::ZERO).unwrap(), &by_name).unwrap();
        let models: Vec<Model> = models.iter().map(Model::of_tobj).collect();
        mesh(&models, 3, (Shading::default(), 1.0)).0
    }

    /// Returns the mesh that the quick way reads, with a text cut into chunks.
    fn quickly(text: &str, chunk_bytes: usize) -> Mesh {
        let quick = in_chunks(text, chunk_bytes).unwrap();
        mesh(&quick.models(material_ix).unwrap(), 3, (Shading::default(), 1.0)).0
    }

    fn in_chunks(text: &str, chunk_bytes: usize) -> Option<QuickObj> {
        quick_obj_in_chunks(text, chunk_bytes, &Progress::default().begin(Work::Reading, 1))
    }

    /// A file of everything that is usual. `relative`: whether some indices count back.
    fn usual(relative: bool) -> String {
        let back = |absolute: &'static str, relative_ix: &'static str| if relative { relative_ix } else { absolute };
        [
            "# made by hand\nmtllib a.mtl\no thing\nv 0 0 0\nv 1.5 0 -2e-3\r\nv 1 1 0\nv 0 1 0\nvt 0 1\nvt 1 1 0.5\n",
            "vn 0 0 1\ng part\nusemtl red\nf 1 2 3\ns off\n",
            back("f 1 2 3 4\n", "f -4 -3 -2 -1\n"),
            back("f 1/1 2/2 3/2 \nf 1//1 2//1 3//1\n", "f 1/1 2/2 3/-1 \nf 1//1 2//1 3//-1\n"),
            "usemtl blue\nf 1/1/1 2/2/1 4/2/1\nf 1/1/1 2 3\nl 1 2\nwhat 3\nv 0 0 \\\n 5\nv 0 -7.25e-1 .5\n",
            "s 1\nusemtl red\nusemtl blue\nf 5 1 2\nusemtl none\nusemtl green\n",
            back("f 6 4 1\nf 3 6 5\n", "f -1 -3 1\nf 3 -1 5\n"),
            "usemtl none\nusemtl green\nf 2 3 4\nf 1 3 6 5 2\nvt 0.25 1\nf 1/3 2/1 3/2",
        ]
        .concat()
    }

    #[test]
    fn both_ways_give_the_same_mesh_however_the_text_is_cut() {
        for text in [usual(false), usual(true)] {
            let expected = by_tobj(&text);
            assert_eq!(expected.slots, [0, 0, 0, 0, 0, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2]);
            // Faces that are there again have no area.
            let has_area = |ix: &usize| expected.faces[*ix][0] != expected.faces[*ix][1];
            assert_eq!((0..15).filter(|ix| !has_area(ix)).collect::<Vec<_>>(), [3, 4, 6, 14]);
            for chunk_bytes in [1, 10, 40, 100, 200, CHUNK_BYTES] {
                assert_eq!(quickly(&text, chunk_bytes), expected, "{chunk_bytes}");
                let (quick, careful) =
                    (in_chunks(&text, chunk_bytes).unwrap(), clean_obj(&text, glam::DVec3::ZERO).unwrap());
                let quick = quick.clean;
                assert_eq!((&quick.libraries, &quick.used_materials), (&careful.libraries, &careful.used_materials));
                assert_eq!((quick.size, quick.colour_scale), (careful.size, 1.0));
                assert_eq!(quick.unknown, Some((22, "what".to_owned())));
                assert_eq!(quick.unknown, careful.unknown);
            }
        }
    }

    #[test]
    fn numbers_that_are_not_finite_count_where_a_face_names_them() {
        let file = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv inf 0 0\nvn 0 1e99 0\nvt 0 nan\n";
        assert!(quick_obj(&format!("{file}f 1 2 3\n"), &Progress::default()).unwrap().models(material_ix).is_some());
        for face in ["f 1 2 4", "f 1//1 2//1 3//1", "f 1/1 2/1 3/1"] {
            assert!(
                quick_obj(&format!("{file}{face}\n"), &Progress::default()).unwrap().models(material_ix).is_none(),
                "{face}"
            );
        }
    }

    #[test]
    fn what_is_unusual_is_left_to_the_careful_way() {
        let start = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n";
        assert!(quick_obj(&format!("{start}f 1 2 3\n"), &Progress::default()).is_some());
        for unusual in [
            "v 0 0 0 1 1 1",
            "v 0 0 0 1",
            "v 0 0",
            "v 0 0 0 # a comment",
            "vn 0 0",
            "vt 0",
            "vt 0 0 nan",
            "vt 0 0 x",
            "f 1 2",
            "f 1 2 4",
            "f 1 2 0",
            "f 1 2 -4",
            "f 1 2 x",
            "f 1 2 3/",
            "f 1 2 3/1/",
            "f 1 2 3/2",
            "f 1 2 3//2",
            "f 1 2 3/1/1/1",
            "f 1 2 99999999999999999999",
            "f 1 2 +3",
            "f 1 2 3 # a comment",
            "vn nan 0 -nan(ind)",
        ] {
            assert!(quick_obj(&format!("{start}{unusual}\n"), &Progress::default()).is_none(), "{unusual}");
        }
    }
}
