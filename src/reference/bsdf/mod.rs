//! How surfaces of microfacets scatter light in the path tracer: the bidirectional scattering distribution function.
//! Twin of `bsdf/bsdf.glsl`, which describes the layers.

mod albedo;
mod clearcoat;
mod conductor;
mod ggx;
mod lambert;
mod local_frame;
mod multiple_scattering;
mod reflection;
mod sheen;
#[cfg(test)]
mod tests;
mod transmission;

use glam::{Vec2, Vec3, Vec3Swizzles, Vec4};

use self::{
    albedo::{GgxAlbedo, ggx_albedo, mean_ggx_albedo, sheen_albedo},
    clearcoat::{clearcoat_albedo, clearcoat_fresnel},
    conductor::conductor_reflectance,
    ggx::sample_ggx,
    lambert::{evaluate_lambert, lambert_density, sample_lambert},
    local_frame::{LocalFrame, frame_around, to_local, to_world},
    multiple_scattering::{later_bounces, mean_reflectance},
    reflection::{evaluate_reflection, reflected_by, reflection_density},
    sheen::{evaluate_sheen, sample_sheen, sheen_bound, sheen_density},
    transmission::{evaluate_refraction, refracted_by, refracting_normal, refraction_density, refracts_between},
};
use super::{
    fresnel::{fresnel, keep_side, refraction_cosine},
    microfacet::{dielectric_reflectance, metal_reflectance, normal_reflectance},
    surface::Surface,
};
use crate::layout::{
    LEAST_COSINE, LEAST_INDEX_STEP, LEAST_ROUGH_WIDTH, LEAST_SHEEN_ROUGHNESS, MATERIAL_CONDUCTOR, MATERIAL_PHONG_WIDTH,
    MATERIAL_SINGLE_SCATTERING, MATERIAL_SOLID, MATERIAL_UNLIT, Material,
};

/// A sampled direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    pub direction: Vec3,
    /// The scattered share times the cosine, divided by the density.
    pub weight: Vec3,
    /// Density of all lobes, per steradian; of a delta lobe, the probability of its choice. A density of 0 means that
    /// the light is absorbed.
    pub density: f32,
    pub is_delta: bool,
}

/// What all lobes need that depends on the material and the viewer.
#[derive(Clone, Copy, Debug)]
pub struct BsdfTerms {
    pub material: Material,
    frame: LocalFrame,
    to_viewer: Vec3,
    /// Width of the interface's distribution of normals. It is 0 if the interface is perfectly smooth.
    width: f32,
    /// Roughness of the clear layer. It is 0 if the layer is perfectly smooth.
    coat_roughness: f32,
    sheen_roughness: f32,
    /// Index of refraction on the viewer's side, divided by that of the other side. 1: light passes unbent.
    eta: f32,
    is_solid: bool,
    /// Whether the interface reflects light or lets it pass. Without an interface, the base is Lambertian.
    has_interface: bool,
    /// Share of the light that the layers above leave to the sheen.
    sheen_share: f32,
    /// Share of the light that the layers above leave to the interface.
    base_share: f32,
    sheen_bound: f32,
    /// Factor on what a sheet reflects and transmits, which makes up for light that bounces between microfacets.
    clear_gain: f32,
    /// Largest channels of what the dielectric reflects: along the normal, at grazing angles, and after light has
    /// bounced between microfacets. They give its albedo.
    dielectric: Vec3,
    /// Reflectance of the Lambertian surface, apart from the factor that depends on the light's direction.
    below: Vec3,
    /// Reflectance of the light that bounces between microfacets, apart from the same factor.
    between: Vec3,
    /// Probabilities of the lobes: interface, Lambertian, clear layer, sheen. Their sum is 1, or 0 for a black surface.
    choice: Vec4,
}

/// The shares of light that a microfacet of the interface reflects and lets pass.
#[derive(Clone, Copy, Debug)]
struct InterfaceSplit {
    reflected: Vec3,
    transmitted: Vec3,
}

/// The scattered share of light times the cosine, and the density of its direction.
#[derive(Clone, Copy, Debug)]
pub struct BsdfValue {
    pub value: Vec3,
    pub density: f32,
}

const BSDF_ABSORBED: BsdfSample = BsdfSample { direction: Vec3::Z, weight: Vec3::ZERO, density: 0.0, is_delta: false };

/// GLSL's `mix`.
fn mix(a: Vec3, b: Vec3, weight: f32) -> Vec3 {
    a * (1.0 - weight) + b * weight
}

fn mean_of(v: Vec3) -> f32 {
    (v.x + v.y + v.z) / 3.0
}

/// The width of the distribution of the interface's normals; 0 if it is perfectly smooth.
fn interface_width(material: &Material) -> f32 {
    let is_of_phong = material.flags & MATERIAL_PHONG_WIDTH != 0;
    let width = if is_of_phong { (2.0 / (material.ns + 2.0)).sqrt() } else { material.roughness * material.roughness };
    if width < LEAST_ROUGH_WIDTH { 0.0 } else { width.min(1.0) }
}

/// The roughness of the clear layer; 0 if it is perfectly smooth.
fn clearcoat_roughness(material: &Material) -> f32 {
    let roughness = material.clearcoat_roughness;
    if roughness * roughness < LEAST_ROUGH_WIDTH { 0.0 } else { roughness.min(1.0) }
}

/// Share of light that passes through the surface, of that which the dielectric and the metal do not reflect.
fn passing_share(material: &Material) -> f32 {
    material.transmission * (1.0 - material.metallic)
}

/// Whether all of the surface's lobes are perfectly smooth. Lights cannot be picked for it.
pub fn is_smooth(material: &Material) -> bool {
    if material.flags & MATERIAL_UNLIT != 0 {
        return true;
    }
    let has_lambert = material.kd.max_element() * (1.0 - material.metallic) * (1.0 - material.transmission) > 0.0;
    let has_rough_coat = material.clearcoat > 0.0 && clearcoat_roughness(material) > 0.0;
    let has_sheen = material.sheen_colour.max_element() > 0.0;
    interface_width(material) == 0.0 && !has_lambert && !has_rough_coat && !has_sheen
}

/// Reflectance of the metal where the light's angle to the microfacet's normal has this cosine.
fn metal_fresnel(material: &Material, cosine: f32) -> Vec3 {
    if material.flags & MATERIAL_CONDUCTOR == 0 {
        return metal_reflectance(material, cosine);
    }
    conductor_reflectance(cosine, material.conductor_eta, material.conductor_k)
}

/// About the share of light that the surface scatters, by colour: what it reflects along its normal, or lets pass. It
/// is 1 if the surface is perfectly smooth, since that shows other surfaces.
pub fn surface_albedo(material: &Material) -> Vec3 {
    if is_smooth(material) {
        return Vec3::ONE;
    }
    let dielectric = material.kd + normal_reflectance(material);
    mix(dielectric, metal_fresnel(material, 1.0), material.metallic).clamp(Vec3::ZERO, Vec3::ONE)
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

/// Returns what a microfacet of the interface does with light. `cosine`: between the microfacet's normal and the
/// viewer.
fn split_at(terms: &BsdfTerms, cosine: f32) -> InterfaceSplit {
    let material = &terms.material;
    let cosine = cosine.clamp(0.0, 1.0);
    let opaque = dielectric_reflectance(material, cosine);
    let clear = match terms.is_solid {
        true => Vec3::splat(fresnel(cosine, refraction_cosine(cosine, terms.eta), terms.eta)),
        false => opaque,
    };
    let reflected = mix(opaque, terms.clear_gain * clear, material.transmission);
    let reflected = mix(reflected, metal_fresnel(material, cosine), material.metallic);
    // Light passes two boundaries of a solid, and is tinted at both.
    let tint = material.tf * if terms.is_solid { material.kd.map(f32::sqrt) } else { material.kd };
    let passing = terms.clear_gain * passing_share(material) * (1.0 - clear.max_element());
    InterfaceSplit { reflected, transmitted: passing * tint }
}

/// Probability that light is sampled as reflected, not as let pass.
fn reflected_choice(split: &InterfaceSplit) -> f32 {
    let reflected = mean_of(split.reflected);
    let sum = reflected + mean_of(split.transmitted);
    if sum > 0.0 { reflected / sum } else { 0.0 }
}

/// Whether transmitted light keeps its direction exactly.
fn passes_straight(terms: &BsdfTerms) -> bool {
    if terms.is_solid { terms.eta == 1.0 } else { terms.width == 0.0 }
}

/// Share of light that the dielectric reflects, from `BsdfTerms::dielectric`.
fn dielectric_albedo(dielectric: Vec3, albedo: GgxAlbedo) -> f32 {
    let at_normal = 1.0 - albedo.loss - albedo.grazing;
    dielectric.x * at_normal + dielectric.y * albedo.grazing + dielectric.z * albedo.loss
}

/// The albedo of a surface without an interface, which reflects and loses nothing.
const NO_ALBEDO: GgxAlbedo = GgxAlbedo { loss: 0.0, grazing: 0.0 };

/// Sets the terms of the Lambertian lobe. `albedo`: of the interface, towards the viewer.
fn set_lambert(terms: &mut BsdfTerms, albedo: GgxAlbedo, roughness: f32) {
    let material = &terms.material;
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
        let later_metal = later_bounces(mean_reflectance(metal_fresnel(material, 1.0), Vec3::ONE), mean.loss);
        let share = mix((1.0 - material.transmission) * later, later_metal, material.metallic);
        terms.between = share * (albedo.loss / mean.loss);
    }
    terms.dielectric = Vec3::new(at_normal.max_element(), at_grazing.x, later.max_element());
    let left = 1.0 - dielectric_albedo(terms.dielectric, albedo);
    let mean_left = (1.0 - dielectric_albedo(terms.dielectric, mean)).max(1.0e-4);
    let share = (1.0 - material.metallic) * (1.0 - material.transmission);
    terms.below = material.kd * (share * left.max(0.0) / mean_left);
}

/// Share of light that the interface reflects, without what a solid reflects of the light that it transmits.
fn interface_albedo(terms: &BsdfTerms, albedo: GgxAlbedo) -> Vec3 {
    let material = &terms.material;
    let at_normal = 1.0 - albedo.loss - albedo.grazing;
    let opaque = normal_reflectance(material) * at_normal + terms.dielectric.y * albedo.grazing;
    let metal = metal_fresnel(material, 1.0) * at_normal + albedo.grazing;
    mix((1.0 - material.transmission) * opaque, metal, material.metallic)
}

/// Sets the shares of the layers, and the probabilities of the lobes.
fn set_layers(terms: &mut BsdfTerms, albedo: GgxAlbedo) {
    let material = terms.material;
    let cosine = terms.to_viewer.z;
    let (mut coat, mut sheen) = (0.0, 0.0);
    if material.clearcoat > 0.0 {
        coat = material.clearcoat * clearcoat_albedo(cosine, terms.coat_roughness);
    }
    if material.sheen_colour.max_element() > 0.0 {
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
    let left = (1.0 - dielectric_albedo(terms.dielectric, albedo)).max(0.0);
    let mut choice = Vec4::new(
        terms.base_share * (mean_of(reflected) + mean_of(split.transmitted)),
        terms.base_share * mean_of(terms.below * left + terms.between * albedo.loss),
        coat,
        terms.sheen_share * mean_of(material.sheen_colour) * sheen,
    );
    // Light of macroscopic total reflection may still pass through some microfacets.
    choice.x += terms.base_share * 0.01 * passing_share(&material);
    let sum = choice.x + choice.y + choice.z + choice.w;
    terms.choice = if sum > 0.0 { choice / sum } else { Vec4::ZERO };
}

/// Returns the terms for a viewer.
pub fn bsdf_terms(material: &Material, surface: &Surface, to_viewer: Vec3) -> BsdfTerms {
    let mut material = *material;
    material.kd = material.kd.clamp(Vec3::ZERO, Vec3::ONE);
    material.sheen_colour = material.sheen_colour.clamp(Vec3::ZERO, Vec3::ONE);
    let is_behind = surface.shading.dot(to_viewer) < LEAST_COSINE;
    let frame = frame_around(if is_behind { surface.geometric } else { surface.shading });
    let mut to_viewer = to_local(&frame, to_viewer);
    to_viewer.z = to_viewer.z.max(LEAST_COSINE);
    let width = interface_width(&material);
    let is_solid = material.flags & MATERIAL_SOLID != 0 && passing_share(&material) > 0.0;
    let bends = is_solid && !((material.ni - 1.0).abs() < LEAST_INDEX_STEP);
    let of_side = if surface.from_inside { material.ni } else { 1.0 / material.ni };
    let roughness = width.sqrt();
    let has_interface = material.ks.max_element() > 0.0 || material.metallic > 0.0 || material.transmission > 0.0;
    let albedo = if has_interface { ggx_albedo(to_viewer.z, roughness) } else { NO_ALBEDO };
    let has_gain = material.flags & MATERIAL_SINGLE_SCATTERING == 0 && !is_solid;
    let mut terms = BsdfTerms {
        material,
        frame,
        to_viewer,
        width,
        coat_roughness: clearcoat_roughness(&material),
        sheen_roughness: material.sheen_roughness.clamp(LEAST_SHEEN_ROUGHNESS, 1.0),
        eta: if bends { of_side } else { 1.0 },
        is_solid,
        has_interface,
        sheen_share: 1.0,
        base_share: 1.0,
        sheen_bound: 1.0,
        clear_gain: if has_gain { 1.0 / (1.0 - albedo.loss) } else { 1.0 },
        dielectric: Vec3::ZERO,
        below: Vec3::ZERO,
        between: Vec3::ZERO,
        choice: Vec4::ZERO,
    };
    set_lambert(&mut terms, albedo, roughness);
    set_layers(&mut terms, albedo);
    if material.flags & MATERIAL_UNLIT != 0 {
        terms.choice = Vec4::ZERO;
    }
    terms
}

/// Adds the interface's reflection.
fn add_reflection(terms: &BsdfTerms, to_light: Vec3, half_vector: Vec3, sum: &mut BsdfValue) {
    if terms.width == 0.0 || !terms.has_interface {
        return;
    }
    let lobe = evaluate_reflection(terms.to_viewer, to_light, half_vector, terms.width);
    let mut split = split_at(terms, terms.to_viewer.dot(half_vector));
    sum.value += terms.base_share * split.reflected * lobe;
    if passes_straight(terms) {
        split = split_at(terms, terms.to_viewer.z);
    }
    let choice = terms.choice.x * reflected_choice(&split);
    sum.density += choice * reflection_density(terms.to_viewer, half_vector, terms.width);
}

/// Adds the reflection of the clear layer.
fn add_clearcoat(terms: &BsdfTerms, to_light: Vec3, half_vector: Vec3, sum: &mut BsdfValue) {
    if !(terms.material.clearcoat > 0.0) || terms.coat_roughness == 0.0 {
        return;
    }
    let width = terms.coat_roughness * terms.coat_roughness;
    let lobe = evaluate_reflection(terms.to_viewer, to_light, half_vector, width);
    sum.value += terms.material.clearcoat * clearcoat_fresnel(terms.to_viewer.dot(half_vector)) * lobe;
    sum.density += terms.choice.z * reflection_density(terms.to_viewer, half_vector, width);
}

/// Adds the Lambertian lobe.
fn add_lambert(terms: &BsdfTerms, to_light: Vec3, sum: &mut BsdfValue) {
    let albedo = if terms.has_interface { ggx_albedo(to_light.z, terms.width.sqrt()) } else { NO_ALBEDO };
    let left = (1.0 - dielectric_albedo(terms.dielectric, albedo)).max(0.0);
    let reflectance = terms.below * left + terms.between * albedo.loss;
    sum.value += terms.base_share * evaluate_lambert(reflectance, to_light);
    sum.density += terms.choice.y * lambert_density(to_light);
}

/// Adds the sheen.
fn add_sheen(terms: &BsdfTerms, to_light: Vec3, sum: &mut BsdfValue) {
    if !(terms.material.sheen_colour.max_element() > 0.0) {
        return;
    }
    let lobe = evaluate_sheen(terms.to_viewer, to_light, terms.sheen_roughness) * terms.sheen_bound;
    sum.value += terms.sheen_share * terms.material.sheen_colour * lobe;
    sum.density += terms.choice.w * sheen_density(to_light);
}

/// Adds the light that passes through the interface.
fn add_transmission(terms: &BsdfTerms, to_light: Vec3, sum: &mut BsdfValue) {
    if terms.width == 0.0 || passes_straight(terms) {
        return;
    }
    let (to_viewer, width, eta) = (terms.to_viewer, terms.width, terms.eta);
    let mirrored = to_light.xy().extend(-to_light.z);
    let half_vector = match terms.is_solid {
        true => refracting_normal(to_viewer, to_light, eta),
        false => (to_viewer + mirrored).normalize(),
    };
    if terms.is_solid && !refracts_between(to_viewer, to_light, half_vector) {
        return;
    }
    let split = split_at(terms, to_viewer.dot(half_vector));
    let (lobe, density) = match terms.is_solid {
        true => (
            evaluate_refraction(to_viewer, to_light, half_vector, width, eta),
            refraction_density(to_viewer, to_light, half_vector, width, eta),
        ),
        false => (
            evaluate_reflection(to_viewer, mirrored, half_vector, width),
            reflection_density(to_viewer, half_vector, width),
        ),
    };
    sum.value += terms.base_share * split.transmitted * lobe;
    sum.density += terms.choice.x * (1.0 - reflected_choice(&split)) * density;
}

/// Returns the sum of all lobes but the delta lobes. `to_light`: in the frame of the surface.
fn value_of(terms: &BsdfTerms, to_light: Vec3) -> BsdfValue {
    let mut sum = BsdfValue { value: Vec3::ZERO, density: 0.0 };
    if to_light.z > 0.0 {
        let half_vector = (terms.to_viewer + to_light).normalize();
        add_reflection(terms, to_light, half_vector, &mut sum);
        add_lambert(terms, to_light, &mut sum);
        add_clearcoat(terms, to_light, half_vector, &mut sum);
        add_sheen(terms, to_light, &mut sum);
    } else if to_light.z < 0.0 {
        add_transmission(terms, to_light, &mut sum);
    }
    sum
}

/// Whether a direction is on the same side of the triangle and of the surface's frame. `local`: in this frame.
fn is_consistent(surface: &Surface, direction: Vec3, local: Vec3) -> bool {
    surface.geometric.dot(direction) * local.z > 0.0
}

/// Returns the sum of all lobes but the delta lobes, at a surface.
pub fn value_at(terms: &BsdfTerms, surface: &Surface, to_light: Vec3) -> BsdfValue {
    let local = to_local(&terms.frame, to_light);
    if terms.choice == Vec4::ZERO || !is_consistent(surface, to_light, local) {
        return BsdfValue { value: Vec3::ZERO, density: 0.0 };
    }
    value_of(terms, local)
}

/// Returns a sample of a delta lobe. `local`: in the frame of the surface.
fn delta_sample(terms: &BsdfTerms, surface: &Surface, local: Vec3, share: Vec3, probability: f32) -> BsdfSample {
    let side = if local.z < 0.0 { -surface.geometric } else { surface.geometric };
    let direction = keep_side(to_world(&terms.frame, local), side);
    if !(probability > 0.0) {
        return BSDF_ABSORBED;
    }
    BsdfSample { direction, weight: share / probability, density: probability, is_delta: true }
}

/// Returns a sample of a lobe with a density. `local`: in the frame of the surface. `is_above`: whether the lobe is on
/// the viewer's side.
fn rough_sample(terms: &BsdfTerms, surface: &Surface, local: Vec3, is_above: bool) -> BsdfSample {
    let direction = to_world(&terms.frame, local);
    let is_on_side = if is_above { local.z > 0.0 } else { local.z < 0.0 };
    if !is_on_side || !is_consistent(surface, direction, local) {
        return BSDF_ABSORBED;
    }
    let found = value_of(terms, local);
    if !(found.density > 0.0) {
        return BSDF_ABSORBED;
    }
    BsdfSample { direction, weight: found.value / found.density, density: found.density, is_delta: false }
}

/// Returns a sample of the interface.
fn sample_interface(terms: &BsdfTerms, surface: &Surface, u: Vec3) -> BsdfSample {
    let is_rough = terms.width > 0.0;
    let half_vector = if is_rough { sample_ggx(terms.to_viewer, terms.width, u.xy()) } else { Vec3::Z };
    let cosine = terms.to_viewer.dot(half_vector);
    // Light that passes straight tells nothing of a microfacet, so the surface's normal decides.
    let split = split_at(terms, if passes_straight(terms) { terms.to_viewer.z } else { cosine });
    let choice = reflected_choice(&split);
    let is_reflected = u.z < choice;
    let probability = terms.choice.x * if is_reflected { choice } else { 1.0 - choice };
    if is_reflected {
        let local = reflected_by(terms.to_viewer, half_vector);
        if is_rough {
            return rough_sample(terms, surface, local, true);
        }
        return delta_sample(terms, surface, local, terms.base_share * split.reflected, probability);
    }
    if passes_straight(terms) {
        return delta_sample(terms, surface, -terms.to_viewer, terms.base_share * split.transmitted, probability);
    }
    if !terms.is_solid {
        let mirrored = reflected_by(terms.to_viewer, half_vector);
        return rough_sample(terms, surface, mirrored.xy().extend(-mirrored.z), false);
    }
    // A black sample of total reflection.
    if refraction_cosine(cosine, terms.eta) <= 0.0 {
        return BSDF_ABSORBED;
    }
    let local = refracted_by(terms.to_viewer, half_vector, terms.eta);
    if is_rough {
        return rough_sample(terms, surface, local, false);
    }
    let share = terms.base_share * terms.eta * terms.eta * split.transmitted;
    delta_sample(terms, surface, local, share, probability)
}

/// Returns a sample of the clear layer.
fn sample_clearcoat(terms: &BsdfTerms, surface: &Surface, u: Vec2) -> BsdfSample {
    let width = terms.coat_roughness * terms.coat_roughness;
    let half_vector = if width > 0.0 { sample_ggx(terms.to_viewer, width, u) } else { Vec3::Z };
    let local = reflected_by(terms.to_viewer, half_vector);
    if width > 0.0 {
        return rough_sample(terms, surface, local, true);
    }
    let share = Vec3::splat(terms.material.clearcoat * clearcoat_fresnel(terms.to_viewer.z));
    delta_sample(terms, surface, local, share, terms.choice.z)
}

/// Returns a direction from which light is scattered to the viewer. `u`: random numbers in [0, 1). `u.z` selects the
/// lobe, and within the interface between reflection and transmission.
pub fn sample_bsdf(terms: &BsdfTerms, surface: &Surface, u: Vec3) -> BsdfSample {
    let choice = terms.choice;
    if choice == Vec4::ZERO {
        return BSDF_ABSORBED;
    }
    if u.z < choice.x {
        return sample_interface(terms, surface, u.xy().extend((u.z / choice.x).min(0.999_999_94)));
    }
    if u.z < choice.x + choice.y {
        return rough_sample(terms, surface, sample_lambert(u.xy()), true);
    }
    if u.z < choice.x + choice.y + choice.z {
        return sample_clearcoat(terms, surface, u.xy());
    }
    if choice.w > 0.0 {
        return rough_sample(terms, surface, sample_sheen(u.xy()), true);
    }
    BSDF_ABSORBED
}
