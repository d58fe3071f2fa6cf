//! One step of sixteen paths at matt surfaces: those whose material is Lambertian, without a normal map and without light
//! of its own. It does the operations of the reference's `step_path` for such a surface, in the same order, so that
//! the results are the same bit for bit.

use std::f32::consts::PI;

use fearless_simd::{Simd, f32x16, i32x16, mask32x16, prelude::*, u32x16};
use glam::Vec3;

use super::{
    area_lights::meets_light,
    lanes::{LANES, LaneMask},
    sampler::PairsSoa,
    vec3x16::{Vec3sSoa, Vec3x16, get, greater, lesser, set},
};
use crate::{
    layout::{
        AreaLight, FLAT_NORMAL, Hit, LEAST_COSINE, LEAST_NORMAL_SQUARED, LEAST_SURVIVAL, LEAST_WEIGHT, MATERIAL_SOLID,
        MATERIAL_UNLIT, Material, NO_TEXTURE, PathRay, ROULETTE_DEPTH, SEGMENT_SHARE, SEGMENT_WAITS, SURFACE_CLEARANCE,
        Segment, Triangle,
    },
    reference::{
        emitters::{LIGHT_HIDES_UP_TO, LightPick},
        inputs::KernelInputs,
        path_vertex::PAIRS_OF_HIT,
    },
    world::Textures,
};

/// Returns for each material whether its surfaces are matt.
pub fn matt_materials(inputs: &KernelInputs) -> Vec<bool> {
    let is_matt = |(material_ix, material)| is_matt(material) && stays_matt(inputs.textures, material_ix);
    inputs.materials.iter().enumerate().map(is_matt).collect()
}

fn is_matt(material: &Material) -> bool {
    let &Material { ks, ke, metallic, transmission, clearcoat, sheen_colour, flags, .. } = material;
    let is_lambertian = !ks.cmpgt(Vec3::ZERO).any() && metallic == 0.0 && transmission == 0.0;
    let is_bare = !(clearcoat > 0.0) && !sheen_colour.cmpgt(Vec3::ZERO).any();
    is_lambertian && is_bare && !ke.cmpgt(Vec3::ZERO).any() && flags & (MATERIAL_UNLIT | MATERIAL_SOLID) == 0
}

/// Returns whether the textures of a material change no more than its colour and its opacity.
fn stays_matt(textures: Option<&Textures>, material_ix: usize) -> bool {
    textures.is_none_or(|textures| {
        let maps = &textures.material_maps[material_ix];
        let of_colours = [maps.specular, maps.specular_factor, maps.emission];
        let others = [maps.normal, maps.metallic, maps.transmission];
        of_colours.iter().chain(&others).all(|&texture_ix| texture_ix == NO_TEXTURE)
    })
}

/// Rays of paths and their hits.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub struct MattHits {
    direction: Vec3sSoa,
    throughput: Vec3sSoa,
    u: [f32; LANES],
    v: [f32; LANES],
    corners: [Vec3sSoa; 3],
    /// Codes of the corners' normals.
    normals: [[u32; LANES]; 3],
    /// Whether a triangle has interpolated normals.
    has_smooth: bool,
    kd: Vec3sSoa,
}

/// The surfaces at the hits.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub struct MattSurfaces {
    point_world: Vec3sSoa,
    /// The unit normals of the triangles' planes, on the side that the ray comes from.
    geometric: Vec3sSoa,
    /// The frames in which light is scattered.
    normal: Vec3sSoa,
    tangent: Vec3sSoa,
    bitangent: Vec3sSoa,
    clearance: [f32; LANES],
}

/// The lights that are picked.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub struct Picks {
    direction: Vec3sSoa,
    distance: [f32; LANES],
    light: Vec3sSoa,
    density: [f32; LANES],
}

/// The segments to lights, and the rays with which paths go on.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub struct MattSteps {
    segment_origin: Vec3sSoa,
    segment_direction: Vec3sSoa,
    segment_light: Vec3sSoa,
    segment_t_max: [f32; LANES],
    pub have_segment: LaneMask,
    origin: Vec3sSoa,
    direction: Vec3sSoa,
    throughput: Vec3sSoa,
    pub density: [f32; LANES],
    pub go_on: LaneMask,
}

impl MattHits {
    #[inline(always)]
    pub fn set(&mut self, lane: usize, ray: &PathRay, hit: &Hit, triangle: &Triangle) {
        set(&mut self.direction, lane, ray.direction);
        set(&mut self.throughput, lane, ray.throughput);
        (self.u[lane], self.v[lane]) = (hit.u, hit.v);
        for (corners, v) in self.corners.iter_mut().zip([triangle.v0, triangle.v1, triangle.v2]) {
            set(corners, lane, v);
        }
        let normals = [triangle.n0, triangle.n1, triangle.n2];
        for (codes, code) in self.normals.iter_mut().zip(normals) {
            codes[lane] = code;
        }
        self.has_smooth |= !normals.contains(&FLAT_NORMAL);
    }

    #[inline(always)]
    pub fn set_colour(&mut self, lane: usize, kd: Vec3) {
        set(&mut self.kd, lane, kd.clamp(Vec3::ZERO, Vec3::ONE));
    }
}

impl MattSurfaces {
    #[inline(always)]
    pub fn point_world(&self, lane: usize) -> Vec3 {
        get(&self.point_world, lane)
    }

    #[inline(always)]
    pub fn geometric(&self, lane: usize) -> Vec3 {
        get(&self.geometric, lane)
    }
}

impl Picks {
    #[inline(always)]
    pub fn set(&mut self, lane: usize, pick: &LightPick) {
        set(&mut self.direction, lane, pick.direction);
        set(&mut self.light, lane, pick.light);
        (self.distance[lane], self.density[lane]) = (pick.distance, pick.density);
    }
}

impl MattSteps {
    #[inline(always)]
    pub fn segment(&self, lane: usize, source_triangle: u32) -> Segment {
        Segment {
            origin: get(&self.segment_origin, lane),
            state: SEGMENT_WAITS,
            direction: get(&self.segment_direction, lane),
            source_triangle,
            light: get(&self.segment_light, lane),
            t_max: self.segment_t_max[lane],
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

/// Returns the unit vectors of octahedral codes, as `decode_normal` does.
#[inline(always)]
fn decoded<S: Simd>(codes: u32x16<S>) -> Vec3x16<S> {
    let simd = codes.simd;
    let (zero, one) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 1.0));
    let [x, y] = [codes << 16, codes];
    let [x, y] = [x.bitcast::<i32x16<S>>() >> 16, y.bitcast::<i32x16<S>>() >> 16];
    let [x, y] = [simd.cvt_f32_i32x16(x) / 32767.0, simd.cvt_f32_i32x16(y) / 32767.0];
    let [x, y] = [lesser(one, greater(-one, x)), lesser(one, greater(-one, y))];
    let z = 1.0 - x.abs() - y.abs();
    let fold = greater(-z, zero);
    let x = x + x.simd_ge(0.0).select(-fold, fold);
    let y = y + y.simd_ge(0.0).select(-fold, fold);
    Vec3x16([x, y, z]).normalize()
}

/// Returns the interpolated normals on the side of `outward`, as `shading_normal` does.
#[inline(always)]
fn interpolated<S: Simd>(hits: &MattHits, outward: Vec3x16<S>, [u, v]: [f32x16<S>; 2]) -> Vec3x16<S> {
    let simd = u.simd;
    let [a, b, c] = &hits.normals;
    let [a, b, c] = [u32x16::load_array_ref(simd, a), u32x16::load_array_ref(simd, b), u32x16::load_array_ref(simd, c)];
    let is_flat = a.simd_eq(FLAT_NORMAL) | b.simd_eq(FLAT_NORMAL) | c.simd_eq(FLAT_NORMAL);
    let n = decoded(a) * (1.0 - u - v) + decoded(b) * u + decoded(c) * v;
    let squared = n.dot(n);
    let is_smooth = !is_flat & squared.simd_gt(LEAST_NORMAL_SQUARED);
    Vec3x16::select(is_smooth, n * (1.0 / squared.sqrt()), outward)
}

/// Returns the surfaces, as `surface_at` and `frame_around` do.
#[inline(always)]
pub fn matt_surfaces<S: Simd>(simd: S, hits: &MattHits) -> MattSurfaces {
    let [v0, v1, v2] =
        [&hits.corners[0], &hits.corners[1], &hits.corners[2]].map(|corners| Vec3x16::load(simd, corners));
    let (u, v) = (f32x16::load_array_ref(simd, &hits.u), f32x16::load_array_ref(simd, &hits.v));
    let direction = Vec3x16::load(simd, &hits.direction);
    let weights = Vec3x16([1.0 - u - v, u, v]).max(f32x16::splat(simd, LEAST_WEIGHT));
    let [x, y, z] = weights.0;
    let [x, y, z] = (weights / (x + y + z)).0;
    let (at_v0, at_v1, at_v2) = (v0 * x, v1 * y, v2 * z);
    let magnitude = at_v0.abs() + at_v1.abs() + at_v2.abs();
    let (e1, e2) = (v1 - v0, v2 - v0);
    let ([ax, ay, az], [bx, by, bz]) = (e1.abs().0, e2.abs().0);
    let scale = 1.0 / greater(greater(ax, bx), greater(greater(ay, by), greater(az, bz)));
    let outward = (e1 * scale).cross(e2 * scale).normalize();
    let from_inside = outward.dot(direction).simd_gt(0.0);
    let geometric = Vec3x16::select(from_inside, -outward, outward);
    let mut normal = geometric;
    if hits.has_smooth {
        let interpolated = interpolated(hits, outward, [u, v]);
        let is_reversed = interpolated.dot(geometric).simd_lt(0.0);
        let shading = Vec3x16::select(is_reversed, -interpolated, interpolated);
        let is_behind = shading.dot(-direction).simd_lt(LEAST_COSINE);
        normal = Vec3x16::select(is_behind, geometric, shading);
    }
    let point_world = at_v0 + at_v1 + at_v2;
    let (tangent, bitangent) = axes_around(normal);
    MattSurfaces {
        point_world: point_world.to_arrays(),
        geometric: geometric.to_arrays(),
        normal: normal.to_arrays(),
        tangent: tangent.to_arrays(),
        bitangent: bitangent.to_arrays(),
        clearance: (magnitude.dot(geometric.abs()) * SURFACE_CLEARANCE).to_array(),
    }
}

/// Returns the tangent and the bitangent of `frame_around`.
#[inline(always)]
fn axes_around<S: Simd>(n: Vec3x16<S>) -> (Vec3x16<S>, Vec3x16<S>) {
    let [x, y, z] = n.0;
    let one = f32x16::splat(z.simd, 1.0);
    let side = z.simd_ge(0.0).select(one, -one);
    let a = -1.0 / (side + z);
    let b = x * y * a;
    (Vec3x16([1.0 + side * x * x * a, side * b, -side * x]), Vec3x16([b, side + y * y * a, -y]))
}

/// Sixteen surfaces in registers.
struct Surfaces<S: Simd> {
    point_world: Vec3x16<S>,
    geometric: Vec3x16<S>,
    normal: Vec3x16<S>,
    tangent: Vec3x16<S>,
    bitangent: Vec3x16<S>,
    clearance: f32x16<S>,
    kd: Vec3x16<S>,
    /// The surfaces that are not black.
    reflects: mask32x16<S>,
}

impl<S: Simd> Surfaces<S> {
    #[inline(always)]
    fn load(simd: S, hits: &MattHits, surfaces: &MattSurfaces) -> Self {
        let kd = Vec3x16::load(simd, &hits.kd);
        let [r, g, b] = kd.0;
        Self {
            point_world: Vec3x16::load(simd, &surfaces.point_world),
            geometric: Vec3x16::load(simd, &surfaces.geometric),
            normal: Vec3x16::load(simd, &surfaces.normal),
            tangent: Vec3x16::load(simd, &surfaces.tangent),
            bitangent: Vec3x16::load(simd, &surfaces.bitangent),
            clearance: f32x16::load_array_ref(simd, &surfaces.clearance),
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
        self.geometric * is_below.select(-self.clearance, self.clearance)
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

/// Writes the segments to the lights that were picked, without regard to what hides them from the surfaces except other
/// area lights.
#[inline(always)]
fn set_segments<S: Simd>(
    steps: &mut MattSteps,
    bounce: &BounceConstants,
    surfaces: &Surfaces<S>,
    (throughput, picks): (Vec3x16<S>, &Picks),
) {
    let simd = surfaces.clearance.simd;
    let (direction, distance) = (Vec3x16::load(simd, &picks.direction), f32x16::load_array_ref(simd, &picks.distance));
    let (light, pick_density) = (Vec3x16::load(simd, &picks.light), f32x16::load_array_ref(simd, &picks.density));
    let z = direction.dot(surfaces.normal);
    let mut exist = surfaces.is_above(direction, z);
    if !bounce.shapes.is_empty() {
        exist &= !meets_light(bounce.shapes, surfaces.point_world, direction, distance * LIGHT_HIDES_UP_TO);
    }
    let density = z / PI;
    let value = surfaces.kd * density;
    let largest = greater(pick_density, density);
    let (own, other) = (pick_density / largest, density / largest);
    let one = f32x16::splat(simd, 1.0);
    let share = pick_density.simd_gt(0.0).select(own * own / (own * own + other * other), one);
    let arriving = throughput.times(value).times(light) * share;
    let arriving = arriving.min(f32x16::splat(simd, bounce.clamp));
    exist &= value.any_positive() & arriving.all_below(1.0e30) & arriving.any_positive();
    steps.have_segment = exist.to_bitmask() as LaneMask;
    let offset = surfaces.offset(direction);
    let to_light = direction * distance - offset;
    let length = to_light.dot(to_light).sqrt();
    let is_far = distance.simd_eq(f32::INFINITY);
    steps.segment_origin = (surfaces.point_world + offset).to_arrays();
    steps.segment_direction = Vec3x16::select(is_far, direction, to_light / length).to_arrays();
    steps.segment_light = arriving.max(f32x16::splat(simd, 0.0)).to_arrays();
    steps.segment_t_max = is_far.select(distance, length * SEGMENT_SHARE).to_array();
}

/// Writes the rays with which the paths go on. `choices`: the random numbers of Russian roulette.
#[inline(always)]
fn set_rays<S: Simd>(
    steps: &mut MattSteps,
    depth: u32,
    surfaces: &Surfaces<S>,
    (throughput, local, choices): (Vec3x16<S>, Vec3x16<S>, f32x16<S>),
) {
    let simd = surfaces.clearance.simd;
    let [x, y, z] = local.0;
    let direction = surfaces.tangent * x + surfaces.bitangent * y + surfaces.normal * z;
    let density = z / PI;
    let weight = surfaces.kd * density / density;
    let mut throughput = throughput.times(weight);
    let mut go_on = surfaces.is_above(direction, z) & density.simd_gt(0.0) & throughput.any_positive();
    if depth >= ROULETTE_DEPTH {
        let survival = throughput.max_element();
        let survival = lesser(f32x16::splat(simd, 1.0), greater(f32x16::splat(simd, LEAST_SURVIVAL), survival));
        throughput = throughput / survival;
        go_on &= choices.simd_lt(survival);
    }
    steps.origin = (surfaces.point_world + surfaces.offset(direction)).to_arrays();
    steps.direction = direction.to_arrays();
    steps.throughput = throughput.to_arrays();
    steps.density = density.to_array();
    steps.go_on = go_on.to_bitmask() as LaneMask;
}

/// Returns directions in the frame of the surface, as `sample_lambert` does. Sines and cosines are computed one by one:
/// only so are they those of the reference.
#[inline(always)]
fn lambert_samples<S: Simd>(simd: S, [ux, uy]: &PairsSoa) -> Vec3x16<S> {
    let (mut cosines, mut sines) = ([0.0; LANES], [0.0; LANES]);
    for (uy, (cosine, sine)) in uy.iter().zip(cosines.iter_mut().zip(&mut sines)) {
        let azimuth = 2.0 * PI * uy;
        (*cosine, *sine) = (azimuth.cos(), azimuth.sin());
    }
    let ux = f32x16::load_array_ref(simd, ux);
    let (cosines, sines) = (f32x16::load_array(simd, cosines), f32x16::load_array(simd, sines));
    let radius = ux.sqrt();
    let z = greater(1.0 - ux, f32x16::splat(simd, 0.0)).sqrt();
    Vec3x16([radius * cosines, radius * sines, z])
}

/// Returns the steps of the paths.
#[inline(always)]
pub fn matt_steps<S: Simd>(
    simd: S,
    bounce: &BounceConstants,
    (hits, surfaces): (&MattHits, &MattSurfaces),
    (picks, random_pairs): (&Picks, &[PairsSoa; PAIRS_OF_HIT]),
) -> MattSteps {
    let surfaces = Surfaces::load(simd, hits, surfaces);
    let throughput = Vec3x16::load(simd, &hits.throughput);
    let [_, choices, to_next, _] = random_pairs;
    let local = lambert_samples(simd, to_next);
    let mut steps = MattSteps::default();
    set_segments(&mut steps, bounce, &surfaces, (throughput, picks));
    let choices = f32x16::load_array_ref(simd, &choices[1]);
    set_rays(&mut steps, bounce.depth, &surfaces, (throughput, local, choices));
    steps
}
