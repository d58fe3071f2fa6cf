//! Tests a few rays against all triangles of a scene, without an acceleration structure. Their hits decide about the
//! scene's camera and lights, before the structure is chosen and built.

use glam::Vec3;
use rayon::prelude::*;

use crate::scene::model::{Camera, Instance, Scene};

/// Returns rays of length 1 through the whole picture of a camera: as many across and down.
pub(crate) fn view_rays(camera: &Camera, aspect: f32, (n_across, n_down): (usize, usize)) -> Vec<Ray> {
    let [right, up, forward] = camera.axes();
    let half_height = camera.height_at(1.0) / 2.0;
    let place = |ix: usize, n: usize| (2 * ix + 1) as f32 / n as f32 - 1.0;
    let ray = |ix: usize| {
        let (x, y) = (place(ix % n_across, n_across), place(ix / n_across, n_down));
        let across = half_height * (x * aspect * right + y * up);
        match camera.is_orthographic() {
            true => Ray { origin: camera.eye + across, direction: forward },
            false => Ray { origin: camera.eye, direction: (forward + across).normalize() },
        }
    };
    (0..n_across * n_down).map(ray).collect()
}

/// A ray from t = 0 to infinity.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ray {
    pub origin: Vec3,
    pub direction: Vec3,
}

/// A hit of a ray with a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Hit {
    pub t: f32,
    /// Whether the ray meets the front of the triangle.
    pub is_front: bool,
    /// Index of the instance.
    pub instance_ix: u32,
    /// Index of the face of the instance's mesh.
    pub face_ix: u32,
}

/// The first and the last hit of a ray.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Hits {
    pub first: Option<Hit>,
    pub last: Option<Hit>,
    /// The t of the last hit with the back of a triangle.
    pub last_back: Option<f32>,
}

impl Hits {
    /// Adds a hit. Of hits at the same t, fronts count, so that the order of the hits makes no difference.
    fn add(&mut self, hit: Hit) {
        let replaces = |old: Option<Hit>, sign: f32| {
            old.is_none_or(|old| sign * hit.t < sign * old.t || hit.t == old.t && hit.is_front)
        };
        if replaces(self.first, 1.0) {
            self.first = Some(hit);
        }
        if replaces(self.last, -1.0) {
            self.last = Some(hit);
        }
        if !hit.is_front && self.last_back.is_none_or(|t| hit.t > t) {
            self.last_back = Some(hit.t);
        }
    }

    /// Adds the hits of another set.
    fn join(mut self, other: &Self) -> Self {
        other.first.into_iter().chain(other.last).for_each(|hit| self.add(hit));
        self.last_back = self.last_back.into_iter().chain(other.last_back).reduce(f32::max);
        self
    }
}

/// Number of faces that one thread tests at a time.
const FACES_PER_CHUNK: usize = 16_384;

/// Returns the hits of each ray with all triangles of a scene.
pub(crate) fn hits(scene: &Scene, rays: &[Ray]) -> Vec<Hits> {
    let none = || vec![Hits::default(); rays.len()];
    let joined = |a: Vec<Hits>, b: Vec<Hits>| a.iter().zip(&b).map(|(a, b)| a.join(b)).collect();
    let of_instance = |(instance_ix, Instance { mesh_ix, transform, .. }): (usize, &Instance)| {
        let mesh = &scene.meshes[*mesh_ix];
        let of_chunk = |(chunk_ix, faces): (usize, &[[u32; 3]])| {
            let mut hits = none();
            for (face_ix, face) in faces.iter().enumerate() {
                let corners = face.map(|ix| transform.point(mesh.positions[ix as usize]));
                for (ray, hits) in rays.iter().zip(&mut hits) {
                    if let Some((t, is_front)) = hit(ray, corners) {
                        hits.add(Hit {
                            t,
                            is_front: is_front ^ transform.mirrors(),
                            instance_ix: instance_ix as u32,
                            face_ix: (chunk_ix * FACES_PER_CHUNK + face_ix) as u32,
                        });
                    }
                }
            }
            hits
        };
        mesh.faces.par_chunks(FACES_PER_CHUNK).enumerate().map(of_chunk).reduce(none, joined)
    };
    scene.instances.par_iter().enumerate().map(of_instance).reduce(none, joined)
}

/// Returns t where a ray hits a triangle, and whether it meets the triangle's front (Möller and Trumbore, Fast, Minimum
/// Storage Ray/Triangle Intersection, 1997).
fn hit(ray: &Ray, [a, b, c]: [Vec3; 3]) -> Option<(f32, bool)> {
    let (ab, ac) = (b - a, c - a);
    let p = ray.direction.cross(ac);
    let determinant = ab.dot(p);
    let from_a = ray.origin - a;
    let u = from_a.dot(p) / determinant;
    if !(0.0..=1.0).contains(&u) {
        return None;
    }
    let q = from_a.cross(ab);
    let v = ray.direction.dot(q) / determinant;
    let t = ac.dot(q) / determinant;
    (v >= 0.0 && u + v <= 1.0 && t > 0.0 && t.is_finite()).then_some((t, determinant > 0.0))
}
