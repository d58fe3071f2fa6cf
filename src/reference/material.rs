//! Materials: local light by Phong, mirrors, glass and transparency as in Wavefront MTL, and microfacets. Twin of
//! `shading/material.glsl`.

use glam::Vec3;

use super::{
    fresnel::{fresnel, keep_side, refraction_cosine},
    microfacet::{
        ambient_reflectance, dielectric_reflectance, is_microfacet, metal_reflectance, microfacet_reflectance,
        mirror_share,
    },
    surface::Surface,
};
use crate::layout::{
    LEAST_COSINE, LEAST_REFLECTANCE, MATERIAL_FRESNEL, MATERIAL_REFLECT, MATERIAL_REFRACT, MATERIAL_SOLID,
    MATERIAL_SPECULAR, MATERIAL_UNLIT, Material,
};

/// The directions in which a ray continues from a surface, and the weights by which its throughput is multiplied. A
/// weight of zero means that there is no such ray.
#[derive(Clone, Copy, Debug, Default)]
pub struct Scattering {
    pub reflected: Vec3,
    pub reflected_weight: Vec3,
    pub transmitted: Vec3,
    pub transmitted_weight: Vec3,
    /// Whether what is transmitted goes straight on through a blended surface.
    pub passes_straight: bool,
}

/// The weight of the light that the surface itself reflects and emits. A see-through material (d < 1) covers only a
/// share d of what is behind it. A material that refracts shows its own light in full.
pub fn local_weight(material: &Material) -> f32 {
    if is_microfacet(material) || is_unlit(material) {
        return material.d;
    }
    if material.flags & MATERIAL_REFRACT != 0 { 1.0 } else { material.d }
}

/// GLSL's `reflect`.
fn reflect(incident: Vec3, normal: Vec3) -> Vec3 {
    incident - 2.0 * normal.dot(incident) * normal
}

/// Whether rays may continue from the surface.
pub fn scatters_light(material: &Material) -> bool {
    if is_unlit(material) {
        return material.d < 1.0;
    }
    if is_microfacet(material) {
        return material.d < 1.0 || material.transmission > 0.0 || mirror_share(material) > 0.0;
    }
    material.flags & (MATERIAL_REFLECT | MATERIAL_REFRACT) != 0 || material.d < 1.0
}

/// The reflectance towards the viewer: the diffuse part, which is multiplied by the cosine of the light's direction,
/// plus the specular part, which is not. All vectors are unit vectors that point away from the surface.
pub fn phong(material: &Material, normal: Vec3, to_viewer: Vec3, to_light: Vec3) -> Vec3 {
    let cos_light = normal.dot(to_light);
    // Not `<=`: a NaN is dark.
    if !(cos_light > 0.0) {
        return Vec3::ZERO;
    }
    let mut reflectance = material.kd * cos_light;
    let cos_mirror = reflect(-to_light, normal).dot(to_viewer);
    if material.flags & MATERIAL_SPECULAR != 0 && cos_mirror > 0.0 {
        reflectance += material.ks * cos_mirror.powf(material.ns);
    }
    reflectance
}

/// Whether the surface shows its colour without any light.
pub fn is_unlit(material: &Material) -> bool {
    material.flags & MATERIAL_UNLIT != 0
}

/// The radiance that the surface gives off by itself.
pub fn emitted(material: &Material) -> Vec3 {
    if is_unlit(material) { material.kd + material.ke } else { material.ke }
}

/// The share of the ambient light that the surface shows.
pub fn ambient_share(material: &Material, normal: Vec3, to_viewer: Vec3) -> Vec3 {
    if is_unlit(material) {
        Vec3::ZERO
    } else if is_microfacet(material) {
        material.ka * ambient_reflectance(material, normal, to_viewer)
    } else {
        material.ka
    }
}

/// The reflectance towards the viewer, times the cosine of the light's direction where the light is reflected diffusely
/// or by microfacets. All vectors are unit vectors that point away from the surface.
pub fn reflectance_of(material: &Material, normal: Vec3, to_viewer: Vec3, to_light: Vec3) -> Vec3 {
    if is_unlit(material) {
        Vec3::ZERO
    } else if is_microfacet(material) {
        microfacet_reflectance(material, normal, to_viewer, to_light)
    } else {
        phong(material, normal, to_viewer, to_light)
    }
}

/// Whether the surface can show a light: whether it reflects towards the viewer more than [`LEAST_REFLECTANCE`], in
/// any colour, of the light that comes from the direction `to_light`.
pub fn can_show(material: &Material, normal: Vec3, to_viewer: Vec3, to_light: Vec3) -> bool {
    if is_unlit(material) {
        return false;
    }
    let least = Vec3::splat(LEAST_REFLECTANCE);
    // The diffuse part alone decides most cases, without the exponentiation of the specular part.
    let diffuse = material.kd * normal.dot(to_light) * local_weight(material);
    !is_microfacet(material) && diffuse.cmpgt(least).any()
        || (reflectance_of(material, normal, to_viewer, to_light) * local_weight(material)).cmpgt(least).any()
}

/// Returns how a ray of this direction continues from a surface of microfacets.
fn scatter_by_microfacets(material: &Material, surface: &Surface, direction: Vec3) -> Scattering {
    let through = material.transmission * (1.0 - material.metallic);
    let is_solid = material.flags & MATERIAL_SOLID != 0 && through > 0.0;
    let eta = if surface.from_inside { material.ni } else { 1.0 / material.ni };
    let cos_in = surface.shading.dot(-direction).max(LEAST_COSINE);
    let cos_out = refraction_cosine(cos_in, eta);
    let total = is_solid && cos_out <= 0.0;
    let dielectric = match is_solid {
        true => Vec3::splat(fresnel(cos_in, cos_out, eta)),
        false => dielectric_reflectance(material, cos_in),
    };
    let reflected = dielectric.lerp(metal_reflectance(material, cos_in), material.metallic);
    let tint = if is_solid { material.kd.map(f32::sqrt) } else { material.kd };
    let refracted = eta * direction + (eta * cos_in - cos_out) * surface.shading;
    Scattering {
        reflected: keep_side((direction + 2.0 * cos_in * surface.shading).normalize(), surface.geometric),
        reflected_weight: material.d * (if total { 1.0 } else { mirror_share(material) }) * reflected,
        transmitted: match is_solid && !total {
            true => keep_side(refracted.normalize(), -surface.geometric),
            false => direction,
        },
        transmitted_weight: material.d * through * (1.0 - dielectric.max_element()) * tint + (1.0 - material.d),
        passes_straight: material.d < 1.0 && (!is_solid || total),
    }
}

/// Returns the transmittance of a ray of length `t` (world units), which may have come through a solid.
pub fn transmittance(material: &Material, surface: &Surface, t: f32) -> Vec3 {
    let is_absorbed = is_microfacet(material) && material.flags & MATERIAL_SOLID != 0 && surface.from_inside;
    if is_absorbed { (-material.absorption * t).exp() } else { Vec3::ONE }
}

/// Returns how a ray of this direction continues from a surface.
pub fn scatter(material: &Material, surface: &Surface, direction: Vec3) -> Scattering {
    if is_unlit(material) {
        let transmitted_weight = Vec3::splat(1.0 - material.d);
        return Scattering {
            transmitted: direction,
            transmitted_weight,
            passes_straight: true,
            ..Scattering::default()
        };
    }
    if is_microfacet(material) {
        return scatter_by_microfacets(material, surface, direction);
    }
    let mut s = Scattering { transmitted: direction, ..Scattering::default() };
    let reflects = material.flags & MATERIAL_REFLECT != 0;
    let refracts = material.flags & MATERIAL_REFRACT != 0;
    if !reflects && !refracts {
        s.transmitted_weight = Vec3::splat(1.0 - material.d);
        s.passes_straight = true;
        return s;
    }
    let eta = if surface.from_inside { material.ni } else { 1.0 / material.ni };
    // An interpolated normal can turn away from the viewer. The ray then counts as grazing.
    let cos_in = surface.shading.dot(-direction).max(LEAST_COSINE);
    let cos_out = refraction_cosine(cos_in, eta);
    let total = refracts && cos_out <= 0.0;
    let has_fresnel = material.flags & MATERIAL_FRESNEL != 0;
    let share = if has_fresnel {
        Vec3::splat(fresnel(cos_in, cos_out, eta))
    } else if total {
        Vec3::ONE
    } else {
        material.ks
    };
    if reflects {
        s.reflected = keep_side((direction + 2.0 * cos_in * surface.shading).normalize(), surface.geometric);
        s.reflected_weight = if has_fresnel && !refracts { share * material.ks } else { share };
    }
    if refracts && !total {
        let through = eta * direction + (eta * cos_in - cos_out) * surface.shading;
        s.transmitted = keep_side(through.normalize(), -surface.geometric);
        s.transmitted_weight = if reflects { (1.0 - share) * material.tf } else { material.tf };
    }
    s
}
