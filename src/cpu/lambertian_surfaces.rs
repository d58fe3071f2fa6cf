//! Lambertian surfaces at the hits of sixteen paths: their material has the Lambertian lobe alone, without a normal map
//! and without light of its own. Their normals and points are those of the reference's `surface_at`, bit for bit.

use fearless_simd::{Simd, f32x16, i32x16, prelude::*, u32x16};
use glam::Vec3;

use super::{
    lanes::LANES,
    vec3x16::{Vec3sSoa, Vec3x16, get, greater, lesser, set},
};
use crate::{
    layout::{
        FLAT_NORMAL, Hit, LEAST_COSINE, LEAST_NORMAL_SQUARED, LEAST_ORIGIN_OFFSET_SHARE, LEAST_WEIGHT, MATERIAL_SOLID,
        MATERIAL_UNLIT, Material, NO_TEXTURE, ORIGIN_OFFSET, PathRay, Triangle,
    },
    reference::inputs::KernelInputs,
    world::Textures,
};

/// Returns for each material whether its surfaces are Lambertian.
pub fn lambertian_materials(inputs: &KernelInputs) -> Vec<bool> {
    let is_lambertian =
        |(material_ix, material)| is_lambertian(material) && stays_lambertian(inputs.textures, material_ix);
    inputs.materials.iter().enumerate().map(is_lambertian).collect()
}

fn is_lambertian(material: &Material) -> bool {
    let &Material { ks, ke, metallic, transmission, clearcoat, sheen_colour, flags, .. } = material;
    let is_lambertian = !ks.cmpgt(Vec3::ZERO).any() && metallic == 0.0 && transmission == 0.0;
    let is_bare = !(clearcoat > 0.0) && !sheen_colour.cmpgt(Vec3::ZERO).any();
    is_lambertian && is_bare && !ke.cmpgt(Vec3::ZERO).any() && flags & (MATERIAL_UNLIT | MATERIAL_SOLID) == 0
}

/// Returns whether the textures of a material change no more than its colour and its opacity.
fn stays_lambertian(textures: Option<&Textures>, material_ix: usize) -> bool {
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
pub struct LambertianHits {
    direction: Vec3sSoa,
    pub(super) throughput: Vec3sSoa,
    u: [f32; LANES],
    v: [f32; LANES],
    corners: [Vec3sSoa; 3],
    /// Codes of the corners' normals.
    normals: [[u32; LANES]; 3],
    /// Whether a triangle has interpolated normals.
    has_smooth: bool,
    pub(super) kd: Vec3sSoa,
}

/// The surfaces at the hits.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub struct LambertianSurfaces {
    pub(super) point_world: Vec3sSoa,
    /// The unit normals of the triangles' planes, on the side that the ray comes from.
    pub(super) geometric: Vec3sSoa,
    /// The frames in which light is scattered.
    pub(super) normal: Vec3sSoa,
    pub(super) tangent: Vec3sSoa,
    pub(super) bitangent: Vec3sSoa,
    pub(super) origin_offset: [f32; LANES],
}

impl LambertianHits {
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

impl LambertianSurfaces {
    #[inline(always)]
    pub fn point_world(&self, lane: usize) -> Vec3 {
        get(&self.point_world, lane)
    }

    #[inline(always)]
    pub fn geometric(&self, lane: usize) -> Vec3 {
        get(&self.geometric, lane)
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
fn interpolated<S: Simd>(hits: &LambertianHits, outward: Vec3x16<S>, [u, v]: [f32x16<S>; 2]) -> Vec3x16<S> {
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
pub fn lambertian_surfaces<S: Simd>(simd: S, hits: &LambertianHits) -> LambertianSurfaces {
    let [v0, v1, v2] =
        [&hits.corners[0], &hits.corners[1], &hits.corners[2]].map(|corners| Vec3x16::load(simd, corners));
    let (u, v) = (f32x16::load_array_ref(simd, &hits.u), f32x16::load_array_ref(simd, &hits.v));
    let direction = Vec3x16::load(simd, &hits.direction);
    let weights = Vec3x16([1.0 - u - v, u, v]).max(f32x16::splat(simd, LEAST_WEIGHT));
    let [x, y, z] = weights.0;
    let [x, y, z] = (weights / (x + y + z)).0;
    let (at_v0, at_v1, at_v2) = (v0 * x, v1 * y, v2 * z);
    let magnitude = at_v0.abs() + at_v1.abs() + at_v2.abs();
    let least_offset = magnitude.max_element() * LEAST_ORIGIN_OFFSET_SHARE;
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
    LambertianSurfaces {
        point_world: point_world.to_arrays(),
        geometric: geometric.to_arrays(),
        normal: normal.to_arrays(),
        tangent: tangent.to_arrays(),
        bitangent: bitangent.to_arrays(),
        origin_offset: (greater(magnitude.dot(geometric.abs()), least_offset) * ORIGIN_OFFSET).to_array(),
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
