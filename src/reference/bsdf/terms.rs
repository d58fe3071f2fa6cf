//! What all lobes need that depends on the material and the viewer: the lobes' shares, and the probabilities with
//! which the lobes are chosen. Twin of `bsdf/terms.glsl`.

use glam::{Vec3, Vec4};

use super::{
    albedo::{GgxAlbedo, ggx_albedo, mean_ggx_albedo, sheen_albedo},
    clearcoat::clearcoat_albedo,
    lobes::{
        clearcoat_roughness, has_clearcoat, has_interface, has_sheen, interface_width, mean_of, metal_fresnel,
        passing_share, with_metal,
    },
    local_frame::{LocalFrame, frame_around, to_local},
    multiple_scattering::{later_bounces, mean_reflectance},
    sheen::sheen_bound,
    solid_loss::solid_loss,
};
use crate::{
    layout::{
        LEAST_COSINE, LEAST_INDEX_STEP, LEAST_SHEEN_ROUGHNESS, MATERIAL_SINGLE_SCATTERING, MATERIAL_SOLID,
        MATERIAL_UNLIT, Material,
    },
    reference::{
        fresnel::{fresnel, refraction_cosine},
        maps::is_bent,
        microfacet::{dielectric_reflectance, normal_reflectance},
        surface::Surface,
    },
};

/// What all lobes need that depends on the material and the viewer.
#[derive(Clone, Copy, Debug)]
pub struct BsdfTerms<'a> {
    pub material: &'a Material,
    pub(super) frame: LocalFrame,
    pub(super) to_viewer: Vec3,
    /// Width of the interface's distribution of normals. It is 0 if the interface is perfectly smooth.
    pub(super) width: f32,
    /// Roughness of the clear coat. It is 0 if the coat is perfectly smooth.
    pub(super) coat_roughness: f32,
    pub(super) sheen_roughness: f32,
    /// Index of refraction on the viewer's side, divided by that of the other side. 1: light passes unbent.
    pub(super) eta: f32,
    pub(super) is_solid: bool,
    /// Whether there is an interface. Without one, the base is Lambertian.
    pub(super) has_interface: bool,
    /// Share of the light that the lobes above leave to the sheen.
    pub(super) sheen_share: f32,
    /// Share of the light that the lobes above leave to the interface.
    pub(super) base_share: f32,
    pub(super) sheen_bound: f32,
    /// Factor on what a sheet or a solid reflects and transmits, for the light that bounces between microfacets.
    pub(super) clear_gain: f32,
    /// Largest channels of what the dielectric reflects: along the normal, at grazing angles, and after light has
    /// bounced between microfacets. They give its albedo.
    pub(super) dielectric: Vec3,
    /// Reflectance of the Lambertian surface, apart from the factor that depends on the light's direction.
    pub(super) below: Vec3,
    /// Reflectance of the light that bounces between microfacets, apart from the same factor.
    pub(super) between: Vec3,
    /// Probability that the interface's light is sampled as reflected if it passes straight, whatever the microfacet.
    pub(super) straight_choice: f32,
    /// Probabilities of the lobes: interface, Lambertian, clear coat, sheen. Their sum is 1, or 0 for a black surface.
    pub(super) choice: Vec4,
}

/// The shares of light that a microfacet of the interface reflects and lets pass.
#[derive(Clone, Copy, Debug)]
pub(super) struct InterfaceSplit {
    pub(super) reflected: Vec3,
    pub(super) transmitted: Vec3,
}

/// GLSL's `mix`.
fn mix(a: Vec3, b: Vec3, weight: f32) -> Vec3 {
    a * (1.0 - weight) + b * weight
}

/// Returns what a microfacet of the interface does with light. `cosine`: between the microfacet's normal and the
/// viewer.
pub(super) fn split_at(terms: &BsdfTerms, cosine: f32) -> InterfaceSplit {
    let material = terms.material;
    let cosine = cosine.clamp(0.0, 1.0);
    // No light passes, so the general formula would give the same result.
    if material.metallic == 1.0 || material.transmission == 0.0 {
        let opaque = || dielectric_reflectance(material, cosine);
        let reflected = with_metal(material, opaque, || metal_fresnel(material, cosine));
        return InterfaceSplit { reflected, transmitted: Vec3::ZERO };
    }
    let opaque = dielectric_reflectance(material, cosine);
    let clear = match terms.is_solid {
        true => Vec3::splat(fresnel(cosine, refraction_cosine(cosine, terms.eta), terms.eta)),
        false => opaque,
    };
    let reflected = || mix(opaque, terms.clear_gain * clear, material.transmission);
    let reflected = with_metal(material, reflected, || metal_fresnel(material, cosine));
    // Light passes two boundaries of a solid, and is tinted at both.
    let tint = material.tf * if terms.is_solid { material.kd.map(f32::sqrt) } else { material.kd };
    let passing = terms.clear_gain * passing_share(material) * (1.0 - clear.max_element());
    InterfaceSplit { reflected, transmitted: passing * tint }
}

/// Probability that light is sampled as reflected, not as let pass.
pub(super) fn reflected_choice(split: &InterfaceSplit) -> f32 {
    let reflected = mean_of(split.reflected);
    let sum = reflected + mean_of(split.transmitted);
    if sum > 0.0 { reflected / sum } else { 0.0 }
}

/// Whether transmitted light keeps its direction exactly.
pub(super) fn passes_straight(terms: &BsdfTerms) -> bool {
    if terms.is_solid { terms.eta == 1.0 } else { terms.width == 0.0 }
}

/// Share of light that the dielectric reflects, from `BsdfTerms::dielectric`.
pub(super) fn dielectric_albedo(dielectric: Vec3, albedo: GgxAlbedo) -> f32 {
    let at_normal = 1.0 - albedo.loss - albedo.grazing;
    dielectric.x * at_normal + dielectric.y * albedo.grazing + dielectric.z * albedo.loss
}

/// The albedo of a surface without an interface, which reflects and loses nothing.
pub(super) const NO_ALBEDO: GgxAlbedo = GgxAlbedo { loss: 0.0, grazing: 0.0 };

/// Sets the terms of the Lambertian lobe. `albedo`: of the interface, towards the viewer.
fn set_lambert(terms: &mut BsdfTerms, albedo: GgxAlbedo, roughness: f32) {
    let material = terms.material;
    terms.below = material.kd;
    if !terms.has_interface {
        return;
    }
    let mean = mean_ggx_albedo(roughness);
    let at_normal = normal_reflectance(material);
    let at_grazing = Vec3::splat(material.ks.max_element().min(1.0));
    let mut later = Vec3::ZERO;
    if material.flags & MATERIAL_SINGLE_SCATTERING == 0 && mean.loss > 0.0 {
        later = later_bounces(mean_reflectance(at_normal, at_grazing), mean.loss);
        let dielectric = || (1.0 - material.transmission) * later;
        let metal = || later_bounces(mean_reflectance(metal_fresnel(material, 1.0), Vec3::ONE), mean.loss);
        terms.between = with_metal(material, dielectric, metal) * (albedo.loss / mean.loss);
    }
    terms.dielectric = Vec3::new(at_normal.max_element(), at_grazing.x, later.max_element());
    let left = 1.0 - dielectric_albedo(terms.dielectric, albedo);
    let mean_left = (1.0 - dielectric_albedo(terms.dielectric, mean)).max(1.0e-4);
    let share = (1.0 - material.metallic) * (1.0 - material.transmission);
    terms.below = material.kd * (share * left.max(0.0) / mean_left);
}

/// Share of light that the interface reflects, without what a solid reflects of the light that it transmits.
fn interface_albedo(terms: &BsdfTerms, albedo: GgxAlbedo) -> Vec3 {
    let material = terms.material;
    let at_normal = 1.0 - albedo.loss - albedo.grazing;
    let opaque = || normal_reflectance(material) * at_normal + terms.dielectric.y * albedo.grazing;
    let metal = || metal_fresnel(material, 1.0) * at_normal + albedo.grazing;
    with_metal(material, || (1.0 - material.transmission) * opaque(), metal)
}

/// Sets the shares and the probabilities of the lobes.
fn set_shares(terms: &mut BsdfTerms, albedo: GgxAlbedo) {
    let material = terms.material;
    // A surface that is only Lambertian has the lobes' shares already: what follows would compute the same.
    if !terms.has_interface && !has_clearcoat(material) && !has_sheen(material) {
        terms.choice = if mean_of(terms.below) > 0.0 { Vec4::Y } else { Vec4::ZERO };
        return;
    }
    let cosine = terms.to_viewer.z;
    let (mut coat, mut sheen) = (0.0, 0.0);
    if has_clearcoat(material) {
        coat = material.clearcoat * clearcoat_albedo(cosine, terms.coat_roughness);
    }
    if has_sheen(material) {
        sheen = sheen_albedo(cosine, terms.sheen_roughness);
    }
    terms.sheen_bound = sheen_bound(sheen);
    let sheen = sheen * terms.sheen_bound;
    terms.sheen_share = 1.0 - coat;
    terms.base_share = terms.sheen_share * (1.0 - material.sheen_colour.max_element() * sheen);
    let (mut split, mut reflected) = (InterfaceSplit { reflected: Vec3::ZERO, transmitted: Vec3::ZERO }, Vec3::ZERO);
    if terms.has_interface {
        split = split_at(terms, cosine);
        reflected = split.reflected.max(interface_albedo(terms, albedo));
    }
    terms.straight_choice = reflected_choice(&split);
    let left = (1.0 - dielectric_albedo(terms.dielectric, albedo)).max(0.0);
    let mut choice = Vec4::new(
        terms.base_share * (mean_of(reflected) + mean_of(split.transmitted)),
        terms.base_share * mean_of(terms.below * left + terms.between * albedo.loss),
        coat,
        terms.sheen_share * mean_of(material.sheen_colour) * sheen,
    );
    // Light of macroscopic total reflection may still pass through some microfacets.
    choice.x += terms.base_share * 0.01 * passing_share(material);
    let sum = choice.x + choice.y + choice.z + choice.w;
    terms.choice = if sum > 0.0 { choice / sum } else { Vec4::ZERO };
}

/// The share of light that a sheet or the boundary of a solid would lose between microfacets.
fn clear_loss(terms: &BsdfTerms, albedo: GgxAlbedo) -> f32 {
    if terms.material.flags & MATERIAL_SINGLE_SCATTERING != 0 {
        return 0.0;
    }
    if !terms.is_solid {
        return albedo.loss;
    }
    // Light passes the boundary straight, or the boundary is perfectly smooth.
    if terms.eta == 1.0 || terms.width == 0.0 {
        return 0.0;
    }
    solid_loss(terms.to_viewer.z, terms.width.sqrt(), terms.eta)
}

/// The mapped normal, turned towards the interpolated one just as far that no mirror image of the viewer is below the
/// surface.
fn mirroring_normal(surface: &Surface, to_viewer: Vec3) -> Vec3 {
    let (up, normal) = (surface.interpolated, surface.shading);
    let up = (up + (LEAST_COSINE - up.dot(to_viewer)).max(0.0) * to_viewer).normalize();
    let cosine = normal.dot(to_viewer);
    if cosine > 0.0 && up.dot(2.0 * cosine * normal - to_viewer) >= 0.0 {
        return normal;
    }
    let horizon = (normal - normal.dot(up) * up).normalize();
    let seen = (to_viewer.dot(up) * up + to_viewer.dot(horizon) * horizon).normalize();
    (seen + horizon).normalize()
}

/// The normal around which the lobes are.
fn normal_of_lobes(material: &Material, surface: &Surface, to_viewer: Vec3) -> Vec3 {
    if is_bent(surface) {
        let is_lambertian = !has_interface(material) && !has_clearcoat(material) && !has_sheen(material);
        return if is_lambertian { surface.shading } else { mirroring_normal(surface, to_viewer) };
    }
    if surface.shading.dot(to_viewer) < LEAST_COSINE { surface.geometric } else { surface.shading }
}

/// Returns the terms for a viewer. Bounds the colours of the material.
pub fn bsdf_terms<'a>(material: &'a mut Material, surface: &Surface, to_viewer: Vec3) -> BsdfTerms<'a> {
    material.kd = material.kd.clamp(Vec3::ZERO, Vec3::ONE);
    material.sheen_colour = material.sheen_colour.clamp(Vec3::ZERO, Vec3::ONE);
    let frame = frame_around(normal_of_lobes(material, surface, to_viewer));
    let mut to_viewer = to_local(&frame, to_viewer);
    to_viewer.z = to_viewer.z.max(LEAST_COSINE);
    let material = &*material;
    let has_interface = has_interface(material);
    let width = if has_interface { interface_width(material) } else { 0.0 };
    let is_solid = material.flags & MATERIAL_SOLID != 0 && passing_share(material) > 0.0;
    let bends = is_solid && !((material.ni - 1.0).abs() < LEAST_INDEX_STEP);
    let roughness = width.sqrt();
    let albedo = if has_interface { ggx_albedo(to_viewer.z, roughness) } else { NO_ALBEDO };
    let mut terms = BsdfTerms {
        material,
        frame,
        to_viewer,
        width,
        coat_roughness: clearcoat_roughness(material),
        sheen_roughness: material.sheen_roughness.clamp(LEAST_SHEEN_ROUGHNESS, 1.0),
        eta: match bends {
            true if surface.from_inside => material.ni,
            true => 1.0 / material.ni,
            false => 1.0,
        },
        is_solid,
        has_interface,
        sheen_share: 1.0,
        base_share: 1.0,
        sheen_bound: 1.0,
        clear_gain: 1.0,
        dielectric: Vec3::ZERO,
        below: Vec3::ZERO,
        between: Vec3::ZERO,
        straight_choice: 0.0,
        choice: Vec4::ZERO,
    };
    if has_interface {
        terms.clear_gain = 1.0 / (1.0 - clear_loss(&terms, albedo));
    }
    set_lambert(&mut terms, albedo, roughness);
    set_shares(&mut terms, albedo);
    if material.flags & MATERIAL_UNLIT != 0 {
        terms.choice = Vec4::ZERO;
    }
    terms
}
