//! Materials with names, which the user may put in place of a scene's own (`--material`).

use std::{fmt, str::FromStr};

use glam::{Vec3, Vec4};
use hashbrown::HashSet;

use super::{Lobes, Material, Microfacet, Scene, error::Checked, scene::GROUND};
use crate::util::text::escape_controls;

/// A material of known values. Those of metals are their reflectances along the normal: Akenine-Möller et al.,
/// *Real-Time Rendering*, third and fourth edition, chapters 7 and 9. Indices of refraction are those of soda-lime
/// glass and of water, for yellow light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preset {
    /// A grey surface that scatters 60 % of the light.
    Clay,
    /// Polished chromium.
    Chrome,
    /// Polished gold.
    Gold,
    /// Polished silver.
    Silver,
    /// Copper, a little rough.
    Copper,
    /// Aluminium, a little rough.
    Aluminium,
    /// White plastic with a soft highlight.
    Plastic,
    /// Clear glass, a solid that refracts.
    Glass,
    /// Water, a solid that refracts.
    Water,
}

named_enum!(Preset {
    Clay = "clay": "grey and diffuse, Kd 0.6",
    Chrome = "chrome": "polished chromium",
    Gold = "gold": "polished gold",
    Silver = "silver": "polished silver",
    Copper = "copper": "copper, a little rough",
    Aluminium = "aluminium": "aluminium, a little rough",
    Plastic = "plastic": "white plastic, Ni 1.46",
    Glass = "glass": "clear glass, Ni 1.52; the mesh should be closed",
    Water = "water": "water, Ni 1.333; the mesh should be closed",
});

impl Preset {
    /// Returns the material under a name.
    pub fn material(self, name: &str) -> Material {
        let diffuse = |kd: Vec3| Material { name: name.to_owned(), ka: kd, kd, ..Material::default() };
        let microfacet = |kd: Vec3, microfacet: Microfacet| {
            let lobes = Lobes { highlight: true, ..Lobes::default() };
            Material { ks: Vec3::ONE, lobes, microfacet: Some(microfacet), ..diffuse(kd) }
        };
        let metal = |kd: [f32; 3], roughness: f32| {
            microfacet(kd.into(), Microfacet { metallic: 1.0, roughness, ..Microfacet::default() })
        };
        let clear = |ni: f32| {
            let solid = Microfacet { roughness: 0.0, transmission: 1.0, is_solid: true, ..Microfacet::default() };
            Material { ni, ..microfacet(Vec3::ONE, solid) }
        };
        match self {
            Self::Clay => diffuse(Vec3::splat(0.6)),
            Self::Chrome => metal([0.549, 0.556, 0.554], 0.05),
            // Red is above 1 in the source: gold reflects more of it than the linear sRGB primaries can show.
            Self::Gold => metal([1.0, 0.782, 0.344], 0.1),
            Self::Silver => metal([0.972, 0.96, 0.915], 0.05),
            Self::Copper => metal([0.955, 0.638, 0.538], 0.2),
            Self::Aluminium => metal([0.913, 0.922, 0.924], 0.25),
            Self::Plastic => {
                let rough = Microfacet { roughness: 0.3, ..Microfacet::default() };
                Material { ni: 1.46, ..microfacet(Vec3::splat(0.75), rough) }
            }
            Self::Glass => clear(1.52),
            Self::Water => clear(1.333),
        }
    }
}

/// The user's choice of a material: `PRESET` for all of a scene, or `NAME=PRESET` for those of that name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MaterialChoice {
    /// Name of the materials that are replaced; `None` stands for all.
    pub name: Option<String>,
    /// What replaces them.
    pub preset: Preset,
}

impl MaterialChoice {
    fn concerns(&self, name: &str) -> bool {
        // The ground below a mesh is none of its materials.
        name != GROUND && (self.name.as_ref().is_none_or(|own| own == name))
    }
}

impl FromStr for MaterialChoice {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, String> {
        // A name may contain `=`, a preset does not.
        let (name, preset) = word.rsplit_once('=').map_or((None, word), |(name, preset)| (Some(name), preset));
        let preset = preset.parse().map_err(|error: crate::util::UnknownWord| error.to_string())?;
        Ok(Self { name: name.map(str::to_owned), preset })
    }
}

impl fmt::Display for MaterialChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.name {
            Some(name) => write!(f, "{name}={}", self.preset),
            None => write!(f, "{}", self.preset),
        }
    }
}

/// Returns whether a choice replaces the materials of a name.
pub(crate) fn is_replaced(choices: &[MaterialChoice], name: &str) -> bool {
    choices.iter().any(|choice| choice.concerns(name))
}

/// Replaces materials of a scene. Of several choices for a material the last one counts. The colours of corners would
/// tint the new materials, so they are removed.
///
/// # Errors
/// A choice names a material that the scene does not have.
pub(crate) fn replace(scene: &mut Scene, choices: &[MaterialChoice]) -> Checked<()> {
    if choices.is_empty() {
        return Ok(());
    }
    for name in choices.iter().filter_map(|choice| choice.name.as_ref()) {
        if !scene.materials.iter().any(|material| material.name == *name) {
            return Err(format!("there is no material `{}`{}", escape_controls(name), others(scene)));
        }
    }
    let mut replaced = vec![false; scene.materials.len()];
    for (material, is_replaced) in scene.materials.iter_mut().zip(&mut replaced) {
        if let Some(choice) = choices.iter().rev().find(|choice| choice.concerns(&material.name)) {
            let is_double_sided = material.is_double_sided;
            *material = Material { is_double_sided, ..choice.preset.material(&material.name) };
            *is_replaced = true;
        }
    }
    // The colours of a face stay if one of its instances has a material of the file.
    let mut seen = HashSet::new();
    for instance in &scene.instances {
        let mesh = &mut scene.meshes[instance.mesh_ix];
        let is_first = seen.insert(instance.mesh_ix);
        if !is_first {
            continue;
        }
        let sharing = || scene.instances.iter().filter(|other| other.mesh_ix == instance.mesh_ix);
        let material_of = |materials: &[u32], slot: u32| materials[slot as usize % materials.len()] as usize;
        for (colours, slot) in mesh.colours.iter_mut().zip(&mesh.slots) {
            if sharing().all(|other| replaced[material_of(&other.materials, *slot)]) {
                *colours = [Vec4::ONE; 3];
            }
        }
        if mesh.colours.as_flattened().iter().all(|colour| *colour == Vec4::ONE) {
            mesh.colours.clear();
        }
    }
    Ok(())
}

/// Returns the names of the scene's first materials, for a message.
fn others(scene: &Scene) -> String {
    const MAX_LISTED: usize = 8;
    let names: Vec<_> =
        scene.materials.iter().map(|material| format!("`{}`", escape_controls(&material.name))).collect();
    match names.len() {
        n if n <= MAX_LISTED => format!(", but {}", names.join(", ")),
        n => {
            format!(", but {} and {} more; `kdray inspect` lists them", names[..MAX_LISTED].join(", "), n - MAX_LISTED)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::formats::material_spec::MaterialSpec;

    #[test]
    fn words_are_presets_with_or_without_a_name() {
        for word in ["clay", "a=gold", "a=b=glass", "=chrome"] {
            let choice: MaterialChoice = word.parse().unwrap();
            assert_eq!(choice.to_string(), word);
        }
        assert_eq!("a=b=glass".parse::<MaterialChoice>().unwrap().name.as_deref(), Some("a=b"));
        for word in ["", "wood", "a=", "a=wood", "clay=a"] {
            assert!(word.parse::<MaterialChoice>().unwrap_err().contains("is not one of clay, chrome"), "{word}");
        }
    }

    /// A metal reflects its colour along the normal; clear solids refract and have no diffuse light.
    #[test]
    fn presets_are_what_they_are_called() {
        for preset in Preset::ALL {
            let material = preset.material("m");
            assert_eq!((material.name.as_str(), material.maps.textures().next()), ("m", None));
            assert!(material.kd.max_element() <= 1.0 && material.kd.min_element() >= 0.0);
            let terms = material.microfacet.unwrap_or_default();
            let is_clear = matches!(preset, Preset::Glass | Preset::Water);
            assert_eq!((terms.transmission == 1.0, terms.is_solid), (is_clear, is_clear), "{preset}");
        }
        assert_eq!(Preset::Clay.material("").microfacet, None);
        // The same terms in a scene file make the same materials.
        let of_terms = |terms: &str| toml::from_str::<MaterialSpec>(terms).unwrap().material("m").unwrap();
        for (preset, terms) in [
            (Preset::Clay, "Kd = [0.6, 0.6, 0.6]"),
            (Preset::Copper, "Kd = [0.955, 0.638, 0.538]\nmetallic = 1.0\nroughness = 0.2"),
            (Preset::Plastic, "Kd = [0.75, 0.75, 0.75]\nNi = 1.46\nroughness = 0.3"),
            (Preset::Water, "Kd = [1.0, 1.0, 1.0]\nNi = 1.333\nroughness = 0.0\ntransmission = 1.0"),
        ] {
            assert_eq!(preset.material("m"), of_terms(terms), "{preset}");
        }
        assert_eq!(Material::default(), Material { name: String::new(), ..of_terms("") });
        assert_eq!(Preset::Gold.material("").kd, Vec3::new(1.0, 0.782, 0.344));
    }
}
