//! Materials: glTF's metallic-roughness model with its extensions.

use glam::Vec3;
use gltf::json::{
    self, Index, extensions::material::PbrSpecularGlossiness, material::AlphaMode, validation::Checked::Valid,
};
use hashbrown::HashMap;

use super::{
    document::{Document, item},
    glossiness::SPECULAR_SCALE,
    textures::{TextureUse, Textures},
};
use crate::scene::model::{
    Alpha, Channel, Clearcoat, Lobes, Maps, Material, MaterialChoice, Microfacet, Sheen, preset::is_replaced,
};

/// Largest index of refraction. A material of index 0, which stands for a perfect reflector, has it, too.
const MAX_IOR: f32 = 100.0;

/// The materials that primitives use, in the order in which they are met first.
pub(super) struct Materials<'a> {
    document: &'a Document,
    /// Which materials are replaced. Their textures are not read.
    replaced: &'a [MaterialChoice],
    pub materials: Vec<Material>,
    pub textures: Textures<'a>,
    /// Index into `materials` by the index in the document; `None` is the default material.
    known: HashMap<Option<usize>, u32>,
}

impl<'a> Materials<'a> {
    pub fn new(document: &'a Document, replaced: &'a [MaterialChoice]) -> Self {
        let (textures, known) = (Textures::new(document), HashMap::new());
        Self { document, replaced, materials: Vec::new(), textures, known }
    }

    /// Returns the index of a primitive's material, and reads it at the first call. `path` is the primitive's JSON
    /// path.
    pub fn index(&mut self, index: Option<Index<json::Material>>, path: &str) -> u32 {
        let key = index.map(|index| index.value());
        if let Some(ix) = self.known.get(&key) {
            return *ix;
        }
        let (json, path) = match key {
            Some(ix) => {
                let from = format_args!("{path}.material");
                let json = self.document.or_left_out(item(&self.document.root.materials, "materials", ix, &from));
                let Some(json) = json else { return self.index(None, path) };
                (json, format!("materials[{ix}]"))
            }
            None => (&json::Material::default(), "(default of glTF)".to_owned()),
        };
        let reader = Reader { document: self.document, path };
        self.materials.push(reader.material(json, (&mut self.textures, self.replaced)));
        let ix = (self.materials.len() - 1) as u32;
        self.known.insert(key, ix);
        ix
    }
}

/// Reads one material.
struct Reader<'a> {
    document: &'a Document,
    /// JSON path of the material.
    path: String,
}

impl Reader<'_> {
    fn material(&self, json: &json::Material, (textures, replaced): (&mut Textures, &[MaterialChoice])) -> Material {
        let name = json.name.clone().unwrap_or_else(|| self.path.clone());
        let glossy = json.extensions.as_ref().and_then(|it| it.pbr_specular_glossiness.as_ref());
        let maps = match is_replaced(replaced, &name) {
            true => Maps::default(),
            false => self.maps(json, glossy, textures),
        };
        let pbr = &json.pbr_metallic_roughness;
        let [r, g, b, opacity] = glossy.map_or(pbr.base_color_factor.0, |glossy| glossy.diffuse_factor.0);
        let kd = self.colour("baseColorFactor", [r, g, b]);
        let extensions = json.extensions.as_ref();
        let ior = extensions.and_then(|it| it.ior.as_ref()).map_or(1.5, |it| it.ior.0);
        let strength = extensions.and_then(|it| it.emissive_strength.as_ref());
        let strength = strength.map_or(1.0, |it| it.emissive_strength.0);
        let is_unlit = extensions.is_some_and(|it| it.unlit.is_some());
        let ke = self.colour("emissiveFactor", json.emissive_factor.0)
            * self.within("emissiveStrength", strength, 0.0, f32::MAX);
        Material {
            name,
            ka: kd,
            kd,
            ks: match glossy {
                Some(glossy) => SPECULAR_SCALE * self.colour("specularFactor", glossy.specular_factor.0),
                None => self.specular(json),
            },
            // An unlit material shows its base colour alone.
            ke: if is_unlit { Vec3::ZERO } else { ke },
            tf: Vec3::ONE,
            ns: 32.0,
            ni: if ior == 0.0 { MAX_IOR } else { self.within("ior", ior, 1.0, MAX_IOR) },
            d: self.within("baseColorFactor[3]", opacity, 0.0, 1.0),
            lobes: Lobes::default(),
            microfacet: Some(match glossy {
                Some(glossy) => self.dielectric(glossy),
                None => self.microfacet(json),
            }),
            alpha: match json.alpha_mode {
                Valid(AlphaMode::Blend) => Alpha::Blend,
                Valid(AlphaMode::Mask) => {
                    let cutoff = json.alpha_cutoff.unwrap_or_default().0;
                    Alpha::Mask(self.within("alphaCutoff", cutoff, 0.0, f32::MAX))
                }
                _ => Alpha::Opaque,
            },
            is_unlit,
            is_double_sided: json.double_sided,
            clearcoat: self.clearcoat(json),
            sheen: self.sheen(json),
            maps,
        }
    }

    fn specular(&self, json: &json::Material) -> Vec3 {
        let extensions = json.extensions.as_ref();
        let Some(specular) = extensions.and_then(|it| it.specular.as_ref()) else { return Vec3::ONE };
        let factor = self.within("specularFactor", specular.specular_factor.0, 0.0, 1.0);
        factor * self.colour("specularColorFactor", specular.specular_color_factor.0)
    }

    fn dielectric(&self, glossy: &PbrSpecularGlossiness) -> Microfacet {
        let glossiness = self.within("glossinessFactor", glossy.glossiness_factor.0, 0.0, 1.0);
        // The image of the roughness has the factor.
        let roughness = if glossy.specular_glossiness_texture.is_some() { 1.0 } else { 1.0 - glossiness };
        Microfacet { metallic: 0.0, roughness, ..Microfacet::default() }
    }

    fn microfacet(&self, json: &json::Material) -> Microfacet {
        let pbr = &json.pbr_metallic_roughness;
        let mut microfacet = Microfacet {
            metallic: self.within("metallicFactor", pbr.metallic_factor.0, 0.0, 1.0),
            roughness: self.within("roughnessFactor", pbr.roughness_factor.0, 0.0, 1.0),
            ..Microfacet::default()
        };
        let Some(extensions) = &json.extensions else { return microfacet };
        if let Some(transmission) = &extensions.transmission {
            let factor = transmission.transmission_factor.0;
            microfacet.transmission = self.within("transmissionFactor", factor, 0.0, 1.0);
        }
        if let Some(volume) = &extensions.volume {
            let distance = volume.attenuation_distance.0;
            microfacet.is_solid = self.within("thicknessFactor", volume.thickness_factor.0, 0.0, f32::MAX) > 0.0;
            microfacet.attenuation_distance =
                self.within("attenuationDistance", distance, f32::MIN_POSITIVE, f32::INFINITY);
            microfacet.attenuation_colour = self.colour("attenuationColor", volume.attenuation_color.0);
        }
        microfacet
    }

    fn clearcoat(&self, json: &json::Material) -> Clearcoat {
        let raw = self.extension(json, "KHR_materials_clearcoat");
        let Some(Raw { clearcoat_factor: factor, clearcoat_roughness_factor: roughness, .. }) = raw else {
            return Clearcoat::default();
        };
        if factor > 0.0 {
            self.document.note("layers of clearcoat, which the integrator whitted does not show", &self.path);
        }
        Clearcoat {
            factor: self.within("clearcoatFactor", factor, 0.0, 1.0),
            roughness: self.within("clearcoatRoughnessFactor", roughness, 0.0, 1.0),
        }
    }

    fn sheen(&self, json: &json::Material) -> Sheen {
        let raw = self.extension(json, "KHR_materials_sheen");
        let Some(Raw { sheen_color_factor: colour, sheen_roughness_factor: roughness, .. }) = raw else {
            return Sheen::default();
        };
        if colour != [0.0; 3] {
            self.document.note("sheen, which the integrator whitted does not show", &self.path);
        }
        Sheen {
            colour: self.colour("sheenColorFactor", colour),
            roughness: self.within("sheenRoughnessFactor", roughness, 0.0, 1.0),
        }
    }

    /// Returns an extension that the crate `gltf` does not know.
    fn extension<T: serde::de::DeserializeOwned>(&self, json: &json::Material, name: &str) -> Option<T> {
        self.document.extension(&json.extensions.as_ref()?.others, name, &self.path)
    }

    fn maps(&self, json: &json::Material, glossy: Option<&PbrSpecularGlossiness>, textures: &mut Textures) -> Maps {
        let pbr = &json.pbr_metallic_roughness;
        let mut map = |info: &Option<json::texture::Info>, name: &str, channel: Option<Channel>| {
            let path = format!("{}.{name}", self.path);
            info.as_ref().and_then(|info| textures.texture(&TextureUse::of(info), &path, channel))
        };
        let mut maps = Maps {
            base_colour: map(&pbr.base_color_texture, "baseColorTexture", None),
            roughness: map(&pbr.metallic_roughness_texture, "metallicRoughnessTexture", Some(Channel::Green)),
            metallic: map(&pbr.metallic_roughness_texture, "metallicRoughnessTexture", Some(Channel::Blue)),
            emission: map(&json.emissive_texture, "emissiveTexture", None),
            ..Maps::default()
        };
        if let Some(glossy) = glossy {
            maps.base_colour = map(&glossy.diffuse_texture, "diffuseTexture", None);
            (maps.roughness, maps.metallic) = (None, None);
            maps.specular = map(&glossy.specular_glossiness_texture, "specularGlossinessTexture", None);
            if let Some(info) = &glossy.specular_glossiness_texture {
                let (path, factor) = (format!("{}.specularGlossinessTexture", self.path), glossy.glossiness_factor.0);
                maps.roughness = textures.roughness(&TextureUse::of(info), &path, factor.clamp(0.0, 1.0));
            }
        } else if let Some(extensions) = &json.extensions {
            if let Some(specular) = &extensions.specular {
                maps.specular_factor = map(&specular.specular_texture, "specularTexture", Some(Channel::Alpha));
                maps.specular = map(&specular.specular_color_texture, "specularColorTexture", None);
            }
            if let Some(transmission) = &extensions.transmission {
                let texture = &transmission.transmission_texture;
                maps.transmission = map(texture, "transmissionTexture", Some(Channel::Red));
            }
        }
        if let Some(normal) = &json.normal_texture {
            let path = format!("{}.normalTexture", self.path);
            let others = normal.extensions.as_ref().map(|it| &it.others);
            maps.normal = textures.of_data((normal.index, normal.tex_coord), others, &path);
            maps.normal_scale = self.within("normalTexture.scale", normal.scale, f32::MIN, f32::MAX);
        }
        if let Some(occlusion) = &json.occlusion_texture {
            let path = format!("{}.occlusionTexture", self.path);
            let others = occlusion.extensions.as_ref().map(|it| &it.others);
            maps.occlusion = textures.of_data((occlusion.index, occlusion.tex_coord), others, &path);
            maps.occlusion_strength = self.within("occlusionTexture.strength", occlusion.strength.0, 0.0, 1.0);
        }
        if json
            .extensions
            .as_ref()
            .is_some_and(|it| it.volume.as_ref().is_some_and(|it| it.thickness_texture.is_some()))
        {
            self.document.note("textures of thickness, which are not needed to trace solids", &self.path);
        }
        maps
    }

    /// Returns a colour. Parts below 0 or without a value are clamped.
    fn colour(&self, name: &str, rgb: [f32; 3]) -> Vec3 {
        Vec3::from_array(rgb.map(|part| self.within(name, part, 0.0, f32::MAX)))
    }

    fn within(&self, name: &str, value: f32, min: f32, max: f32) -> f32 {
        self.document.clamped(&self.path, name, value, (min, max))
    }
}

/// The numbers of KHR_materials_clearcoat and KHR_materials_sheen. Their textures are not read.
#[derive(Default, serde::Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Raw {
    clearcoat_factor: f32,
    clearcoat_roughness_factor: f32,
    sheen_color_factor: [f32; 3],
    sheen_roughness_factor: f32,
}
