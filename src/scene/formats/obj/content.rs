//! The reader of OBJ files, by all threads. A first pass reads all elements, and the faces whose indices are positive
//! and name elements of the file. Chunks with other faces, and all chunks of a file with elements that are not finite,
//! have their faces read again when the elements are known.

use std::collections::BTreeMap;

use glam::DVec3;
use rayon::prelude::*;

use super::{
    elements::Elements,
    faces::{Chunk, Faces, Known, Part},
    statement::{Fault, split_keyword},
};
use crate::{
    scene::{meshes::needs::MeshSize, model::error::Checked},
    util::progress::{Meter, Progress, Work},
};

/// Least number of bytes of the text that one thread reads at a time.
const CHUNK_BYTES: usize = 1 << 20;

/// The content of an OBJ file, without its materials.
#[derive(Debug, Default)]
pub struct ObjFile {
    /// The point of the file that is the origin of the points.
    pub origin: DVec3,
    pub elements: Elements,
    /// The faces in the order of the file.
    pub chunks: Vec<Faces>,
    /// Names after `mtllib`, each with its line, counted from 1.
    pub libraries: Vec<(usize, String)>,
    /// Names after `usemtl`, each with the first line that uses it.
    pub used_materials: BTreeMap<String, usize>,
    /// Size of the mesh, if polygons are cut into fans.
    pub size: MeshSize,
    /// Line and keyword of the first statement that is not part of the format, if any.
    pub unknown: Option<(usize, String)>,
    /// The first normal or texture vertex that does not exist, if any.
    pub missing: Option<Fault>,
    /// The first face that is left out, if any.
    pub left_out: Option<Fault>,
}

impl ObjFile {
    /// Reads the text of an OBJ file. `origin` is subtracted from its points. `progress` is told of the bytes that have
    /// been read.
    pub fn read(text: &str, origin: DVec3, progress: &Progress) -> Result<Self, Fault> {
        Self::read_in_chunks(text, origin, (CHUNK_BYTES, &progress.begin(Work::Reading, text.len() as u64)))
    }

    fn read_in_chunks(text: &str, origin: DVec3, (n_bytes, meter): (usize, &Meter)) -> Result<Self, Fault> {
        let chunks = chunks_of(text, n_bytes);
        let read = |chunk: &Chunk| {
            let read = chunk.read(origin);
            meter.add(chunk.text.len() as u64);
            read
        };
        let (parts, mut faces): (Vec<Elements>, Vec<Faces>) = chunks.par_iter().map(read).unzip();
        let mut seen = [0; 3];
        let seen_before = |part: &Elements| {
            let (before, counts) = (seen, part.counts());
            seen = [0, 1, 2].map(|kind| before[kind] + counts[kind]);
            before
        };
        let seen: Vec<[usize; 3]> = parts.iter().map(seen_before).collect();
        let elements = Elements::joined(parts);
        let (counts, are_finite) = (elements.counts(), elements.are_finite());
        let read_again = |((faces, chunk), seen): ((&mut Faces, &Chunk), [usize; 3])| {
            if !(are_finite && faces.are_certain(counts)) {
                *faces = chunk.faces(Known { elements: &elements, seen });
            }
        };
        faces.par_iter_mut().zip(&chunks).zip(seen).for_each(read_again);
        let file = Self::joined(elements, faces)?;
        Ok(Self { origin, ..file })
    }

    /// Joins the faces of all chunks. Fails with what is wrong first.
    fn joined(mut elements: Elements, mut chunks: Vec<Faces>) -> Result<Self, Fault> {
        let mut file = Self::default();
        let mut faults: Vec<Fault> = elements.error.take().into_iter().collect();
        for chunk in &mut chunks {
            for part in &chunk.parts {
                match part {
                    Part::Faces(run) => {
                        file.size.n_triangles += run.n_triangles() as u64;
                        file.size.attributes.n_uv_sets |= u64::from(run.has(1));
                    }
                    Part::Statement(line, statement) => {
                        faults.extend(file.add(*line, statement).err().map(|what| (*line, what)));
                    }
                }
            }
            faults.extend(chunk.error.take());
            file.missing = file.missing.or(chunk.missing.take());
            file.left_out = file.left_out.or(chunk.left_out.take());
        }
        // Numbers beyond single precision do no harm where no face names them.
        let names_overflow = chunks.iter().any(|chunk| chunk.names_overflow);
        if names_overflow || file.size.n_triangles == 0 || !faults.is_empty() {
            faults.extend(elements.overflow.take());
        }
        if let Some(first) = faults.into_iter().min() {
            return Err(first);
        }
        file.size.n_points = elements.counts()[0] as u64;
        file.size.attributes.has_colours = elements.has_colours();
        Ok(Self { elements, chunks, ..file })
    }

    /// Returns the number of points.
    pub fn n_points(&self) -> usize {
        self.size.n_points as usize
    }

    /// Adds a statement that is neither an element nor a face.
    fn add(&mut self, line: usize, statement: &str) -> Checked<()> {
        match split_keyword(statement) {
            ("usemtl", name) => drop(self.used_materials.entry(name.to_owned()).or_insert(line)),
            ("s", _) | ("mtllib", "") => {}
            ("mtllib", rest) => self.libraries.push((line, rest.to_owned())),
            _ if statement.contains('\0') => return Err("this is no text file".to_owned()),
            (keyword, _) => self.unknown = self.unknown.take().or(Some((line, keyword.to_owned()))),
        }
        Ok(())
    }
}

/// Cuts a text into chunks of about `n_bytes` or more, each of which begins with a statement.
fn chunks_of(mut text: &str, n_bytes: usize) -> Vec<Chunk<'_>> {
    let mut texts = Vec::new();
    while text.len() > n_bytes {
        // A line that ends in `\` is continued by the next one.
        let line = |at: usize| text[..at].rsplit('\n').next().unwrap_or_default();
        let is_end = |at: &usize| text.as_bytes()[*at] == b'\n' && !line(*at).trim_end().ends_with('\\');
        let Some(end) = (n_bytes..text.len() - 1).find(is_end) else { break };
        let (chunk, rest) = text.split_at(end + 1);
        texts.push(chunk);
        text = rest;
    }
    texts.push(text);
    let n_lines = |text: &&str| text.bytes().filter(|byte| *byte == b'\n').count();
    let n_lines: Vec<usize> = texts.par_iter().map(n_lines).collect();
    let first_line = |before: &mut usize, (text, n): (_, usize)| {
        let first_line = *before;
        *before += n;
        Some(Chunk { text, first_line })
    };
    texts.into_iter().zip(n_lines).scan(0, first_line).collect()
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::scene::{formats::obj::model::mesh, meshes::smooth::Shading, model::Mesh};

    const MATERIALS: [&str; 3] = ["red", "blue", "green"];

    fn material_ix(name: &str) -> Option<usize> {
        MATERIALS.iter().position(|known| *known == name)
    }

    fn in_chunks(text: &str, n_bytes: usize) -> Result<ObjFile, Fault> {
        let progress = Progress::default();
        ObjFile::read_in_chunks(text, DVec3::ZERO, (n_bytes, &progress.begin(Work::Reading, 1)))
    }

    fn mesh_of(content: &ObjFile) -> Mesh {
        mesh(content, material_ix, 3, Shading::default()).0
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
    fn the_mesh_does_not_depend_on_how_the_text_is_cut() {
        let points = [[0.0, 0.0, 0.0], [1.5, 0.0, -2e-3], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let points = [&points[..], &[[0.0, 0.0, 5.0], [0.0, -0.725, 0.5]]].concat();
        let expected = mesh_of(&in_chunks(&usual(false), CHUNK_BYTES).unwrap());
        assert_eq!(expected.slots, [0, 0, 0, 0, 0, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2]);
        // Repeated faces become triangles without area.
        let has_area = |ix: &usize| expected.faces[*ix][0] != expected.faces[*ix][1];
        assert_eq!((0..15).filter(|ix| !has_area(ix)).collect::<Vec<_>>(), [3, 4, 6, 14]);
        let is_one_of = |point: &Vec3| points.iter().any(|known| point.distance(Vec3::from_array(*known)) < 1e-4);
        assert!(expected.positions.iter().all(is_one_of), "{:?}", expected.positions);
        let corner = |face: usize, ix: usize| expected.positions[expected.faces[face][ix] as usize];
        for (face, indices) in [(0, [1, 2, 3]), (1, [1, 2, 3]), (2, [1, 3, 4]), (5, [1, 2, 4]), (7, [5, 1, 2])] {
            for (ix, point) in indices.into_iter().enumerate() {
                assert!(corner(face, ix).distance(Vec3::from_array(points[point - 1])) < 1e-4, "{face}");
            }
        }
        assert_eq!(expected.uvs[0][3].map(|uv| uv.to_array()), [[0.0, 0.0], [1.0, 0.0], [1.0, 0.0]]);
        assert_eq!(expected.uvs[0][14].map(|uv| uv.to_array()), [[0.25, 0.0], [0.0, 0.0], [1.0, 0.0]]);
        for text in [usual(false), usual(true)] {
            for n_bytes in [1, 10, 40, 100, 200, CHUNK_BYTES] {
                let content = in_chunks(&text, n_bytes).unwrap();
                assert_eq!(mesh_of(&content), expected, "{n_bytes}");
                assert_eq!(content.libraries, [(2, "a.mtl".to_owned())]);
                let used = [("blue", 18), ("green", 31), ("none", 30), ("red", 12)];
                assert_eq!(content.used_materials, used.map(|(name, line)| (name.to_owned(), line)).into());
                assert_eq!((content.size.n_triangles, content.size.n_points), (15, 6));
                assert_eq!(content.size.attributes.n_uv_sets, 1);
                assert_eq!((content.elements.has_colours(), content.elements.colour_scale()), (false, 1.0));
                assert_eq!(content.unknown, Some((22, "what".to_owned())));
                assert_eq!((content.missing, content.left_out), (None, None));
            }
        }
    }

    #[test]
    fn numbers_that_are_not_finite_count_where_a_face_names_them() {
        let file = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv inf 0 0\nvn 0 1e99 0\nvt 0 nan\n";
        for n_bytes in [1, CHUNK_BYTES] {
            let read = |face: &str| in_chunks(&format!("{file}{face}\n"), n_bytes);
            let content = read("f 1 2 3").unwrap();
            assert_eq!((content.left_out, content.size.n_triangles), (None, 1));
            let content = read("f 1 2 4\nf 1 2 3").unwrap();
            assert_eq!(content.left_out, Some((7, "vertex 4 is not finite".to_owned())));
            assert_eq!(content.size.n_triangles, 1);
            let overflow = Some((5, "`1e99` is not a finite number of single precision".to_owned()));
            assert_eq!(read("f 1//1 2//1 3//1").err(), overflow);
            let content = read("f 1/1 2/1 3/1").unwrap();
            assert_eq!((content.size.n_triangles, content.size.attributes.n_uv_sets), (1, 0));
            // Without a face, and beside other faults, they count too.
            assert_eq!((read("").err(), read("f 1 2 9").err()), (overflow.clone(), overflow));
        }
    }

    /// Work that grows with the square of the number of lines would take hours.
    #[test]
    fn millions_of_blank_and_continued_lines_take_no_time() {
        for lines in ["\n", "\\\n"] {
            let text = format!("v 0 0 0\\\n{}\n", lines.repeat(3 << 20));
            assert_eq!(in_chunks(&text, CHUNK_BYTES).unwrap().size.n_points, 1);
        }
    }

    #[test]
    fn unusual_statements_are_read_or_told() {
        let start = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n";
        let out_of_range = |what: &str, n: usize| format!("{what} is out of range: there are {n}");
        let missing =
            [("f 1 2 3/2", "texture vertex 2"), ("f 1 2 3//2", "normal 2"), ("f 1/0 2 3", "texture vertex 0")];
        let wrong = [
            ("v 0 0", "`v` has 2 numbers: it takes 3 to 7".to_owned()),
            ("vn 0 0", "`vn` has 2 numbers: it takes 3".to_owned()),
            ("vt 0 0 x", "`x` is not a number".to_owned()),
            ("v 0 0 1,5", "`1,5` is not a number: decimals need a point in place of the comma".to_owned()),
            ("f 1 2 4", out_of_range("vertex 4", 3)),
            ("f 1 2 0", out_of_range("vertex 0", 3)),
            ("f 1 2 -4", out_of_range("vertex -4", 3)),
            ("f 1 2 x", "`x` is not the index of a vertex".to_owned()),
            ("f 1 2 3/1/1/1", "`3/1/1/1` has more than three indices".to_owned()),
            ("f 1 2 4294967297", out_of_range("vertex 4294967297", 3)),
            ("f 1 2 99999999999999999999", "`99999999999999999999` is not the index of a vertex".to_owned()),
        ];
        let fine = [
            "v 0 0 0 1 1 1",
            "v 0 0 0 1",
            "v 0 0 0 # a comment",
            "vt 0",
            "vt 0 0 nan",
            "f 1 2 3/",
            "f 1 2 3/1/",
            "f 1 2 +3",
            "f 1 2 3 # a comment",
            "vn nan 0 -nan(ind)",
            "v -1.#IND 0 0",
        ];
        for n_bytes in [1, CHUNK_BYTES] {
            let read = |statement: &str| in_chunks(&format!("{start}{statement}\nf 1 2 3\n"), n_bytes);
            for (statement, what) in &wrong {
                assert_eq!(read(statement).err(), Some((6, what.clone())), "{statement}");
            }
            for (statement, what) in missing {
                let content = read(statement).unwrap();
                assert_eq!(content.missing, Some((6, out_of_range(what, 1))), "{statement}");
                assert_eq!(content.size.n_triangles, 2);
            }
            for statement in fine {
                let content = read(statement).unwrap();
                assert_eq!((&content.missing, &content.left_out), (&None, &None), "{statement}");
                let is_face = u64::from(statement.starts_with('f'));
                assert_eq!((content.size.n_triangles, content.size.attributes.n_uv_sets), (1 + is_face, 0));
            }
            let few = read("f 1 2").unwrap().left_out;
            assert_eq!(few, Some((6, "a face of 2 corners: it needs 3 or more".to_owned())));
        }
    }
}
