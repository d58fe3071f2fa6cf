//! STL files, as text and binary. Each facet has corners of its own; for shading normals, corners at the same place
//! count as one point. The stored normals of facets are not used, since the order of a facet's corners,
//! counter-clockwise seen from outside, gives its normal. Coordinates are taken as they are: the format states
//! neither a unit nor an axis that points up.

use std::io::Cursor;

use glam::{DVec3, Vec3};
use stl_io::{Triangle, create_stl_reader};

use super::{
    error::Checked,
    mesh::Mesh,
    needs::{MeshSize, require_for_mesh},
    smooth::{Shading, smooth_normals},
};
use crate::util::progress::{Meter, Progress, Work};

/// Size in bytes of the header of a binary file: 80 bytes of comment, then the number of facets.
const HEAD_BYTES: usize = 84;
/// Size in bytes of a facet in a binary file.
const FACET_BYTES: usize = 50;

/// Returns whether a file is certainly a binary STL file: its size is exactly that of the number of facets that its
/// header states. The comment of such a file may begin with the word `solid`, as text does.
pub(super) fn is_binary_stl(bytes: &[u8]) -> bool {
    n_facets(bytes).is_some_and(|n| n > 0 && bytes.len() - HEAD_BYTES == n * FACET_BYTES)
}

/// Returns the number of facets that the header of a binary file states.
fn n_facets(bytes: &[u8]) -> Option<usize> {
    let n = bytes.get(80..HEAD_BYTES)?;
    Some(u32::from_le_bytes(n.try_into().expect("four bytes")) as usize)
}

/// Returns whether a file that is not certainly binary is text: it begins with the word `solid`.
pub(super) fn is_stl_text(bytes: &[u8]) -> bool {
    is_statement(without_bom(bytes).trim_ascii_start(), b"solid")
}

/// Returns what follows a byte order mark.
fn without_bom(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

/// Returns whether a line begins with a keyword. Some writers use capitals.
fn is_statement(line: &[u8], keyword: &[u8]) -> bool {
    line.get(..keyword.len()).is_some_and(|word| word.eq_ignore_ascii_case(keyword))
}

/// Makes a mesh of a file's content. Its faces have slot 0. `n_loaded`: the number of triangles that the scene has
/// already. `progress` is told of the facets that have been read.
pub(super) fn parse_stl(
    bytes: Vec<u8>,
    (shading, origin): (Shading, DVec3),
    (n_loaded, progress): (usize, &Progress),
) -> Checked<Mesh> {
    let triangles = match is_binary_stl(&bytes) || !is_stl_text(&bytes) {
        true => binary(bytes, (n_loaded, progress))?,
        false => text(without_bom(&bytes), (n_loaded, progress))?,
    };
    let position = |v: stl_io::Vertex| (Vec3::from(v.0).as_dvec3() - origin).as_vec3();
    let positions: Vec<_> = triangles.iter().flat_map(|triangle| triangle.vertices.map(position)).collect();
    let faces: Vec<_> = (0..triangles.len() as u32).map(|ix| [3 * ix, 3 * ix + 1, 3 * ix + 2]).collect();
    let normals = smooth_normals(&positions, &faces, shading);
    Ok(Mesh { positions, slots: vec![0; faces.len()], faces, normals, ..Mesh::default() })
}

fn binary(mut bytes: Vec<u8>, (n_loaded, progress): (usize, &Progress)) -> Checked<Vec<Triangle>> {
    let n = n_facets(&bytes).ok_or("is no STL file: it is neither text nor long enough for the binary form")?;
    let n_held = (bytes.len() - HEAD_BYTES) / FACET_BYTES;
    if n_held < n {
        return Err(format!("ends after {n_held} of {n} facets"));
    }
    require_for_facets(n_loaded, n)?;
    if let Some(whole) = whole_facets(&bytes[HEAD_BYTES..][..n * FACET_BYTES]) {
        bytes.truncate(HEAD_BYTES);
        bytes[80..].copy_from_slice(&((whole.len() / FACET_BYTES) as u32).to_le_bytes());
        bytes.extend(whole);
    }
    bytes[..80].fill(0); // a comment, which the reader would take for text if it began with `solid`
    triangles_of(bytes, &progress.begin(Work::Reading, n as u64))
}

/// Returns the facets of a binary file whose corners are finite, or `None` if all are. Programs write NaN for what they
/// could not compute.
fn whole_facets(facets: &[u8]) -> Option<Vec<u8>> {
    // A facet begins with its normal, which is not used.
    let is_whole = |facet: &[u8; FACET_BYTES]| {
        facet[12..48].as_chunks().0.iter().all(|bytes| f32::from_le_bytes(*bytes).is_finite())
    };
    let facets = facets.as_chunks().0;
    let is_broken = facets.iter().any(|facet| !is_whole(facet));
    is_broken.then(|| facets.iter().filter(|facet| is_whole(facet)).flatten().copied().collect())
}

/// Refuses facets, which have three points each, if there is not enough memory for them.
fn require_for_facets(n_loaded: usize, n: usize) -> Checked<()> {
    let n_triangles = n as u64;
    let size = MeshSize { n_triangles, n_points: n_triangles.saturating_mul(3), ..MeshSize::default() };
    require_for_mesh(n_loaded as u64, &size)
}

/// Reads the solids of a text.
fn text(bytes: &[u8], (n_loaded, progress): (usize, &Progress)) -> Checked<Vec<Triangle>> {
    let lines = bytes.split(|byte| *byte == b'\n');
    let n_facets = lines.filter(|line| is_statement(line.trim_ascii_start(), b"facet")).count();
    require_for_facets(n_loaded, n_facets)?;
    let meter = progress.begin(Work::Reading, n_facets as u64);
    let mut triangles = Vec::new();
    for (line, solid) in solids(bytes) {
        let named = |what| format!("the solid at line {line}: {what}");
        triangles.extend(triangles_of(solid, &meter).map_err(named)?);
    }
    Ok(triangles)
}

/// The number of facets between two reports of progress.
const REPORTED_FACETS: usize = 1 << 14;

/// Reads a binary file, or a text of one solid.
fn triangles_of(bytes: Vec<u8>, meter: &Meter) -> Checked<Vec<Triangle>> {
    let mut bytes = Cursor::new(bytes);
    let count = |(ix, triangle)| {
        if ix % REPORTED_FACETS == REPORTED_FACETS - 1 {
            meter.add(REPORTED_FACETS as u64);
        }
        triangle
    };
    let triangles = create_stl_reader(&mut bytes).and_then(|reader| reader.enumerate().map(count).collect());
    let triangles = triangles.inspect(|read: &Vec<Triangle>| meter.add((read.len() % REPORTED_FACETS) as u64));
    triangles.map_err(|error| error.to_string().escape_debug().to_string().replace("\\\"", "\""))
}

/// Returns all solids of a text as the reader accepts them, each with the number of its first line: in small letters,
/// without names, which may be missing or in any encoding, and without stored normals, which need not be numbers.
fn solids(bytes: &[u8]) -> Vec<(usize, Vec<u8>)> {
    let mut solids: Vec<(usize, Vec<u8>)> = Vec::new();
    for (ix, line) in bytes.split_inclusive(|byte| *byte == b'\n').enumerate() {
        let statement = line.trim_ascii_start();
        if is_statement(statement, b"solid") {
            solids.push((ix + 1, b"solid \n".to_vec()));
        } else if let Some((_, solid)) = solids.last_mut() {
            match () {
                () if is_statement(statement, b"facet") => solid.extend(b"facet normal 0 0 0\n"),
                () if is_statement(statement, b"endsolid") => solid.extend(b"endsolid\n"),
                () => solid.extend(line.iter().map(u8::to_ascii_lowercase)),
            }
            if is_statement(statement, b"endfacet") {
                leave_out_if_broken(solid);
            }
        }
    }
    solids
}

/// Takes the last facet from a solid if a number of it is NaN or infinite.
fn leave_out_if_broken(solid: &mut Vec<u8>) {
    const BEGIN: &[u8] = b"facet normal 0 0 0\n";
    let begin = solid.windows(BEGIN.len()).rposition(|part| part == BEGIN).unwrap_or(solid.len());
    let mut words = solid[begin..].split(u8::is_ascii_whitespace);
    let is_broken = |word: &[u8]| {
        let word = word.strip_prefix(b"-").or(word.strip_prefix(b"+")).unwrap_or(word);
        word.starts_with(b"nan") || word.starts_with(b"inf") || word.starts_with(b"1.#")
    };
    if words.any(is_broken) {
        solid.truncate(begin);
    }
}
