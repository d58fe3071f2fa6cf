//! Resolve: the light of all rays of a pixel. Twin of `resolve.comp`.

use std::ops::Range;

use glam::Vec3;

use crate::layout::{Bounce, PathRay};

/// Writes the pixels of the first bounce's rays: of each the sum of its ray's `ray_radiance` and that of all rays that came of
/// it, bounce after bounce.
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

/// The children, in the bounce `next`, of a span of rays of the bounce before.
fn children_of(span: &Range<usize>, next: &Bounce, first_children: &[u32]) -> Range<usize> {
    let Range { start, end } = next.rays();
    // Behind the last ray of a bounce stands none of it.
    let end = if span.end < start { first_children[span.end] as usize } else { end };
    first_children[span.start] as usize..end
}
