//! The planes of the cells' triangles, by which a ray is spared tests as in a kd-tree's leaves (kdtree/planes.rs), from
//! arithmetic that every device has.

use crate::layout::{Plane, Triangle};

/// In units of 2^-24 times the largest coordinate: twice what the rounding of a normal may do to the heights of its triangle's
/// points. The plane's distance is off by 4 units more. Together it is 12; a kd-tree's planes are off by 4, and of the 256
/// units of `KD_PLANE_EPSILON` they leave 21.
const MOST_ERROR: f32 = 16.0;

/// The plane of a triangle; a normal of 0, which nothing is clear of, where rounding puts the plane too far off.
///
/// The normal's longest component is in [1/4, 1/2), by a power of two, since a root has no exact last bit on a device. So
/// its length is below 1, and a height above the plane is less than the true one.
pub fn plane_of(triangle: &Triangle, largest_coordinate: f32) -> Plane {
    let a = triangle.v1 - triangle.v0;
    let b = triangle.v2 - triangle.v0;
    let [[ax, ay, az], [bx, by, bz]] = [a.to_array(), b.to_array()];
    let normal = glam::vec3(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx);
    let longest = normal.abs().max_element();
    // Each component is off by 4 units times the product (overlap.rs), a point is no farther away than the edges are long.
    let edges = a.abs().element_sum() * b.abs().element_sum();
    let reach = a.abs().element_sum().max(b.abs().element_sum());
    let is_certain = 4.0 * edges * reach <= MOST_ERROR * (largest_coordinate * longest);
    let exponent = longest.to_bits() >> 23;
    if !is_certain || !(3..250).contains(&exponent) {
        return Plane::default();
    }
    let normal = normal * f32::from_bits((252 - exponent) << 23);
    let [x, y, z] = (normal * triangle.v0).to_array();
    Plane { normal, distance: x + y + z }
}
