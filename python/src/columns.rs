//! From hits to the columns of results.

use glam::{DVec3, Vec3};
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

/// Rows that one thread writes at a time.
const ROWS_AT_ONCE: usize = 4096;

/// The identifier of a miss.
const INVALID_ID: u32 = u32::MAX;

/// A hit in the terms of the scene.
pub struct Found {
    pub geometry_id: u32,
    pub primitive_id: u32,
    pub uv: [f32; 2],
    pub normal: Vec3,
    pub point: Vec3,
}

impl Found {
    const MISS: Self =
        Self { geometry_id: INVALID_ID, primitive_id: INVALID_ID, uv: [0.0; 2], normal: Vec3::ZERO, point: Vec3::NAN };

    /// Corners are in the order in which the caller has given them, also where a transform mirrors.
    pub fn of(placed: Placed, hit: &Hit) -> Self {
        if hit.triangle_ix == NO_TRIANGLE {
            return Self::MISS;
        }
        let scene = placed.world.scene();
        let origin = scene.origin_of(hit.triangle_ix);
        let Triangle { v0, v1, v2, .. } = scene.triangle(hit.triangle_ix as usize);
        let [a, b, c] = [v0, v1, v2].map(|corner| corner.as_dvec3());
        let across = (b - a).cross(c - a);
        let place = &placed.places[origin.instance_ix as usize];
        let (uv, side) = if place.mirrors { ([hit.v, hit.u], -1.0) } else { ([hit.u, hit.v], 1.0) };
        let point = a + f64::from(hit.u) * (b - a) + f64::from(hit.v) * (c - a);
        Self {
            geometry_id: place.geometry_id,
            primitive_id: origin.face_ix,
            uv,
            normal: (side * across.normalize_or(DVec3::ZERO)).as_vec3(),
            point: point.as_vec3(),
        }
    }
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
        let chunks = self.split_off_chunks(hits.len(), ROWS_AT_ONCE);
        chunks
            .into_par_iter()
            .zip(hits.par_chunks(ROWS_AT_ONCE))
            .for_each(|(chunk, hits)| chunk.write_rows(placed, hits));
    }

    fn write_rows(self, placed: Placed, hits: &[Hit]) {
        let Columns { t, mut geometry_ids, mut primitive_ids, mut uvs, mut normals, mut points } = self;
        t.into_iter().flatten().zip(hits).for_each(|(t, hit)| *t = hit.t);
        let has_ids = geometry_ids.is_some() || primitive_ids.is_some();
        if !(has_ids || uvs.is_some() || normals.is_some() || points.is_some()) {
            return;
        }
        fn set<T>(column: &mut Option<&mut [T]>, row: usize, value: T) {
            if let Some(column) = column {
                column[row] = value;
            }
        }
        for (row, hit) in hits.iter().enumerate() {
            let found = Found::of(placed, hit);
            set(&mut geometry_ids, row, found.geometry_id);
            set(&mut primitive_ids, row, found.primitive_id);
            set(&mut uvs, row, found.uv);
            set(&mut normals, row, found.normal.to_array());
            set(&mut points, row, found.point.to_array());
        }
    }
}
