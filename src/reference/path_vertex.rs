//! One step of a path: the light at its hit, and the way on. Twin of `path_vertex.glsl`.

use glam::{Vec2, Vec3, vec3};

use super::{
    bsdf::{BsdfTerms, bsdf_terms, is_smooth, sample_bsdf, value_at},
    emitters::{LightPick, ambient_radiance, emission_at, emission_pdf, pick_light_with, seen_environment, seen_light},
    inputs::KernelInputs,
    maps::shaded_at,
    material::{emitted, is_unlit, unabsorbed},
    sampler::{SampleKey, random_pair},
    studio::studio_radiance,
    surface::Surface,
};
use crate::layout::{
    Hit, LEAST_SURVIVAL, NO_TRIANGLE, PathRay, PathState, ROULETTE_DEPTH, SEGMENT_NONE, SEGMENT_SHARE, SEGMENT_WAITS,
    STUDIO_LEAST_PDF, Segment,
};

/// The number of pairs of random numbers that come before those of the first hit: in the pixel and in the lens.
const PAIRS_OF_CAMERA: u32 = 2;
/// The number of pairs for each hit.
pub const PAIRS_OF_HIT: usize = 4;

/// The place of the first pair of random numbers of a hit.
pub fn first_pair_of(depth: u32) -> u32 {
    PAIRS_OF_CAMERA + PAIRS_OF_HIT as u32 * depth
}

/// The random decisions at a hit.
#[derive(Clone, Copy, Debug, Default)]
pub struct HitChoices {
    pub pairs: [Vec2; PAIRS_OF_HIT],
    /// The pick of the environment that these random numbers give, if it is known already.
    pub of_environment: Option<LightPick>,
}

/// The random numbers of a hit.
pub fn pairs_of_hit(key: SampleKey, depth: u32) -> [Vec2; PAIRS_OF_HIT] {
    [0, 1, 2, 3].map(|place| random_pair(key, first_pair_of(depth) + place))
}

/// The share of a way of sampling, whose pdf is the first one, beside another way.
pub fn power_share(pdf: f32, other: f32) -> f32 {
    let largest = pdf.max(other);
    let (own, others) = (pdf / largest, other / largest);
    own * own / (own * own + others * others)
}

/// The share of light that a path meets on its way, and that could have been sampled with the pdf `of_lights`.
fn share_of_met(state: &PathState, of_lights: f32) -> f32 {
    if state.pdf > 0.0 { power_share(state.pdf, of_lights) } else { 1.0 }
}

/// Light that is added to the path: bounded after the first hit, and nothing if it is not a number.
fn added_light(inputs: &KernelInputs, light: Vec3, depth: u32) -> Vec3 {
    let light = if depth > 0 { light.min(Vec3::splat(inputs.frame().clamp)) } else { light };
    let is_finite = light.cmplt(Vec3::splat(1.0e30)).all();
    if is_finite { light.max(Vec3::ZERO) } else { Vec3::ZERO }
}

/// The light of an environment that a ray meets.
/// The studio is no light that is sampled, so all of it is met. Only narrow lobes see it: it is there to be mirrored,
/// and wide ones would make noise of it.
fn met_environment(inputs: &KernelInputs, ray: &PathRay, state: &PathState, depth: u32) -> Vec3 {
    let seen = seen_environment(inputs, ray.direction);
    let mut radiance = seen.radiance;
    if state.pdf > 0.0 {
        radiance += ambient_radiance(inputs, ray.direction);
    }
    let met = radiance * share_of_met(state, seen.pdf);
    let mirrors = depth > 0 && (state.pdf == 0.0 || state.pdf > STUDIO_LEAST_PDF);
    if mirrors { met + studio_radiance(inputs.frame(), ray.direction) } else { met }
}

const NO_SEGMENT: Segment = Segment {
    origin: Vec3::ZERO,
    state: SEGMENT_NONE,
    direction: Vec3::ZERO,
    source_triangle: NO_TRIANGLE,
    light: Vec3::ZERO,
    t_max: 0.0,
};

/// A hit of a path, as its light is computed.
struct Vertex<'a> {
    depth: u32,
    surface: &'a Surface,
    terms: &'a BsdfTerms<'a>,
    triangle_ix: u32,
    throughput: Vec3,
}

/// The segment to a light that is picked at a hit.
fn segment_to_light(inputs: &KernelInputs, choices: &HitChoices, vertex: &Vertex) -> Segment {
    let &Vertex { depth, surface, terms, triangle_ix, throughput } = vertex;
    if is_smooth(terms.material) {
        return NO_SEGMENT;
    }
    let [to_light, which, ..] = choices.pairs;
    let u = vec3(to_light.x, to_light.y, which.x);
    let pick = pick_light_with(inputs, surface.point_world, u, choices.of_environment.as_ref());
    if pick.light == Vec3::ZERO {
        return NO_SEGMENT;
    }
    let scattered = value_at(terms, surface, pick.direction);
    if !scattered.value.cmpgt(Vec3::ZERO).any() {
        return NO_SEGMENT;
    }
    let share = if pick.pdf > 0.0 { power_share(pick.pdf, scattered.pdf) } else { 1.0 };
    let light = added_light(inputs, throughput * scattered.value * pick.light * share, depth + 1);
    if !light.cmpgt(Vec3::ZERO).any() {
        return NO_SEGMENT;
    }
    let side = if pick.direction.dot(surface.geometric) < 0.0 { -surface.clearance } else { surface.clearance };
    let offset = side * surface.geometric;
    let mut segment = Segment {
        origin: surface.point_world + offset,
        state: SEGMENT_WAITS,
        direction: pick.direction,
        source_triangle: triangle_ix,
        light,
        t_max: pick.distance,
    };
    if pick.distance.is_infinite() {
        return segment;
    }
    // From its start beside the surface, the segment still goes to the point that was picked.
    let to_light = pick.distance * pick.direction - offset;
    let distance = to_light.length();
    segment.direction = to_light / distance;
    segment.t_max = SEGMENT_SHARE * distance;
    segment
}

/// Whether a path survives Russian roulette. Its throughput is then larger, by the reciprocal of the probability.
fn survives(depth: u32, u: f32, throughput: &mut Vec3) -> bool {
    if depth < ROULETTE_DEPTH {
        return true;
    }
    let survival = throughput.max_element().clamp(LEAST_SURVIVAL, 1.0);
    *throughput /= survival;
    u < survival
}

/// Adds the light that the path's ray meets to its state, samples a light at the hit, and replaces the ray by the one
/// with which the path goes on. Returns whether it does, and the segment to the light. `choices` is called if the
/// path makes random decisions.
pub fn step_path(
    inputs: &KernelInputs,
    choices: impl FnOnce() -> HitChoices,
    depth: u32,
    hit: &Hit,
    ray: &mut PathRay,
    state: &mut PathState,
) -> (bool, Segment) {
    let is_miss = hit.triangle_ix == NO_TRIANGLE;
    let seen = seen_light(inputs, ray.origin, ray.direction, if is_miss { f32::INFINITY } else { hit.t });
    if seen.t < f32::INFINITY {
        let light = seen.radiance * share_of_met(state, seen.pdf);
        state.radiance += added_light(inputs, ray.throughput * light, depth);
        return (false, NO_SEGMENT);
    }
    step_past_lights(inputs, choices, depth, hit, ray, state)
}

/// Does what [`step_path`] does, for a ray that meets no rectangle, disk or sphere which shines.
pub fn step_past_lights(
    inputs: &KernelInputs,
    choices: impl FnOnce() -> HitChoices,
    depth: u32,
    hit: &Hit,
    ray: &mut PathRay,
    state: &mut PathState,
) -> (bool, Segment) {
    if hit.triangle_ix == NO_TRIANGLE {
        state.radiance += added_light(inputs, ray.throughput * met_environment(inputs, ray, state, depth), depth);
        return (false, NO_SEGMENT);
    }
    let (surface, mut material) = shaded_at(inputs, ray, hit);
    let mut throughput = ray.throughput * unabsorbed(&material, &surface, hit.t);
    if is_unlit(&material) || material.ke.cmpgt(Vec3::ZERO).any() {
        let light =
            if is_unlit(&material) { emitted(&material) } else { emission_at(inputs, hit.triangle_ix, hit.u, hit.v) };
        let share = share_of_met(state, emission_pdf(inputs, hit.triangle_ix, ray.origin, ray.direction, hit.t));
        state.radiance += added_light(inputs, throughput * light * share, depth);
    }
    // The last ray of a path only meets light.
    if is_unlit(&material) || depth + 1 >= inputs.frame().max_depth {
        return (false, NO_SEGMENT);
    }
    let terms = bsdf_terms(&mut material, &surface, -ray.direction);
    let choices = choices();
    let [_, survival, to_next, lobe] = choices.pairs;
    let vertex = Vertex { depth, surface: &surface, terms: &terms, triangle_ix: hit.triangle_ix, throughput };
    let segment = segment_to_light(inputs, &choices, &vertex);
    let next = sample_bsdf(&terms, &surface, vec3(to_next.x, to_next.y, lobe.x));
    throughput *= next.weight;
    if !throughput.cmpgt(Vec3::ZERO).any() || !survives(depth, survival.y, &mut throughput) {
        return (false, segment);
    }
    *ray = surface.ray_from(next.direction, hit.triangle_ix, ray, throughput);
    state.pdf = if next.is_delta { 0.0 } else { next.pdf };
    (true, segment)
}
