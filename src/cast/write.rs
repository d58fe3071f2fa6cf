//! Writes hits to a NumPy archive, with the names that Open3D's `cast_rays` uses.
//!
//! An archive holds one array after the other, while each hit has a part of every array. So hits are first stored in
//! a spool (a temporary file), which is read again for each array. Memory use is bounded for any number of rays.

use std::{
    fs::File,
    io::{self, BufWriter, Read, Seek, SeekFrom, Write},
    iter,
    marker::PhantomData,
    path::{Path, PathBuf},
};

use bytemuck::Pod;
use npyz::{AutoSerialize, WriteOptions, WriterBuilder};
use tempfile::SpooledTempFile;
use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

use super::{Hit, NO_TRIANGLE};
use crate::{
    accel::Query,
    output::{self, OutputError},
    world::{FlatScene, TriangleOrigin},
};

/// Number of elements that are read from a spool at a time: of hits, 1 MiB.
const ELEMENTS_AT_A_TIME: usize = 1 << 16;

/// Writes a `.npz` file. Until [`HitWriter::finish`], no file is created at its path, and an earlier file stays.
///
/// The arrays for [`Query::Closest`] are `t_hit` (float32 K, infinity on a miss), `instance_ids`, `geometry_ids` and
/// `primitive_ids` (uint32 K, 4294967295 on a miss: the instance, its mesh, and the mesh's face), `primitive_uvs`
/// (float32 K x 2, the weights of the triangle's second and third corner) and `primitive_normals` (float32 K x 3, unit
/// length, zero on a miss). The normal points to the side from which the corners are seen in counter-clockwise order.
/// The array for [`Query::Any`] is `occluded` (bool K).
pub struct HitWriter {
    path: PathBuf,
    hits: Spool<Hit>,
}

impl HitWriter {
    /// Creates a writer with an empty spool.
    ///
    /// # Errors
    /// No file can be written at this path.
    pub fn new(path: &Path) -> Result<Self, OutputError> {
        Ok(Self { path: path.to_owned(), hits: Spool::new(path)? })
    }

    /// Appends the hits of the next rays.
    ///
    /// # Errors
    /// The disk is full, or a write fails.
    pub fn push(&mut self, hits: &[Hit]) -> Result<(), OutputError> {
        self.hits.push(&self.path, hits)
    }

    /// Writes the whole file or nothing, as [`output::write`] does. The hits are of triangles of the
    /// scene.
    ///
    /// # Errors
    /// The disk is full, or a write fails.
    pub fn finish(self, scene: &FlatScene, query: Query) -> Result<(), OutputError> {
        let mut hits = self.hits;
        write_archive(&self.path, |archive| match query {
            Query::Closest => write_hits(archive, &mut hits, scene),
            Query::Any => hits.write(archive, "occluded", |hit| [hit.triangle_ix != NO_TRIANGLE]),
        })
    }
}

/// An archive that is written.
pub(super) type Archive<'a> = ZipWriter<FailsOnce<'a>>;

/// Writes a whole archive or nothing, as [`output::write`] does. `write`: writes its arrays.
pub(super) fn write_archive(
    path: &Path,
    write: impl FnOnce(&mut Archive) -> io::Result<()>,
) -> Result<(), OutputError> {
    output::write_with(path, |file| {
        let mut archive = ZipWriter::new(FailsOnce { file, failed: false });
        write(&mut archive)?;
        archive.finish()?;
        Ok(())
    })
}

/// Writes the arrays of hits.
pub(super) fn write_hits(archive: &mut Archive, hits: &mut Spool<Hit>, scene: &FlatScene) -> io::Result<()> {
    hits.write(archive, "t_hit", |hit| [hit.t])?;
    hits.write(archive, "instance_ids", |hit| id_of(scene, hit, |it| it.instance_ix))?;
    hits.write(archive, "geometry_ids", |hit| id_of(scene, hit, |it| it.mesh_ix))?;
    hits.write(archive, "primitive_ids", |hit| id_of(scene, hit, |it| it.face_ix))?;
    hits.write(archive, "primitive_uvs", |hit| [hit.u, hit.v])?;
    hits.write(archive, "primitive_normals", |hit| normal_at(scene, hit))
}

/// Returns an index that names the hit triangle, or that of no triangle on a miss.
fn id_of(scene: &FlatScene, hit: &Hit, id: impl Fn(TriangleOrigin) -> u32) -> [u32; 1] {
    [if hit.triangle_ix == NO_TRIANGLE { NO_TRIANGLE } else { id(scene.origin_of(hit.triangle_ix)) }]
}

/// Returns the unit normal of the hit triangle by its winding. It is zero on a miss and for a triangle without area.
fn normal_at(scene: &FlatScene, hit: &Hit) -> [f32; 3] {
    if hit.triangle_ix as usize >= scene.n_triangles() {
        return [0.0; 3];
    }
    let triangle = scene.triangle(hit.triangle_ix as usize);
    // In double precision, the squares of the shortest edges do not underflow.
    let [v0, v1, v2] = [triangle.v0, triangle.v1, triangle.v2].map(|v| v.as_dvec3());
    (v1 - v0).cross(v2 - v0).normalize_or_zero().as_vec3().to_array()
}

/// Elements in a temporary file.
pub(super) struct Spool<E> {
    file: SpooledTempFile,
    n: u64,
    elements: PhantomData<E>,
}

impl<E: Pod> Spool<E> {
    /// Creates an empty spool. `path`: that of the file that will be written.
    pub(super) fn new(path: &Path) -> Result<Self, OutputError> {
        Ok(Self { file: output::spool(path)?, n: 0, elements: PhantomData })
    }

    /// Appends elements.
    pub(super) fn push(&mut self, path: &Path, elements: &[E]) -> Result<(), OutputError> {
        self.n += elements.len() as u64;
        let written = self.file.write_all(bytemuck::cast_slice(elements));
        written.map_err(|source| OutputError::Write { path: path.to_owned(), source })
    }

    /// Writes an array of `N` columns, one-dimensional if `N` is 1.
    pub(super) fn write<T: AutoSerialize + npyz::Serialize, const N: usize>(
        &mut self,
        archive: &mut Archive,
        name: &str,
        columns: impl FnMut(&E) -> [T; N],
    ) -> io::Result<()> {
        self.write_after(archive, name, None, columns)
    }

    /// Writes an array as [`Self::write`] does, after a row of its own.
    pub(super) fn write_after<T: AutoSerialize + npyz::Serialize, const N: usize>(
        &mut self,
        archive: &mut Archive,
        name: &str,
        first: Option<[T; N]>,
        mut columns: impl FnMut(&E) -> [T; N],
    ) -> io::Result<()> {
        let n_rows = self.n + u64::from(first.is_some());
        let n_bytes = n_rows * (N * size_of::<T>()) as u64;
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .large_file(n_bytes >= u64::from(u32::MAX) - 1024); // 1024 bytes for the array's header
        archive.start_file(npyz::npz::file_name_from_array_name(name), options)?;
        let mut file = BufWriter::with_capacity(1 << 16, archive);
        let shape = [n_rows, N as u64];
        let shape = if N == 1 { &shape[..1] } else { &shape[..] };
        let mut array = WriteOptions::new().default_dtype().shape(shape).writer(&mut file).begin_nd()?;
        first.iter().flatten().try_for_each(|number| array.push(number))?;
        self.for_each(|element| columns(element).iter().try_for_each(|number| array.push(number)))?;
        array.finish()?;
        file.flush()
    }

    fn for_each(&mut self, mut visit: impl FnMut(&E) -> io::Result<()>) -> io::Result<()> {
        self.file.rewind()?;
        let mut elements: Vec<E> = iter::repeat_n(E::zeroed(), ELEMENTS_AT_A_TIME).collect();
        let mut n_left = self.n;
        while n_left > 0 {
            let n = n_left.min(ELEMENTS_AT_A_TIME as u64) as usize;
            self.file.read_exact(bytemuck::cast_slice_mut(&mut elements[..n]))?;
            elements[..n].iter().try_for_each(&mut visit)?;
            n_left -= n as u64;
        }
        Ok(())
    }
}

/// A file that reports only its first error and discards all later writes. An archive's writer that is dropped after
/// an error writes again, and would print the error of that second write.
pub(super) struct FailsOnce<'a> {
    file: &'a mut File,
    failed: bool,
}

impl Write for FailsOnce<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.failed {
            return Ok(bytes.len());
        }
        let written = self.file.write(bytes);
        self.failed = written.as_ref().is_err_and(|error| error.kind() != io::ErrorKind::Interrupted);
        written
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for FailsOnce<'_> {
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        self.file.seek(position)
    }
}
