//! The studio that metals and glass mirror. Twin of `shading/studio.glsl`, which describes it.

use glam::{Vec2, Vec3, Vec4, vec2, vec3, vec4};

use crate::layout::Frame;

/// Radiance of the ceiling in the zenith.
const CEILING: f32 = 0.5;
/// Share of the background's radiance that the floor lacks.
const FLOOR: f32 = 0.6;
/// Sine of the angle below the horizon from which on the floor lacks that share.
const HORIZON: f32 = 0.1;
/// Width of a box's soft edge, as a tangent from the box's middle.
const EDGE: f32 = 0.08;

/// A box: sine and cosine of the azimuth and of the elevation of its middle, tangents of half its angles, radiance.
const BOXES: [(Vec4, Vec2, f32); 3] = [
    (vec4(-0.7660444, 0.6427876, 0.6427876, 0.7660444), vec2(0.5, 0.4), 2.4),
    (vec4(0.9659258, 0.258819, 0.258819, 0.9659258), vec2(0.25, 0.7), 1.2),
    (vec4(0.3420201, -0.9396926, 0.6427876, 0.7660444), vec2(0.6, 0.2), 1.6),
];

/// The radiance of a box in a direction of the studio's frame: to the right, up, and towards the viewer.
fn radiance_of_box(local: Vec3, (angles, half_size, radiance): (Vec4, Vec2, f32)) -> f32 {
    let [azimuth_sin, azimuth_cos, elevation_sin, elevation_cos] = angles.to_array();
    let middle = vec3(azimuth_sin * elevation_cos, elevation_sin, azimuth_cos * elevation_cos);
    let across = vec3(azimuth_cos, 0.0, -azimuth_sin);
    let along = vec3(-azimuth_sin * elevation_sin, elevation_cos, -azimuth_cos * elevation_sin);
    let depth = local.dot(middle);
    if depth <= 0.0 {
        return 0.0;
    }
    let place = vec2(local.dot(across), local.dot(along)).abs() / depth;
    let share = ((half_size - place) / EDGE).clamp(Vec2::ZERO, Vec2::ONE);
    radiance * share.x * share.y
}

/// The radiance that the studio adds to that of the background, for a ray that leaves the scene after its first hit.
/// The floor is darker than the background, so it adds a negative radiance.
pub fn studio_radiance(frame: &Frame, direction: Vec3) -> Vec3 {
    if frame.has_studio == 0 {
        return Vec3::ZERO;
    }
    let up = if frame.up_axis == 2 { Vec3::Z } else { Vec3::Y };
    let right = up.cross(frame.to_viewer);
    let local = vec3(direction.dot(right), direction.dot(up), direction.dot(frame.to_viewer));
    let mut sum = CEILING * local.y.max(0.0);
    for it in BOXES {
        sum += radiance_of_box(local, it);
    }
    Vec3::splat(sum) - FLOOR * (-local.y / HORIZON).clamp(0.0, 1.0) * frame.background
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_above_the_left_and_beside_the_right_shoulder_of_the_viewer() {
        let seen = |up_axis, to_viewer, direction: Vec3| {
            let frame = Frame { has_studio: 1, up_axis, to_viewer, ..Frame::default() };
            studio_radiance(&frame, direction.normalize()).x
        };
        for (up_axis, to_viewer, right) in [(1, Vec3::Z, Vec3::X), (2, Vec3::NEG_Y, Vec3::X), (1, Vec3::X, Vec3::NEG_Z)]
        {
            let up = if up_axis == 2 { Vec3::Z } else { Vec3::Y };
            let at = |x: f32, y: f32, z: f32| seen(up_axis, to_viewer, x * right + y * up + z * to_viewer);
            assert!(at(-0.59, 0.64, 0.49) > 2.4 && at(0.93, 0.26, 0.25) > 1.2 && at(0.26, 0.64, -0.72) > 1.6);
            assert_eq!(at(0.0, 1.0, 0.0), CEILING);
            for dark in [at(0.0, 0.0, 1.0), at(0.0, -1.0, 0.0), at(0.0, 0.0, -1.0), at(-0.2, -0.1, -1.0)] {
                assert_eq!(dark, 0.0);
            }
        }
        assert_eq!(studio_radiance(&Frame::default(), Vec3::Y), Vec3::ZERO);
    }

    /// A box mirrors the floor at its sides, and stands out from the background.
    #[test]
    fn the_floor_is_darker_than_the_background() {
        let background = vec3(0.3, 0.4, 0.5);
        let frame = Frame { has_studio: 1, up_axis: 2, to_viewer: Vec3::X, background, ..Frame::default() };
        let seen = |z: f32| background + studio_radiance(&frame, vec3(-(1.0 - z * z).sqrt(), 0.0, z));
        assert_eq!(seen(0.0), background);
        assert!(seen(-0.05).abs_diff_eq(0.7 * background, 1e-6) && seen(-0.9).abs_diff_eq(0.4 * background, 1e-6));
    }
}
