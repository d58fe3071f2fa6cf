//! Materials as scene files and MTL files describe them, with the defaults of absent terms.

use glam::Vec3;
use serde::Deserialize;

use super::map_spec::MapSpec;
use crate::scene::model::{
    Alpha, Clearcoat, Conductor, Lobes, Maps, Material, Microfacet, Sheen,
    error::Checked,
    material::{colour, within},
};

/// A material as a file describes it. Each term may be absent.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MaterialSpec {
    /// Ambient colour; Kd where absent.
    #[serde(rename = "Ka")]
    pub ka: Option<[f32; 3]>,
    /// Diffuse colour; where absent, white beside `map_Kd`, and else 0.8, as in MTL.
    #[serde(rename = "Kd")]
    pub kd: Option<[f32; 3]>,
    /// Specular colour, of the highlight and of the mirror; where absent, white beside `map_Ks`, and else black.
    #[serde(rename = "Ks")]
    pub ks: Option<[f32; 3]>,
    /// Radiance that the surface gives off; where absent, white beside `map_Ke`, and else black.
    #[serde(rename = "Ke")]
    pub ke: Option<[f32; 3]>,
    /// Transmission colour; white where absent.
    #[serde(rename = "Tf")]
    pub tf: Option<[f32; 3]>,
    /// Exponent of the highlight; 32 where absent.
    #[serde(rename = "Ns")]
    pub ns: Option<f32>,
    /// Index of refraction; 1.5 where absent.
    #[serde(rename = "Ni")]
    pub ni: Option<f32>,
    /// Opacity, 0 to 1; 1 where absent.
    pub d: Option<f32>,
    /// Transparency, 1 - d; an error beside `d`.
    #[serde(rename = "Tr")]
    pub tr: Option<f32>,
    /// Illumination model, 0 to 10; where absent, 2 if Ks is not black and 1 otherwise.
    pub illum: Option<u8>,
    /// Share of metal, 0 to 1; where absent, 1 beside `conductor_eta`, and else 0. This key and the next twelve make a
    /// microfacet material.
    pub metallic: Option<f32>,
    /// Perceived roughness, 0 to 1; 1 where absent.
    pub roughness: Option<f32>,
    /// Share of light that passes through, 0 to 1; 0 where absent.
    pub transmission: Option<f32>,
    /// Whether light passes straight, as through a thin sheet; false where absent.
    pub thin: Option<bool>,
    /// Colour that white light has after `attenuation_distance`; white where absent.
    pub attenuation_color: Option<[f32; 3]>,
    /// World units; infinite where absent.
    pub attenuation_distance: Option<f32>,
    /// Share of the surface that a clear coat covers, 0 to 1; 0 where absent.
    pub clearcoat: Option<f32>,
    /// Perceived roughness of the clear coat, 0 to 1; 0 where absent.
    pub clearcoat_roughness: Option<f32>,
    /// Reflectance of the sheen of cloth; black where absent.
    pub sheen_color: Option<[f32; 3]>,
    /// Perceived roughness of the sheen, 0 to 1; 0 where absent.
    pub sheen_roughness: Option<f32>,
    /// Real part of a metal's index of refraction, above 0; needs `conductor_k`.
    pub conductor_eta: Option<[f32; 3]>,
    /// Imaginary part of a metal's index of refraction; needs `conductor_eta`.
    pub conductor_k: Option<[f32; 3]>,
    /// Whether light that bounces between microfacets more than once is lost; false where absent.
    pub single_scattering: Option<bool>,
    /// Whether the surface shows Kd without any light; false where absent.
    pub unlit: Option<bool>,
    /// Opacity below which there is no surface.
    pub cutoff: Option<f32>,
    /// Factor on the slope of the normals of `map_normal`; 1 where absent.
    pub normal_scale: Option<f32>,
    #[serde(rename = "map_Kd")]
    pub map_kd: Option<MapSpec>,
    #[serde(rename = "map_Ks")]
    pub map_ks: Option<MapSpec>,
    #[serde(rename = "map_Ke")]
    pub map_ke: Option<MapSpec>,
    pub map_d: Option<MapSpec>,
    #[serde(rename = "map_Ns")]
    pub map_ns: Option<MapSpec>,
    pub map_normal: Option<MapSpec>,
    pub map_roughness: Option<MapSpec>,
    pub map_metallic: Option<MapSpec>,
    pub map_occlusion: Option<MapSpec>,
}

/// The keys of a material's maps in a scene file.
pub(crate) const MAP_KEYS: [&str; 9] =
    ["map_Kd", "map_Ks", "map_Ke", "map_d", "map_Ns", "map_normal", "map_roughness", "map_metallic", "map_occlusion"];

impl MaterialSpec {
    /// Returns the maps with their keys.
    pub fn maps(&self) -> impl Iterator<Item = (&'static str, &MapSpec)> {
        let Self { map_kd, map_ks, map_ke, map_d, map_ns, map_normal, map_roughness, map_metallic, .. } = self;
        let maps =
            [map_kd, map_ks, map_ke, map_d, map_ns, map_normal, map_roughness, map_metallic, &self.map_occlusion];
        MAP_KEYS.into_iter().zip(maps).filter_map(|(key, map)| Some((key, map.as_ref()?)))
    }

    /// Returns the material with defaults in place of absent terms, and without maps. The error says which term is out
    /// of range.
    pub fn material(&self, name: &str) -> Checked<Material> {
        let microfacet = self.microfacet()?;
        // The whitted integrator shows a metal by its base colour alone.
        let metal = microfacet.and_then(|terms| terms.conductor).map(|conductor| conductor.normal_reflectance());
        let plain = metal.unwrap_or(Vec3::splat(0.8));
        let kd = colour("Kd", self.kd, self.map_kd.as_ref().map_or(plain, |_| Vec3::ONE))?;
        let ks_is_white = microfacet.is_some() || self.map_ks.is_some();
        let ks = colour("Ks", self.ks, if ks_is_white { Vec3::ONE } else { Vec3::ZERO })?;
        let illum = self.illum.map_or(if ks == Vec3::ZERO { 1 } else { 2 }, u32::from);
        // Some exporters write 0 for a surface that does not refract.
        let ni = self.ni.map(|ni| if ni == 0.0 { 1.0 } else { ni }).unwrap_or(1.5);
        if self.normal_scale.is_some() && self.map_normal.is_none() {
            return Err("has normal_scale and no map_normal".to_owned());
        }
        let cutoff = self.cutoff.map(|cutoff| within("cutoff", cutoff, 0.0, 1.0)).transpose()?;
        Ok(Material {
            name: name.to_owned(),
            ka: colour("Ka", self.ka, kd)?,
            // An exponent below 1 is raised to 1: 0 would be a constant highlight, and pow(0, 0) is undefined in
            // GLSL.
            ns: within("Ns", self.ns.unwrap_or(32.0), 0.0, 1e6)?.max(1.0),
            kd,
            d: self.opacity()?,
            ks,
            ni: within("Ni", ni, 0.001, 100.0)?,
            ke: colour("Ke", self.ke, self.map_ke.as_ref().map_or(Vec3::ZERO, |_| Vec3::ONE))?,
            lobes: Lobes::of_illum(illum).ok_or_else(|| format!("illum {illum} is not one of 0 to 10"))?,
            tf: colour("Tf", self.tf, Vec3::ONE)?,
            microfacet,
            alpha: cutoff.map_or(Alpha::Blend, Alpha::Mask),
            is_unlit: self.unlit.unwrap_or(false),
            is_double_sided: true,
            clearcoat: Clearcoat {
                factor: within("clearcoat", self.clearcoat.unwrap_or(0.0), 0.0, 1.0)?,
                roughness: within("clearcoat_roughness", self.clearcoat_roughness.unwrap_or(0.0), 0.0, 1.0)?,
            },
            sheen: Sheen {
                colour: colour("sheen_color", self.sheen_color, Vec3::ZERO)?.min(Vec3::ONE),
                roughness: within("sheen_roughness", self.sheen_roughness.unwrap_or(0.0), 0.0, 1.0)?,
            },
            maps: Maps {
                normal_scale: within("normal_scale", self.normal_scale.unwrap_or(1.0), -100.0, 100.0)?,
                occlusion_strength: 1.0,
                ..Maps::default()
            },
        })
    }

    fn opacity(&self) -> Checked<f32> {
        match (self.d, self.tr) {
            (Some(_), Some(_)) => Err("has both d and Tr: they are one term (Tr = 1 - d)".to_owned()),
            (None, Some(tr)) => Ok(1.0 - within("Tr", tr, 0.0, 1.0)?),
            (d, None) => within("d", d.unwrap_or(1.0), 0.0, 1.0),
        }
    }

    /// Returns the microfacet terms if there are any. Terms that they would make idle are an error.
    fn microfacet(&self) -> Checked<Option<Microfacet>> {
        let terms = [
            ("metallic", self.metallic.is_some()),
            ("roughness", self.roughness.is_some()),
            ("transmission", self.transmission.is_some()),
            ("thin", self.thin.is_some()),
            ("attenuation_color", self.attenuation_color.is_some()),
            ("attenuation_distance", self.attenuation_distance.is_some()),
            ("clearcoat", self.clearcoat.is_some()),
            ("clearcoat_roughness", self.clearcoat_roughness.is_some()),
            ("sheen_color", self.sheen_color.is_some()),
            ("sheen_roughness", self.sheen_roughness.is_some()),
            ("conductor_eta", self.conductor_eta.is_some()),
            ("conductor_k", self.conductor_k.is_some()),
            ("single_scattering", self.single_scattering.is_some()),
            ("map_roughness", self.map_roughness.is_some()),
            ("map_metallic", self.map_metallic.is_some()),
        ];
        let Some((term, _)) = terms.into_iter().find(|(_, is_there)| *is_there) else { return Ok(None) };
        let idle = [
            ("Ka", self.ka.is_some()),
            ("Ks", self.ks.is_some()),
            ("Tf", self.tf.is_some()),
            ("Ns", self.ns.is_some()),
            ("illum", self.illum.is_some()),
            ("map_Ns", self.map_ns.is_some()),
        ];
        if let Some((idle, _)) = idle.into_iter().find(|(_, is_there)| *is_there) {
            return Err(format!("has {idle} beside {term}: a microfacet material ignores {idle}"));
        }
        let transmission = within("transmission", self.transmission.unwrap_or(0.0), 0.0, 1.0)?;
        let distance = self.attenuation_distance.unwrap_or(f32::INFINITY);
        if !(distance > 0.0) {
            return Err(format!("attenuation_distance = {distance} is not above 0"));
        }
        let conductor = self.conductor()?;
        let is_metal = self.map_metallic.is_some() || conductor.is_some();
        let metallic = self.metallic.unwrap_or(if is_metal { 1.0 } else { 0.0 });
        Ok(Some(Microfacet {
            metallic: within("metallic", metallic, 0.0, 1.0)?,
            roughness: within("roughness", self.roughness.unwrap_or(1.0), 0.0, 1.0)?,
            transmission,
            is_solid: transmission > 0.0 && !self.thin.unwrap_or(false),
            attenuation_colour: colour("attenuation_color", self.attenuation_color, Vec3::ONE)?.min(Vec3::ONE),
            attenuation_distance: distance,
            conductor,
            has_single_scattering: self.single_scattering.unwrap_or(false),
        }))
    }

    /// Returns a metal's index of refraction. One of its parts without the other is an error.
    fn conductor(&self) -> Checked<Option<Conductor>> {
        let (eta, k) = match (self.conductor_eta, self.conductor_k) {
            (None, None) => return Ok(None),
            (Some(eta), Some(k)) => (eta, k),
            (Some(_), None) => return Err("has conductor_eta and no conductor_k".to_owned()),
            (None, Some(_)) => return Err("has conductor_k and no conductor_eta".to_owned()),
        };
        for (name, parts, least) in [("conductor_eta", eta, 0.001), ("conductor_k", k, 0.0)] {
            for part in parts {
                within(name, part, least, 100.0)?;
            }
        }
        Ok(Some(Conductor { eta: Vec3::from_array(eta), k: Vec3::from_array(k) }))
    }
}
