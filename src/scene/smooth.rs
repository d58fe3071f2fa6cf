//! Shading normals for meshes without normals. The normal at a face's corner is the angle-weighted average of the
//! normals of the faces that meet there. Only faces count whose normals differ from the face's own normal by at most
//! the crease angle.
//!
//! The weights follow Thürmer and Wüthrich, "Computing Vertex Normals from Polygonal Facets" (JGT 1998).

use std::collections::HashMap;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Largest number of faces around a point that are compared in pairs. A point where more faces meet is called a hub,
/// for example the middle of a fan. Comparing all its pairs would take quadratic time, so a hub's normal is the
/// average of all its faces, whatever their angles.
const MAX_PAIRED_FACES: usize = 256;
/// Deviation (1 - cosine; 0.08 degrees) below which a normal counts as the normal of the face's plane.
const FLAT_TOLERANCE: f32 = 1e-6;

/// Angle between two faces, in degrees, beyond which their common edge is sharp.
pub(super) const DEFAULT_CREASE: f32 = 40.0;

/// Options of a mesh's shading.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shading {
    /// If false, every face is flat, even where the file has normals.
    pub smooth: bool,
    /// Angle between two faces without normals, in degrees, beyond which their common edge is sharp.
    pub crease: f32,
}

impl Default for Shading {
    fn default() -> Self {
        Self { smooth: true, crease: DEFAULT_CREASE }
    }
}

/// A face's share in the averages at its corners: its normal, and its angles as weights.
#[derive(Clone, Copy, Default)]
struct Facet {
    /// Unit normal, or zero where the face has no area or is not smooth.
    normal: Vec3,
    /// Angles at its corners, radians.
    angles: [f32; 3],
}

/// Returns unit normals at the three corners of each face, or zeros where the normal of the face's plane is as good.
///
/// Points at the same place count as one, whatever their indices. A face whose `smooth` is false stays flat, and its
/// neighbours' normals ignore it. `crease` is in degrees.
pub(super) fn crease_normals(positions: &[Vec3], faces: &[[u32; 3]], smooth: &[bool], crease: f32) -> Vec<[Vec3; 3]> {
    let point_of = weld(positions);
    let facet = |(face, smooth): (&[u32; 3], &bool)| {
        if *smooth { facet(face.map(|ix| positions[ix as usize].as_dvec3())) } else { Facet::default() }
    };
    let facets: Vec<Facet> = faces.par_iter().zip(smooth).map(facet).collect();
    let around = FacesAround::new(&point_of, faces, positions.len());
    let corner_normals = CornerNormals::new(&around, &facets, crease);
    let normals_of = |(face, facet): (&[u32; 3], &Facet)| {
        if facet.normal == Vec3::ZERO {
            return [Vec3::ZERO; 3];
        }
        let normals = face.map(|ix| corner_normals.at(point_of[ix as usize], facet.normal));
        let is_flat = normals.iter().all(|n| n.dot(facet.normal) > 1.0 - FLAT_TOLERANCE);
        if is_flat { [Vec3::ZERO; 3] } else { normals }
    };
    faces.par_iter().zip(&facets).map(normals_of).collect()
}

/// Returns the shading normals of a mesh whose file has none: those of [`crease_normals`], or zeros for flat shading.
pub(super) fn smooth_normals(positions: &[Vec3], faces: &[[u32; 3]], shading: Shading) -> Vec<[Vec3; 3]> {
    match shading.smooth {
        true => crease_normals(positions, faces, &vec![true; faces.len()], shading.crease),
        false => vec![[Vec3::ZERO; 3]; faces.len()],
    }
}

/// The data from which the normals at the corners of faces are computed.
struct CornerNormals<'a> {
    around: &'a FacesAround,
    facets: &'a [Facet],
    min_cosine: f32,
    /// The normals of hubs, points where more than `MAX_PAIRED_FACES` faces meet.
    hubs: HashMap<u32, Vec3>,
}

impl<'a> CornerNormals<'a> {
    fn new(around: &'a FacesAround, facets: &'a [Facet], crease: f32) -> Self {
        let mut normals = Self { around, facets, min_cosine: crease.to_radians().cos(), hubs: HashMap::new() };
        let is_hub = |point: &u32| around.of(*point).len() > MAX_PAIRED_FACES;
        normals.hubs = (0..around.n_points()).filter(is_hub).map(|p| (p, normals.average(p, |_| true))).collect();
        normals
    }

    /// Returns the normal at a point of a face with normal `own`. It is `own` if the average differs by more than the
    /// crease angle.
    fn at(&self, point: u32, own: Vec3) -> Vec3 {
        let near = |n: Vec3| n.dot(own) >= self.min_cosine;
        let normal = self.hubs.get(&point).copied().unwrap_or_else(|| self.average(point, near));
        if near(normal) { normal } else { own }
    }

    /// Returns the average of the normals around a point that the predicate `counts` accepts: a unit vector, or zero
    /// if they cancel out.
    fn average(&self, point: u32, counts: impl Fn(Vec3) -> bool) -> Vec3 {
        let corners = self.around.of(point).iter();
        let weighted = corners.map(|corner| {
            let facet = &self.facets[*corner as usize / 3];
            if counts(facet.normal) { facet.normal * facet.angles[*corner as usize % 3] } else { Vec3::ZERO }
        });
        weighted.sum::<Vec3>().normalize_or_zero()
    }
}

/// Returns for each position the index of the first position at the same place.
fn weld(positions: &[Vec3]) -> Vec<u32> {
    let mut first_at = HashMap::with_capacity(positions.len());
    let place = |(ix, p): (usize, &Vec3)| {
        // Adding 0 turns -0 into 0.
        *first_at.entry((*p + Vec3::ZERO).to_array().map(f32::to_bits)).or_insert(ix as u32)
    };
    positions.iter().enumerate().map(place).collect()
}

/// Returns the normal and the angles of a face. They are computed in f64, in which the cross product of edges of
/// 1e-20 is not zero.
fn facet(corners: [DVec3; 3]) -> Facet {
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a).normalize_or_zero().as_vec3();
    let angle = |at: DVec3, p: DVec3, q: DVec3| (p - at).angle_between(q - at) as f32;
    // The angles of a face without area may be NaN.
    let angles = if normal == Vec3::ZERO { [0.0; 3] } else { [angle(a, b, c), angle(b, c, a), angle(c, a, b)] };
    Facet { normal, angles }
}

/// The corners that meet at each point. Corner k of face f has the number 3 f + k.
struct FacesAround {
    /// The corners of point `ix` are `corners[first[ix]..first[ix + 1]]`.
    first: Vec<u32>,
    corners: Vec<u32>,
}

impl FacesAround {
    fn new(point_of: &[u32], faces: &[[u32; 3]], n_points: usize) -> Self {
        let mut first = vec![0u32; n_points + 1];
        for ix in faces.as_flattened() {
            first[point_of[*ix as usize] as usize + 1] += 1;
        }
        for ix in 0..n_points {
            first[ix + 1] += first[ix];
        }
        let mut next = first.clone();
        let mut corners = vec![0; faces.len() * 3];
        for (corner, ix) in faces.as_flattened().iter().enumerate() {
            let slot = &mut next[point_of[*ix as usize] as usize];
            corners[*slot as usize] = corner as u32;
            *slot += 1;
        }
        Self { first, corners }
    }

    fn n_points(&self) -> u32 {
        (self.first.len() - 1) as u32
    }

    fn of(&self, point: u32) -> &[u32] {
        &self.corners[self.first[point as usize] as usize..self.first[point as usize + 1] as usize]
    }
}
