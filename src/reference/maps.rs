//! The surface and the material at a hit, with the material's textures applied. Twin of `shading/maps.glsl`.

use std::cell::OnceCell;

use glam::{Vec3, Vec4};

use super::{
    inputs::KernelInputs,
    microfacet::is_microfacet,
    surface::{Surface, decode_normal, surface_of},
    texture::{sample_texture, scalar_of, uv_set_of},
};
use crate::{
    layout::{
        FLAT_NORMAL, Frame, Hit, LEAST_COSINE, LEAST_NORMAL_SQUARED, MAPS_ALPHA_MASK, MAPS_COLOUR_HAS_OPACITY,
        MAPS_CORNERS_HAVE_OPACITY, Material, MaterialMaps, NO_TEXTURE, PathRay, Texture, Triangle,
    },
    world::{Textures, instances::Stored},
};

/// A hit, as textures are looked up at it.
struct TextureHit<'a> {
    textures: &'a Textures,
    at: Stored<'a>,
    u: f32,
    v: f32,
    log_width: LogWidth<'a>,
}

/// Base-2 logarithm of the width of a ray's cone on a surface, divided by the square root of twice the triangle's area.
/// It is computed when the first texture needs it.
struct LogWidth<'a> {
    cell: OnceCell<f32>,
    frame: &'a Frame,
    ray: &'a PathRay,
    hit: &'a Hit,
    t: Triangle,
    geometric: Vec3,
}

/// Width of the ray's cone at its hit, world units.
fn cone_width(frame: &Frame, ray: &PathRay, hit: &Hit) -> f32 {
    let pixel = 2.0 * frame.up.length() / frame.picture_height as f32;
    if frame.is_orthographic == 1 {
        return pixel;
    }
    pixel * (ray.origin.distance(frame.eye) + hit.t)
}

impl LogWidth<'_> {
    fn get(&self) -> f32 {
        *self.cell.get_or_init(|| {
            let t = &self.t;
            let (e1, e2) = (t.v1 - t.v0, t.v2 - t.v0);
            let scale = 1.0 / e1.abs().max_element().max(e2.abs().max_element());
            let doubled_area = (e1 * scale).cross(e2 * scale).length();
            let cosine = self.ray.direction.dot(self.geometric).abs().max(LEAST_COSINE);
            let cone_width = cone_width(self.frame, self.ray, self.hit);
            (cone_width * scale / cosine).log2() - 0.5 * doubled_area.log2()
        })
    }
}

impl<'a> TextureHit<'a> {
    fn new(
        inputs: &KernelInputs<'a>,
        textures: &'a Textures,
        (ray, hit): (&'a PathRay, &'a Hit),
        geometric: Vec3,
    ) -> Self {
        let t = inputs.triangle(hit.triangle_ix);
        let log_width = LogWidth { cell: OnceCell::new(), frame: inputs.frame(), ray, hit, t, geometric };
        Self { textures, at: inputs.stored(hit.triangle_ix), u: hit.u, v: hit.v, log_width }
    }

    /// The mip level of a texture whose texels are as large as the cone on the surface.
    fn mip_of(&self, map: &Texture) -> f32 {
        let [a, b, c] = self.textures.uvs_of(&self.at, uv_set_of(map));
        let (e1, e2) = (b - a, c - a);
        let scale = (map.m00 * map.m11 - map.m01 * map.m10).abs();
        let (width, height) = ((map.size & 0xffff) as f32, (map.size >> 16) as f32);
        let n_texels = (e1.x * e2.y - e1.y * e2.x).abs() * scale * width * height;
        if n_texels > 0.0 { self.log_width.get() + 0.5 * n_texels.log2() } else { 0.0 }
    }

    fn map_at(&self, texture_ix: u32) -> Vec4 {
        let map = &self.textures.textures[texture_ix as usize];
        let uv = self.textures.uv_at(&self.at, uv_set_of(map), self.u, self.v);
        let mip = if self.textures.has_uvs() { self.mip_of(map) } else { 0.0 };
        sample_texture(&self.textures.texels, map, uv, mip)
    }

    /// The value of a texture of one number; 1 if there is none.
    fn factor_at(&self, texture_ix: u32) -> f32 {
        if texture_ix == NO_TEXTURE {
            return 1.0;
        }
        scalar_of(&self.textures.textures[texture_ix as usize], self.map_at(texture_ix))
    }

    /// The colour of a texture; white if there is none.
    fn colour_at(&self, texture_ix: u32) -> Vec3 {
        if texture_ix == NO_TEXTURE { Vec3::ONE } else { self.map_at(texture_ix).truncate() }
    }

    /// The shading normal that the normal map gives, on the side of the interpolated normal.
    fn mapped_normal(&self, maps: &MaterialMaps, surface: &Surface) -> Vec3 {
        let corners = self.textures.corners.get(self.at.row);
        let Some(corners) = corners.filter(|_| maps.normal != NO_TEXTURE) else { return surface.interpolated };
        let tangents = self.at.corners(corners.map(|corner| self.at.tangent(corner.tangent)));
        if tangents.contains(&FLAT_NORMAL) {
            return surface.interpolated;
        }
        let weights = [1.0 - self.u - self.v, self.u, self.v];
        let weighted = weights.iter().zip(tangents).map(|(weight, tangent)| *weight * decode_normal(tangent & !1));
        let tangent: Vec3 = weighted.fold(Vec3::ZERO, |sum, tangent| sum + tangent);
        let side = if tangents[2] & 1 != 0 { 1.0 } else { -1.0 };
        let front = if surface.is_reversed { -1.0 } else { 1.0 };
        let normal = front * surface.interpolated;
        let tangent = tangent - tangent.dot(normal) * normal;
        let squared = tangent.dot(tangent);
        if !(squared > LEAST_NORMAL_SQUARED) {
            return surface.interpolated;
        }
        let tangent = tangent * (1.0 / squared.sqrt());
        let bitangent = side * normal.cross(tangent);
        let map = 2.0 * self.map_at(maps.normal).truncate() - 1.0;
        let map = map.with_z(map.z.max(0.0));
        let bent = maps.normal_scale * (map.x * tangent + map.y * bitangent) + map.z * normal;
        let squared = bent.dot(bent);
        if squared > LEAST_NORMAL_SQUARED { front * bent * (1.0 / squared.sqrt()) } else { surface.interpolated }
    }

    /// The colour by which textures and the colours of the triangle's corners multiply the material's. The colours of
    /// the corners and of the texture follow, with their opacity.
    fn base_colour(&self, maps: &MaterialMaps) -> (Vec3, Vec4, Vec4) {
        let corner_colour = self.textures.corner_colour_at(&self.at, self.u, self.v);
        let map_colour = if maps.base_colour == NO_TEXTURE { Vec4::ONE } else { self.map_at(maps.base_colour) };
        (corner_colour.truncate() * map_colour.truncate().max(Vec3::ZERO), corner_colour, map_colour)
    }

    /// Multiplies the material's terms by its textures and by the colours of the triangle's corners. Values that make
    /// no sense are bounded.
    fn apply_maps(&self, maps: &MaterialMaps, material: &mut Material) {
        let (base, corner_colour, map_colour) = self.base_colour(maps);
        material.kd *= base;
        if maps.flags & MAPS_ALPHA_MASK == 0 {
            if maps.flags & MAPS_CORNERS_HAVE_OPACITY != 0 {
                material.d *= corner_colour.w;
            }
            if maps.flags & MAPS_COLOUR_HAS_OPACITY != 0 {
                material.d *= map_colour.w;
            }
            material.d = (material.d * self.factor_at(maps.opacity)).clamp(0.0, 1.0);
        }
        material.ks *= (self.colour_at(maps.specular) * self.factor_at(maps.specular_factor)).max(Vec3::ZERO);
        material.ke *= self.colour_at(maps.emission).max(Vec3::ZERO);
        let rough = self.factor_at(maps.roughness).max(0.0);
        material.roughness = (material.roughness * rough).min(1.0);
        material.ns = (material.ns * rough).max(1.0);
        material.metallic *= self.factor_at(maps.metallic).clamp(0.0, 1.0);
        material.transmission *= self.factor_at(maps.transmission).clamp(0.0, 1.0);
        material.ka *= 1.0 + maps.occlusion_strength * (self.factor_at(maps.occlusion).clamp(0.0, 1.0) - 1.0);
        if !is_microfacet(material) {
            material.ka *= base;
        }
    }
}

/// The squared tangent of an angle, from its cosine.
fn squared_tangent(cosine: f32) -> f32 {
    (1.0 - cosine * cosine).max(0.0) / (cosine * cosine)
}

/// Whether a normal map has bent the shading normal. It has not where a normal is not a number.
pub fn is_bent(surface: &Surface) -> bool {
    (surface.shading - surface.interpolated).abs().cmpgt(Vec3::ZERO).any()
}

/// The share of a light that reaches a bent normal, whose bumps shadow one another: 1 from the direction of the
/// interpolated normal, 0 at the horizon of the interpolated surface.
pub fn bump_shadowing(surface: &Surface, to_light: Vec3) -> f32 {
    if !is_bent(surface) {
        return 1.0;
    }
    let cos_bend = surface.interpolated.dot(surface.shading).abs().max(LEAST_COSINE);
    let cos_light = surface.interpolated.dot(to_light).abs().max(LEAST_COSINE);
    let squared_width = (0.125 * squared_tangent(cos_bend)).min(1.0);
    2.0 / (1.0 + (1.0 + squared_width * squared_tangent(cos_light)).sqrt())
}

/// Returns the surface and its material at a ray's hit.
///
/// # Panics
/// Nothing was hit.
pub fn shaded_at(inputs: &KernelInputs, ray: &PathRay, hit: &Hit) -> (Surface, Material) {
    let material_ix = inputs.material_ix_of(hit.triangle_ix) as usize;
    let mut surface = surface_of(ray, hit, &inputs.triangle(hit.triangle_ix), &inputs.stored(hit.triangle_ix));
    let mut material = inputs.materials[material_ix];
    if let Some(textures) = inputs.textures {
        let maps = &textures.material_maps[material_ix];
        let at = TextureHit::new(inputs, textures, (ray, hit), surface.geometric);
        at.apply_maps(maps, &mut material);
        surface.shading = at.mapped_normal(maps, &surface);
    }
    (surface, material)
}

/// Returns the diffuse colour of the material that [`shaded_at`] returns. `geometric`: of the surface.
///
/// # Panics
/// Nothing was hit.
pub fn colour_at(inputs: &KernelInputs, ray: &PathRay, hit: &Hit, geometric: Vec3) -> Vec3 {
    let material_ix = inputs.material_ix_of(hit.triangle_ix) as usize;
    let kd = inputs.materials[material_ix].kd;
    let Some(textures) = inputs.textures else { return kd };
    kd * TextureHit::new(inputs, textures, (ray, hit), geometric).base_colour(&textures.material_maps[material_ix]).0
}
