//! Reads rays or points from a NumPy file, batch by batch.

use std::{
    fs::File,
    io::{self, BufReader, Seek},
    path::{Path, PathBuf},
};

use glam::Vec3;
use npyz::{NpyFile, NpyHeader, NpyReader, Order};

use super::{QueryPoint, Ray};
use crate::util::{npy, text::short_line};

/// Error that says why rays or points could not be read. It displays as one line.
#[derive(Debug, thiserror::Error)]
#[error("{}: {what}", path.display())]
pub struct RayFileError {
    path: PathBuf,
    what: String,
}

/// Reads a `.npy` file of float32, K x 8 (origin, direction, t_min, t_max) or K x 6 (origin, direction; t from 0 to
/// infinity).
pub struct RayReader(Rows);

impl RayReader {
    /// Opens a file and reads its header. A regular file must be large enough for the number of rays in its header.
    /// The size of a pipe is unknown, so it is not checked.
    ///
    /// # Errors
    /// The file cannot be read, or is no `.npy` file of such an array.
    pub fn open(path: &Path) -> Result<Self, RayFileError> {
        Rows::open(path, "rays", [6, 8]).map(Self)
    }

    /// Returns the number of rays in the whole file.
    pub fn n_rays(&self) -> u64 {
        self.0.n_rows
    }

    /// Reads the next rays, at most `most`. Returns none at the end.
    ///
    /// # Errors
    /// The file ends early, or cannot be read.
    pub fn next_batch(&mut self, most: usize) -> Result<Vec<Ray>, RayFileError> {
        self.0.next_batch(most, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, f32::INFINITY], |row| {
            let [ox, oy, oz, dx, dy, dz, t_min, t_max] = row;
            Ray { origin: Vec3::new(ox, oy, oz), t_min, direction: Vec3::new(dx, dy, dz), t_max }
        })
    }
}

/// Reads a `.npy` file of float32, K x 4 (position, greatest distance of the closest point) or K x 3 (position; any
/// distance).
pub struct PointReader(Rows);

impl PointReader {
    /// Opens a file and reads its header, as [`RayReader::open`] does.
    ///
    /// # Errors
    /// The file cannot be read, or is no `.npy` file of such an array.
    pub fn open(path: &Path) -> Result<Self, RayFileError> {
        Rows::open(path, "points", [3, 4]).map(Self)
    }

    /// Returns the number of points in the whole file.
    pub fn n_points(&self) -> u64 {
        self.0.n_rows
    }

    /// Reads the next points, at most `most`. Returns none at the end.
    ///
    /// # Errors
    /// The file ends early, or cannot be read.
    pub fn next_batch(&mut self, most: usize) -> Result<Vec<QueryPoint>, RayFileError> {
        self.0.next_batch(most, [0.0, 0.0, 0.0, f32::INFINITY], |[x, y, z, t_max]| QueryPoint {
            position: Vec3::new(x, y, z),
            t_max,
        })
    }
}

/// The rows of a file, which are one kind of things.
struct Rows {
    path: PathBuf,
    /// What the rows are, in messages.
    noun: &'static str,
    numbers: NpyReader<f32, BufReader<File>>,
    n_columns: usize,
    n_rows: u64,
    n_read: u64,
}

impl Rows {
    /// Opens a file of rows that have one of two numbers of columns.
    fn open(path: &Path, noun: &'static str, widths: [u64; 2]) -> Result<Self, RayFileError> {
        // A parser's message may have several lines, and quotes the file.
        let failed = |what: String| RayFileError { path: path.to_owned(), what: short_line(&what) };
        let unreadable = |e: io::Error| failed(format!("cannot be read: {e}"));
        let file = File::open(path).map_err(unreadable)?;
        let metadata = file.metadata().map_err(unreadable)?;
        if metadata.is_dir() {
            return Err(failed("is a directory".to_owned()));
        }
        let mut file = BufReader::with_capacity(1 << 16, file);
        let wanted = format!("{noun} are a plain array of float32");
        let header = npy::read_header(&mut file, &wanted).map_err(failed)?;
        let (n_rows, n_columns) = check_header(&header, noun, widths).map_err(failed)?;
        if metadata.is_file() {
            let n_bytes = metadata.len().saturating_sub(file.stream_position().map_err(unreadable)?);
            let n_held = n_bytes / (4 * n_columns as u64);
            if n_held < n_rows {
                return Err(failed(format!("ends after {n_held} of {n_rows} {noun}")));
            }
        }
        let numbers = NpyFile::with_header(header, file).data().map_err(|e| failed(e.to_string()))?;
        Ok(Self { path: path.to_owned(), noun, numbers, n_columns, n_rows, n_read: 0 })
    }

    /// Reads the next rows, at most `most`. Columns that the file lacks are those of `defaults`.
    fn next_batch<T, const N: usize>(
        &mut self,
        most: usize,
        defaults: [f32; N],
        of_row: impl Fn([f32; N]) -> T,
    ) -> Result<Vec<T>, RayFileError> {
        let n = (self.n_rows - self.n_read).min(most as u64) as usize;
        let mut rows = Vec::with_capacity(n);
        for _ in 0..n {
            let row = self.next_row(defaults).map_err(|e| self.broken_off(&e))?;
            rows.push(of_row(row));
            self.n_read += 1;
        }
        Ok(rows)
    }

    fn next_row<const N: usize>(&mut self, mut row: [f32; N]) -> io::Result<[f32; N]> {
        for number in &mut row[..self.n_columns] {
            *number = self.numbers.next().ok_or(io::ErrorKind::UnexpectedEof)??;
        }
        Ok(row)
    }

    fn broken_off(&self, error: &io::Error) -> RayFileError {
        let what = match error.kind() {
            io::ErrorKind::UnexpectedEof => format!("ends after {} of {} {}", self.n_read, self.n_rows, self.noun),
            _ => format!("cannot be read: {error}"),
        };
        RayFileError { path: self.path.clone(), what }
    }
}

/// Returns the numbers of rows and of columns of an array. `noun`: what the rows are.
fn check_header(header: &NpyHeader, noun: &str, widths: [u64; 2]) -> Result<(u64, usize), String> {
    let dtype = header.dtype().descr();
    if !matches!(dtype.as_str(), "'<f4'" | "'>f4'") {
        return Err(format!("holds {dtype}: {noun} are float32, as of `{noun}.astype(numpy.float32)`"));
    }
    let (n_rows, n_columns) = match header.shape() {
        [n_rows, n_columns] if widths.contains(n_columns) => (*n_rows, *n_columns),
        shape => return Err(format!("has the shape {shape:?}: {noun} are K x {} or K x {}", widths[0], widths[1])),
    };
    if header.order() != Order::C {
        return Err(format!("is in Fortran order: {noun} are rows, as of `numpy.ascontiguousarray({noun})`"));
    }
    // npyz counts the array's numbers in 64 bits.
    if n_rows.checked_mul(n_columns).is_none() {
        return Err(format!("has {n_rows} {noun}: too many"));
    }
    Ok((n_rows, n_columns as usize))
}
