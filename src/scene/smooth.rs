//! Shading normals for meshes that come without: angle-weighted averages over the faces around a point, as far as the
//! surface does not bend by more than a crease angle.
//!
//! Weights after Thürmer and Wüthrich, "Computing Vertex Normals from Polygonal Facets" (JGT 1998).

use std::collections::HashMap;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Where more faces than this meet (a fan's hub), comparing all pairs would take quadratic time, so all of them are
/// averaged whatever their angles.
const MAX_PAIRED_FACES: usize = 256;
/// Normals closer than this to the plane's own are the plane's own (1 - cosine; 0.08 degrees).
const FLAT_TOLERANCE: f32 = 1e-6;

/// A face, as far as its neighbours need it.
#[derive(Clone, Copy, Default)]
struct Facet {
    /// Unit length, or zero where the face has no area.
    normal: Vec3,
    /// Radians at its corners.
    angles: [f32; 3],
}

/// One entry a face: unit normals at its corners, zero where the face's own plane will do.
///
/// Points at the same place count as one, whatever their index. Faces that are not in `smooth` stay flat, and neither
/// do their neighbours see them. `crease`: degrees.
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

/// What the normal of a face's corner is computed from.
struct CornerNormals<'a> {
    around: &'a FacesAround,
    facets: &'a [Facet],
    min_cosine: f32,
    /// The averages of points where more than `MAX_PAIRED_FACES` meet.
    hubs: HashMap<u32, Vec3>,
}

impl<'a> CornerNormals<'a> {
    fn new(around: &'a FacesAround, facets: &'a [Facet], crease: f32) -> Self {
        let mut normals = Self { around, facets, min_cosine: crease.to_radians().cos(), hubs: HashMap::new() };
        let is_hub = |point: &u32| around.of(*point).len() > MAX_PAIRED_FACES;
        normals.hubs = (0..around.n_points()).filter(is_hub).map(|p| (p, normals.average(p, |_| true))).collect();
        normals
    }

    /// The normal at a point of a face with normal `own`.
    fn at(&self, point: u32, own: Vec3) -> Vec3 {
        let near = |n: Vec3| n.dot(own) >= self.min_cosine;
        let normal = self.hubs.get(&point).copied().unwrap_or_else(|| self.average(point, near));
        if near(normal) { normal } else { own }
    }

    /// Unit length, or zero where the faces that count cancel out.
    fn average(&self, point: u32, counts: impl Fn(Vec3) -> bool) -> Vec3 {
        let corners = self.around.of(point).iter();
        let weighted = corners.map(|corner| {
            let facet = &self.facets[*corner as usize / 3];
            if counts(facet.normal) { facet.normal * facet.angles[*corner as usize % 3] } else { Vec3::ZERO }
        });
        weighted.sum::<Vec3>().normalize_or_zero()
    }
}

/// For each position the index of the first one at the same place.
fn weld(positions: &[Vec3]) -> Vec<u32> {
    let mut first_at = HashMap::with_capacity(positions.len());
    let place = |(ix, p): (usize, &Vec3)| {
        // Adding 0 turns -0 into 0.
        *first_at.entry((*p + Vec3::ZERO).to_array().map(f32::to_bits)).or_insert(ix as u32)
    };
    positions.iter().enumerate().map(place).collect()
}

/// In f64: the cross product of edges of 1e-20 is not yet zero there.
fn facet(corners: [DVec3; 3]) -> Facet {
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a).normalize_or_zero().as_vec3();
    let angle = |at: DVec3, p: DVec3, q: DVec3| (p - at).angle_between(q - at) as f32;
    // Of a face without area the angles may be NaN.
    let angles = if normal == Vec3::ZERO { [0.0; 3] } else { [angle(a, b, c), angle(b, c, a), angle(c, a, b)] };
    Facet { normal, angles }
}

/// Which corners (3 * face + 0, 1 or 2) meet at each point.
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
