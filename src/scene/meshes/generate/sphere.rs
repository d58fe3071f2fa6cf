//! Spheres, divided by longitude and latitude or from an icosahedron.

use std::{collections::HashMap, f64::consts::PI};

use glam::{DVec3, Vec2, Vec3};
use serde::Deserialize;

use super::{
    TriangleBudget, count, length,
    rings::{Rings, SurfacePoint, heading},
};
use crate::scene::model::{Mesh, error::Checked};

/// A closed sphere around the origin with poles at +y and -y. It has 2 * segments * rings triangles, or exactly
/// `triangles`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sphere {
    radius: f32,
    segments: Option<u32>,
    rings: Option<u32>,
    triangles: Option<u32>,
}

/// A closed sphere around the origin: 20 frequency^2 triangles of almost equal size and shape.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Geodesic {
    radius: f32,
    /// Number of parts that each edge of the icosahedron is cut into.
    frequency: u32,
}

impl Sphere {
    pub fn build(&self, budget: &TriangleBudget) -> Checked<Mesh> {
        let radius = length("radius", self.radius)?;
        let rings = polar_rings(self.segments, self.rings, self.triangles, budget)?;
        let point = |ring: usize, around: f64| -> SurfacePoint {
            let normal = polar_direction(&rings, ring, around);
            (radius * normal, normal)
        };
        Ok(rings.sweep(point))
    }
}

/// Returns the rings between two poles: `rings` rings of `segments` points each, or rings that make exactly
/// `triangles` and whose numbers of points are in proportion to the circles of latitude.
pub fn polar_rings(
    segments: Option<u32>,
    rings: Option<u32>,
    triangles: Option<u32>,
    budget: &TriangleBudget,
) -> Checked<Rings> {
    match (segments, rings, triangles) {
        (Some(segments), Some(rings), None) => {
            let (segments, n_rings) = (count("segments", segments, 3)?, count("rings", rings, 1)?);
            budget.require(2 * u64::from(segments) * u64::from(n_rings))?;
            let mut n_points = vec![segments; n_rings as usize + 2];
            n_points[0] = 1;
            n_points[n_rings as usize + 1] = 1;
            Ok(Rings { n_points, cyclic: false })
        }
        (None, None, Some(triangles)) => {
            budget.require(u64::from(triangles))?;
            // For almost equilateral triangles, rows are sqrt(3)/2 edges high. Rings have on average 2/pi of the
            // equator's points.
            let n_rows = (f64::from(triangles) * PI / (4.0 * 3f64.sqrt())).sqrt().round() as u32;
            Rings::between_poles(triangles, n_rows.max(2) - 1, |down| (PI * down).sin())
        }
        _ => Err("needs either `segments` and `rings`, or `triangles`".to_owned()),
    }
}

/// Returns the unit vector from the middle to a point of a ring.
pub fn polar_direction(rings: &Rings, ring: usize, around: f64) -> DVec3 {
    let last = rings.n_points.len() - 1;
    if ring == 0 || ring == last {
        return if ring == 0 { DVec3::Y } else { DVec3::NEG_Y };
    }
    let (sin, cos) = (PI * ring as f64 / last as f64).sin_cos();
    sin * heading(around) + cos * DVec3::Y
}

/// Faces of the icosahedron, as indices into `icosahedron_corners`, counter-clockwise seen from outside.
const ICOSAHEDRON: [[usize; 3]; 20] = [
    [0, 11, 5],
    [0, 5, 1],
    [0, 1, 7],
    [0, 7, 10],
    [0, 10, 11],
    [1, 5, 9],
    [5, 11, 4],
    [11, 10, 2],
    [10, 7, 6],
    [7, 1, 8],
    [3, 9, 4],
    [3, 4, 2],
    [3, 2, 6],
    [3, 6, 8],
    [3, 8, 9],
    [4, 9, 5],
    [2, 4, 11],
    [6, 2, 10],
    [8, 6, 7],
    [9, 8, 1],
];

/// Returns the corners of the icosahedron: (0, +-1, +-golden ratio) and their cyclic permutations.
fn icosahedron_corners() -> [DVec3; 12] {
    let g = (1.0 + 5f64.sqrt()) / 2.0;
    std::array::from_fn(|ix| {
        let mut corner = DVec3::ZERO;
        corner[ix / 4] = [-1.0, 1.0][ix % 2];
        corner[(ix / 4 + 1) % 3] = [g, -g][ix / 2 % 2];
        corner
    })
}

impl Geodesic {
    pub fn build(&self, budget: &TriangleBudget) -> Checked<Mesh> {
        let radius = length("radius", self.radius)?;
        let frequency = count("frequency", self.frequency, 1)?;
        budget.require(20 * u64::from(frequency).pow(2))?;
        let mut points =
            Points { radius, corners: icosahedron_corners(), by_weights: HashMap::new(), mesh: Mesh::default() };
        for face in ICOSAHEDRON {
            for row in 0..frequency {
                for ix in 0..=row {
                    // A point's weights of the face's three corners; they sum to `frequency`.
                    let mut at = |row: u32, ix: u32| points.at(face, [frequency - row, row - ix, ix]);
                    let (top, left, right) = (at(row, ix), at(row + 1, ix), at(row + 1, ix + 1));
                    let beside = (ix < row).then(|| at(row, ix + 1));
                    points.mesh.push_flat([top, left, right], 0);
                    if let Some(beside) = beside {
                        points.mesh.push_flat([top, right, beside], 0);
                    }
                }
            }
        }
        let Mesh { positions, faces, mut normals, slots, .. } = points.mesh;
        for (normals, face) in normals.iter_mut().zip(&faces) {
            *normals = face.map(|ix| positions[ix as usize].normalize());
        }
        let uvs = normals.iter().map(|normals| spherical_uvs(*normals)).collect();
        Ok(Mesh { positions, faces, normals, slots, uvs: [uvs, Vec::new()], ..Mesh::default() })
    }
}

/// Returns the texture coordinates of a triangle on the unit sphere, as [`Rings::sweep`] gives them to a sphere: u is
/// the angle from +z around the y axis, v that from +y, as shares of the full and the half turn. A triangle across the
/// seam has u beyond 1. At a pole, u is the mean of the other corners'.
fn spherical_uvs(corners: [Vec3; 3]) -> [Vec2; 3] {
    let turn = |p: Vec3| (f64::from(p.x).atan2(f64::from(p.z)) / (2.0 * PI)).rem_euclid(1.0);
    let vs = corners.map(|p| f64::from(p.y).clamp(-1.0, 1.0).acos() / PI);
    let is_pole = corners.map(|p| p.x.hypot(p.z) < 1e-6);
    // Corners are at most half a turn from the middle of the triangle.
    let middle = turn(corners.iter().sum());
    let mut us = corners.map(|p| middle + (turn(p) - middle + 0.5).rem_euclid(1.0) - 0.5);
    let least = (0..3).filter(|ix| !is_pole[*ix]).map(|ix| us[ix]).fold(1.0, f64::min);
    us = us.map(|u| if least < -1e-6 { u + 1.0 } else { u });
    if let Some(pole) = is_pole.iter().position(|is_pole| *is_pole) {
        us[pole] = (us[(pole + 1) % 3] + us[(pole + 2) % 3]) / 2.0;
    }
    [0, 1, 2].map(|ix| Vec2::new(us[ix] as f32, vs[ix] as f32))
}

/// Points on the sphere. Faces that share a point share its index.
struct Points {
    radius: f64,
    corners: [DVec3; 12],
    /// Index of each point by its key, which is the same for all faces that share the point: three pairs of a corner
    /// of the icosahedron and its weight, sorted. A pair of weight 0 is (0, 0).
    by_weights: HashMap<[(usize, u32); 3], u32>,
    mesh: Mesh,
}

impl Points {
    fn at(&mut self, face: [usize; 3], weights: [u32; 3]) -> u32 {
        let mut key = [0, 1, 2].map(|k| if weights[k] == 0 { (0, 0) } else { (face[k], weights[k]) });
        key.sort_unstable();
        *self.by_weights.entry(key).or_insert_with(|| {
            let sum: DVec3 = key.iter().map(|(corner, weight)| self.corners[*corner] * f64::from(*weight)).sum();
            self.mesh.push_position((self.radius * sum.normalize()).as_vec3())
        })
    }
}
