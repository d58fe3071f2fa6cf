//! Planes of the cells' triangles. Where a ray keeps clear of a triangle's plane, the triangle need not be tested
//! (kdtree/planes.rs). Only arithmetic that rounds in the same way on every device is used.

use crate::layout::{Plane, Triangle};

/// Limit of the error that the rounding of the normal causes in heights above the triangle's plane. The limit is in
/// units of 2^-24 times the largest coordinate times the normal's longest component. Scaling makes that component
/// less than 1/2, so heights are off by at most 8 units of 2^-24 times the largest coordinate. The rounding of the
/// plane's distance adds 4 units, which makes 12. The planes of a kd-tree are off by 4 units, and their proof
/// (kdtree/planes.rs) leaves 21 of the 256 units of `KD_PLANE_EPSILON` unused. So the additional 8 units of a grid's
/// planes are covered.
const MAX_ERROR: f32 = 16.0;

/// Returns the plane of a triangle, or a plane with a normal of 0 if rounding may put the plane too far off. No ray
/// is clear of a plane with such a normal.
///
/// The normal is scaled by a power of two and not by its length, since devices round square roots differently. The
/// longest component of the scaled normal is in `[1/4, 1/2)`. So its length is below 1, and a height above the plane
/// is less than the true one.
pub fn plane_of(triangle: &Triangle, largest_coordinate: f32) -> Plane {
    let a = triangle.v1 - triangle.v0;
    let b = triangle.v2 - triangle.v0;
    let [[ax, ay, az], [bx, by, bz]] = [a.to_array(), b.to_array()];
    let normal = glam::vec3(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx);
    let longest = normal.abs().max_element();
    // Each component is off by 4 units times the product of the edges (overlap.rs). A point of the triangle is no
    // farther from the first corner than the edges are long.
    let edges = a.abs().element_sum() * b.abs().element_sum();
    let reach = a.abs().element_sum().max(b.abs().element_sum());
    let (error, limit) = (4.0 * edges * reach, MAX_ERROR * (largest_coordinate * longest));
    // If the limit is denormal, a device may take both for 0.
    let is_certain = limit >= f32::MIN_POSITIVE && error <= limit;
    let exponent = longest.to_bits() >> 23;
    if !is_certain || !(3..250).contains(&exponent) {
        return Plane::default();
    }
    let normal = normal * f32::from_bits((252 - exponent) << 23);
    let [x, y, z] = (normal * triangle.v0).to_array();
    Plane { normal, distance: x + y + z }
}
