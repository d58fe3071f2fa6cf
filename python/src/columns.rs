//! From hits to the columns of results.

use glam::{DVec3, Vec3};
use kdray::{
    cast::{Hit, NO_TRIANGLE},
    layout::Triangle,
};
use rayon::prelude::*;

use super::state::Ready;

/// Where results go, one row per hit.
pub struct Columns<'a> {
    /// t of rays, distances of points.
    pub t: &'a mut [f32],
    pub geometry_ids: &'a mut [u32],
    pub primitive_ids: &'a mut [u32],
    pub uvs: &'a mut [[f32; 2]],
    pub normals: &'a mut [[f32; 3]],
}

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
    pub fn of(ready: &Ready, hit: &Hit) -> Self {
        if hit.triangle_ix == NO_TRIANGLE {
            return Self::MISS;
        }
        let scene = ready.world.scene();
        let origin = scene.origin_of(hit.triangle_ix);
        let Triangle { v0, v1, v2, .. } = scene.triangle(hit.triangle_ix as usize);
        let [a, b, c] = [v0, v1, v2].map(|corner| corner.as_dvec3());
        let across = (b - a).cross(c - a);
        let place = &ready.places[origin.instance_ix as usize];
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
        fn first<'a, T>(column: &mut &'a mut [T], n: usize) -> &'a mut [T] {
            column.split_off_mut(..n).expect("a row for each ray")
        }
        Columns {
            t: first(&mut self.t, n),
            geometry_ids: first(&mut self.geometry_ids, n),
            primitive_ids: first(&mut self.primitive_ids, n),
            uvs: first(&mut self.uvs, n),
            normals: first(&mut self.normals, n),
        }
    }

    /// Writes hits, one per row.
    pub fn write(self, ready: &Ready, hits: &[Hit]) {
        let Columns { t, geometry_ids, primitive_ids, uvs, normals } = self;
        t.iter_mut().zip(hits).for_each(|(t, hit)| *t = hit.t);
        let rows = geometry_ids.par_iter_mut().zip(primitive_ids).zip(uvs).zip(normals).zip(hits);
        rows.with_min_len(1024).for_each(|((((geometry_id, primitive_id), uv), normal), hit)| {
            let found = Found::of(ready, hit);
            (*geometry_id, *primitive_id) = (found.geometry_id, found.primitive_id);
            (*uv, *normal) = (found.uv, found.normal.to_array());
        });
    }
}
