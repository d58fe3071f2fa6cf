//! Arrays of transforms, by which a `[[mesh]]` table places its mesh many times.

use glam::DMat4;
use npyz::{NpyFile, Order};

use crate::{
    scene::{
        files::SourceFile,
        model::{Transform, error::Checked},
    },
    util::{memory::require, npy, text::short_line},
};

/// What a file of transforms has to hold.
const RULE: &str = "instances are N x 3 x 4 numbers, the rows of matrices that take the mesh to the scene";

/// Reads a `.npy` file of transforms: N x 3 x 4, or N x 4 x 4 with the last row 0 0 0 1, float32 or float64. Errors
/// name the file and the index of the transform.
pub(crate) fn read(file: &SourceFile) -> Checked<Vec<Transform>> {
    let bytes = file.bytes().map_err(|error| error.to_string())?;
    parse(&bytes).map_err(|what| format!("{}: {}", file.path.display(), short_line(&what)))
}

fn parse(mut bytes: &[u8]) -> Checked<Vec<Transform>> {
    let header = npy::read_header(&mut bytes, RULE)?;
    let dtype = header.dtype().descr();
    let (n, n_rows) = match *header.shape() {
        [n, rows @ (3 | 4), 4] => (n, rows as usize),
        ref shape => return Err(format!("has the shape {shape:?}: {RULE}")),
    };
    if header.order() != Order::C {
        return Err(format!("is in Fortran order, not as of `numpy.ascontiguousarray`: {RULE}"));
    }
    let n_bytes_of_one = (4 * n_rows * if dtype.contains("f8") { 8 } else { 4 }) as u64;
    let n_held = bytes.len() as u64 / n_bytes_of_one;
    if n_held < n {
        return Err(format!("ends after {n_held} of {n} instances"));
    }
    let n_bytes = n.saturating_mul((2 * size_of::<[f64; 16]>() + size_of::<Transform>()) as u64);
    require("reading instances", n_bytes)?;
    let file = NpyFile::with_header(header, bytes);
    let unreadable = |e: std::io::Error| e.to_string();
    let numbers: Vec<f64> = match dtype.as_str() {
        "'<f8'" | "'>f8'" => file.into_vec().map_err(unreadable)?,
        "'<f4'" | "'>f4'" => file.into_vec::<f32>().map_err(unreadable)?.into_iter().map(f64::from).collect(),
        _ => return Err(format!("holds {dtype}, not float32 or float64: {RULE}")),
    };
    let of_instance = |(ix, rows): (usize, &[f64])| {
        if n_rows == 4 && rows[12..] != [0.0, 0.0, 0.0, 1.0] {
            return Err(format!("instance {ix}: the last row of its matrix is not 0 0 0 1"));
        }
        let mut columns = DMat4::IDENTITY.to_cols_array();
        rows[..12].iter().enumerate().for_each(|(place, x)| columns[4 * (place % 4) + place / 4] = *x);
        let matrix = DMat4::from_cols_array(&columns);
        Transform::of_affine(matrix).map_err(|what| format!("instance {ix}: {what}"))
    };
    numbers.chunks_exact(4 * n_rows).enumerate().map(of_instance).collect()
}
