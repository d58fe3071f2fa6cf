//! The camera rays of paths. Twin of `rays/path_camera.glsl`.

use glam::{UVec2, Vec2, Vec3, vec2};

use super::{
    camera::pixel_ix_of, inputs::KernelInputs, noise_tiles::picture_pixel_of, tent::tent, turns::sin_cos_of_turns,
};
use crate::layout::{FILTER_BOX, FILTER_CENTRE, FILTER_TENT, Frame, NO_TRIANGLE, PathRay};

/// The direction of an angle that is the share `turn` of a full turn.
fn on_circle(turn: f32) -> Vec2 {
    let (sine, cosine) = sin_cos_of_turns(turn);
    vec2(cosine, sine)
}

/// The offset of a sample from the centre of its pixel, pixels. Its pdf is the pixel's filter.
pub fn filter_offset(frame: &Frame, u: Vec2) -> Vec2 {
    match frame.pixel_filter {
        FILTER_CENTRE => Vec2::ZERO,
        FILTER_BOX => u - 0.5,
        FILTER_TENT => vec2(tent(u.x), tent(u.y)),
        _ => {
            let within = 1.0 - (-4.5_f32).exp();
            0.5 * (-2.0 * (1.0 - u.x * within).ln()).sqrt() * on_circle(u.y)
        }
    }
}

/// The point of the unit disk, by the concentric map of the square.
pub fn lens_point(u: Vec2) -> Vec2 {
    let at = 2.0 * u - 1.0;
    if at == Vec2::ZERO {
        return Vec2::ZERO;
    }
    let is_flat = at.x.abs() > at.y.abs();
    let radius = if is_flat { at.x } else { at.y };
    let turn = if is_flat { 0.125 * at.y / at.x } else { 0.25 - 0.125 * at.x / at.y };
    radius * on_circle(turn)
}

/// The camera ray of a sample of the window's pixel. `in_pixel`, `in_lens`: random numbers in [0, 1).
pub fn path_camera_ray(inputs: &KernelInputs, pixel: UVec2, in_pixel: Vec2, in_lens: Vec2) -> PathRay {
    let frame = inputs.frame();
    let at_px = picture_pixel_of(frame, inputs.noise_tiles, pixel).as_vec2() + 0.5 + filter_offset(frame, in_pixel);
    let at = at_px / vec2(frame.picture_width as f32, frame.picture_height as f32) * 2.0 - 1.0;
    let in_image = at.x * frame.right - at.y * frame.up;
    let (mut origin, mut direction) = (frame.eye, frame.forward);
    if frame.is_orthographic == 1 {
        origin += in_image;
    } else {
        direction += in_image;
    }
    if frame.aperture > 0.0 {
        let lens = frame.aperture * lens_point(in_lens);
        let aside = lens.x * frame.right.normalize() + lens.y * frame.up.normalize();
        direction = frame.focus * direction - aside;
        origin += aside;
    }
    PathRay {
        origin,
        pixel_ix: pixel_ix_of(frame, pixel),
        direction: direction.normalize(),
        source_triangle: NO_TRIANGLE,
        throughput: Vec3::ONE,
        t_max: f32::INFINITY,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::FILTER_GAUSSIAN;

    /// The filter `gaussian` is as wide as the help says: it has standard deviation 0.5 px before it is cut off at
    /// 1.5 px from the centre.
    #[test]
    fn a_gaussian_is_cut_off() {
        const N: usize = 400;
        let frame = Frame { pixel_filter: FILTER_GAUSSIAN, ..Frame::default() };
        let unit = |i: usize| (i as f32 + 0.5) / N as f32;
        let offsets: Vec<_> = (0..N * N).map(|i| filter_offset(&frame, vec2(unit(i % N), unit(i / N)))).collect();
        let weight = |x: f32, y: f32| if x.hypot(y) < 1.5 { (-2.0 * (x * x + y * y)).exp() } else { 0.0 };
        let at = |i: usize| 3.0 * unit(i) - 1.5;
        let integral = |most: f32| -> f32 {
            let columns = (0..N).filter(|&i| at(i) < most);
            columns.map(|i| (0..N).map(|k| weight(at(i), at(k))).sum::<f32>()).sum()
        };
        for most in [-1.2, -0.6, 0.0, 0.9] {
            let found = offsets.iter().filter(|offset| offset.x < most).count() as f32 / (N * N) as f32;
            let expected = integral(most) / integral(2.0);
            assert!((found - expected).abs() < 0.003 * expected.max(0.1), "{most}: {found}, not {expected}");
        }
        assert!(offsets.iter().all(|offset| offset.length() < 1.5 + 1e-5));
    }
}
