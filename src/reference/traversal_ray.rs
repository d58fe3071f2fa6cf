//! A ray in the form that searches through an acceleration structure use, and its interval in the structure's box.
//! Twin of `search/traversal_ray.glsl`. Here all t are the ray's own; there they are halves.

use glam::{Vec3, Vec3A};

use super::{candidate::HitFilter, counting::table::ReadCounter, inputs::KernelInputs, search_ray::SearchRay};
use crate::layout::{Hit, KD_LEAST_COMPONENT, KD_MAX_ORIGIN_DISTANCE, KD_PLANE_EPSILON, NO_TRIANGLE};

/// A ray in the form that the traversal uses. Arrays by axis have a fourth entry, so that two bits index them without
/// a check.
#[derive(Clone, Copy, Debug)]
pub struct TraversalRay {
    pub hit_filter: HitFilter,
    pub origin: Vec3A,
    pub direction: Vec3A,
    /// Distance from a plane beyond which a segment of the ray is clear of it (world units).
    pub plane_epsilon: f32,
    /// The inverses of the direction's components. They are finite, since a component whose magnitude is less than
    /// `KD_LEAST_COMPONENT` is first replaced by that constant.
    pub inv_direction: [f32; 4],
    /// The t at which the ray meets the plane at 0 on each axis.
    pub bias: [f32; 4],
    /// The t at which the ray enters the structure's box, but at least the ray's `t_min`.
    pub t_enter: f32,
    /// The t at which the ray leaves the structure's box, but at most the ray's `t_max`.
    pub t_exit: f32,
}

/// GLSL's `min`: returns the first operand if either is NaN.
#[inline(always)]
pub fn min(x: f32, y: f32) -> f32 {
    if y < x { y } else { x }
}

/// GLSL's `max`: returns the first operand if either is NaN.
#[inline(always)]
pub fn max(x: f32, y: f32) -> f32 {
    if x < y { y } else { x }
}

/// Returns the signs of a direction. Bit i is set if the ray goes downwards on axis i, and so meets the upper child
/// of a split on that axis first.
#[inline(always)]
pub fn signs_of(direction: Vec3) -> u32 {
    let is_below = |d: f32| u32::from(d <= -KD_LEAST_COMPONENT);
    is_below(direction.x) | is_below(direction.y) << 1 | is_below(direction.z) << 2
}

impl TraversalRay {
    /// Prepares a ray for the traversal and clips it to the structure's box. If the ray misses the box, `t_enter` is
    /// greater than `t_exit`.
    #[inline]
    pub fn new(inputs: &KernelInputs<impl ReadCounter>, ray: &SearchRay) -> Self {
        let origin = ray.origin.to_array();
        let box_min = inputs.box_min.to_array();
        let box_max = inputs.box_max.to_array();
        let direction =
            ray.direction.to_array().map(|d| if d.abs() < KD_LEAST_COMPONENT { KD_LEAST_COMPONENT } else { d });
        let inv_direction = direction.map(|d| 1.0 / d);
        let bias = [0, 1, 2].map(|i| -origin[i] * inv_direction[i]);
        let t0 = [0, 1, 2].map(|i| box_min[i] * inv_direction[i] + bias[i]);
        let t1 = [0, 1, 2].map(|i| box_max[i] * inv_direction[i] + bias[i]);
        let near = [0, 1, 2].map(|i| min(t0[i], t1[i]));
        let far = [0, 1, 2].map(|i| max(t0[i], t1[i]));
        Self {
            hit_filter: HitFilter::of(ray),
            origin: ray.origin.into(),
            direction: ray.direction.into(),
            plane_epsilon: KD_PLANE_EPSILON * largest_coordinate(inputs),
            inv_direction: by_axis(inv_direction),
            bias: by_axis(bias),
            t_enter: max(max(near[0], near[1]), max(near[2], ray.t_min)),
            t_exit: min(min(far[0], far[1]), min(far[2], ray.t_max)),
        }
    }
}

/// Returns the greatest magnitude of a coordinate of the structure's box (world units).
#[inline(always)]
pub fn largest_coordinate(inputs: &KernelInputs<impl ReadCounter>) -> f32 {
    inputs.box_min.abs().max(inputs.box_max.abs()).max_element()
}

/// Returns the greatest magnitude of a component.
#[inline(always)]
fn longest_component(v: Vec3) -> f32 {
    v.abs().max_element()
}

/// Returns the ray with its origin moved along itself by t.
#[inline(always)]
fn moved(ray: &SearchRay, t: f32) -> SearchRay {
    SearchRay { origin: ray.origin + t * ray.direction, t_min: ray.t_min - t, t_max: ray.t_max - t, ..*ray }
}

/// Moves a ray's origin to the point that is nearest to 0, of those with t from `t_min` or 0 up to `t_max`, if that at
/// least halves its largest coordinate. Returns the distance of the move, or else 0.
fn move_to_centre(ray: &mut SearchRay) -> f32 {
    let t_nearest = -ray.origin.dot(ray.direction) / ray.direction.length_squared();
    let t_move = min(max(t_nearest, min(ray.t_min, 0.0)), ray.t_max);
    let there = moved(ray, t_move);
    if !(2.0 * longest_component(there.origin) <= longest_component(ray.origin)) {
        return 0.0;
    }
    *ray = there;
    t_move
}

/// Returns the ray, and the t by which its origin was moved, or 0. If the origin is beyond the limit of
/// `KD_MAX_ORIGIN_DISTANCE`, it is moved along the ray to the structure's box. If it is then beyond `origin_reach`, it
/// is moved towards 0 (`accel/kdtree/scales.rs`).
#[inline(always)]
pub fn near_scene(inputs: &KernelInputs<impl ReadCounter>, ray: &SearchRay) -> (SearchRay, f32) {
    if longest_component(ray.origin) <= inputs.origin_reach { (*ray, 0.0) } else { far_near_scene(inputs, ray) }
}

#[cold]
fn far_near_scene(inputs: &KernelInputs<impl ReadCounter>, ray: &SearchRay) -> (SearchRay, f32) {
    let (mut near, mut t_start) = (*ray, 0.0);
    if longest_component(ray.origin) > KD_MAX_ORIGIN_DISTANCE * largest_coordinate(inputs) {
        t_start = max(TraversalRay::new(inputs, &SearchRay { t_min: 0.0, ..*ray }).t_enter, 0.0);
        near = moved(ray, t_start);
    }
    if longest_component(near.origin) > inputs.origin_reach {
        t_start += move_to_centre(&mut near);
    }
    // A greater t is above the difference, so that its sum with t_start is above t_min even if it is rounded. The
    // kernel subtracts the sum of the moves, too, so that the result is the same.
    near.t_min = if t_start == 0.0 { ray.t_min } else { ray.t_min.next_up() - t_start };
    (near, t_start)
}

/// Returns the t of a hit, counted from the ray's own origin. `t_near`: the t of the hit on the ray that [`near_scene`]
/// moved by `t_start`. `t_max`: the end of the ray's interval, beyond which the sum could round.
#[inline(always)]
pub fn t_from_origin(t_near: f32, t_start: f32, t_max: f32) -> f32 {
    min(t_near + t_start, t_max)
}

/// Calls `search` with the ray that [`near_scene`] returns, and returns its hit with t counted from the ray's own
/// origin. A miss has t = t_max.
#[inline(always)]
pub fn hit_from_near(
    inputs: &KernelInputs<impl ReadCounter>,
    search_ray: &SearchRay,
    search: impl FnOnce(&SearchRay, &mut Hit),
) -> Hit {
    let (near, t_start) = near_scene(inputs, search_ray);
    let mut best = near.miss();
    search(&near, &mut best);
    let is_miss = best.triangle_ix == NO_TRIANGLE;
    best.t = if is_miss { search_ray.t_max } else { t_from_origin(best.t, t_start, search_ray.t_max) };
    best
}

fn by_axis([x, y, z]: [f32; 3]) -> [f32; 4] {
    [x, y, z, 0.0]
}
