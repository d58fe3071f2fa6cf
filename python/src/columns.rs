//! From hits to the columns of results.

use std::sync::{
    OnceLock,
    atomic::{AtomicUsize, Ordering},
};

use glam::DVec3;
use kdray::{
    cast::{Hit, NO_TRIANGLE},
    layout::Triangle,
};
use rayon::prelude::*;

use super::state::Placed;

/// Where results go, one row per hit. What nobody asks for is `None`.
#[derive(Default)]
pub struct Columns<'a> {
    /// t of rays, distances of points.
    pub t: Option<&'a mut [f32]>,
    pub geometry_ids: Option<&'a mut [u32]>,
    pub primitive_ids: Option<&'a mut [u32]>,
    pub uvs: Option<&'a mut [[f32; 2]]>,
    pub normals: Option<&'a mut [[f32; 3]]>,
    pub points: Option<&'a mut [[f32; 3]]>,
}

/// Rows whose faces are looked up at a time, before they are written column by column.
const ROWS_AT_ONCE: usize = 256;
/// Rows that one thread writes at a time.
const ROWS_PER_TASK: usize = 4096;

/// The most triangles of a table of faces: 1 GiB.
const MOST_FACES: usize = 1 << 25;

/// The identifier of a miss.
const INVALID_ID: u32 = u32::MAX;

/// A triangle in the terms of the scene. Half a cache line has all of it.
#[derive(Clone, Copy)]
#[repr(align(32))]
pub struct Face {
    pub geometry_id: u32,
    pub primitive_id: u32,
    normal: [f32; 3],
    mirrors: bool,
}

impl Face {
    const MISS: Self = Self { geometry_id: INVALID_ID, primitive_id: INVALID_ID, normal: [0.0; 3], mirrors: false };

    /// The normal is that of corners in the order in which the caller has given them, also where a transform mirrors.
    pub fn of(placed: Placed, triangle_ix: u32) -> Self {
        if triangle_ix == NO_TRIANGLE {
            return Self::MISS;
        }
        let origin = placed.world.scene().origin_of(triangle_ix);
        let [a, b, c] = corners(placed, triangle_ix);
        let across = (b - a).cross(c - a);
        let place = &placed.places[origin.instance_ix as usize];
        let side = if place.mirrors { -1.0 } else { 1.0 };
        Self {
            geometry_id: place.geometry_id,
            primitive_id: origin.face_ix,
            normal: (side * across.normalize_or(DVec3::ZERO)).as_vec3().to_array(),
            mirrors: place.mirrors,
        }
    }

    /// The weights of a hit, in the order of the caller's corners.
    pub fn uv(&self, hit: &Hit) -> [f32; 2] {
        if self.mirrors { [hit.v, hit.u] } else { [hit.u, hit.v] }
    }
}

/// The faces of all triangles of a world, made when so many rays have been cast that it pays: the scene's own
/// arrays take several cache lines for each hit. Triangles of instances have a face for each instance.
#[derive(Default)]
pub struct FaceTable {
    faces: OnceLock<Vec<Face>>,
    n_looked_up: AtomicUsize,
}

impl FaceTable {
    /// Makes the table if, with `n_hits` more rays, it pays. `placed`: the world of this table.
    pub fn expect(&self, placed: Placed, n_hits: usize) {
        let n_looked_up = self.n_looked_up.fetch_add(n_hits, Ordering::Relaxed).saturating_add(n_hits);
        let n_triangles = placed.world.scene().n_triangles();
        if self.faces.get().is_none() && n_triangles <= n_looked_up.min(MOST_FACES) {
            let face = |ix| Face::of(placed, ix);
            let faces = (0..n_triangles as u32).into_par_iter().with_min_len(4096).map(face).collect();
            // `get_or_init` could make a thread of rayon wait for itself.
            drop(self.faces.set(faces));
        }
    }
}

fn corners(placed: Placed, triangle_ix: u32) -> [DVec3; 3] {
    let Triangle { v0, v1, v2, .. } = placed.world.scene().triangle(triangle_ix as usize);
    [v0, v1, v2].map(|corner| corner.as_dvec3())
}

/// Returns the point of a hit, NaN for a miss.
fn point(placed: Placed, hit: &Hit) -> [f32; 3] {
    if hit.triangle_ix == NO_TRIANGLE {
        return [f32::NAN; 3];
    }
    let [a, b, c] = corners(placed, hit.triangle_ix);
    let point = a + f64::from(hit.u) * (b - a) + f64::from(hit.v) * (c - a);
    point.as_vec3().to_array()
}

impl<'a> Columns<'a> {
    /// Cuts the first `n` rows off.
    pub fn split_off(&mut self, n: usize) -> Columns<'a> {
        fn first<'a, T>(column: &mut Option<&'a mut [T]>, n: usize) -> Option<&'a mut [T]> {
            column.as_mut().map(|column| column.split_off_mut(..n).expect("a row for each hit"))
        }
        Columns {
            t: first(&mut self.t, n),
            geometry_ids: first(&mut self.geometry_ids, n),
            primitive_ids: first(&mut self.primitive_ids, n),
            uvs: first(&mut self.uvs, n),
            normals: first(&mut self.normals, n),
            points: first(&mut self.points, n),
        }
    }

    /// Cuts the first `n` rows off, in chunks of `len` and a rest.
    pub fn split_off_chunks(&mut self, n: usize, len: usize) -> Vec<Columns<'a>> {
        (0..n).step_by(len).map(|first| self.split_off(len.min(n - first))).collect()
    }

    /// Writes hits, one per row.
    pub fn write(mut self, placed: Placed, hits: &[Hit]) {
        let chunks = self.split_off_chunks(hits.len(), ROWS_PER_TASK);
        let chunks = chunks.into_par_iter().zip(hits.par_chunks(ROWS_PER_TASK));
        chunks.for_each(|(chunk, hits)| chunk.write_rows(placed, hits));
    }

    /// Whether the columns tell which triangles were hit.
    pub fn have_faces(&self) -> bool {
        self.geometry_ids.is_some() || self.primitive_ids.is_some() || self.uvs.is_some() || self.normals.is_some()
    }

    /// Whether there are no columns but that of t.
    pub fn are_bare(&self) -> bool {
        !self.have_faces() && self.points.is_none()
    }

    /// Writes the column of t, which is the only one.
    pub fn write_bare(self, ts: &[f32]) {
        if let Some(column) = self.t {
            column.copy_from_slice(ts);
        }
    }

    /// Writes hits as [`Columns::write`] does, on this thread alone.
    pub fn write_rows(mut self, placed: Placed, hits: &[Hit]) {
        if let Some(column) = self.t.take() {
            column.iter_mut().zip(hits).for_each(|(t, hit)| *t = hit.t);
        }
        if let Some(column) = self.points.take() {
            column.iter_mut().zip(hits).for_each(|(to, hit)| *to = point(placed, hit));
        }
        if !self.have_faces() {
            return;
        }
        let mut faces = [Face::MISS; ROWS_AT_ONCE];
        for hits in hits.chunks(ROWS_AT_ONCE) {
            let faces = &mut faces[..hits.len()];
            placed.look_up(hits, faces);
            self.split_off(hits.len()).write_faces(hits, faces);
        }
    }

    fn write_faces(self, hits: &[Hit], faces: &[Face]) {
        if let Some(column) = self.geometry_ids {
            column.iter_mut().zip(faces).for_each(|(to, face)| *to = face.geometry_id);
        }
        if let Some(column) = self.primitive_ids {
            column.iter_mut().zip(faces).for_each(|(to, face)| *to = face.primitive_id);
        }
        if let Some(column) = self.uvs {
            column.iter_mut().zip(faces.iter().zip(hits)).for_each(|(to, (face, hit))| *to = face.uv(hit));
        }
        if let Some(column) = self.normals {
            column.iter_mut().zip(faces).for_each(|(to, face)| *to = face.normal);
        }
    }
}

impl Placed<'_> {
    /// Sets the faces of hits.
    fn look_up(self, hits: &[Hit], faces: &mut [Face]) {
        match self.table.faces.get() {
            Some(all) => faces.iter_mut().zip(hits).for_each(|(face, hit)| {
                // The index of a miss is greater than all others.
                *face = *all.get(hit.triangle_ix as usize).unwrap_or(&Face::MISS);
            }),
            None => faces.iter_mut().zip(hits).for_each(|(face, hit)| *face = Face::of(self, hit.triangle_ix)),
        }
    }
}
