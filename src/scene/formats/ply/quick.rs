//! The quick way to read the vertices and the triangles of a binary PLY file. It takes what nearly all programs write:
//! vertices of numbers, and a list of three indices in each row, and nothing else. All other files are left to the
//! reader of any PLY file.

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use serde_ply::{ElementDef, PlyFormat, PlyHeader, PropertyType, ScalarType};

use super::{
    INDICES, least_bytes,
    vertex::{Vertices, has_more},
};

/// Bytes of a face: the number of its corners in one byte, and three indices of 32 bits.
const ROW_BYTES: usize = 13;

/// Returns the triangles of a file, or `None` if its faces are not all triangles of vertices that the file has, if they
/// have more than indices, or if other elements follow them.
pub fn quick_triangles(bytes: &[u8], header: &PlyHeader) -> Option<Vec<[u32; 3]>> {
    let [vertex, face] = &header.elem_defs[..] else { return None };
    if !matches!(header.format, PlyFormat::BinaryLittleEndian) || vertex.name != "vertex" || !is_usual(face) {
        return None;
    }
    let first = header_bytes(bytes)?.checked_add(vertex.count.checked_mul(row_bytes(vertex)?)?)?;
    let rows: &[[u8; ROW_BYTES]] =
        bytes.get(first..first.checked_add(face.count.checked_mul(ROW_BYTES)?)?)?.as_chunks().0;
    let triangle = |row: &[u8; ROW_BYTES]| {
        let indices = row[1..].as_chunks().0;
        [0, 1, 2].map(|corner| u32::from_le_bytes(indices[corner]))
    };
    let is_usual = |row: &[u8; ROW_BYTES]| row[0] == 3 && triangle(row).iter().all(|ix| (*ix as usize) < vertex.count);
    // A list whose length is known is written in place. Lists of parts would have to be joined.
    rows.par_iter().all(is_usual).then(|| rows.par_iter().map(triangle).collect())
}

/// Returns the vertices of a file for which [`quick_triangles`] is not `None`. Returns `None` if they have colours or
/// texture coordinates, or other numbers than floats as coordinates. `origin` is subtracted from their coordinates.
pub fn quick_vertices(bytes: &[u8], header: &PlyHeader, origin: DVec3) -> Option<Vertices> {
    let vertex = header.elem_defs.first()?;
    if has_more(vertex) {
        return None;
    }
    let n_row_bytes = row_bytes(vertex)?;
    let first = header_bytes(bytes)?;
    let rows =
        bytes.get(first..first.checked_add(vertex.count.checked_mul(n_row_bytes)?)?)?.par_chunks_exact(n_row_bytes);
    let [x, y, z] = places(vertex, ["x", "y", "z"])?;
    let position = |row: &[u8]| (DVec3::new(x.number(row), y.number(row), z.number(row)) - origin).as_vec3();
    let positions = rows.clone().map(position).collect();
    let normals = match places(vertex, ["nx", "ny", "nz"]) {
        Some(normal) => {
            rows.map(|row| Vec3::from_array(normal.map(|part| part.number(row) as f32)).normalize_or_zero()).collect()
        }
        None if ["nx", "ny", "nz"].iter().all(|name| vertex.has_property(name)) => return None,
        None => Vec::new(),
    };
    Some(Vertices { positions, normals, ..Vertices::default() })
}

/// Returns the number of bytes of a vertex, or `None` if it has lists.
fn row_bytes(vertex: &ElementDef) -> Option<usize> {
    vertex.properties.iter().map(|property| number_bytes(&property.property_type)).sum()
}

/// Returns the number of bytes of a number, or `None` for a list.
fn number_bytes(property: &PropertyType) -> Option<usize> {
    matches!(property, PropertyType::Scalar(_)).then(|| least_bytes(property) as usize)
}

/// Place of a float in a row.
#[derive(Clone, Copy)]
struct Place {
    begin: usize,
    is_double: bool,
}

impl Place {
    /// Returns the number in a row.
    fn number(self, row: &[u8]) -> f64 {
        let bytes = &row[self.begin..];
        match self.is_double {
            true => f64::from_le_bytes(*bytes.first_chunk().expect("the row has the number")),
            false => f64::from(f32::from_le_bytes(*bytes.first_chunk().expect("the row has the number"))),
        }
    }
}

/// Returns the places of three floats, or `None` if one of them is missing, is there twice, or is no float.
fn places(vertex: &ElementDef, names: [&str; 3]) -> Option<[Place; 3]> {
    let mut found = [None; 3];
    let mut begin = 0;
    for property in &vertex.properties {
        if let Some(ix) = names.iter().position(|name| *name == property.name) {
            let is_double = match property.property_type {
                PropertyType::Scalar(ScalarType::F32) => false,
                PropertyType::Scalar(ScalarType::F64) => true,
                _ => return None,
            };
            if found[ix].replace(Place { begin, is_double }).is_some() {
                return None;
            }
        }
        begin += number_bytes(&property.property_type)?;
    }
    let [a, b, c] = found;
    Some([a?, b?, c?])
}

/// Returns whether the rows of faces are lists of 32-bit indices whose lengths are one byte.
fn is_usual(face: &ElementDef) -> bool {
    let [property] = &face.properties[..] else { return false };
    let is_list = matches!(
        property.property_type,
        PropertyType::List {
            count_type: ScalarType::I8 | ScalarType::U8,
            data_type: ScalarType::I32 | ScalarType::U32
        }
    );
    face.name == "face" && INDICES.contains(&&*property.name) && is_list
}

/// Returns the number of bytes of the header.
pub fn header_bytes(bytes: &[u8]) -> Option<usize> {
    const END: &[u8] = b"\nend_header";
    let end = bytes.windows(END.len()).position(|part| part == END)? + END.len();
    match bytes[end..] {
        [b'\n', ..] => Some(end + 1),
        [b'\r', b'\n', ..] => Some(end + 2),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use serde_ply::PlyReader;

    use super::*;
    use crate::{scene::formats::ply::Counted, util::progress::Progress};

    /// Returns a file of three vertices with rows of faces. `more` are further lines of the header.
    fn file(list: &str, more: &str, rows: &[(u8, [i32; 3])]) -> Vec<u8> {
        let n = rows.len();
        let header = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty double y\n\
             property uchar z\nelement face {n}\n{list}{more}end_header\n"
        );
        let mut bytes = header.into_bytes();
        bytes.resize(bytes.len() + 3 * 13, 0);
        for (n, row) in rows {
            bytes.push(*n);
            row.iter().for_each(|ix| bytes.extend(ix.to_le_bytes()));
        }
        bytes
    }

    fn quickly(bytes: &[u8]) -> Option<Vec<[u32; 3]>> {
        let reader = PlyReader::from_reader(bytes).unwrap();
        quick_triangles(bytes, reader.header())
    }

    /// Returns a file of two vertices without faces. `properties` are lines of the header.
    fn vertices(properties: &str, rows: &[u8]) -> Vec<u8> {
        let header = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex 2\n{properties}element face 0\n\
             property list uchar int vertex_indices\nend_header\n"
        );
        [header.as_bytes(), rows].concat()
    }

    #[test]
    fn vertices_are_those_of_the_slow_way() {
        let origin = DVec3::new(0.25, -1.0, 1e6);
        let numbers = |n: usize| (0..n).flat_map(|ix| (ix as f32 * 1.7 - 3.0).to_le_bytes()).collect::<Vec<u8>>();
        let xyz = "property float x\nproperty float y\nproperty float z\n";
        let normal = "property float ny\nproperty float nx\nproperty float nz\n";
        let more = "property double z\nproperty uchar flags\nproperty float x\nproperty ushort w\nproperty double y\n";
        let normals_of_two = "property float nx\nproperty float ny\n";
        for (properties, n_bytes, has_normals) in [
            (xyz.to_owned(), 12, false),
            (format!("{xyz}{normal}"), 24, true),
            (format!("{normal}{xyz}property uint tag\n"), 28, true),
            (more.to_owned(), 23, false),
            (format!("{xyz}{normals_of_two}"), 20, false),
        ] {
            let bytes = vertices(&properties, &numbers(16)[..2 * n_bytes]);
            let progress = Progress::default();
            let mut reader = PlyReader::from_reader(Counted::new(&bytes, &[], &progress)).unwrap();
            let header = reader.header().clone();
            let slow = Vertices::read(&mut reader, &header.elem_defs[0], origin).unwrap();
            let quick = quick_vertices(&bytes, &header, origin).unwrap();
            assert_eq!((quick.positions.len(), quick.normals.len()), (2, if has_normals { 2 } else { 0 }));
            // NaN differs from itself.
            assert_eq!(format!("{quick:?}"), format!("{slow:?}"), "{properties}");
            let header = PlyReader::from_reader(&bytes[..]).unwrap().header().clone();
            assert!(quick_vertices(&bytes[..bytes.len() - 1], &header, origin).is_none(), "{properties}");
        }
        for properties in [
            "property int x\nproperty float y\nproperty float z\n".to_owned(),
            format!("{xyz}property uchar red\nproperty uchar green\nproperty uchar blue\n"),
            format!("{xyz}property float s\nproperty float t\n"),
            format!("{xyz}property short nx\nproperty float ny\nproperty float nz\n"),
        ] {
            let bytes = vertices(&properties, &[0; 64]);
            let header = PlyReader::from_reader(&bytes[..]).unwrap().header().clone();
            assert!(quick_vertices(&bytes, &header, origin).is_none(), "{properties}");
        }
    }

    #[test]
    fn triangles_alone_are_read_quickly() {
        let list = "property list uchar int vertex_indices\n";
        let rows = [(3, [0, 1, 2]), (3, [2, 1, 0])];
        assert_eq!(quickly(&file(list, "", &rows)), Some(vec![[0, 1, 2], [2, 1, 0]]));
        assert_eq!(quickly(&file("property list uint8 uint32 vertex_index\n", "", &rows)).unwrap().len(), 2);
        assert_eq!(quickly(&file(list, "", &[])), Some(Vec::new()));
        for row in [(4, [0, 1, 2]), (2, [0, 1, 2]), (3, [0, 1, 3]), (3, [-1, 1, 2])] {
            assert_eq!(quickly(&file(list, "", &[rows[0], row])), None, "{row:?}");
        }
        assert_eq!(quickly(&file(list, "property uchar flags\n", &rows)), None);
        assert_eq!(quickly(&file(list, "element edge 0\nproperty int vertex1\n", &rows)), None);
        assert_eq!(quickly(&file("property list uchar short vertex_indices\n", "", &rows)), None);
        let whole = file(list, "", &rows);
        assert_eq!(quickly(&whole[..whole.len() - 1]), None);
    }
}
