//! The sum of a surface's lobes for two directions, and the pdf with which
//! [`sample_bsdf`](super::sample::sample_bsdf) samples the one towards the light. Twin of `bsdf/evaluate.glsl`.

use glam::{Vec3, Vec3Swizzles, Vec4};

use super::{
    albedo::ggx_albedo,
    clearcoat::clearcoat_fresnel,
    lambert::{evaluate_lambert, lambert_pdf},
    lobes::{has_clearcoat, has_sheen},
    local_frame::to_local,
    reflection::{evaluate_reflection, reflection_pdf},
    sheen::{evaluate_sheen, sheen_pdf},
    terms::{BsdfTerms, NO_ALBEDO, dielectric_albedo, passes_straight, reflected_choice, split_at},
    transmission::{evaluate_refraction, refracting_normal, refraction_pdf, refracts_between},
};
use crate::reference::{
    maps::{bump_shadowing, is_bent},
    surface::Surface,
};

/// The scattered share of light times the cosine, and the pdf of its direction.
#[derive(Clone, Copy, Debug)]
pub struct BsdfEval {
    pub value: Vec3,
    pub pdf: f32,
}

/// Adds the interface's reflection.
fn add_reflection(terms: &BsdfTerms, to_light: Vec3, half_vector: Vec3, sum: &mut BsdfEval) {
    if terms.width == 0.0 || !terms.has_interface {
        return;
    }
    let lobe = evaluate_reflection(terms.to_viewer, to_light, half_vector, terms.width);
    let split = split_at(terms, terms.to_viewer.dot(half_vector));
    sum.value += terms.base_share * split.reflected * lobe;
    // Light that passes straight tells nothing of a microfacet, so the surface's normal decides.
    let choice = if passes_straight(terms) { terms.straight_choice } else { reflected_choice(&split) };
    sum.pdf += terms.choice.x * choice * reflection_pdf(terms.to_viewer, half_vector, terms.width);
}

/// Adds the reflection of the clear coat.
fn add_clearcoat(terms: &BsdfTerms, to_light: Vec3, half_vector: Vec3, sum: &mut BsdfEval) {
    if !has_clearcoat(terms.material) || terms.coat_roughness == 0.0 {
        return;
    }
    let width = terms.coat_roughness * terms.coat_roughness;
    let lobe = evaluate_reflection(terms.to_viewer, to_light, half_vector, width);
    sum.value += terms.material.clearcoat * clearcoat_fresnel(terms.to_viewer.dot(half_vector)) * lobe;
    sum.pdf += terms.choice.z * reflection_pdf(terms.to_viewer, half_vector, width);
}

/// Adds the Lambertian lobe.
fn add_lambert(terms: &BsdfTerms, to_light: Vec3, sum: &mut BsdfEval) {
    // The Lambertian lobe of metals and glass is often black. Its probability is then 0, and it adds nothing.
    if terms.below == Vec3::ZERO && terms.between == Vec3::ZERO {
        return;
    }
    let albedo = if terms.has_interface { ggx_albedo(to_light.z, terms.width.sqrt()) } else { NO_ALBEDO };
    let left = (1.0 - dielectric_albedo(terms.dielectric, albedo)).max(0.0);
    let reflectance = terms.below * left + terms.between * albedo.loss;
    sum.value += terms.base_share * evaluate_lambert(reflectance, to_light);
    sum.pdf += terms.choice.y * lambert_pdf(to_light);
}

/// Adds the sheen.
fn add_sheen(terms: &BsdfTerms, to_light: Vec3, sum: &mut BsdfEval) {
    if !has_sheen(terms.material) {
        return;
    }
    let lobe = evaluate_sheen(terms.to_viewer, to_light, terms.sheen_roughness) * terms.sheen_bound;
    sum.value += terms.sheen_share * terms.material.sheen_colour * lobe;
    sum.pdf += terms.choice.w * sheen_pdf(to_light);
}

/// Adds the light that passes through the interface.
fn add_transmission(terms: &BsdfTerms, to_light: Vec3, sum: &mut BsdfEval) {
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
    let (lobe, pdf) = match terms.is_solid {
        true => (
            evaluate_refraction(to_viewer, to_light, half_vector, width, eta),
            refraction_pdf(to_viewer, to_light, half_vector, width, eta),
        ),
        false => (
            evaluate_reflection(to_viewer, mirrored, half_vector, width),
            reflection_pdf(to_viewer, half_vector, width),
        ),
    };
    sum.value += terms.base_share * split.transmitted * lobe;
    sum.pdf += terms.choice.x * (1.0 - reflected_choice(&split)) * pdf;
}

/// Returns the sum of all lobes but the delta lobes. `to_light`: in the frame of the surface.
pub(super) fn eval_lobes(terms: &BsdfTerms, to_light: Vec3) -> BsdfEval {
    let mut sum = BsdfEval { value: Vec3::ZERO, pdf: 0.0 };
    if to_light.z > 0.0 {
        let has_microfacets = terms.has_interface || has_clearcoat(terms.material);
        let half_vector = if has_microfacets { (terms.to_viewer + to_light).normalize() } else { Vec3::Z };
        add_reflection(terms, to_light, half_vector, &mut sum);
        add_lambert(terms, to_light, &mut sum);
        add_clearcoat(terms, to_light, half_vector, &mut sum);
        add_sheen(terms, to_light, &mut sum);
    } else if to_light.z < 0.0 {
        add_transmission(terms, to_light, &mut sum);
    }
    sum
}

/// The share of the light from a direction that the surface itself lets pass to its lobes: nothing if the direction is
/// not on the same side of the surface and of its frame. `local`: the direction in the frame.
pub(super) fn share_from(surface: &Surface, direction: Vec3, local: Vec3) -> f32 {
    let up = if is_bent(surface) { surface.interpolated } else { surface.geometric };
    if up.dot(direction) * local.z > 0.0 { bump_shadowing(surface, direction) } else { 0.0 }
}

/// Returns the sum of all lobes but the delta lobes, at a surface.
pub fn eval_bsdf(terms: &BsdfTerms, surface: &Surface, to_light: Vec3) -> BsdfEval {
    let local = to_local(&terms.frame, to_light);
    let share = share_from(surface, to_light, local);
    if terms.choice == Vec4::ZERO || !(share > 0.0) {
        return BsdfEval { value: Vec3::ZERO, pdf: 0.0 };
    }
    let found = eval_lobes(terms, local);
    BsdfEval { value: found.value * share, ..found }
}
