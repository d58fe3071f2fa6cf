//! Tests of the comparers that the other tests rely on.

use glam::Vec3;
use kdray::layout::{Hit, PathRay};

use super::stage::{UNTOUCHED_HIT as HIT, UNTOUCHED_RAY as RAY};
use crate::support::compare::{bytes, exact, exact_but_for, hits, near, pixels, rays};

#[test]
fn each_comparer_notices_one_element() {
    let one = |plant: &dyn Fn() -> Result<(), String>| assert!(plant().is_err());
    one(&|| exact(&[1, 2, 3], &[1, 2, 4]));
    one(&|| exact(&[1, 2, 3], &[1, 2]));
    one(&|| exact_but_for(1, &[1, 2, 3], &[2, 2, 4]));
    one(&|| pixels(1e-5, 0, &[[1.0; 4]; 2], &[[1.0; 4], [1.0, 1.0, 1.0, 1.0 + 1e-4]]));
    one(&|| pixels(1e-5, 0, &[[1.0; 4]], &[[1.0, f32::NAN, 1.0, 1.0]]));
    one(&|| hits(0, &[HIT], &[Hit { t: -7.1, ..HIT }]));
    one(&|| hits(0, &[HIT], &[Hit { u: -7.1, ..HIT }]));
    one(&|| hits(0, &[HIT], &[Hit { v: f32::NAN, ..HIT }]));
    one(&|| hits(0, &[HIT], &[Hit { triangle_ix: u32::MAX, ..HIT }]));
    one(&|| rays(1e-5, 0, &[RAY], &[PathRay { pixel_ix: 1, ..RAY }]));
    one(&|| rays(1e-5, 0, &[RAY], &[PathRay { source_triangle: 1, ..RAY }]));
    one(&|| rays(1e-5, 0, &[RAY], &[PathRay { origin: RAY.origin + 1e-3 * Vec3::X, ..RAY }]));
    one(&|| rays(1e-5, 0, &[RAY], &[PathRay { direction: RAY.direction + 1e-3 * Vec3::Y, ..RAY }]));
    one(&|| rays(1e-5, 0, &[RAY], &[PathRay { throughput: RAY.throughput + 1e-3 * Vec3::Z, ..RAY }]));
    one(&|| rays(1e-5, 0, &[RAY], &[PathRay { t_max: f32::INFINITY, ..RAY }]));
    one(&|| bytes(1, &[[0, 5, 9, 255]], &[[0, 5, 11, 255]]));
    assert!(hits(0, &[HIT], &[HIT]).is_ok() && rays(1e-5, 0, &[RAY], &[RAY]).is_ok());
    assert!(near(f32::INFINITY, f32::INFINITY, 0.0) && !near(f32::INFINITY, 1.0, 1.0));
}
