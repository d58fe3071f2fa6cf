//! A random direction from which light is scattered to the viewer. Twin of `bsdf/sample.glsl`.

use glam::{Vec2, Vec3, Vec3Swizzles, Vec4};

use super::{
    clearcoat::clearcoat_fresnel,
    evaluate::{eval_lobes, share_from},
    ggx::sample_ggx,
    lambert::sample_lambert,
    local_frame::to_world,
    reflection::reflected_by,
    sheen::sample_sheen,
    terms::{BsdfTerms, passes_straight, reflected_choice, split_at},
    transmission::refracted_by,
};
use crate::reference::{
    fresnel::{keep_side, refraction_cosine},
    surface::Surface,
};

/// A sampled direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    pub direction: Vec3,
    /// The scattered share times the cosine, divided by the pdf.
    pub weight: Vec3,
    /// Pdf of all lobes, per steradian; of a delta lobe, the probability of its choice. A pdf of 0 means that
    /// the light is absorbed.
    pub pdf: f32,
    pub is_delta: bool,
}

const BSDF_ABSORBED: BsdfSample = BsdfSample { direction: Vec3::Z, weight: Vec3::ZERO, pdf: 0.0, is_delta: false };

/// A direction that is sampled for one lobe.
#[derive(Clone, Copy, Debug)]
struct LobeSample {
    /// A unit vector in the frame of the surface.
    local: Vec3,
    /// 1: the lobe is on the viewer's side; -1: on the other side; 0: there is no lobe.
    side: f32,
    /// The share of light that a delta lobe scatters, and the probability with which it was chosen. `None` if the lobe
    /// is not a delta lobe.
    delta: Option<(Vec3, f32)>,
}

const NO_LOBE: LobeSample = LobeSample { local: Vec3::Z, side: 0.0, delta: None };

fn rough_lobe(local: Vec3, side: f32) -> LobeSample {
    LobeSample { local, side, delta: None }
}

fn delta_lobe(local: Vec3, share: Vec3, probability: f32) -> LobeSample {
    LobeSample { local, side: 1.0, delta: Some((share, probability)) }
}

/// Returns a sample of the interface. `u.z` selects between reflection and transmission.
fn sample_interface(terms: &BsdfTerms, u: Vec3) -> LobeSample {
    let is_rough = terms.width > 0.0;
    let half_vector = if is_rough { sample_ggx(terms.to_viewer, terms.width, u.xy()) } else { Vec3::Z };
    let cosine = terms.to_viewer.dot(half_vector);
    let split = split_at(terms, if passes_straight(terms) { terms.to_viewer.z } else { cosine });
    let choice = reflected_choice(&split);
    let mirrored = reflected_by(terms.to_viewer, half_vector);
    if u.z < choice {
        if is_rough {
            return rough_lobe(mirrored, 1.0);
        }
        return delta_lobe(mirrored, terms.base_share * split.reflected, terms.choice.x * choice);
    }
    let probability = terms.choice.x * (1.0 - choice);
    if passes_straight(terms) {
        return delta_lobe(-terms.to_viewer, terms.base_share * split.transmitted, probability);
    }
    if !terms.is_solid {
        return rough_lobe(mirrored.xy().extend(-mirrored.z), -1.0);
    }
    // A black sample of total reflection.
    if refraction_cosine(cosine, terms.eta) <= 0.0 {
        return NO_LOBE;
    }
    let refracted = refracted_by(terms.to_viewer, half_vector, terms.eta);
    if is_rough {
        return rough_lobe(refracted, -1.0);
    }
    delta_lobe(refracted, terms.base_share * terms.eta * terms.eta * split.transmitted, probability)
}

/// Returns a sample of the clear coat.
fn sample_clearcoat(terms: &BsdfTerms, u: Vec2) -> LobeSample {
    let width = terms.coat_roughness * terms.coat_roughness;
    let half_vector = if width > 0.0 { sample_ggx(terms.to_viewer, width, u) } else { Vec3::Z };
    let mirrored = reflected_by(terms.to_viewer, half_vector);
    if width > 0.0 {
        return rough_lobe(mirrored, 1.0);
    }
    let share = terms.material.clearcoat * clearcoat_fresnel(terms.to_viewer.z);
    delta_lobe(mirrored, Vec3::splat(share), terms.choice.z)
}

/// Returns a sample of the lobe that `u.z` selects.
fn sample_lobe(terms: &BsdfTerms, u: Vec3) -> LobeSample {
    let choice = terms.choice;
    if choice == Vec4::ZERO {
        return NO_LOBE;
    }
    if u.z < choice.x {
        return sample_interface(terms, u.xy().extend((u.z / choice.x).min(0.999_999_94)));
    }
    if u.z < choice.x + choice.y {
        return rough_lobe(sample_lambert(u.xy()), 1.0);
    }
    if u.z < choice.x + choice.y + choice.z {
        return sample_clearcoat(terms, u.xy());
    }
    if choice.w > 0.0 { rough_lobe(sample_sheen(u.xy()), 1.0) } else { NO_LOBE }
}

/// Returns the sample of a delta lobe, which no other lobe scatters light to.
fn delta_sample(terms: &BsdfTerms, surface: &Surface, local: Vec3, (share, probability): (Vec3, f32)) -> BsdfSample {
    let side = if local.z < 0.0 { -surface.geometric } else { surface.geometric };
    let direction = keep_side(to_world(&terms.frame, local), side);
    if !(probability > 0.0) {
        return BSDF_ABSORBED;
    }
    BsdfSample { direction, weight: share / probability, pdf: probability, is_delta: true }
}

/// Returns the sample of a lobe with a pdf. All lobes with a pdf scatter light to its direction.
fn rough_sample(terms: &BsdfTerms, surface: &Surface, lobe: &LobeSample) -> BsdfSample {
    let direction = to_world(&terms.frame, lobe.local);
    let is_on_side = lobe.local.z * lobe.side > 0.0;
    let share = share_from(surface, direction, lobe.local);
    if !is_on_side || !(share > 0.0) {
        return BSDF_ABSORBED;
    }
    let found = eval_lobes(terms, lobe.local);
    if !(found.pdf > 0.0) {
        return BSDF_ABSORBED;
    }
    BsdfSample { direction, weight: found.value * share / found.pdf, pdf: found.pdf, is_delta: false }
}

/// Returns a direction from which light is scattered to the viewer. `u`: random numbers in [0, 1). `u.z` selects the
/// lobe, and within the interface between reflection and transmission.
pub fn sample_bsdf(terms: &BsdfTerms, surface: &Surface, u: Vec3) -> BsdfSample {
    let lobe = sample_lobe(terms, u);
    match lobe.delta {
        Some(delta) => delta_sample(terms, surface, lobe.local, delta),
        None => rough_sample(terms, surface, &lobe),
    }
}
