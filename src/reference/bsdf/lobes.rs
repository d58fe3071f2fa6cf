//! Which lobes a material has, whoever looks at it. Twin of `bsdf/lobes.glsl`.

use glam::Vec3;

use super::conductor::conductor_reflectance;
use crate::{
    layout::{
        LEAST_ROUGH_WIDTH, MATERIAL_CONDUCTOR, MATERIAL_FRESNEL, MATERIAL_PHONG_WIDTH, MATERIAL_REFLECT,
        MATERIAL_REFRACT, MATERIAL_SPECULAR, MATERIAL_UNLIT, Material,
    },
    reference::microfacet::{is_microfacet, metal_reflectance, normal_reflectance},
};

/// Whether the material has an interface, which reflects light or lets it pass. Otherwise its base is Lambertian.
pub(super) fn has_interface(material: &Material) -> bool {
    material.ks.max_element() > 0.0 || material.metallic > 0.0 || material.transmission > 0.0
}

pub(super) fn has_clearcoat(material: &Material) -> bool {
    material.clearcoat > 0.0
}

pub(super) fn has_sheen(material: &Material) -> bool {
    material.sheen_colour.max_element() > 0.0
}

pub(super) fn mean_of(v: Vec3) -> f32 {
    (v.x + v.y + v.z) / 3.0
}

/// The width of the distribution of the interface's normals; 0 if it is perfectly smooth.
pub(super) fn interface_width(material: &Material) -> f32 {
    let is_of_phong = material.flags & MATERIAL_PHONG_WIDTH != 0;
    let width = if is_of_phong { (2.0 / (material.ns + 2.0)).sqrt() } else { material.roughness * material.roughness };
    if width < LEAST_ROUGH_WIDTH { 0.0 } else { width.min(1.0) }
}

/// The roughness of the clear coat; 0 if it is perfectly smooth.
pub(super) fn clearcoat_roughness(material: &Material) -> f32 {
    let roughness = material.clearcoat_roughness;
    if roughness * roughness < LEAST_ROUGH_WIDTH { 0.0 } else { roughness.min(1.0) }
}

/// Share of light that passes through the surface, of that which the dielectric and the metal do not reflect.
pub(super) fn passing_share(material: &Material) -> f32 {
    material.transmission * (1.0 - material.metallic)
}

/// Whether all of the surface's lobes are perfectly smooth. Lights cannot be sampled for it.
pub fn is_smooth(material: &Material) -> bool {
    if material.flags & MATERIAL_UNLIT != 0 {
        return true;
    }
    let has_lambert = material.kd.max_element() * (1.0 - material.metallic) * (1.0 - material.transmission) > 0.0;
    let has_rough_coat = has_clearcoat(material) && clearcoat_roughness(material) > 0.0;
    !has_lambert && !has_rough_coat && !has_sheen(material) && interface_width(material) == 0.0
}

/// Reflectance of the metal where the light's angle to the microfacet's normal has this cosine.
pub(super) fn metal_fresnel(material: &Material, cosine: f32) -> Vec3 {
    if material.flags & MATERIAL_CONDUCTOR == 0 {
        return metal_reflectance(material, cosine);
    }
    conductor_reflectance(cosine, material.conductor_eta, material.conductor_k)
}

/// The mean of the reflectances of a dielectric and of a metal, weighted as the material is metallic. A
/// reflectance whose weight is 0 is not computed.
pub(super) fn with_metal(material: &Material, dielectric: impl FnOnce() -> Vec3, metal: impl FnOnce() -> Vec3) -> Vec3 {
    if material.metallic == 0.0 {
        return dielectric();
    }
    if material.metallic == 1.0 {
        return metal();
    }
    dielectric() * (1.0 - material.metallic) + metal() * material.metallic
}

/// The albedo of a material of MTL as the integrator whitted reads it: that of the microfacets which it is for paths.
fn phong_albedo(material: &Material) -> Vec3 {
    let has = |flag: u32| material.flags & flag != 0;
    if has(MATERIAL_REFRACT) {
        let ratio = (material.ni - 1.0) / (material.ni + 1.0);
        return material.tf + ratio * ratio;
    }
    if has(MATERIAL_REFLECT) && has(MATERIAL_FRESNEL) {
        return material.kd + normal_reflectance(material);
    }
    if has(MATERIAL_REFLECT) || has(MATERIAL_SPECULAR) { material.kd + material.ks } else { material.kd }
}

/// About the share of light that the surface scatters, by colour: what it reflects along its normal, or lets pass. Of
/// metals it is the reflectance, of glass the tint. It is the same for both integrators.
pub fn hit_albedo(material: &Material) -> Vec3 {
    let albedo = if material.flags & MATERIAL_UNLIT != 0 {
        material.kd
    } else if !is_microfacet(material) {
        phong_albedo(material)
    } else {
        let base = material.kd * (1.0 - material.transmission * (1.0 - material.tf));
        with_metal(material, || base + normal_reflectance(material), || metal_fresnel(material, 1.0))
    };
    albedo.clamp(Vec3::ZERO, Vec3::ONE)
}

/// Returns the albedo as `hit_albedo` does, but 1 for a perfectly smooth surface, which shows other surfaces.
pub fn surface_albedo(material: &Material) -> Vec3 {
    if is_smooth(material) { Vec3::ONE } else { hit_albedo(material) }
}

/// How narrow the surface scatters light, 0..1: the share of its albedo that is not Lambertian, less the wider its
/// distribution of microfacets is.
pub fn surface_gloss(material: &Material) -> f32 {
    let sum = mean_of(surface_albedo(material));
    if is_smooth(material) || sum <= 0.0 {
        return if is_smooth(material) { 1.0 } else { 0.0 };
    }
    let lambertian = mean_of(material.kd) * (1.0 - material.metallic) * (1.0 - material.transmission);
    (1.0 - interface_width(material)) * (1.0 - lambertian / sum).clamp(0.0, 1.0)
}
