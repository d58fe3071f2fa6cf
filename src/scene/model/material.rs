//! Materials. Those with `microfacet` follow glTF's model ([`Microfacet`]); the others have MTL's terms, which whitted
//! shades as follows.
//!
//! The radiance that leaves a hit is `Ke + Ka * ambient` plus the sum over all visible lights of
//! `(Kd * max(0, N.L) + Ks * (R.V)^Ns) * irradiance`, without a factor 1/pi. `illum` selects further terms:
//!
//! | illum | terms |
//! |---|---|
//! | 0 | colour only: Kd, without a highlight (treated as 1) |
//! | 1 | diffuse |
//! | 2, 10 | diffuse and a highlight (10's "cast shadows onto invisible surfaces" is left out) |
//! | 3, 8 | as 2, and mirror reflection, weighted by Ks |
//! | 4, 6 | glass: reflection Ks, refraction Tf (1 - Ks), no Fresnel term |
//! | 5 | mirror reflection by Fresnel's term (Ni) |
//! | 7 | glass whose reflection and refraction are weighted by Fresnel's term |
//! | 9 | as 4, without reflection |

use glam::Vec3;

use super::{Texture, error::Checked};

/// A material. Colours are linear RGB.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// The name in its file, by which meshes refer to it.
    pub name: String,
    /// Share of the ambient light.
    pub ka: Vec3,
    /// Diffuse reflectance.
    pub kd: Vec3,
    /// Reflectance of the highlight and of the mirror.
    pub ks: Vec3,
    /// Radiance that the surface gives off.
    pub ke: Vec3,
    /// Share of light that refraction lets through.
    pub tf: Vec3,
    /// Exponent of the highlight, at least 1.
    pub ns: f32,
    /// Index of refraction, above 0.
    pub ni: f32,
    /// Opacity, 0 to 1.
    pub d: f32,
    /// Terms beside diffuse reflection.
    pub lobes: Lobes,
    /// Microfacet reflection in place of Phong's. The terms above then have the meaning that [`Microfacet`] says.
    pub microfacet: Option<Microfacet>,
    /// How opacity acts.
    pub alpha: Alpha,
    /// Whether the surface shows `kd` as it is, without any light.
    pub is_unlit: bool,
    /// Whether the camera sees both sides of the surface. If not, camera rays pass through its back faces: those whose
    /// corners turn clockwise as the camera sees them. All other rays meet both sides.
    pub is_double_sided: bool,
    /// A clear coat above the surface. The path tracer alone shows it, with microfacets.
    pub clearcoat: Clearcoat,
    /// The sheen of cloth. The path tracer alone shows it, with microfacets.
    pub sheen: Sheen,
    /// Textures of the terms.
    pub maps: Maps,
}

/// Microfacet reflection by metals and dielectrics (glTF's metallic-roughness model). `kd` is the base colour, `ks` a
/// factor on the reflectance of a dielectric, `ni` its index of refraction, and `d` and `ke` are as in MTL. `ka`,
/// `ns`, `tf` and `lobes` are ignored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Microfacet {
    /// Share of metal, 0 to 1.
    pub metallic: f32,
    /// Perceived roughness, 0 to 1. Its square is the width of the distribution of microfacets' normals.
    pub roughness: f32,
    /// Share of the light that enters a dielectric and passes through it, in place of diffuse reflection, 0 to 1.
    pub transmission: f32,
    /// Whether the surface is the boundary of a solid, in which light is refracted and absorbed. If not, it is a thin
    /// sheet, through which light passes straight.
    pub is_solid: bool,
    /// Colour that white light has after a distance of `attenuation_distance` in the solid, linear RGB.
    pub attenuation_colour: Vec3,
    /// World units, above 0. Infinity: nothing is absorbed.
    pub attenuation_distance: f32,
    /// Index of refraction of the metal. Without it, the metal's reflectance follows from the base colour. The path
    /// tracer alone uses it.
    pub conductor: Option<Conductor>,
    /// Whether light that bounces between microfacets more than once is lost. The path tracer alone shows that light.
    pub has_single_scattering: bool,
}

/// Complex index of refraction of a metal, by colour.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Conductor {
    /// Real part, above 0.
    pub eta: Vec3,
    /// Imaginary part, the extinction coefficient, at least 0.
    pub k: Vec3,
}

impl Conductor {
    /// Returns the reflectance along the normal.
    pub fn normal_reflectance(&self) -> Vec3 {
        let squared = self.k * self.k;
        let (less, more) = (self.eta - 1.0, self.eta + 1.0);
        (less * less + squared) / (more * more + squared)
    }
}

impl Default for Microfacet {
    /// A rough dielectric that nothing passes through.
    fn default() -> Self {
        Self {
            metallic: 0.0,
            roughness: 1.0,
            transmission: 0.0,
            is_solid: false,
            attenuation_colour: Vec3::ONE,
            attenuation_distance: f32::INFINITY,
            conductor: None,
            has_single_scattering: false,
        }
    }
}

/// How the opacity of a surface acts, `d` times the opacity of the maps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Alpha {
    /// It is ignored: the surface is opaque.
    Opaque,
    /// It is the share of what is behind the surface that the surface covers.
    #[default]
    Blend,
    /// Where it is below this value, there is no surface.
    Mask(f32),
}

/// A clear coat above a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Clearcoat {
    /// Share of the surface that the coat covers, 0 to 1.
    pub factor: f32,
    /// Perceived roughness of the coat, 0 to 1.
    pub roughness: f32,
}

/// The sheen of cloth, whose fibres stand upright.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sheen {
    /// Reflectance, linear RGB.
    pub colour: Vec3,
    /// Perceived roughness, 0 to 1.
    pub roughness: f32,
}

/// Textures of a material's terms. Each multiplies the term of its name, unless it says otherwise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Maps {
    /// Colour of `kd`, and of `ka`. With microfacets, the opacity of the image multiplies `d`.
    pub base_colour: Option<Texture>,
    /// One number, which multiplies `d`.
    pub opacity: Option<Texture>,
    /// Colour of `ks`.
    pub specular: Option<Texture>,
    /// One number, which multiplies `ks`.
    pub specular_factor: Option<Texture>,
    /// Colour of `ke`.
    pub emission: Option<Texture>,
    /// One number, which multiplies the roughness, or Phong's exponent `ns`.
    pub roughness: Option<Texture>,
    /// One number.
    pub metallic: Option<Texture>,
    /// One number.
    pub transmission: Option<Texture>,
    /// Share of the ambient light that reaches the surface; one number.
    pub occlusion: Option<Texture>,
    /// How much of `occlusion` acts, 0 to 1.
    pub occlusion_strength: f32,
    /// Normals in tangent space: each channel c stands for 2 c - 1. x is along u, y along decreasing v, z along the
    /// interpolated normal.
    pub normal: Option<Texture>,
    /// Factor on x and y of the normals that `normal` shows.
    pub normal_scale: f32,
}

impl Maps {
    /// Returns all textures, in the order of the fields.
    pub fn textures(&self) -> impl Iterator<Item = &Texture> {
        self.named().map(|(_, texture)| texture)
    }

    /// Returns the textures with the names of the terms that they vary.
    pub fn named(&self) -> impl Iterator<Item = (&'static str, &Texture)> {
        let all = [
            ("base colour", &self.base_colour),
            ("opacity", &self.opacity),
            ("specular colour", &self.specular),
            ("specular factor", &self.specular_factor),
            ("emission", &self.emission),
            ("roughness", &self.roughness),
            ("metallic", &self.metallic),
            ("transmission", &self.transmission),
            ("occlusion", &self.occlusion),
            ("normal", &self.normal),
        ];
        all.into_iter().filter_map(|(name, texture)| Some((name, texture.as_ref()?)))
    }

    /// Calls `change` for each texture.
    pub(crate) fn change_each(&mut self, change: impl FnMut(&mut Texture)) {
        self.places().flatten().for_each(change);
    }

    /// Removes the textures for which `is_kept` returns false.
    pub(crate) fn keep_each(&mut self, is_kept: impl Fn(&Texture) -> bool) {
        self.places().for_each(|texture| *texture = texture.take().filter(&is_kept));
    }

    fn places(&mut self) -> impl Iterator<Item = &mut Option<Texture>> {
        let Self { base_colour, opacity, specular, specular_factor, emission, roughness, metallic, .. } = self;
        let Self { transmission, occlusion, normal, .. } = self;
        let first = [base_colour, opacity, specular, specular_factor, emission, roughness, metallic];
        first.into_iter().chain([transmission, occlusion, normal])
    }
}

/// A grey diffuse surface without a name.
impl Default for Material {
    fn default() -> Self {
        let kd = Vec3::splat(0.8);
        Self {
            name: String::new(),
            ka: kd,
            kd,
            ks: Vec3::ZERO,
            ke: Vec3::ZERO,
            tf: Vec3::ONE,
            ns: 32.0,
            ni: 1.5,
            d: 1.0,
            lobes: Lobes::default(),
            microfacet: None,
            alpha: Alpha::Blend,
            is_unlit: false,
            is_double_sided: true,
            clearcoat: Clearcoat::default(),
            sheen: Sheen::default(),
            maps: Maps { normal_scale: 1.0, occlusion_strength: 1.0, ..Maps::default() },
        }
    }
}

/// Reflection and refraction terms of a surface beside diffuse reflection.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lobes {
    /// Lights make a highlight (Ks, Ns).
    pub highlight: bool,
    /// The surface is a mirror.
    pub reflection: bool,
    /// Light passes through the surface and is refracted.
    pub refraction: bool,
    /// The shares of reflection and refraction follow Fresnel's equations.
    pub fresnel: bool,
}

impl Lobes {
    /// Returns the lobes of MTL's illumination model `illum`, or `None` beyond 10.
    pub fn of_illum(illum: u32) -> Option<Self> {
        let diffuse = Self::default();
        let highlight = Self { highlight: true, ..diffuse };
        let mirror = Self { reflection: true, ..highlight };
        match illum {
            0 | 1 => Some(diffuse),
            2 | 10 => Some(highlight),
            3 | 8 => Some(mirror),
            4 | 6 => Some(Self { refraction: true, ..mirror }),
            5 => Some(Self { fresnel: true, ..mirror }),
            7 => Some(Self { refraction: true, fresnel: true, ..mirror }),
            9 => Some(Self { refraction: true, ..highlight }),
            _ => None,
        }
    }
}

/// Checks a colour, whose parts must be finite and at least 0. Returns `default` where there is none.
pub(crate) fn colour(name: &str, value: Option<[f32; 3]>, default: Vec3) -> Checked<Vec3> {
    let Some(value) = value else { return Ok(default) };
    if value.iter().all(|part| part.is_finite() && *part >= 0.0) {
        Ok(Vec3::from_array(value))
    } else {
        Err(format!("{name} = {value:?} is not a colour: three finite numbers, none below 0"))
    }
}

/// Checks that a number is between `min` and `max`, both included.
pub(crate) fn within(name: &str, value: f32, min: f32, max: f32) -> Checked<f32> {
    // A range contains no NaN.
    if (min..=max).contains(&value) { Ok(value) } else { Err(format!("{name} = {value} is outside {min} to {max}")) }
}
