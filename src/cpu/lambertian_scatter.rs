//! One bounce of sixteen paths at [Lambertian surfaces](super::lambertian_surfaces). It does the operations of the
//! reference's `scatter_path` for such a surface, in the same order, so that the results are the same bit for bit.

use std::f32::consts::PI;

use fearless_simd::{Simd, f32x16, mask32x16, prelude::*};

use super::{
    area_lights::meets_light,
    lambertian_surfaces::{LambertianHits, LambertianSurfaces},
    lanes::{LANES, LaneMask},
    sampler::PairsSoa,
    turns::sin_cos_of_turns,
    vec3x16::{Vec3sSoa, Vec3x16, get, greater, lesser, set},
};
use crate::{
    layout::{
        AreaLight, LEAST_SURVIVAL, MOST_ADDED_LIGHT, PathRay, ROULETTE_DEPTH, SHADOW_RAY_SHARE, SHADOW_RAY_WAITS,
        ShadowRay,
    },
    reference::{
        emitters::{LIGHT_HIDES_UP_TO, LightSample},
        path_vertex::PAIRS_OF_HIT,
    },
};

/// The lights that are sampled.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub struct Samples {
    direction: Vec3sSoa,
    distance: [f32; LANES],
    light: Vec3sSoa,
    pdf: [f32; LANES],
}

/// The shadow rays to lights, and the rays with which paths go on.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub struct LambertianScatter {
    shadow_ray_origin: Vec3sSoa,
    shadow_ray_direction: Vec3sSoa,
    shadow_ray_light: Vec3sSoa,
    shadow_ray_t_max: [f32; LANES],
    pub have_shadow_ray: LaneMask,
    origin: Vec3sSoa,
    direction: Vec3sSoa,
    throughput: Vec3sSoa,
    pub pdf: [f32; LANES],
    pub go_on: LaneMask,
}

impl Samples {
    #[inline(always)]
    pub fn set(&mut self, lane: usize, sample: &LightSample) {
        set(&mut self.direction, lane, sample.direction);
        set(&mut self.light, lane, sample.light);
        (self.distance[lane], self.pdf[lane]) = (sample.distance, sample.pdf);
    }
}

impl LambertianScatter {
    #[inline(always)]
    pub fn shadow_ray(&self, lane: usize, source_triangle: u32) -> ShadowRay {
        ShadowRay {
            origin: get(&self.shadow_ray_origin, lane),
            state: SHADOW_RAY_WAITS,
            direction: get(&self.shadow_ray_direction, lane),
            source_triangle,
            light: get(&self.shadow_ray_light, lane),
            t_max: self.shadow_ray_t_max[lane],
        }
    }

    /// Returns the ray with which a path goes on from a triangle.
    #[inline(always)]
    pub fn ray(&self, lane: usize, source_triangle: u32, parent: &PathRay) -> PathRay {
        PathRay {
            origin: get(&self.origin, lane),
            direction: get(&self.direction, lane),
            throughput: get(&self.throughput, lane),
            source_triangle,
            ..*parent
        }
    }
}

/// Sixteen surfaces in registers.
struct Surfaces<S: Simd> {
    point_world: Vec3x16<S>,
    geometric: Vec3x16<S>,
    normal: Vec3x16<S>,
    tangent: Vec3x16<S>,
    bitangent: Vec3x16<S>,
    origin_offset: f32x16<S>,
    kd: Vec3x16<S>,
    /// The surfaces that are not black.
    reflects: mask32x16<S>,
}

impl<S: Simd> Surfaces<S> {
    #[inline(always)]
    fn load(simd: S, hits: &LambertianHits, surfaces: &LambertianSurfaces) -> Self {
        let kd = Vec3x16::load(simd, &hits.kd);
        let [r, g, b] = kd.0;
        Self {
            point_world: Vec3x16::load(simd, &surfaces.point_world),
            geometric: Vec3x16::load(simd, &surfaces.geometric),
            normal: Vec3x16::load(simd, &surfaces.normal),
            tangent: Vec3x16::load(simd, &surfaces.tangent),
            bitangent: Vec3x16::load(simd, &surfaces.bitangent),
            origin_offset: f32x16::load_array_ref(simd, &surfaces.origin_offset),
            kd,
            reflects: ((r + g + b) / 3.0).simd_gt(0.0),
        }
    }

    /// Returns whether a direction is above the surface, on both the triangle's and the frame's side. `z`: of the
    /// direction in the frame.
    #[inline(always)]
    fn is_above(&self, direction: Vec3x16<S>, z: f32x16<S>) -> mask32x16<S> {
        self.reflects & (self.geometric.dot(direction) * z).simd_gt(0.0) & z.simd_gt(0.0)
    }

    /// Returns the vector from the surface to the start of a ray.
    #[inline(always)]
    fn offset(&self, direction: Vec3x16<S>) -> Vec3x16<S> {
        let is_below = direction.dot(self.geometric).simd_lt(0.0);
        self.geometric * is_below.select(-self.origin_offset, self.origin_offset)
    }
}

/// The constants of a bounce.
#[derive(Clone, Copy, Debug)]
pub struct BounceConstants<'a> {
    pub depth: u32,
    /// The bound of the light that is added to a path.
    pub clamp: f32,
    pub shapes: &'a [AreaLight],
}

/// Writes the shadow rays to the lights that were sampled, without regard to what hides them from the surfaces except
/// other area lights.
#[inline(always)]
fn set_shadow_rays<S: Simd>(
    scattered: &mut LambertianScatter,
    bounce: &BounceConstants,
    surfaces: &Surfaces<S>,
    (throughput, samples): (Vec3x16<S>, &Samples),
) {
    let simd = surfaces.origin_offset.simd;
    let (direction, distance) =
        (Vec3x16::load(simd, &samples.direction), f32x16::load_array_ref(simd, &samples.distance));
    let (light, sample_pdf) = (Vec3x16::load(simd, &samples.light), f32x16::load_array_ref(simd, &samples.pdf));
    let z = direction.dot(surfaces.normal);
    let mut exist = surfaces.is_above(direction, z);
    if !bounce.shapes.is_empty() {
        exist &= !meets_light(bounce.shapes, surfaces.point_world, direction, distance * LIGHT_HIDES_UP_TO);
    }
    let pdf = z / PI;
    let value = surfaces.kd * pdf;
    let largest = greater(sample_pdf, pdf);
    let (own, other) = (sample_pdf / largest, pdf / largest);
    let one = f32x16::splat(simd, 1.0);
    let share = sample_pdf.simd_gt(0.0).select(own * own / (own * own + other * other), one);
    let arriving = throughput.times(value).times(light) * share;
    let arriving = arriving.min(f32x16::splat(simd, bounce.clamp));
    exist &= value.any_positive() & arriving.all_below(f32::INFINITY) & arriving.any_positive();
    scattered.have_shadow_ray = exist.to_bitmask() as LaneMask;
    let offset = surfaces.offset(direction);
    let to_light = direction * distance - offset;
    let length = to_light.dot(to_light).sqrt();
    let is_far = distance.simd_eq(f32::INFINITY);
    scattered.shadow_ray_origin = (surfaces.point_world + offset).to_arrays();
    scattered.shadow_ray_direction = Vec3x16::select(is_far, direction, to_light / length).to_arrays();
    let bounded = arriving.max(f32x16::splat(simd, 0.0)).min(f32x16::splat(simd, MOST_ADDED_LIGHT));
    scattered.shadow_ray_light = bounded.to_arrays();
    scattered.shadow_ray_t_max = is_far.select(distance, length * SHADOW_RAY_SHARE).to_array();
}

/// Writes the rays with which the paths go on. `choices`: the random numbers of Russian roulette.
#[inline(always)]
fn set_rays<S: Simd>(
    scattered: &mut LambertianScatter,
    depth: u32,
    surfaces: &Surfaces<S>,
    (throughput, local, choices): (Vec3x16<S>, Vec3x16<S>, f32x16<S>),
) {
    let simd = surfaces.origin_offset.simd;
    let [x, y, z] = local.0;
    let direction = surfaces.tangent * x + surfaces.bitangent * y + surfaces.normal * z;
    let pdf = z / PI;
    let weight = surfaces.kd * pdf / pdf;
    let mut throughput = throughput.times(weight);
    let mut go_on = surfaces.is_above(direction, z) & pdf.simd_gt(0.0) & throughput.any_positive();
    if depth >= ROULETTE_DEPTH {
        let survival = throughput.max_element();
        let survival = lesser(f32x16::splat(simd, 1.0), greater(f32x16::splat(simd, LEAST_SURVIVAL), survival));
        throughput = throughput / survival;
        go_on &= choices.simd_lt(survival);
    }
    scattered.origin = (surfaces.point_world + surfaces.offset(direction)).to_arrays();
    scattered.direction = direction.to_arrays();
    scattered.throughput = throughput.to_arrays();
    scattered.pdf = pdf.to_array();
    scattered.go_on = go_on.to_bitmask() as LaneMask;
}

/// Returns directions in the frame of the surface, as `sample_lambert` does.
#[inline(always)]
fn lambert_samples<S: Simd>(simd: S, [ux, uy]: &PairsSoa) -> Vec3x16<S> {
    let (ux, uy) = (f32x16::load_array_ref(simd, ux), f32x16::load_array_ref(simd, uy));
    let (sines, cosines) = sin_cos_of_turns(uy);
    let radius = ux.sqrt();
    let z = greater(1.0 - ux, f32x16::splat(simd, 0.0)).sqrt();
    Vec3x16([radius * cosines, radius * sines, z])
}

/// Returns the scattered of the paths.
#[inline(always)]
pub fn lambertian_scatter<S: Simd>(
    simd: S,
    bounce: &BounceConstants,
    (hits, surfaces): (&LambertianHits, &LambertianSurfaces),
    (samples, random_pairs): (&Samples, &[PairsSoa; PAIRS_OF_HIT]),
) -> LambertianScatter {
    let surfaces = Surfaces::load(simd, hits, surfaces);
    let throughput = Vec3x16::load(simd, &hits.throughput);
    let [_, choices, to_next, _] = random_pairs;
    let local = lambert_samples(simd, to_next);
    let mut scattered = LambertianScatter::default();
    set_shadow_rays(&mut scattered, bounce, &surfaces, (throughput, samples));
    let choices = f32x16::load_array_ref(simd, &choices[1]);
    set_rays(&mut scattered, bounce.depth, &surfaces, (throughput, local, choices));
    scattered
}
