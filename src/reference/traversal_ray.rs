//! A ray as a search through an acceleration structure takes it, and the part of it that is in the structure's box. Twin of
//! `traversal_ray.glsl`.

use glam::{Vec3, Vec3A};

use super::{candidate::Target, counting::table::ReadCounter, inputs::KernelInputs, search_ray::SearchRay};
use crate::layout::{Hit, KD_LEAST_COMPONENT, KD_MAX_ORIGIN_DISTANCE, KD_PLANE_EPSILON, NO_TRIANGLE};

/// What the traversal needs of a ray. Arrays by axis have a fourth entry so that two bits index them without a check.
#[derive(Clone, Copy, Debug)]
pub struct TraversalRay {
    pub target: Target,
    pub origin: Vec3A,
    pub direction: Vec3A,
    /// How far a segment has to keep from a plane to be clear of it.
    pub plane_epsilon: f32,
    pub inv_direction: [f32; 4],
    /// Where the ray meets the plane at 0 on each axis, in t.
    pub bias: [f32; 4],
    pub t_enter: f32,
    pub t_exit: f32,
}

/// GLSL's `min`: the first operand where either is NaN.
#[inline(always)]
pub fn min(x: f32, y: f32) -> f32 {
    if y < x { y } else { x }
}

/// GLSL's `max`: the first operand where either is NaN.
#[inline(always)]
pub fn max(x: f32, y: f32) -> f32 {
    if x < y { y } else { x }
}

/// Bit i: on axis i, the ray comes to the upper child first.
#[inline(always)]
pub fn signs_of(direction: Vec3) -> u32 {
    let is_below = |d: f32| u32::from(d <= -KD_LEAST_COMPONENT);
    is_below(direction.x) | is_below(direction.y) << 1 | is_below(direction.z) << 2
}

impl TraversalRay {
    #[inline]
    pub fn new(inputs: &KernelInputs<impl ReadCounter>, ray: &SearchRay) -> Self {
        let origin = ray.origin.to_array();
        let cell_min = inputs.cell_min.to_array();
        let cell_max = inputs.cell_max.to_array();
        let direction =
            ray.direction.to_array().map(|d| if d.abs() < KD_LEAST_COMPONENT { KD_LEAST_COMPONENT } else { d });
        let inv_direction = direction.map(|d| 1.0 / d);
        let bias = [0, 1, 2].map(|i| -origin[i] * inv_direction[i]);
        let t0 = [0, 1, 2].map(|i| cell_min[i] * inv_direction[i] + bias[i]);
        let t1 = [0, 1, 2].map(|i| cell_max[i] * inv_direction[i] + bias[i]);
        let near = [0, 1, 2].map(|i| min(t0[i], t1[i]));
        let far = [0, 1, 2].map(|i| max(t0[i], t1[i]));
        Self {
            target: Target::of(ray),
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

#[inline(always)]
pub fn largest_coordinate(inputs: &KernelInputs<impl ReadCounter>) -> f32 {
    inputs.cell_min.abs().max(inputs.cell_max.abs()).max_element()
}

/// How far from 0, by its largest coordinate, a ray may start for the margins of the leaves to cover its rounding.
#[inline(always)]
pub fn origin_reach(inputs: &KernelInputs<impl ReadCounter>) -> f32 {
    KD_MAX_ORIGIN_DISTANCE * largest_coordinate(inputs)
}

/// Whether the ray starts within reach.
#[inline(always)]
fn is_within_reach(inputs: &KernelInputs<impl ReadCounter>, ray: &SearchRay) -> bool {
    ray.origin.abs().max_element() <= origin_reach(inputs)
}

/// The ray with its origin moved along it to lie within `KD_MAX_ORIGIN_DISTANCE`, and how far: 0 for all but cameras far away.
#[inline(always)]
pub fn near_scene(inputs: &KernelInputs<impl ReadCounter>, ray: &SearchRay) -> (SearchRay, f32) {
    if is_within_reach(inputs, ray) {
        return (*ray, 0.0);
    }
    let t_start = max(TraversalRay::new(inputs, &SearchRay { t_min: 0.0, ..*ray }).t_enter, 0.0);
    let origin = ray.origin + t_start * ray.direction;
    (SearchRay { origin, t_min: ray.t_min - t_start, t_max: ray.t_max - t_start, ..*ray }, t_start)
}

/// What `search` finds from near the scene, as seen from where the ray starts. A miss keeps t = t_max.
#[inline(always)]
pub fn hit_from_near(
    inputs: &KernelInputs<impl ReadCounter>,
    probe: &SearchRay,
    search: impl FnOnce(&SearchRay, &mut Hit),
) -> Hit {
    let (near, t_start) = near_scene(inputs, probe);
    let mut best = near.miss();
    search(&near, &mut best);
    best.t = if best.triangle_ix == NO_TRIANGLE { probe.t_max } else { best.t + t_start };
    best
}

fn by_axis([x, y, z]: [f32; 3]) -> [f32; 4] {
    [x, y, z, 0.0]
}
