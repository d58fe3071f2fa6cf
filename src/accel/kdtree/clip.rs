//! Clipping of triangles to cells, and "perfect splits" (Havran 2000). A perfect split cuts the clipped triangle at
//! the plane and takes the bounds of each of the two pieces.
//!
//! The clipping is Sutherland-Hodgman's, in f64. Coordinates are f32, so a computed point is off by some 2^-52 of
//! them, which is far less than a triangle's margin.

use crate::{accel::bounds::Bounds, layout::Triangle};

/// The most corners of a clipped triangle: three, and one more for each of the six faces of a cell.
const MAX_CORNERS: usize = 9;

/// Convex polygon, which may be empty.
pub struct Polygon {
    corners: [[f64; 3]; MAX_CORNERS],
    len: usize,
}

/// Clips `triangle` to a cell and cuts it at a plane through the cell. Returns the bounds of the pieces below and
/// above the plane, or none for an empty piece. A piece reaches up to the margin outside the cell and beyond the plane.
/// Its bounds are then grown by the margin once more. `plane`: the axis and the coordinate of the plane, world units.
pub fn split_bounds(triangle: &Triangle, cell: &Bounds, plane: (usize, f32), margin: f32) -> [Option<Bounds>; 2] {
    let polygon = Polygon::near(triangle, cell, margin);
    let (axis, position, margin) = (plane.0, f64::from(plane.1), f64::from(margin));
    [polygon.bounds_in::<true>(axis, position + margin), polygon.bounds_in::<false>(axis, position - margin)]
        .map(|piece| piece.grown(margin))
}

impl Polygon {
    /// Returns the piece of `triangle` within a margin of a cell.
    pub fn near(triangle: &Triangle, cell: &Bounds, margin: f32) -> Self {
        let corner = |v: glam::Vec3| v.as_dvec3().to_array();
        let mut polygon = Polygon { corners: [[0.0; 3]; MAX_CORNERS], len: 3 };
        polygon.corners[..3].copy_from_slice(&[corner(triangle.v0), corner(triangle.v1), corner(triangle.v2)]);
        let margin = f64::from(margin);
        for face in 0..3 {
            polygon.clip::<false>(face, f64::from(cell.min[face]) - margin);
            polygon.clip::<true>(face, f64::from(cell.max[face]) + margin);
        }
        polygon
    }

    /// Returns the corners in their order round the polygon; none if the polygon is empty.
    pub fn corners(&self) -> &[[f64; 3]] {
        &self.corners[..self.len]
    }

    /// Cuts off the piece above (`KEEP_BELOW`) or below a plane.
    fn clip<const KEEP_BELOW: bool>(&mut self, axis: usize, position: f64) {
        let outside = |p: &[f64; 3]| if KEEP_BELOW { p[axis] > position } else { p[axis] < position };
        if !self.corners[..self.len].iter().any(outside) {
            return;
        }
        let mut kept = Polygon { corners: [[0.0; 3]; MAX_CORNERS], len: 0 };
        for ix in 0..self.len {
            let (a, b) = (&self.corners[ix], &self.corners[if ix + 1 == self.len { 0 } else { ix + 1 }]);
            if !outside(a) {
                kept.push(*a);
            }
            // An edge with an end on the plane needs no further corner: that end is kept as a corner already.
            if outside(a) != outside(b) && a[axis] != position && b[axis] != position {
                kept.push(crossing(a, b, axis, position));
            }
        }
        *self = kept;
    }

    /// Appends a corner. A convex polygon never needs more than `MAX_CORNERS`. If rounding has bent a polygon,
    /// further corners replace the last one.
    fn push(&mut self, corner: [f64; 3]) {
        self.corners[self.len.min(MAX_CORNERS - 1)] = corner;
        self.len = (self.len + 1).min(MAX_CORNERS);
    }

    /// Returns the bounds of the piece below (`KEEP_BELOW`) or above a plane.
    fn bounds_in<const KEEP_BELOW: bool>(&self, axis: usize, position: f64) -> Box3 {
        let mut piece = Box3::EMPTY;
        for ix in 0..self.len {
            let (a, b) = (&self.corners[ix], &self.corners[if ix + 1 == self.len { 0 } else { ix + 1 }]);
            if if KEEP_BELOW { a[axis] <= position } else { a[axis] >= position } {
                piece.grow(a);
            }
            if (a[axis] < position && b[axis] > position) || (a[axis] > position && b[axis] < position) {
                piece.grow(&crossing(a, b, axis, position));
            }
        }
        piece
    }
}

/// Returns the point where the edge from `a` to `b` crosses a plane. The two are on different sides of it.
fn crossing(a: &[f64; 3], b: &[f64; 3], axis: usize, position: f64) -> [f64; 3] {
    let t = (position - a[axis]) / (b[axis] - a[axis]);
    let mut point = [0, 1, 2].map(|k| a[k] + t * (b[k] - a[k]));
    point[axis] = position;
    point
}

/// Axis-aligned box in f64.
struct Box3 {
    min: [f64; 3],
    max: [f64; 3],
}

impl Box3 {
    const EMPTY: Self = Self { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3] };

    fn grow(&mut self, point: &[f64; 3]) {
        for (k, &x) in point.iter().enumerate() {
            self.min[k] = if x < self.min[k] { x } else { self.min[k] };
            self.max[k] = if x > self.max[k] { x } else { self.max[k] };
        }
    }

    /// Returns the smallest f32 box around this box and a margin, or none if this box is empty.
    fn grown(&self, margin: f64) -> Option<Bounds> {
        let (min, max) = (self.min.map(|x| round_down(x - margin)), self.max.map(|x| round_up(x + margin)));
        (self.min[0] <= self.max[0]).then_some(Bounds { min, max })
    }
}

/// Returns the largest f32 not above `x`.
fn round_down(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) > x { nearest.next_down() } else { nearest }
}

/// Returns the smallest f32 not below `x`.
fn round_up(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) < x { nearest.next_up() } else { nearest }
}
