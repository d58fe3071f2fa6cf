//! Reads rays from a NumPy file, batch by batch.

use std::{
    fs::File,
    io::{self, BufReader, Read, Seek},
    path::{Path, PathBuf},
};

use glam::Vec3;
use npyz::{NpyFile, NpyHeader, NpyReader, Order};

use super::Ray;
use crate::util::text::short_line;

/// Error that says why rays could not be read. It displays as one line.
#[derive(Debug, thiserror::Error)]
#[error("{}: {what}", path.display())]
pub struct RayFileError {
    path: PathBuf,
    what: String,
}

/// Greatest accepted size of a header in bytes. Headers of plain arrays are smaller. The reader allocates as many
/// bytes as the file claims, so the size is checked first.
const MAX_HEADER: u32 = 1024;
/// Deepest accepted nesting of brackets in a header. That of an array of structures is 3, of plain numbers 2. The time
/// in which the reader parses a header grows exponentially with it: 30 take more than ten seconds.
const MAX_NESTING: usize = 4;

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
        let text = read_header(&mut file).map_err(failed)?;
        let header = NpyHeader::from_reader(text.as_slice());
        let header = header.map_err(|e| failed(format!("is no .npy file: {e}")))?;
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

/// Reads the header of a file, from the file's first byte on. Refuses one that is no plain array's before it is parsed:
/// see `MAX_HEADER` and `MAX_NESTING`. Every `.npy` file is longer than 12 bytes. A pipe may deliver them one by one.
fn read_header(file: &mut impl Read) -> Result<Vec<u8>, String> {
    let mut read = |bytes: &mut [u8]| {
        file.read_exact(bytes).map_err(|e| match e.kind() {
            io::ErrorKind::UnexpectedEof => "is no .npy file".to_owned(),
            _ => format!("cannot be read: {e}"),
        })
    };
    let mut header = vec![0; 12];
    read(&mut header)?;
    let (begin, size) = match header[..] {
        [0x93, b'N', b'U', b'M', b'P', b'Y', 1, _, a, b, ..] => (10, u32::from_le_bytes([a, b, 0, 0])),
        [0x93, b'N', b'U', b'M', b'P', b'Y', _, _, a, b, c, d] => (12, u32::from_le_bytes([a, b, c, d])),
        _ => return Err("is no .npy file".to_owned()),
    };
    if size > MAX_HEADER {
        return Err(format!("has a header of {size} bytes: rays are a plain array of float32"));
    }
    header.resize((begin + size as usize).max(12), 0);
    read(&mut header[12..])?;
    if nesting(&header[begin..]) > MAX_NESTING {
        return Err("has a header of nested brackets: rays are a plain array of float32".to_owned());
    }
    Ok(header)
}

/// Returns how deep brackets are nested in a text.
fn nesting(text: &[u8]) -> usize {
    let (mut depth, mut deepest) = (0_usize, 0);
    for byte in text {
        match byte {
            b'(' | b'[' | b'{' => depth += 1,
            b')' | b']' | b'}' => depth = depth.saturating_sub(1),
            _ => {}
        }
        deepest = deepest.max(depth);
    }
    deepest
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
