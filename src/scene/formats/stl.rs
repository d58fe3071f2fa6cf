//! STL files, as text and binary. Each facet has corners of its own; for shading normals, corners at the same place
//! count as one point. The stored normals of facets are not used, since the order of a facet's corners,
//! counter-clockwise seen from outside, gives its normal. Coordinates are taken as they are: the format states
//! neither a unit nor an axis that points up.

mod colours;
mod text;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::{
    scene::{
        meshes::{
            needs::{Attributes, MeshSize, require_for_mesh},
            smooth::{Shading, smooth_normals},
        },
        model::{Mesh, error::Checked},
    },
    util::progress::{Progress, Work},
};

/// Size in bytes of the header of a binary file: 80 bytes of comment, then the number of facets.
const HEAD_BYTES: usize = 84;
/// Size in bytes of a facet in a binary file: its normal, its three corners, and two bytes of attributes.
const FACET_BYTES: usize = 50;
/// Numbers of facets in files of programs that do not know the number when they begin to write.
const UNKNOWN_COUNTS: [usize; 2] = [0, u32::MAX as usize];

/// The number of facets between two reports of progress.
const REPORTED_FACETS: usize = 1 << 14;

/// The corners of a facet.
type Facet = [Vec3; 3];

/// Returns whether a file is certainly a binary STL file: its size is exactly that of the number of facets that its
/// header states. The comment of such a file may begin with the word `solid`, as text does.
pub(crate) fn is_binary_stl(bytes: &[u8]) -> bool {
    n_facets(bytes).is_some_and(|n| n > 0 && bytes.len() - HEAD_BYTES == n * FACET_BYTES)
}

/// Returns the number of facets that the header of a binary file states. If the program did not know it, the file's
/// size tells.
fn n_facets(bytes: &[u8]) -> Option<usize> {
    let stated = u32::from_le_bytes(bytes.get(80..HEAD_BYTES)?.try_into().expect("four bytes")) as usize;
    let n_rest = bytes.len() - HEAD_BYTES;
    let is_unknown = UNKNOWN_COUNTS.contains(&stated) && n_rest.is_multiple_of(FACET_BYTES);
    Some(if is_unknown { n_rest / FACET_BYTES } else { stated })
}

/// Returns whether a file that is not certainly binary is text: it begins with the word `solid`, or `facet` in files
/// whose first line is missing.
pub(crate) fn is_stl_text(bytes: &[u8]) -> bool {
    let first = text::Words::new(bytes).next().map(|word| word.text);
    first.is_some_and(|word| ["solid", "facet"].iter().any(|it| word.eq_ignore_ascii_case(it.as_bytes())))
}

/// Returns whether a file that begins like text is binary nevertheless: it has the facets that its header states, and
/// no word of a text's facets.
fn has_binary_facets(bytes: &[u8]) -> bool {
    let has_facets = n_facets(bytes).is_some_and(|n| n > 0 && (bytes.len() - HEAD_BYTES) / FACET_BYTES >= n);
    has_facets && !bytes.windows(b"facet".len()).any(|word| word.eq_ignore_ascii_case(b"facet"))
}

/// Makes a mesh of a file's content. Its faces have slot 0. Also returns what is to be warned of. `n_loaded`: the
/// number of triangles that the scene has already. `progress` is told of the facets that have been read.
pub(crate) fn parse_stl(
    bytes: &[u8],
    (shading, origin): (Shading, DVec3),
    (n_loaded, progress): (usize, &Progress),
) -> Checked<(Mesh, Option<String>)> {
    let is_binary = is_binary_stl(bytes) || !is_stl_text(bytes) || has_binary_facets(bytes);
    let (facets, colours) = match is_binary {
        true => binary(bytes, origin, (n_loaded, progress))?,
        false => (text::facets(bytes, origin, (n_loaded, progress))?, Vec::new()),
    };
    let n_facets = n_facets(bytes).filter(|_| is_binary);
    let n_behind = n_facets.map_or(0, |n| bytes.len() - HEAD_BYTES - n * FACET_BYTES);
    let warning = (n_behind > 0).then(|| {
        let n = n_facets.unwrap_or_default();
        format!("the header states {n} facets: {n_behind} bytes behind them are not read")
    });
    let positions = facets.as_flattened().to_vec();
    let faces: Vec<_> = (0..facets.len() as u32).map(|ix| [3 * ix, 3 * ix + 1, 3 * ix + 2]).collect();
    let normals = smooth_normals(&positions, &faces, shading);
    let colours = colours.into_iter().map(|colour: Vec3| [colour.extend(1.0); 3]).collect();
    Ok((Mesh { positions, slots: vec![0; faces.len()], faces, normals, colours, ..Mesh::default() }, warning))
}

/// Returns the facets of a binary file whose corners are finite, and their colours, if the file has any. Programs write
/// NaN for what they could not compute.
fn binary(bytes: &[u8], origin: DVec3, (n_loaded, progress): (usize, &Progress)) -> Checked<(Vec<Facet>, Vec<Vec3>)> {
    let n = n_facets(bytes).ok_or("is no STL file: it is neither text nor long enough for the binary form")?;
    let rows: &[[u8; FACET_BYTES]] = bytes[HEAD_BYTES..].as_chunks().0;
    let Some(rows) = rows.get(..n) else {
        let n_held = rows.len();
        return Err(match n_held {
            0 => "is no STL file: it neither begins with `solid`, as text does, nor has binary facets".to_owned(),
            _ => format!("ends after {n_held} of {n} facets, if it is a binary STL file; text begins with `solid`"),
        });
    };
    require_for_facets(n_loaded, n)?;
    let meter = progress.begin(Work::Reading, n as u64);
    let corners = |row: &[u8; FACET_BYTES]| -> Facet {
        let numbers = row[12..48].as_chunks().0;
        std::array::from_fn(|corner| {
            let number = |axis: usize| f64::from(f32::from_le_bytes(numbers[3 * corner + axis]));
            (DVec3::new(number(0), number(1), number(2)) - origin).as_vec3()
        })
    };
    let of_chunk = |rows: &'_ [[u8; FACET_BYTES]]| {
        meter.add(rows.len() as u64);
        rows.iter().map(corners).collect::<Vec<_>>()
    };
    let mut facets: Vec<Facet> = rows.par_chunks(REPORTED_FACETS).flat_map_iter(of_chunk).collect();
    let attributes = |row: &[u8; FACET_BYTES]| u16::from_le_bytes([row[48], row[49]]);
    let mut colours = colours::of_attributes(&bytes[..80], &rows.iter().map(attributes).collect::<Vec<_>>());
    let is_whole = |facet: &Facet| facet.iter().all(|corner| corner.is_finite());
    if !facets.par_iter().all(is_whole) {
        let mut whole = facets.iter().map(is_whole);
        colours.retain(|_| whole.next() == Some(true));
        facets.retain(is_whole);
    }
    Ok((facets, colours))
}

/// Refuses facets, which have three points each, if there is not enough memory for them.
fn require_for_facets(n_loaded: usize, n: usize) -> Checked<()> {
    let n_triangles = n as u64;
    let attributes = Attributes { has_colours: true, ..Attributes::default() };
    require_for_mesh(n_loaded as u64, &MeshSize { n_triangles, n_points: n_triangles.saturating_mul(3), attributes })
}
