//! Small meshes in world space. The triangles of closed ones share the points of their edges, bit for bit.

use std::f32::consts::TAU;

use glam::{Vec3, vec3};
use kdray::layout::{FLAT_NORMAL, Triangle};

use super::random::Random;

pub fn triangle(v0: Vec3, v1: Vec3, v2: Vec3) -> Triangle {
    Triangle { v0, n0: FLAT_NORMAL, v1, n1: FLAT_NORMAL, v2, n2: FLAT_NORMAL }
}

/// Returns the quads of a grid of points as two triangles each.
fn grid(n_u: usize, n_v: usize, point: impl Fn(usize, usize) -> Vec3) -> Vec<Triangle> {
    let mut triangles = Vec::new();
    for (u, v) in (0..n_v).flat_map(|v| (0..n_u).map(move |u| (u, v))) {
        let (a, b, c, d) = (point(u, v), point(u + 1, v), point(u + 1, v + 1), point(u, v + 1));
        triangles.extend([triangle(a, b, c), triangle(a, c, d)]);
    }
    triangles
}

/// A closed torus around y.
pub fn torus(n_around: usize, n_across: usize) -> Vec<Triangle> {
    grid(n_around, n_across, |u, v| {
        let around = (u % n_around) as f32 / n_around as f32 * TAU;
        let across = (v % n_across) as f32 / n_across as f32 * TAU;
        let radius = 1.0 + 0.4 * across.cos();
        vec3(radius * around.cos(), 0.4 * across.sin(), -radius * around.sin())
    })
}

/// A closed tube along a trefoil knot around y.
pub fn knot(n_along: usize, n_across: usize) -> Vec<Triangle> {
    let centre = |t: f32| {
        let radius = 1.0 + 0.4 * (3.0 * t).cos();
        vec3(radius * (2.0 * t).cos(), 0.4 * (3.0 * t).sin(), radius * (2.0 * t).sin())
    };
    grid(n_along, n_across, |u, v| {
        let along = (u % n_along) as f32 / n_along as f32 * TAU;
        let across = (v % n_across) as f32 / n_across as f32 * TAU;
        let heading = (centre(along + 1e-2) - centre(along - 1e-2)).normalize();
        let side = heading.cross(Vec3::Y).normalize();
        centre(along) + 0.15 * (across.cos() * side + across.sin() * side.cross(heading))
    })
}

/// A closed cube from -1 to 1 whose faces are cut into n x n squares. The tree's split planes are along the edges of
/// these. `bulge` moves each point towards the unit sphere.
pub fn cube(n: usize, bulge: f32) -> Vec<Triangle> {
    let mut triangles = Vec::new();
    for (axis, side) in (0..3).flat_map(|axis| [(axis, 1.0), (axis, -1.0)]) {
        triangles.extend(grid(n, n, |u, v| {
            let at = |i: usize| i as f32 / n as f32 * 2.0 - 1.0;
            let mut p = Vec3::splat(side);
            p[(axis + 1) % 3] = at(if side > 0.0 { u } else { v });
            p[(axis + 2) % 3] = at(if side > 0.0 { v } else { u });
            p.lerp(p.normalize(), bulge)
        }));
    }
    triangles
}

/// Triangles of all sizes and shapes that intersect one another: needles, specks, and one whose corners are all on a
/// line.
pub fn soup(n: usize, seed: u64) -> Vec<Triangle> {
    let mut random = Random(seed);
    let mut triangles = vec![triangle(Vec3::ZERO, Vec3::ONE, Vec3::splat(0.5))];
    while triangles.len() < n {
        let v0 = random.in_box(Vec3::NEG_ONE, Vec3::ONE);
        let size = 2f32.powf(random.between(-10.0, 0.0));
        let v1 = v0 + size * random.direction();
        let v2 = if random.below(4) == 0 {
            v0.lerp(v1, 1.1) + 1e-5 * random.direction()
        } else {
            v0 + size * random.direction()
        };
        triangles.push(triangle(v0, v1, v2));
    }
    triangles
}

/// Repeats the triangles three times, so that only the lowest index may win.
pub fn threefold(triangles: Vec<Triangle>) -> Vec<Triangle> {
    let n = triangles.len();
    triangles.into_iter().cycle().take(3 * n).collect()
}

/// Returns the mesh scaled and then moved.
pub fn placed(mut triangles: Vec<Triangle>, scale: f32, offset: Vec3) -> Vec<Triangle> {
    for corner in triangles.iter_mut().flat_map(|t| [&mut t.v0, &mut t.v1, &mut t.v2]) {
        *corner = *corner * scale + offset;
    }
    triangles
}
