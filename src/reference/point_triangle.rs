//! The point of a triangle that is closest to the origin. Twin of `search/point_triangle.glsl`, which says how exact it
//! is.

use glam::Vec3;

/// A point of a triangle: the square of its distance from the origin, and the weights of the second and third corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointOnTriangle {
    pub squared: f32,
    pub u: f32,
    pub v: f32,
}

impl PointOnTriangle {
    /// Replaces the point by the one with these weights, if that is closer.
    fn take_closer(&mut self, [a, b, c]: [Vec3; 3], [u, v]: [f32; 2]) {
        let point = (1.0 - u - v) * a + u * b + v * c;
        let squared = point.dot(point);
        if squared < self.squared {
            *self = Self { squared, u, v };
        }
    }
}

/// The place of the origin's foot on the line from `a` along an edge, as a share of the edge. 0 if the edge has no
/// length.
fn share_along(a: Vec3, edge: Vec3) -> f32 {
    let squared = edge.dot(edge);
    if squared > 0.0 { -a.dot(edge) / squared } else { 0.0 }
}

/// The edge's point that is closest to the origin, as a share of the edge: 0 at `a`, 1 at the other end.
fn share_on(a: Vec3, edge: Vec3) -> f32 {
    let (along, squared) = (-a.dot(edge), edge.dot(edge));
    if along <= 0.0 {
        0.0
    } else if along >= squared {
        1.0
    } else {
        along / squared
    }
}

/// [`closest_on_triangle`] if the edge from `a` to `b` is the longest one.
fn closest_beside_longest(corners @ [a, b, c]: [Vec3; 3]) -> PointOnTriangle {
    let (ab, ac) = (b - a, c - a);
    let along_ab = share_along(a, ab);
    let along_bc = share_on(b, c - b);
    let mut best = PointOnTriangle { squared: a.dot(a), u: 0.0, v: 0.0 };
    best.take_closer(corners, [share_on(a, ab), 0.0]);
    best.take_closer(corners, [0.0, share_on(a, ac)]);
    best.take_closer(corners, [1.0 - along_bc, along_bc]);
    let height_along_ab = -share_along(ac, ab);
    let height = ac - height_along_ab * ab;
    let v = share_along(a + along_ab * ab, height);
    let u = along_ab - v * height_along_ab;
    if u > 0.0 && v > 0.0 && 1.0 - u - v > 0.0 {
        best.take_closer(corners, [u, v]);
    }
    best
}

/// Returns the point of the triangle that is closest to the origin. The corners' coordinates are below 2^60.
pub fn closest_on_triangle([a, b, c]: [Vec3; 3]) -> PointOnTriangle {
    let [ab, bc, ca] = [b - a, c - b, a - c].map(|edge| edge.dot(edge));
    if bc > ab && bc >= ca {
        let turned = closest_beside_longest([b, c, a]);
        return PointOnTriangle { u: (1.0 - turned.u - turned.v).max(0.0), v: turned.u, ..turned };
    }
    if ca > ab {
        let turned = closest_beside_longest([c, a, b]);
        return PointOnTriangle { u: turned.v, v: (1.0 - turned.u - turned.v).max(0.0), ..turned };
    }
    closest_beside_longest([a, b, c])
}
