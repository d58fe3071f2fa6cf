//! Resolve: sums the radiance of all rays of a pixel. Twin of `resolve.comp`.

use std::ops::Range;

use glam::Vec3;

use crate::layout::{Bounce, PathRay};

/// Writes the pixels of the first bounce's rays. Each is the sum of the `ray_radiance` of its ray and of all the
/// ray's descendants, bounce after bounce.
pub fn resolve(
    bounces: &[Bounce],
    rays: &[PathRay],
    ray_radiance: &[[f32; 4]],
    first_children: &[u32],
    pixel_radiance: &mut [[f32; 4]],
) {
    for ray_ix in bounces[0].rays() {
        let mut sum = Vec3::ZERO;
        let mut span = ray_ix..ray_ix + 1;
        for next in bounces[1..].iter().map(Some).chain([None]) {
            sum = ray_radiance[span.clone()].iter().fold(sum, |sum, &[r, g, b, _]| sum + Vec3::new(r, g, b));
            span = next.filter(|next| next.n_rays > 0).map_or(0..0, |next| children_of(&span, next, first_children));
            if span.is_empty() {
                break;
            }
        }
        pixel_radiance[rays[ray_ix].pixel_ix as usize] = sum.extend(1.0).to_array();
    }
}

/// The children, in the bounce `next`, of a span of rays of the previous bounce.
fn children_of(span: &Range<usize>, next: &Bounce, first_children: &[u32]) -> Range<usize> {
    let Range { start, end } = next.rays();
    // The children end where those of the next ray begin. After a bounce's last ray there is no such ray.
    let end = if span.end < start { first_children[span.end] as usize } else { end };
    first_children[span.start] as usize..end
}
