//! Surfaces swept from rings, each of any number of points.
//!
//! Two neighbouring rings of n and m points are stitched by n + m triangles:
//!
//! ```text
//!   a0 ---- a1 ---- a2      ring i, the upper one; `around` grows to the right, seen from outside
//!   |  \   / \     / |
//!   b0 -- b1 - b2 -- b3     ring i + 1
//! ```
//!
//! A ring of one point is called a pole and adds no triangles of its own. A surface between two poles thus has twice
//! as many triangles as the rings between them have points. The same is true of a surface whose last ring is stitched
//! to the first. With r rings (poles do not count), every even number of triangles from 6 r is possible.

use glam::{DVec2, DVec3, Vec2};
use rayon::prelude::*;

use crate::scene::model::{Mesh, error::Checked};

/// A point of a surface and the unit normal there.
pub type SurfacePoint = (DVec3, DVec3);

/// The rings of a surface.
#[derive(Clone, Debug)]
pub struct Rings {
    /// Number of points on each ring, from the first to the last.
    pub n_points: Vec<u32>,
    /// Whether the last ring is stitched to the first.
    pub cyclic: bool,
}

impl Rings {
    /// Returns the number of triangles of the stitched surface.
    pub fn n_triangles(&self) -> u64 {
        self.pairs().map(|(a, b)| edges(self.n_points[a]) + edges(self.n_points[b])).sum()
    }

    /// Returns `n_rings` rings between two poles that make exactly `n_triangles`. Their numbers of points are in
    /// proportion to `girth`, the length of a ring as a function of its position from one pole (0) to the other (1).
    pub fn between_poles(n_triangles: u32, n_rings: u32, girth: impl Fn(f64) -> f64) -> Checked<Self> {
        let inner: Vec<f64> = (1..=n_rings).map(|ring| girth(f64::from(ring) / f64::from(n_rings + 1))).collect();
        let mut n_points = vec![1];
        n_points.extend(distribute(half(n_triangles)?, &inner)?);
        n_points.push(1);
        Ok(Self { n_points, cyclic: false })
    }

    /// Returns `n_rings` rings of a surface closed in both directions that make exactly `n_triangles`. Their numbers
    /// of points differ by at most 1.
    pub fn cyclic(n_triangles: u32, n_rings: u32) -> Checked<Self> {
        Ok(Self { n_points: distribute(half(n_triangles)?, &vec![1.0; n_rings as usize])?, cyclic: true })
    }

    /// Makes the mesh. `point` is called with the index of a ring and the position around it, 0 to 1. The texture
    /// coordinate u is the position around the ring, and v grows evenly from the first ring, 0, to the last, 1; on a
    /// cyclic surface to the first one again. At a pole, u is that of the middle of the triangle's other edge.
    pub fn sweep(&self, point: impl Fn(usize, f64) -> SurfacePoint + Sync) -> Mesh {
        let ring = |(ring, n): (usize, &u32)| {
            (0..*n).map(|ix| point(ring, f64::from(ix) / f64::from(*n))).collect::<Vec<SurfacePoint>>()
        };
        let points: Vec<Vec<SurfacePoint>> = self.n_points.par_iter().enumerate().map(ring).collect();
        let points: Vec<SurfacePoint> = points.into_iter().flatten().collect();
        let mut faces = Vec::with_capacity(self.n_triangles() as usize);
        let first: Vec<u32> = self.n_points.iter().scan(0, |sum, n| Some(std::mem::replace(sum, *sum + n))).collect();
        let mut uvs = Vec::with_capacity(faces.capacity());
        let n_pairs = self.pairs().count() as f64;
        for (a, b) in self.pairs() {
            let rows = [a as f64 / n_pairs, (a + 1) as f64 / n_pairs];
            let uv = |u: f64, row: usize| DVec2::new(u, rows[row]).as_vec2();
            stitch(&mut faces, &mut uvs, (first[a], self.n_points[a]), (first[b], self.n_points[b]), uv);
        }
        let normals = faces.iter().map(|face: &[u32; 3]| face.map(|ix| points[ix as usize].1.as_vec3())).collect();
        Mesh {
            positions: points.iter().map(|(position, _)| position.as_vec3()).collect(),
            normals,
            slots: vec![0; faces.len()],
            faces,
            uvs: [uvs, Vec::new()],
            ..Mesh::default()
        }
    }

    /// Returns the indices of neighbouring rings.
    fn pairs(&self) -> impl Iterator<Item = (usize, usize)> {
        let n = self.n_points.len();
        let last = if self.cyclic { n } else { n.saturating_sub(1) };
        (0..last).map(move |ring| (ring, (ring + 1) % n))
    }
}

/// Returns the number of a ring's edges.
fn edges(n_points: u32) -> u64 {
    if n_points == 1 { 0 } else { u64::from(n_points) }
}

fn half(n_triangles: u32) -> Checked<u32> {
    if n_triangles.is_multiple_of(2) {
        Ok(n_triangles / 2)
    } else {
        Err(format!("triangles = {n_triangles} is odd: a closed surface has an even number"))
    }
}

/// Splits `total` into whole numbers, one per weight: each is 3 plus a share of the rest in proportion to its weight.
fn distribute(total: u32, weights: &[f64]) -> Checked<Vec<u32>> {
    let n_parts = weights.len() as u32;
    let Some(rest) = total.checked_sub(3 * n_parts) else {
        return Err(format!("{total} points are too few for {n_parts} rings of 3"));
    };
    // Each share is a difference of rounded prefix sums, and the last prefix sum is exactly `rest`.
    let whole: f64 = weights.iter().sum();
    let mut sum = 0.0;
    let mut given = 0;
    let part = |(ix, weight): (usize, &f64)| {
        sum += weight;
        let until = if ix + 1 == weights.len() { rest } else { (f64::from(rest) * sum / whole).round() as u32 };
        let part = 3 + until - given;
        given = until;
        part
    };
    Ok(weights.iter().enumerate().map(part).collect())
}

/// Adds the strip of triangles between an upper and a lower ring, each given by the index of its first point and its
/// number of points. `uv` returns the texture coordinates at a position around the upper (0) or lower (1) ring.
fn stitch(
    faces: &mut Vec<[u32; 3]>,
    uvs: &mut Vec<[Vec2; 3]>,
    (first_a, n_a): (u32, u32),
    (first_b, n_b): (u32, u32),
    uv: impl Fn(f64, usize) -> Vec2,
) {
    let (edges_a, edges_b) = (edges(n_a), edges(n_b));
    let (mut a, mut b) = (0, 0);
    // A pole is at every position around itself.
    let uv_a = |at: u64, pole: f64| uv(if n_a == 1 { pole } else { at as f64 / f64::from(n_a) }, 0);
    let uv_b = |at: u64, pole: f64| uv(if n_b == 1 { pole } else { at as f64 / f64::from(n_b) }, 1);
    while a < edges_a || b < edges_b {
        let at_a = first_a + (a % u64::from(n_a)) as u32;
        let at_b = first_b + (b % u64::from(n_b)) as u32;
        // Advance on the ring whose next edge has its middle further back. The middles are at (a + 1/2) / n_a and
        // (b + 1/2) / n_b.
        let upper = b == edges_b || a < edges_a && (2 * a + 1) * edges_b <= (2 * b + 1) * edges_a;
        let middle = if upper { (a as f64 + 0.5) / f64::from(n_a) } else { (b as f64 + 0.5) / f64::from(n_b) };
        if upper {
            faces.push([at_a, at_b, first_a + ((a + 1) % u64::from(n_a)) as u32]);
            uvs.push([uv_a(a, middle), uv_b(b, middle), uv_a(a + 1, middle)]);
            a += 1;
        } else {
            faces.push([at_b, first_b + ((b + 1) % u64::from(n_b)) as u32, at_a]);
            uvs.push([uv_b(b, middle), uv_b(b + 1, middle), uv_a(a, middle)]);
            b += 1;
        }
    }
}

/// Returns the unit normal of a surface whose second parameter grows to the right and whose first grows downwards,
/// seen from outside.
///
/// Central differences in f64 have an error of some 1e-9, far below the 1e-4 of the encoding of normals.
pub fn normal_at(position: impl Fn(f64, f64) -> DVec3, down: f64, around: f64) -> DVec3 {
    const STEP: f64 = 1e-6;
    let along_down = position(down + STEP, around) - position(down - STEP, around);
    let along_around = position(down, around + STEP) - position(down, around - STEP);
    along_down.cross(along_around).normalize_or_zero()
}

/// Returns the unit vector in the plane y = 0 at the angle `around`, in turns (0 to 1) from +z, counter-clockwise
/// seen from above.
pub fn heading(around: f64) -> DVec3 {
    let (sin, cos) = (around * std::f64::consts::TAU).sin_cos();
    DVec3::new(sin, 0.0, cos)
}
