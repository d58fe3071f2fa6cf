//! Resolve: adds a bounce's radiance to the image. Twin of `resolve.comp`.

use glam::Vec3;

use crate::layout::Ray;

/// Adds `ray_radiance` to the rays' pixels (depth 0: sets them). The rays of a pixel stand together.
pub fn resolve(depth: u32, rays: &[Ray], ray_radiance: &[[f32; 4]], pixel_radiance: &mut [[f32; 4]]) {
    let mut of_pixel = ray_radiance.iter();
    for rays in rays.chunk_by(|a, b| a.pixel_ix == b.pixel_ix) {
        let pixel = &mut pixel_radiance[rays[0].pixel_ix as usize];
        let before = if depth == 0 { Vec3::ZERO } else { rgb(pixel) };
        let sum = of_pixel.by_ref().take(rays.len()).fold(before, |sum, radiance| sum + rgb(radiance));
        *pixel = sum.extend(1.0).to_array();
    }
}

fn rgb(&[r, g, b, _]: &[f32; 4]) -> Vec3 {
    Vec3::new(r, g, b)
}
