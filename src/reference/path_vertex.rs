//! One vertex of a path: the light at its hit, and the way on. Twin of `shading/path_vertex.glsl`.

use glam::{Vec2, Vec3, vec3};

use super::{
    bsdf::{BsdfTerms, bsdf_terms, eval_bsdf, is_smooth, sample_bsdf},
    emitters::{
        LightSample, ambient_radiance, emission_at, emission_pdf, sample_light_with, seen_environment, seen_light,
    },
    inputs::KernelInputs,
    maps::{is_bent, shaded_at},
    material::{emitted, is_unlit, transmittance},
    sampler::{SampleKey, random_pair},
    studio::studio_radiance,
    surface::{Surface, lit_point},
};
use crate::layout::{
    Hit, LEAST_SURVIVAL, MOST_ADDED_LIGHT, NO_TRIANGLE, PathRay, PathState, ROULETTE_DEPTH, SHADOW_RAY_NONE,
    SHADOW_RAY_SHARE, SHADOW_RAY_WAITS, STUDIO_LEAST_PDF, ShadowRay,
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
    /// The sample of the environment that these random numbers give, if it is known already.
    pub of_environment: Option<LightSample>,
}

/// The random numbers of a hit.
pub fn pairs_of_hit(key: SampleKey, depth: u32) -> [Vec2; PAIRS_OF_HIT] {
    [0, 1, 2, 3].map(|place| random_pair(key, first_pair_of(depth) + place))
}

/// Power-heuristic weight of the strategy with pdf `pdf_a` against one with pdf `pdf_b`.
pub fn power_heuristic(pdf_a: f32, pdf_b: f32) -> f32 {
    let largest = pdf_a.max(pdf_b);
    let (a, b) = (pdf_a / largest, pdf_b / largest);
    a * a / (a * a + b * b)
}

/// MIS weight of light that the path's ray meets. `light_pdf`: pdf with which `sample_light` samples the ray's
/// direction.
fn mis_weight(state: &PathState, light_pdf: f32) -> f32 {
    if state.pdf > 0.0 { power_heuristic(state.pdf, light_pdf) } else { 1.0 }
}

/// Light that is added to the path: bounded, after the first hit as the options say, and nothing if it is not finite.
fn added_light(inputs: &KernelInputs, light: Vec3, depth: u32) -> Vec3 {
    let light = if depth > 0 { light.min(Vec3::splat(inputs.frame().clamp)) } else { light };
    let is_finite = light.cmplt(Vec3::INFINITY).all();
    if is_finite { light.clamp(Vec3::ZERO, Vec3::splat(MOST_ADDED_LIGHT)) } else { Vec3::ZERO }
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
    let met = radiance * mis_weight(state, seen.pdf);
    let mirrors = depth > 0 && (state.pdf == 0.0 || state.pdf > STUDIO_LEAST_PDF);
    if mirrors { met + studio_radiance(inputs.frame(), ray.direction) } else { met }
}

const NO_SHADOW_RAY: ShadowRay = ShadowRay {
    origin: Vec3::ZERO,
    state: SHADOW_RAY_NONE,
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
    hit: &'a Hit,
    throughput: Vec3,
}

/// The vector from a hit to the start of a ray in a direction to which lobes with a pdf scatter light.
fn to_start(inputs: &KernelInputs, surface: &Surface, hit: &Hit, direction: Vec3) -> Vec3 {
    let is_mapped = is_bent(surface);
    let is_below = direction.dot(if is_mapped { surface.interpolated } else { surface.geometric }) < 0.0;
    let offset = (if is_below { -surface.origin_offset } else { surface.origin_offset }) * surface.geometric;
    if !is_mapped || is_below {
        return offset;
    }
    let t = &inputs.triangle(hit.triangle_ix);
    offset + (lit_point(surface, hit, t, direction) - surface.point_world)
}

/// The shadow ray to a light that is sampled at a hit.
fn shadow_ray_to_light(inputs: &KernelInputs, choices: &HitChoices, vertex: &Vertex) -> ShadowRay {
    let &Vertex { depth, surface, terms, hit, throughput } = vertex;
    if is_smooth(terms.material) {
        return NO_SHADOW_RAY;
    }
    let [to_light, which, ..] = choices.pairs;
    let u = vec3(to_light.x, to_light.y, which.x);
    let sample = sample_light_with(inputs, surface.point_world, u, choices.of_environment.as_ref());
    if sample.light == Vec3::ZERO {
        return NO_SHADOW_RAY;
    }
    let scattered = eval_bsdf(terms, surface, sample.direction);
    if !scattered.value.cmpgt(Vec3::ZERO).any() {
        return NO_SHADOW_RAY;
    }
    let weight = if sample.pdf > 0.0 { power_heuristic(sample.pdf, scattered.pdf) } else { 1.0 };
    let light = added_light(inputs, throughput * scattered.value * sample.light * weight, depth + 1);
    if !light.cmpgt(Vec3::ZERO).any() {
        return NO_SHADOW_RAY;
    }
    let offset = to_start(inputs, surface, hit, sample.direction);
    let mut shadow_ray = ShadowRay {
        origin: surface.point_world + offset,
        state: SHADOW_RAY_WAITS,
        direction: sample.direction,
        source_triangle: hit.triangle_ix,
        light,
        t_max: sample.distance,
    };
    if sample.distance.is_infinite() {
        return shadow_ray;
    }
    // From its start beside the surface, the shadow ray still goes to the point that was sampled.
    let to_light = sample.distance * sample.direction - offset;
    let distance = to_light.length();
    shadow_ray.direction = to_light / distance;
    shadow_ray.t_max = SHADOW_RAY_SHARE * distance;
    shadow_ray
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
/// with which the path goes on. Returns whether it does, and the shadow ray to the light. `choices` is called if the
/// path makes random decisions.
pub fn scatter_path(
    inputs: &KernelInputs,
    choices: impl FnOnce() -> HitChoices,
    depth: u32,
    hit: &Hit,
    ray: &mut PathRay,
    state: &mut PathState,
) -> (bool, ShadowRay) {
    let is_miss = hit.triangle_ix == NO_TRIANGLE;
    let seen = seen_light(inputs, ray.origin, ray.direction, if is_miss { f32::INFINITY } else { hit.t });
    if seen.t < f32::INFINITY {
        let light = seen.radiance * mis_weight(state, seen.pdf);
        state.radiance += added_light(inputs, ray.throughput * light, depth);
        return (false, NO_SHADOW_RAY);
    }
    scatter_past_lights(inputs, choices, depth, hit, ray, state)
}

/// Does what [`scatter_path`] does, for a ray that meets no rectangle, disk or sphere which shines.
pub fn scatter_past_lights(
    inputs: &KernelInputs,
    choices: impl FnOnce() -> HitChoices,
    depth: u32,
    hit: &Hit,
    ray: &mut PathRay,
    state: &mut PathState,
) -> (bool, ShadowRay) {
    if hit.triangle_ix == NO_TRIANGLE {
        state.radiance += added_light(inputs, ray.throughput * met_environment(inputs, ray, state, depth), depth);
        return (false, NO_SHADOW_RAY);
    }
    let (surface, mut material) = shaded_at(inputs, ray, hit);
    let mut throughput = ray.throughput * transmittance(&material, &surface, hit.t);
    if is_unlit(&material) || material.ke.cmpgt(Vec3::ZERO).any() {
        let light =
            if is_unlit(&material) { emitted(&material) } else { emission_at(inputs, hit.triangle_ix, hit.u, hit.v) };
        let weight = mis_weight(state, emission_pdf(inputs, hit.triangle_ix, ray.origin, ray.direction, hit.t));
        state.radiance += added_light(inputs, throughput * light * weight, depth);
    }
    // The last ray of a path only meets light.
    if is_unlit(&material) || depth + 1 >= inputs.frame().max_depth {
        return (false, NO_SHADOW_RAY);
    }
    let terms = bsdf_terms(&mut material, &surface, -ray.direction);
    let choices = choices();
    let [_, survival, to_next, lobe] = choices.pairs;
    let vertex = Vertex { depth, surface: &surface, terms: &terms, hit, throughput };
    let shadow_ray = shadow_ray_to_light(inputs, &choices, &vertex);
    let next = sample_bsdf(&terms, &surface, vec3(to_next.x, to_next.y, lobe.x));
    throughput *= next.weight;
    if !throughput.cmpgt(Vec3::ZERO).any() || !survives(depth, survival.y, &mut throughput) {
        return (false, shadow_ray);
    }
    *ray = surface.ray_from(next.direction, hit.triangle_ix, ray, throughput);
    if is_bent(&surface) && !next.is_delta {
        ray.origin = surface.point_world + to_start(inputs, &surface, hit, next.direction);
    }
    state.pdf = if next.is_delta { 0.0 } else { next.pdf };
    (true, shadow_ray)
}
