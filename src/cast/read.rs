//! Reads rays from a NumPy file, batch by batch.

use std::{
    fs::File,
    io::{self, BufReader, Seek},
    path::{Path, PathBuf},
};

use glam::Vec3;
use npyz::{NpyFile, NpyHeader, NpyReader, Order};

use super::Ray;
use crate::util::{npy, text::short_line};

/// Error that says why rays could not be read. It displays as one line.
#[derive(Debug, thiserror::Error)]
#[error("{}: {what}", path.display())]
pub struct RayFileError {
    path: PathBuf,
    what: String,
}

/// Reads a `.npy` file of float32, K x 8 (origin, direction, t_min, t_max) or K x 6 (origin, direction; t from 0 to
/// infinity).
pub struct RayReader {
    path: PathBuf,
    numbers: NpyReader<f32, BufReader<File>>,
    n_columns: usize,
    n_rays: u64,
    n_read: u64,
}

impl RayReader {
    /// Opens a file and reads its header. A regular file must be large enough for the number of rays in its header.
    /// The size of a pipe is unknown, so it is not checked.
    ///
    /// # Errors
    /// The file cannot be read, or is no `.npy` file of such an array.
    pub fn open(path: &Path) -> Result<Self, RayFileError> {
        // A parser's message may have several lines, and quotes the file.
        let failed = |what: String| RayFileError { path: path.to_owned(), what: short_line(&what) };
        let unreadable = |e: io::Error| failed(format!("cannot be read: {e}"));
        let file = File::open(path).map_err(unreadable)?;
        let metadata = file.metadata().map_err(unreadable)?;
        if metadata.is_dir() {
            return Err(failed("is a directory".to_owned()));
        }
        let mut file = BufReader::with_capacity(1 << 16, file);
        let header = npy::read_header(&mut file, "rays are a plain array of float32").map_err(failed)?;
        let (n_rays, n_columns) = check_header(&header).map_err(failed)?;
        if metadata.is_file() {
            let n_bytes = metadata.len().saturating_sub(file.stream_position().map_err(unreadable)?);
            let n_held = n_bytes / (4 * n_columns as u64);
            if n_held < n_rays {
                return Err(failed(format!("ends after {n_held} of {n_rays} rays")));
            }
        }
        let numbers = NpyFile::with_header(header, file).data().map_err(|e| failed(e.to_string()))?;
        Ok(Self { path: path.to_owned(), numbers, n_columns, n_rays, n_read: 0 })
    }

    /// Returns the number of rays in the whole file.
    pub fn n_rays(&self) -> u64 {
        self.n_rays
    }

    /// Reads the next rays, at most `most`. Returns none at the end.
    ///
    /// # Errors
    /// The file ends early, or cannot be read.
    pub fn next_batch(&mut self, most: usize) -> Result<Vec<Ray>, RayFileError> {
        let n = (self.n_rays - self.n_read).min(most as u64) as usize;
        let mut rays = Vec::with_capacity(n);
        for _ in 0..n {
            let ray = self.next_ray().map_err(|e| self.broken_off(&e))?;
            rays.push(ray);
            self.n_read += 1;
        }
        Ok(rays)
    }

    fn next_ray(&mut self) -> io::Result<Ray> {
        let mut row = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, f32::INFINITY];
        for number in &mut row[..self.n_columns] {
            *number = self.numbers.next().ok_or(io::ErrorKind::UnexpectedEof)??;
        }
        let [ox, oy, oz, dx, dy, dz, t_min, t_max] = row;
        Ok(Ray { origin: Vec3::new(ox, oy, oz), t_min, direction: Vec3::new(dx, dy, dz), t_max })
    }

    fn broken_off(&self, error: &io::Error) -> RayFileError {
        let what = match error.kind() {
            io::ErrorKind::UnexpectedEof => format!("ends after {} of {} rays", self.n_read, self.n_rays),
            _ => format!("cannot be read: {error}"),
        };
        RayFileError { path: self.path.clone(), what }
    }
}

/// Returns the numbers of rays and of columns of an array of rays.
fn check_header(header: &NpyHeader) -> Result<(u64, usize), String> {
    let dtype = header.dtype().descr();
    if !matches!(dtype.as_str(), "'<f4'" | "'>f4'") {
        return Err(format!("holds {dtype}: rays are float32, as of `rays.astype(numpy.float32)`"));
    }
    let (n_rays, n_columns) = match header.shape() {
        [n_rays, 6] => (*n_rays, 6),
        [n_rays, 8] => (*n_rays, 8),
        shape => return Err(format!("has the shape {shape:?}: rays are K x 6 or K x 8")),
    };
    if header.order() != Order::C {
        return Err("is in Fortran order: rays are rows, as of `numpy.ascontiguousarray(rays)`".to_owned());
    }
    // npyz counts the array's numbers in 64 bits.
    if n_rays.checked_mul(n_columns as u64).is_none() {
        return Err(format!("has {n_rays} rays: too many"));
    }
    Ok((n_rays, n_columns))
}
