//! The class `Core`: a scene behind a lock.

use std::{
    mem, ops,
    sync::{Mutex, MutexGuard, PoisonError},
    thread::{self, ThreadId},
};

use bytemuck::{Zeroable, cast_slice};
use glam::{DMat4, DVec3, DVec4, Vec3};
use kdray::{
    accel::Query,
    cast::{Hit, QueryPoint, RAYS_PER_CHUNK, Ray, StreamHit},
    engine::Caster,
};
use numpy::{
    IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyReadwriteArray1, PyReadwriteArray2,
    PyUntypedArrayMethods,
};
use pyo3::{exceptions::PyRuntimeError, prelude::*};
use rayon::prelude::*;

use super::{
    columns::{Columns, Face},
    process::{Selector, check_fork, engine, failed, is_forked, name_of, pool},
    state::{Placed, State},
    watched::watched,
};

/// Rays that are cast between two looks at Ctrl-C, by a GPU or by others: some tenths of a second, or a second of rays
/// that take long.
const RAYS_AT_ONCE: [usize; 2] = [1 << 25, 1 << 18];
/// The same number of queries that take longer.
const QUERIES_AT_ONCE: [usize; 2] = [1 << 20, 1 << 16];

/// Calls of up to so many queries are cast by the calling thread. The library does not divide so few among threads, and
/// to hand a single ray over to a pool takes several times as long as to cast it.
const FEW: usize = 64;

/// The number of rays for which `build` chooses the structure, since it does not know how many will follow.
const RAYS_TO_BUILD_FOR: usize = 1 << 23;

/// A scene. Arrays are C-contiguous and of the stated types: `kdray/scene.py` sees to it.
#[pyclass(frozen, module = "kdray._kdray")]
pub struct Core {
    /// `None` after the scene was closed.
    state: Mutex<Option<State>>,
    /// The thread that has locked the state.
    owner: Mutex<Option<ThreadId>>,
    device_name: String,
}

/// t, geometry_ids, primitive_ids, uvs, normals, points.
type Outputs<'py> = (
    Option<PyReadwriteArray1<'py, f32>>,
    Option<PyReadwriteArray1<'py, u32>>,
    Option<PyReadwriteArray1<'py, u32>>,
    Option<PyReadwriteArray2<'py, f32>>,
    Option<PyReadwriteArray2<'py, f32>>,
    Option<PyReadwriteArray2<'py, f32>>,
);

/// Of a geometry: vertices (N, 3), triangles (M, 3) and transform (3, 4), which are flat, and the mask.
type GeometryArrays<'py> = (Bound<'py, PyArray1<f32>>, Bound<'py, PyArray1<u32>>, Bound<'py, PyArray1<f64>>, u8);

/// ray_splits, ray_ids, t_hit, geometry_ids, primitive_ids, uvs.
type Lists<'py> = (
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray1<f32>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray1<f32>>,
);

/// Rays as Python hands them over.
struct Rows<'a> {
    rows: &'a [f32],
    /// 6 or 8.
    width: usize,
    t_min: &'a [f32],
    t_max: &'a [f32],
}

/// t_min and t_max: one for all rays, or one for each.
type Range<'py> = (PyReadonlyArray1<'py, f32>, PyReadonlyArray1<'py, f32>);

impl<'a> Rows<'a> {
    fn new(rays: &'a PyReadonlyArray2<f32>, (t_min, t_max): &'a Range) -> PyResult<Self> {
        let (t_min, t_max) = (t_min.as_slice()?, t_max.as_slice()?);
        Ok(Self { width: rays.shape()[1], rows: rays.as_slice()?, t_min, t_max })
    }

    fn len(&self) -> usize {
        self.rows.len() / self.width
    }

    /// Returns the rays if they are origins and directions alone, whose t are from 0 to infinity.
    fn bare(&self) -> Option<&'a [[f32; 6]]> {
        let is_bare = self.width == 6 && self.t_min == [0.0] && self.t_max == [f32::INFINITY];
        is_bare.then_some(self.rows.as_chunks().0)
    }

    /// Casts a range of the rays, and hands chunks of their hits to `take`.
    fn cast<H: StreamHit>(
        &self,
        caster: &mut Caster,
        range: ops::Range<usize>,
        query: Query,
        take: impl Fn(usize, &[H]) + Sync,
    ) -> PyResult<()> {
        let n = range.len();
        match self.bare() {
            Some(rows) => {
                let make = |begin: usize, rays: &mut [[f32; 6]]| {
                    rays.copy_from_slice(&rows[range.start + begin..][..rays.len()]);
                };
                caster.cast_stream(n, query, make, take)
            }
            None => {
                let make = |begin: usize, rays: &mut [Ray]| self.write(range.start + begin, rays);
                caster.cast_stream(n, query, make, take)
            }
        }
        .map_err(failed)
    }

    /// Writes the rays from `first` on, in order.
    fn write(&self, first: usize, rays: &mut [Ray]) {
        let rows = &self.rows[first * self.width..][..rays.len() * self.width];
        let ray = |row: &[f32; 6], t_min, t_max| {
            let [x, y, z, dx, dy, dz] = *row;
            Ray { origin: Vec3::new(x, y, z), t_min, direction: Vec3::new(dx, dy, dz), t_max }
        };
        if self.width == 8 {
            let rows = rows.as_chunks::<8>().0;
            rays.iter_mut().zip(rows).for_each(|(to, [row @ .., t_min, t_max])| *to = ray(row, *t_min, *t_max));
            return;
        }
        let rows = rays.iter_mut().zip(rows.as_chunks::<6>().0);
        if let ([t_min], [t_max]) = (self.t_min, self.t_max) {
            rows.for_each(|(to, row)| *to = ray(row, *t_min, *t_max));
            return;
        }
        let at = |values: &[f32], ix: usize| if values.len() == 1 { values[0] } else { values[ix] };
        for (ix, (to, row)) in (first..).zip(rows) {
            *to = ray(row, at(self.t_min, ix), at(self.t_max, ix));
        }
    }

    /// Returns the rays of a range.
    fn rays(&self, range: ops::Range<usize>) -> Vec<Ray> {
        let mut rays = vec![Ray::zeroed(); range.len()];
        let chunks = rays.par_chunks_mut(RAYS_PER_CHUNK).enumerate();
        chunks.for_each(|(ix, rays)| self.write(range.start + ix * RAYS_PER_CHUNK, rays));
        rays
    }
}

impl Drop for Core {
    /// A forked child has neither the threads nor the device that would be waited for.
    fn drop(&mut self) {
        if is_forked() {
            // The lock may be held by a thread that the child does not have.
            mem::forget(self.state.get_mut().unwrap_or_else(PoisonError::into_inner).take());
        }
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Names the owner of a lock, until it is dropped.
struct Owned<'a>(&'a Mutex<Option<ThreadId>>);

impl<'a> Owned<'a> {
    fn new(owner: &'a Mutex<Option<ThreadId>>, caller: ThreadId) -> Self {
        *locked(owner) = Some(caller);
        Self(owner)
    }
}

impl Drop for Owned<'_> {
    fn drop(&mut self) {
        *locked(self.0) = None;
    }
}

impl Core {
    /// Calls `f` with the scene, or with none if the scene is closed. No other thread uses it meanwhile, and the GIL is
    /// released.
    fn locked<T: Send>(&self, py: Python, f: impl FnOnce(&mut Option<State>) -> PyResult<T> + Send) -> PyResult<T> {
        check_fork()?;
        let caller = thread::current().id();
        // Between chunks, Python may run handlers of signals and finalizers.
        if *locked(&self.owner) == Some(caller) {
            return Err(PyRuntimeError::new_err("the scene is in use by a call that this one interrupts"));
        }
        py.detach(|| {
            let mut state = locked(&self.state);
            let _owned = Owned::new(&self.owner, caller);
            f(&mut state)
        })
    }

    fn with<T: Send>(&self, py: Python, f: impl FnOnce(&mut State) -> PyResult<T> + Send) -> PyResult<T> {
        let closed = || PyRuntimeError::new_err("the scene is closed");
        self.locked(py, |state| f(state.as_mut().ok_or_else(closed)?))
    }

    /// Does the same on a pool of threads. The lock is taken first: a thread of the pool that waited for it could be
    /// the one whose help the owner of the lock needs.
    fn with_threads<T: Send>(
        &self,
        py: Python,
        n_threads: usize,
        f: impl FnOnce(&mut State) -> PyResult<T> + Send,
    ) -> PyResult<T> {
        let pool = pool(n_threads)?;
        self.with(py, |state| pool.install(|| f(state)))
    }

    /// Sees to what casts `n` queries, and calls `chunk` on a pool of threads for each `at_once` of them: the first
    /// number is for GPUs, the second for others. In between, the caller's own thread lets Python raise
    /// KeyboardInterrupt. If the queries are few and the CPU's caster has been made, that thread calls `chunk` itself.
    fn in_chunks(
        &self,
        py: Python,
        (n, at_once): (usize, [usize; 2]),
        (mask, n_threads): (u8, usize),
        mut chunk: impl FnMut(ops::Range<usize>, (&mut Caster<'static>, Placed)) -> PyResult<()> + Send,
    ) -> PyResult<()> {
        let pool = pool(n_threads)?;
        self.with(py, |state| {
            if n > 0 && !state.is_built() {
                watched(&pool, |progress| state.prepare(n, progress), |_| Ok(()))?;
            }
            if (1..=FEW).contains(&n) && state.cpu_is_ready(n) {
                return chunk(0..n, state.caster(n, mask)?);
            }
            let at_once = at_once[usize::from(!state.has_gpu())];
            for first in (0..n).step_by(at_once) {
                if first > 0 {
                    Python::attach(|py| py.check_signals())?;
                }
                pool.install(|| chunk(first..n.min(first + at_once), state.caster(n, mask)?))?;
            }
            Ok(())
        })
    }
}

#[pymethods]
impl Core {
    /// Opens a device, or uses the CPU if there is no selector.
    #[new]
    fn new(py: Python, device: Option<Selector>) -> PyResult<Self> {
        let engine = engine(py, device)?;
        let device_name = name_of(&engine);
        Ok(Self { state: Mutex::new(Some(State::new(engine))), owner: Mutex::default(), device_name })
    }

    /// The name of the device, or "cpu".
    #[getter]
    fn device_name(&self) -> &str {
        &self.device_name
    }

    /// Frees everything. A second call does nothing.
    fn close(&self, py: Python) -> PyResult<()> {
        self.locked(py, |state| {
            *state = None;
            Ok(())
        })
    }

    /// Adds a geometry, and returns its id. `vertices`: (N, 3), `faces`: (M, 3).
    fn add(
        &self,
        py: Python,
        vertices: PyReadonlyArray2<f32>,
        faces: PyReadonlyArray2<u32>,
        mask: u8,
    ) -> PyResult<u32> {
        let vertices = vec3s(vertices.as_slice()?);
        let faces = cast_slice(faces.as_slice()?).to_vec();
        self.with_threads(py, 0, |state| state.add(vertices, faces, mask))
    }

    /// Uses up an id.
    fn add_removed(&self, py: Python) -> PyResult<()> {
        self.with(py, |state| {
            state.add_removed();
            Ok(())
        })
    }

    fn remove(&self, py: Python, id: u32) -> PyResult<()> {
        self.with(py, |state| state.remove(id))
    }

    fn set_vertices(&self, py: Python, id: u32, first: usize, vertices: PyReadonlyArray2<f32>) -> PyResult<()> {
        let vertices = vec3s(vertices.as_slice()?);
        self.with_threads(py, 0, |state| state.set_vertices(id, first, &vertices))
    }

    /// `transforms`: (N, 3, 4).
    fn set_transforms(
        &self,
        py: Python,
        ids: PyReadonlyArray1<u32>,
        transforms: PyReadonlyArray3<f64>,
    ) -> PyResult<()> {
        let (ids, transforms) = (ids.as_slice()?, transforms.as_slice()?);
        let transforms: Vec<_> = transforms.chunks_exact(12).map(matrix).collect();
        self.with(py, |state| state.set_transforms(ids, &transforms))
    }

    fn set_masks(&self, py: Python, ids: PyReadonlyArray1<u32>, masks: PyReadonlyArray1<u8>) -> PyResult<()> {
        let (ids, masks) = (ids.as_slice()?, masks.as_slice()?);
        self.with(py, |state| state.set_masks(ids, masks))
    }

    /// The number of ids that were given out.
    fn n_ids(&self, py: Python) -> PyResult<usize> {
        self.with(py, |state| Ok(state.n_ids()))
    }

    /// Builds what the next query needs, and calls `progress` with the share that is done.
    fn build(&self, py: Python, n_threads: usize, progress: Option<Py<PyAny>>) -> PyResult<()> {
        let pool = pool(n_threads)?;
        let tell = |share: f32| match &progress {
            Some(progress) => Python::attach(|py| progress.call1(py, (share,))).map(|_| ()),
            None => Ok(()),
        };
        self.with(py, |state| {
            let n = RAYS_TO_BUILD_FOR;
            watched(&pool, |progress| state.prepare(n, progress), tell)?;
            pool.install(|| state.caster(n, u8::MAX).map(|_| ()))?;
            tell(1.0)
        })
    }

    /// Whether the next query builds nothing. For tests.
    fn is_built(&self, py: Python) -> PyResult<bool> {
        self.with(py, |state| Ok(state.is_built()))
    }

    /// The addresses of the structures of geometries: what has not changed keeps its own. For tests.
    fn structures(&self, py: Python) -> PyResult<Vec<usize>> {
        self.with(py, |state| Ok(state.structures()))
    }

    /// A geometry, or None where one was removed.
    fn geometry<'py>(&self, py: Python<'py>, id: u32) -> PyResult<Option<GeometryArrays<'py>>> {
        let geometry = self.with(py, |state| Ok(state.geometry(id).cloned()))?;
        Ok(geometry.map(|geometry| {
            let rows = geometry.transform.transpose().to_cols_array();
            let vertices: Vec<f32> = geometry.vertices.iter().flat_map(|vertex| vertex.to_array()).collect();
            let faces = geometry.faces.into_flattened();
            let transform = rows[..12].to_vec().into_pyarray(py);
            (vertices.into_pyarray(py), faces.into_pyarray(py), transform, geometry.mask)
        }))
    }

    /// Casts rays, and writes their nearest hits into `outputs`.
    fn cast(
        &self,
        py: Python,
        rays: PyReadonlyArray2<f32>,
        range: Range,
        mask: u8,
        n_threads: usize,
        mut outputs: Outputs,
    ) -> PyResult<()> {
        let rows = Rows::new(&rays, &range)?;
        let mut columns = columns_of(&mut outputs)?;
        self.in_chunks(py, (rows.len(), RAYS_AT_ONCE), (mask, n_threads), |range, (caster, placed)| {
            // The calling thread casts few queries alone, and many threads make the table.
            if columns.have_faces() && range.len() > FEW {
                placed.table.expect(placed, range.len());
            }
            let chunks = columns.split_off_chunks(range.len(), RAYS_PER_CHUNK);
            let chunks: Vec<_> = chunks.into_iter().map(|chunk| Mutex::new(Some(chunk))).collect();
            let chunk_at =
                |begin: usize| locked(&chunks[begin / RAYS_PER_CHUNK]).take().expect("each chunk is taken once");
            if columns.are_bare() {
                let take = |begin: usize, ts: &[f32]| chunk_at(begin).write_bare(ts);
                return rows.cast(caster, range, Query::Closest, take);
            }
            let take = |begin: usize, hits: &[Hit]| chunk_at(begin).write_rows(placed, hits);
            rows.cast(caster, range, Query::Closest, take)
        })
    }

    /// Tells of each ray whether it hits anything.
    fn occluded(
        &self,
        py: Python,
        rays: PyReadonlyArray2<f32>,
        range: Range,
        mask: u8,
        n_threads: usize,
        mut output: PyReadwriteArray1<bool>,
    ) -> PyResult<()> {
        let rows = Rows::new(&rays, &range)?;
        let output = output.as_slice_mut()?;
        self.in_chunks(py, (rows.len(), RAYS_AT_ONCE), (mask, n_threads), |range, (caster, _)| {
            let chunks: Vec<_> = output[range.clone()].chunks_mut(RAYS_PER_CHUNK).map(Mutex::new).collect();
            let take = |begin: usize, ts: &[f32]| {
                let mut chunk = locked(&chunks[begin / RAYS_PER_CHUNK]);
                chunk.iter_mut().zip(ts).for_each(|(out, t)| *out = *t < f32::INFINITY);
            };
            rows.cast(caster, range, Query::Any, take)
        })
    }

    /// Counts the hits of rays.
    fn count(
        &self,
        py: Python,
        rays: PyReadonlyArray2<f32>,
        range: Range,
        mask: u8,
        n_threads: usize,
        mut output: PyReadwriteArray1<i32>,
    ) -> PyResult<()> {
        let rows = Rows::new(&rays, &range)?;
        let output = output.as_slice_mut()?;
        self.in_chunks(py, (rows.len(), QUERIES_AT_ONCE), (mask, n_threads), |range, (caster, _)| {
            let counts = caster.count_hits(&rows.rays(range.clone())).map_err(failed)?;
            output[range].iter_mut().zip(&counts).for_each(|(out, count)| *out = *count as i32);
            Ok(())
        })
    }

    /// Lists the hits of rays: ray_splits, ray_ids, t_hit, geometry_ids, primitive_ids, uvs (flat).
    fn list<'py>(
        &self,
        py: Python<'py>,
        rays: PyReadonlyArray2<f32>,
        range: Range,
        mask: u8,
        most_per_ray: Option<u32>,
        n_threads: usize,
    ) -> PyResult<Lists<'py>> {
        let rows = Rows::new(&rays, &range)?;
        let (mut splits, mut ray_ids, mut t_hit) = (vec![0_u32], Vec::new(), Vec::new());
        let (mut geometry_ids, mut primitive_ids, mut uvs) = (Vec::new(), Vec::new(), Vec::new());
        self.in_chunks(py, (rows.len(), QUERIES_AT_ONCE), (mask, n_threads), |range, (caster, placed)| {
            let all = caster.all_hits(&rows.rays(range.clone()), most_per_ray).map_err(failed)?;
            let before = t_hit.len() as u64;
            if before + all.hits.len() as u64 > u64::from(u32::MAX) {
                return Err(PyRuntimeError::new_err("rays: there are more than 2^32 - 1 hits"));
            }
            splits.extend(all.ray_splits[1..].iter().map(|end| (before + end) as u32));
            for (ix, ends) in range.zip(all.ray_splits.windows(2)) {
                ray_ids.extend((ends[0]..ends[1]).map(|_| ix as u32));
            }
            let face = |hit: &Hit| Face::of(placed, hit.triangle_ix);
            let hits_per_task = if all.ray_splits.len() <= FEW + 1 { usize::MAX } else { 1024 };
            let faces: Vec<_> = all.hits.par_iter().with_min_len(hits_per_task).map(face).collect();
            t_hit.extend(all.hits.iter().map(|hit| hit.t));
            geometry_ids.extend(faces.iter().map(|face| face.geometry_id));
            primitive_ids.extend(faces.iter().map(|face| face.primitive_id));
            uvs.extend(faces.iter().zip(&all.hits).flat_map(|(face, hit)| face.uv(hit)));
            Ok(())
        })?;
        Ok((
            splits.into_pyarray(py),
            ray_ids.into_pyarray(py),
            t_hit.into_pyarray(py),
            geometry_ids.into_pyarray(py),
            primitive_ids.into_pyarray(py),
            uvs.into_pyarray(py),
        ))
    }

    /// Finds the closest points of (N, 3) points.
    fn closest(
        &self,
        py: Python,
        points: PyReadonlyArray2<f32>,
        mask: u8,
        n_threads: usize,
        mut outputs: Outputs,
    ) -> PyResult<()> {
        let points: &[[f32; 3]] = cast_slice(points.as_slice()?);
        let mut columns = columns_of(&mut outputs)?;
        self.in_chunks(py, (points.len(), QUERIES_AT_ONCE), (mask, n_threads), |range, (caster, placed)| {
            let query = |p: &[f32; 3]| QueryPoint { position: Vec3::from(*p), t_max: f32::INFINITY };
            let queries: Vec<_> = points[range].par_iter().with_min_len(1024).map(query).collect();
            let hits = caster.closest_points(&queries, 1).map_err(failed)?.hits;
            columns.split_off(hits.len()).write(placed, &hits);
            Ok(())
        })
    }
}

fn columns_of<'a>((t, geometry_ids, primitive_ids, uvs, normals, points): &'a mut Outputs) -> PyResult<Columns<'a>> {
    fn rows<'a, T: numpy::Element, const N: usize>(
        column: &'a mut Option<PyReadwriteArray2<T>>,
    ) -> PyResult<Option<&'a mut [[T; N]]>> {
        let rows = column.as_mut().map(PyReadwriteArray2::as_slice_mut).transpose()?;
        Ok(rows.map(|rows| rows.as_chunks_mut().0))
    }
    Ok(Columns {
        t: t.as_mut().map(PyReadwriteArray1::as_slice_mut).transpose()?,
        geometry_ids: geometry_ids.as_mut().map(PyReadwriteArray1::as_slice_mut).transpose()?,
        primitive_ids: primitive_ids.as_mut().map(PyReadwriteArray1::as_slice_mut).transpose()?,
        uvs: rows(uvs)?,
        normals: rows(normals)?,
        points: rows(points)?,
    })
}

fn vec3s(values: &[f32]) -> Vec<Vec3> {
    values.par_chunks_exact(3).with_min_len(4096).map(Vec3::from_slice).collect()
}

/// Returns the matrix of three rows of four.
fn matrix(rows: &[f64]) -> DMat4 {
    let row = |ix: usize| DVec4::from_slice(&rows[4 * ix..]);
    DMat4::from_cols(row(0), row(1), row(2), DVec3::ZERO.extend(1.0)).transpose()
}
