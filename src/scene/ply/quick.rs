//! The quick way to read the triangles of a binary PLY file. It takes what nearly all programs write: a list of three
//! indices in each row, and nothing else. All other files are left to the reader of any PLY file.

use rayon::prelude::*;
use serde_ply::{ElementDef, PlyFormat, PlyHeader, PropertyType, ScalarType};

use super::{INDICES, least_bytes};

/// Bytes of a face: the number of its corners in one byte, and three indices of 32 bits.
const ROW_BYTES: usize = 13;

/// Returns the triangles of a file, or `None` if its faces are not all triangles of vertices that the file has, if they
/// have more than indices, or if other elements follow them.
pub fn quick_triangles(bytes: &[u8], header: &PlyHeader) -> Option<Vec<[u32; 3]>> {
    let [vertex, face] = &header.elem_defs[..] else { return None };
    if !matches!(header.format, PlyFormat::BinaryLittleEndian) || vertex.name != "vertex" || !is_usual(face) {
        return None;
    }
    let of_vertex = |property: &serde_ply::PlyProperty| match property.property_type {
        PropertyType::Scalar(_) => Some(least_bytes(&property.property_type) as usize),
        PropertyType::List { .. } => None,
    };
    let vertex_bytes = vertex.properties.iter().map(of_vertex).sum::<Option<usize>>()?;
    let first = header_bytes(bytes)?.checked_add(vertex.count.checked_mul(vertex_bytes)?)?;
    let rows = bytes.get(first..first.checked_add(face.count.checked_mul(ROW_BYTES)?)?)?;
    let triangle = |row: &[u8; ROW_BYTES]| {
        let indices = row[1..].as_chunks().0;
        let triangle = [0, 1, 2].map(|corner| u32::from_le_bytes(indices[corner]));
        (row[0] == 3 && triangle.iter().all(|ix| (*ix as usize) < vertex.count)).then_some(triangle)
    };
    rows.as_chunks().0.par_iter().map(triangle).collect()
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
fn header_bytes(bytes: &[u8]) -> Option<usize> {
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
