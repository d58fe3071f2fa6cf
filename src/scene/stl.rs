//! STL files, as text and binary. Facets have corners of their own, so points at the same place are welded before they
//! are shaded. The facets' stored normals are not used: corners counter-clockwise from outside define them. Coordinates
//! are taken as they are: the format states neither a unit nor an axis that points up.

use std::io::Cursor;

use glam::Vec3;
use stl_io::{Triangle, create_stl_reader};

use super::{
    error::Checked,
    mesh::Mesh,
    needs::require_for_triangles,
    smooth::{Shading, smooth_normals},
};

/// Size of a binary file's head, 80 bytes of comment and the number of facets, and of a facet.
const HEAD_BYTES: usize = 84;
const FACET_BYTES: usize = 50;
/// The fewest bytes of a facet as text, with every number of one digit.
const LEAST_TEXT_BYTES: usize = 80;

/// Returns whether a file has exactly the size that its number of facets gives a binary STL file. Such a file may begin
/// with the word `solid`, as text does.
pub(super) fn is_binary_stl(bytes: &[u8]) -> bool {
    n_facets(bytes).is_some_and(|n| n > 0 && bytes.len() - HEAD_BYTES == n * FACET_BYTES)
}

/// Returns the number of facets that the head of a binary file states.
fn n_facets(bytes: &[u8]) -> Option<usize> {
    let n = bytes.get(80..HEAD_BYTES)?;
    Some(u32::from_le_bytes(n.try_into().expect("four bytes")) as usize)
}

/// Makes a mesh of a file's content. Its faces have slot 0.
pub(super) fn parse_stl(bytes: Vec<u8>, shading: Shading, n_loaded: usize) -> Checked<Mesh> {
    let triangles = match is_binary_stl(&bytes) || !bytes.trim_ascii_start().starts_with(b"solid") {
        true => binary(bytes, n_loaded)?,
        false => text(&bytes, n_loaded)?,
    };
    let positions: Vec<_> = triangles.iter().flat_map(|triangle| triangle.vertices.map(|v| Vec3::from(v.0))).collect();
    let faces: Vec<_> = (0..triangles.len() as u32).map(|ix| [3 * ix, 3 * ix + 1, 3 * ix + 2]).collect();
    let normals = smooth_normals(&positions, &faces, shading);
    Ok(Mesh { positions, slots: vec![0; faces.len()], faces, normals })
}

fn binary(mut bytes: Vec<u8>, n_loaded: usize) -> Checked<Vec<Triangle>> {
    let n = n_facets(&bytes).ok_or("is no STL file: it is neither text nor long enough for the binary form")?;
    let n_held = (bytes.len() - HEAD_BYTES) / FACET_BYTES;
    if n_held < n {
        return Err(format!("ends after {n_held} of {n} facets"));
    }
    require_for_triangles(n_loaded as u64, n as u64)?;
    bytes[..80].fill(0); // a comment, which the reader would take for text if it began with `solid`
    triangles_of(bytes)
}

/// Reads the solids of a text.
fn text(bytes: &[u8], n_loaded: usize) -> Checked<Vec<Triangle>> {
    require_for_triangles(n_loaded as u64, (bytes.len() / LEAST_TEXT_BYTES) as u64)?;
    let mut triangles = Vec::new();
    for (line, solid) in solids(bytes) {
        let named = |what| format!("the solid at line {line}: {what}");
        triangles.extend(triangles_of(solid).map_err(named)?);
    }
    Ok(triangles)
}

/// Reads a binary file, or a text of one solid.
fn triangles_of(bytes: Vec<u8>) -> Checked<Vec<Triangle>> {
    let mut bytes = Cursor::new(bytes);
    let triangles = create_stl_reader(&mut bytes).and_then(Iterator::collect);
    triangles.map_err(|error| error.to_string().escape_debug().to_string().replace("\\\"", "\""))
}

/// Returns all solids of a text as the reader accepts them, each with the number of its first line: without names,
/// which may be missing or in any encoding, and without stored normals, which may be no numbers.
fn solids(bytes: &[u8]) -> Vec<(usize, Vec<u8>)> {
    let mut solids: Vec<(usize, Vec<u8>)> = Vec::new();
    for (ix, line) in bytes.split_inclusive(|byte| *byte == b'\n').enumerate() {
        let statement = line.trim_ascii_start();
        if statement.starts_with(b"solid") {
            solids.push((ix + 1, b"solid \n".to_vec()));
        } else if let Some((_, solid)) = solids.last_mut() {
            solid.extend_from_slice(match () {
                () if statement.starts_with(b"facet") => b"facet normal 0 0 0\n",
                () if statement.starts_with(b"endsolid") => b"endsolid\n",
                () => line,
            });
        }
    }
    solids
}
