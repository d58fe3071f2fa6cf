//! The terms of a material as a list, under the keys that they have in scene files.

use glam::Vec3;

use crate::scene::model::{Alpha, Conductor, Lobes, Material, Microfacet};

/// A term of a material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Term {
    /// The term's key in scene files.
    pub key: &'static str,
    /// The term's value.
    pub value: TermValue,
    /// Whether the value is the one of a material that does not state the term.
    pub is_default: bool,
}

/// Value of a term.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TermValue {
    /// A number.
    Number(f32),
    /// A colour, linear RGB.
    Colour(Vec3),
    /// An illumination model.
    Model(u32),
    /// True or false.
    Flag(bool),
}

impl Material {
    /// Returns the terms that the material's model has, without maps.
    pub fn terms(&self) -> Vec<Term> {
        let mut terms = match &self.microfacet {
            Some(microfacet) => self.microfacet_terms(microfacet),
            None => self.phong_terms(),
        };
        if let Alpha::Mask(cutoff) = self.alpha {
            terms.push(Term { key: "cutoff", value: TermValue::Number(cutoff), is_default: false });
        }
        terms.push(flag("unlit", self.is_unlit, false));
        terms
    }

    fn phong_terms(&self) -> Vec<Term> {
        let default = Material::default();
        let mut terms = vec![
            colour("Ka", self.ka, self.kd),
            colour("Kd", self.kd, default.kd),
            colour("Ks", self.ks, default.ks),
            colour("Ke", self.ke, default.ke),
            colour("Tf", self.tf, default.tf),
            number("Ns", self.ns, default.ns),
            number("Ni", self.ni, default.ni),
            number("d", self.d, default.d),
        ];
        if let Some(illum) = (1..=9).find(|illum| Lobes::of_illum(*illum) == Some(self.lobes)) {
            let default = if self.ks == Vec3::ZERO { 1 } else { 2 };
            terms.push(Term { key: "illum", value: TermValue::Model(illum), is_default: illum == default });
        }
        terms
    }

    fn microfacet_terms(&self, microfacet: &Microfacet) -> Vec<Term> {
        let (material, default) = (Material::default(), Microfacet::default());
        let Microfacet { metallic, roughness, transmission, is_solid, .. } = *microfacet;
        let mut terms = vec![
            colour("Kd", self.kd, material.kd),
            colour("Ks", self.ks, Vec3::ONE),
            colour("Ke", self.ke, material.ke),
            number("Ni", self.ni, material.ni),
            number("d", self.d, material.d),
            number("metallic", metallic, default.metallic),
            number("roughness", roughness, default.roughness),
            number("transmission", transmission, default.transmission),
        ];
        if transmission > 0.0 {
            terms.push(flag("thin", !is_solid, false));
        }
        if is_solid || microfacet.attenuation_distance.is_finite() {
            let Microfacet { attenuation_colour, attenuation_distance, .. } = *microfacet;
            terms.push(colour("attenuation_color", attenuation_colour, default.attenuation_colour));
            terms.push(number("attenuation_distance", attenuation_distance, default.attenuation_distance));
        }
        if let Some(Conductor { eta, k }) = microfacet.conductor {
            terms.push(colour("conductor_eta", eta, Vec3::ZERO));
            // Both keys are needed, whatever the value.
            terms.push(Term { key: "conductor_k", value: TermValue::Colour(k), is_default: false });
        }
        terms.extend(self.coat_terms());
        terms.push(flag("single_scattering", microfacet.has_single_scattering, default.has_single_scattering));
        terms
    }

    /// Returns the terms of the clear coat and the sheen that differ from their defaults.
    fn coat_terms(&self) -> impl Iterator<Item = Term> {
        let (coat, sheen) = (self.clearcoat, self.sheen);
        let terms = [
            number("clearcoat", coat.factor, 0.0),
            number("clearcoat_roughness", coat.roughness, 0.0),
            colour("sheen_color", sheen.colour, Vec3::ZERO),
            number("sheen_roughness", sheen.roughness, 0.0),
        ];
        terms.into_iter().filter(|term| !term.is_default)
    }
}

fn number(key: &'static str, value: f32, default: f32) -> Term {
    Term { key, value: TermValue::Number(value), is_default: value == default }
}

fn colour(key: &'static str, value: Vec3, default: Vec3) -> Term {
    Term { key, value: TermValue::Colour(value), is_default: value == default }
}

fn flag(key: &'static str, value: bool, default: bool) -> Term {
    Term { key, value: TermValue::Flag(value), is_default: value == default }
}
