//! Division of polygons into triangles. A polygon that a fan around its first corner covers becomes that fan. Others
//! are cut by ear clipping in the plane of their mean normal, unless they are too large, or cross themselves so that
//! ears do not cover them.

use earcut::Earcut;
use glam::{DVec2, DVec3, Vec3};

/// Share of twice the polygon's area by which a triangle of a fan may be turned over. Corners that should lie on one
/// line deviate from it by the rounding of single precision, 2^-24 of their coordinates.
const TURNED_TOLERANCE: f64 = 1e-6;
/// Share of a polygon's area by which that of its ears may differ from it, if there are fewer than the polygon has.
const CLIPPED_TOLERANCE: f64 = 0.01;
/// Largest number of corners of a polygon that is cut by ear clipping, whose time can grow with the square of the
/// number. Larger polygons become fans, which is told once.
const MAX_CLIPPED_CORNERS: usize = 1 << 14;

/// Divides polygons into triangles. It keeps its memory from one polygon to the next.
#[derive(Default)]
pub(crate) struct Triangulator {
    clipper: Earcut<f64>,
    flat: Vec<[f64; 2]>,
    clipped: Vec<u32>,
    has_told: bool,
}

impl Triangulator {
    /// Calls `push` with the numbers of the corners of each of the `corners.len() - 2` triangles. The order of corners
    /// is that of the polygon. Where corners lie on one line, some triangles have no area.
    pub fn cut(&mut self, corners: &[Vec3], mut push: impl FnMut([usize; 3])) {
        if !self.clips(corners) {
            (2..corners.len()).for_each(|ix| push([0, ix - 1, ix]));
            return;
        }
        for triangle in self.clipped.as_chunks::<3>().0 {
            let [a, b, c] = triangle.map(|ix| ix as usize);
            push(if self.doubled_area(*triangle) < 0.0 { [a, c, b] } else { [a, b, c] });
        }
    }

    /// Clips the ears of a polygon that is no fan. Returns false for a fan, for a polygon without a plane, and for one
    /// that crosses itself, so that the ears do not cover it.
    fn clips(&mut self, corners: &[Vec3]) -> bool {
        if corners.len() < 4 {
            return false;
        }
        let normal = newell_normal(corners);
        let turned = -TURNED_TOLERANCE * normal.length_squared();
        let first = corners[0].as_dvec3();
        let doubled = |pair: &[Vec3; 2]| (pair[0].as_dvec3() - first).cross(pair[1].as_dvec3() - first).dot(normal);
        if corners[1..].array_windows().all(|pair| doubled(pair) >= turned) || normal.try_normalize().is_none() {
            return false;
        }
        if corners.len() > MAX_CLIPPED_CORNERS {
            if !std::mem::replace(&mut self.has_told, true) {
                tracing::warn!(
                    "a concave polygon of {} corners is filled as if it were convex: those of more than \
                     {MAX_CLIPPED_CORNERS} are not cut",
                    corners.len()
                );
            }
            return false;
        }
        let (x, y) = normal.normalize().any_orthonormal_pair();
        // The axes x, y and the normal are right-handed, so the polygon is counter-clockwise in the plane.
        let flat = |corner: &Vec3| [corner.as_dvec3() - first].map(|p| [p.dot(x), p.dot(y)])[0];
        self.flat.clear();
        self.flat.extend(corners.iter().map(flat));
        self.clipper.earcut(self.flat.iter().copied(), &[], &mut self.clipped);
        self.complete(corners.len(), normal.length())
    }

    /// Adds the triangles that the clipper has left out of a polygon of `n` corners, whose area is half of
    /// `doubled_area`: none of them has an area. Returns whether the triangles cover the polygon.
    fn complete(&mut self, n: usize, doubled_area: f64) -> bool {
        if self.clipped.len() == 3 * (n - 2) {
            return true;
        }
        let clipped: f64 = self.clipped.as_chunks().0.iter().map(|triangle| self.doubled_area(*triangle).abs()).sum();
        if !((clipped - doubled_area).abs() <= CLIPPED_TOLERANCE * doubled_area) {
            return false;
        }
        let mut is_used = vec![false; n];
        self.clipped.iter().for_each(|ix| is_used[*ix as usize] = true);
        for ix in (0..n).filter(|ix| !is_used[*ix]) {
            // It covers what rounding leaves between an edge and a corner of a neighbour on that edge.
            let triangle = [(ix + n - 1) % n, ix, (ix + 1) % n].map(|ix| ix as u32);
            if self.doubled_area(triangle).abs() <= TURNED_TOLERANCE * doubled_area {
                self.clipped.extend(triangle);
            }
        }
        self.clipped.resize(3 * (n - 2), 0);
        true
    }

    /// Returns twice the area of a triangle, which is negative if it is clockwise.
    fn doubled_area(&self, triangle: [u32; 3]) -> f64 {
        let [p, q, r] = triangle.map(|ix| DVec2::from_array(self.flat[ix as usize]));
        (q - p).perp_dot(r - p)
    }
}

/// Returns the mean normal of a polygon, whose length is twice its area (Newell's method).
fn newell_normal(corners: &[Vec3]) -> DVec3 {
    let first = corners[0].as_dvec3();
    let doubled = |pair: &[Vec3; 2]| (pair[0].as_dvec3() - first).cross(pair[1].as_dvec3() - first);
    corners[1..].array_windows().map(doubled).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cut(corners: &[[f32; 2]]) -> Vec<[usize; 3]> {
        let corners: Vec<Vec3> = corners.iter().map(|[x, y]| Vec3::new(*x, 3.0, -*y)).collect();
        let mut triangles = Vec::new();
        Triangulator::default().cut(&corners, |triangle| triangles.push(triangle));
        triangles
    }

    /// Returns twice the area of a triangle.
    fn doubled(corners: &[[f32; 2]], triangle: &[usize; 3]) -> f32 {
        let [a, b, c] = triangle.map(|ix| glam::Vec2::from_array(corners[ix]));
        (b - a).perp_dot(c - a)
    }

    #[test]
    fn convex_polygons_are_fans() {
        assert_eq!(cut(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]), [[0, 1, 2], [0, 2, 3]]);
        let on_a_line = [[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [1.0, 1.0]];
        assert_eq!(cut(&on_a_line), [[0, 1, 2], [0, 2, 3]]);
        let corner = |ix: u32| (ix as f32 / 99.0 * std::f32::consts::TAU).sin_cos();
        let round: Vec<[f32; 2]> = (0..99).map(corner).map(|(sin, cos)| [cos, sin]).collect();
        assert_eq!(cut(&round), (2..99).map(|ix| [0, ix - 1, ix]).collect::<Vec<_>>());
    }

    #[test]
    fn concave_polygons_are_covered_once() {
        let l = [[2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0], [0.0, 0.0]];
        let tip = |ix: u32| {
            let (sin, cos) = (ix as f32 / 10.0 * std::f32::consts::TAU).sin_cos();
            [cos, sin].map(|x| x * if ix.is_multiple_of(2) { 1.0 } else { 0.3 })
        };
        let star: Vec<[f32; 2]> = (0..10).map(tip).collect();
        let star_area = 10.0 * 0.3 * (std::f32::consts::TAU / 10.0).sin();
        for (corners, area) in [(&l[..], 6.0), (&star[..], star_area)] {
            let triangles = cut(corners);
            assert_eq!(triangles.len(), corners.len() - 2);
            // If the areas have one sign and add up to that of the polygon, nothing is covered twice or left out.
            assert!(triangles.iter().all(|t| doubled(corners, t) > 0.0), "{triangles:?}");
            let sum: f32 = triangles.iter().map(|t| doubled(corners, t)).sum();
            assert!((sum - area).abs() < 1e-5, "{sum} in place of {area}");
            let middle_is_inside = |t: &[usize; 3]| {
                let middle = t.iter().map(|ix| glam::Vec2::from_array(corners[*ix])).sum::<glam::Vec2>() / 3.0;
                is_inside(corners, middle.to_array())
            };
            assert!(triangles.iter().all(middle_is_inside), "{triangles:?}");
        }
    }

    #[test]
    fn every_polygon_has_its_number_of_triangles() {
        // A quad that crosses itself, as meshes that were deformed have.
        assert_eq!(cut(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.3]]), [[0, 1, 2], [0, 2, 3]]);
        // A square with a spike, which covers nothing, and a staircase with its steps on one line.
        let spike = [[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [7.0, 2.0], [4.0, 2.0], [4.0, 4.0], [0.0, 4.0]];
        let stairs = [[3.0, 1.0], [2.0, 1.0], [2.0, 2.0], [1.0, 2.0], [1.0, 3.0], [0.0, 3.0], [0.0, 0.0], [3.0, 0.0]];
        for (corners, area) in [(&spike[..], 32.0), (&stairs, 12.0)] {
            let triangles = cut(corners);
            assert_eq!(triangles.len(), corners.len() - 2);
            let areas: Vec<f32> = triangles.iter().map(|t| doubled(corners, t)).collect();
            assert!(areas.iter().all(|area| *area >= 0.0) && areas.iter().sum::<f32>() == area, "{areas:?}");
        }
        // An L with corners on its edges, at a reflex corner's neighbours, too.
        let l = [[2.0, 0.0], [2.0, 1.0], [1.5, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0], [0.0, 1.0], [0.0, 0.0]];
        for first in 0..l.len() {
            let corners = [&l[first..], &l[..first]].concat();
            let triangles = cut(&corners);
            assert_eq!(triangles.len(), 6, "{first}");
            let areas: Vec<f32> = triangles.iter().map(|t| doubled(&corners, t)).collect();
            assert!(areas.iter().all(|area| *area >= 0.0) && areas.iter().sum::<f32>() == 6.0, "{first}: {areas:?}");
        }
    }

    /// Returns whether a ray from a point along +x crosses the polygon's edges an odd number of times.
    fn is_inside(corners: &[[f32; 2]], [x, y]: [f32; 2]) -> bool {
        let edges = corners.iter().zip(corners.iter().cycle().skip(1));
        let crosses =
            |[ax, ay]: [f32; 2], [bx, by]: [f32; 2]| (ay > y) != (by > y) && x < ax + (y - ay) / (by - ay) * (bx - ax);
        edges.filter(|(a, b)| crosses(**a, **b)).count() % 2 == 1
    }

    #[test]
    fn polygons_without_area_are_no_trouble() {
        assert_eq!(cut(&[[0.0, 0.0]; 4]).len(), 2);
        assert_eq!(cut(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [1.0, 0.0]]).len(), 2);
        assert!(cut(&[[0.0, 0.0]; 2]).is_empty());
        assert_eq!(cut(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]).len(), 2);
        cut(&[[0.0, 0.0], [3e38, 3e38], [1.0, 0.0], [-3e38, 1.0], [0.0, 1.0]]);
    }
}
