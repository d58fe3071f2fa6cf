//! Closest points by a look at all triangles, in double precision.

use glam::DVec3;
use kdray::{
    cast::{Hit, NO_TRIANGLE, QueryPoint},
    layout::Triangle,
};
use rayon::prelude::*;

pub const MISS: Hit = Hit { t: f32::INFINITY, triangle_ix: NO_TRIANGLE, u: 0.0, v: 0.0 };
/// The greatest error of a distance, as a share of the distance to the triangle's farthest corner.
const TOLERANCE: f64 = 1.0 / (1 << 20) as f64;

fn corners(triangle: &Triangle) -> [DVec3; 3] {
    [triangle.v0, triangle.v1, triangle.v2].map(|v| v.as_dvec3())
}

/// The distance from a point to a triangle, and by how much a computed distance may differ.
#[derive(Clone, Copy)]
struct Exact {
    distance: f64,
    tolerance: f64,
}

impl Exact {
    /// The distance to the plane if the foot is inside, or else to the nearest edge.
    fn of(point: DVec3, triangle: &Triangle) -> Self {
        let corners = corners(triangle);
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a);
        let to_edge = |from: DVec3, to: DVec3| {
            let edge = to - from;
            let share = (point - from).dot(edge) / edge.length_squared();
            point.distance(from + if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) } * edge)
        };
        let edges = [(a, b), (b, c), (c, a)];
        let is_inside = edges.iter().all(|(from, to)| normal.dot((to - from).cross(point - from)) > 0.0);
        let of_edges = edges.iter().map(|(from, to)| to_edge(*from, *to)).fold(f64::INFINITY, f64::min);
        let of_plane = if is_inside { (point - a).dot(normal).abs() / normal.length() } else { f64::INFINITY };
        let reach = corners.iter().map(|corner| corner.distance(point)).fold(0.0, f64::max);
        Self { distance: of_edges.min(of_plane), tolerance: TOLERANCE * reach }
    }
}

/// Checks a hit by a look at all triangles that are not hidden.
fn check_hit(triangles: &[Triangle], hidden: &[u32], point: &QueryPoint, hit: &Hit) -> Result<(), String> {
    let position = point.position.as_dvec3();
    let t_max = f64::from(point.t_max);
    let seen = (0..).zip(triangles).filter(|(ix, _)| !hidden.contains(ix));
    let nearest =
        seen.map(|(_, triangle)| Exact::of(position, triangle)).min_by(|a, b| a.distance.total_cmp(&b.distance));
    let wrong = |what: &str| Err(format!("{what}: {hit:?} of {point:?}"));
    let Some(nearest) = nearest else { return if *hit == MISS { Ok(()) } else { wrong("a hit of nothing") } };
    if hit.triangle_ix == NO_TRIANGLE {
        let is_right = *hit == MISS && nearest.distance > t_max - nearest.tolerance;
        return if is_right { Ok(()) } else { wrong("a miss") };
    }
    let triangle = &triangles[hit.triangle_ix as usize];
    let found = Exact::of(position, triangle);
    let t = f64::from(hit.t);
    let [a, b, c] = corners(triangle);
    let [u, v] = [hit.u, hit.v].map(f64::from);
    let at = (1.0 - u - v) * a + u * b + v * c;
    let checks = [
        ("too far", found.distance <= nearest.distance + nearest.tolerance + found.tolerance),
        ("t", (t - found.distance).abs() <= found.tolerance && hit.t <= point.t_max),
        ("hidden", !hidden.contains(&hit.triangle_ix)),
        ("weights", u.min(v) >= 0.0 && u + v <= 1.0 + TOLERANCE),
        ("point", (at.distance(position) - t).abs() <= found.tolerance),
    ];
    checks.iter().find(|(_, is_right)| !is_right).map_or(Ok(()), |(what, _)| wrong(what))
}

/// Checks hits by a look at all triangles that are not hidden.
pub fn check(triangles: &[Triangle], hidden: &[u32], points: &[QueryPoint], hits: &[Hit]) -> Result<(), String> {
    assert_eq!(points.len(), hits.len());
    points.par_iter().zip(hits).try_for_each(|(point, hit)| check_hit(triangles, hidden, point, hit))
}

/// Succeeds if the kernel and its twin have the same hits, but for distances that are equal up to rounding.
pub fn agree(triangles: &[Triangle], points: &[QueryPoint], twin: &[Hit], kernel: &[Hit]) -> Result<(), String> {
    assert_eq!(twin.len(), kernel.len());
    let is_close = |(point, (a, b)): (&QueryPoint, (&Hit, &Hit))| {
        let exact = |hit: &Hit| Exact::of(point.position.as_dvec3(), &triangles[hit.triangle_ix as usize]);
        let is_miss = [a, b].map(|hit| hit.triangle_ix == NO_TRIANGLE);
        let is_same = a == b
            || is_miss == [false; 2] && f64::from((a.t - b.t).abs()) <= exact(a).tolerance.min(exact(b).tolerance);
        if is_same { Ok(()) } else { Err(format!("{b:?}, not {a:?} of {point:?}")) }
    };
    points.iter().zip(twin.iter().zip(kernel)).try_for_each(is_close)
}
