//! What lights a scene, and what mirrors its surroundings: for warnings and guesses.

use std::path::Path;

use glam::Vec3;

use super::{Encoding, Image, Light, Material, Microfacet, Scene, Texture, texture::linear_of_srgb};
use crate::frame::Integrator;

/// Roughness of a surface that still shows shapes of what it mirrors.
const ROUGHEST_MIRROR: f32 = 0.5;
/// Share of a material's surface that has to mirror for the material to count as a mirror.
const LEAST_MIRRORED_SHARE: f32 = 0.25;
/// Number of pixels of each map that are looked at. It is odd, so that they are not all in one column of the image.
pub(crate) const N_PLACES: usize = 4095;

/// Returns the index of the pixel that a share of an image's pixels precedes.
fn pixel_ix(image: &Image, place: f32) -> usize {
    ((place * image.pixels.len() as f32) as usize).min(image.pixels.len() - 1)
}

impl Scene {
    /// Returns whether the scene has light that only paths show: surfaces that shine, lights with an area, an
    /// environment, or a sky.
    pub fn needs_path(&self) -> bool {
        self.has_shining_surfaces() || self.has_light_beyond() || self.lights.iter().any(Light::has_area)
    }

    /// Returns whether light comes from an environment or a sky.
    fn has_light_beyond(&self) -> bool {
        self.environment.is_some() || self.sky.is_some()
    }

    /// Returns whether some surfaces give off light. Only paths show it on other surfaces.
    fn has_shining_surfaces(&self) -> bool {
        self.materials.iter().any(|material| material.ke != Vec3::ZERO)
    }

    /// Returns the greatest of a colour map's red, green and blue, linear, at the pixel that [`value_of_map`] reads.
    ///
    /// [`value_of_map`]: Self::value_of_map
    pub(crate) fn colour_of_map(&self, map: &Texture, place: f32) -> f32 {
        let Some(image) = self.images.get(map.image_ix as usize) else { return 1.0 };
        let [r, g, b, _] = image.pixels.get(pixel_ix(image, place));
        let greatest = r.max(g).max(b);
        if image.encoding(map.encoding) == Encoding::Srgb { linear_of_srgb(greatest) } else { greatest }
    }

    /// Returns whether some surfaces mirror what is beyond the scene, or show it through them: metals and glass that
    /// are not rough.
    pub(crate) fn has_mirrors(&self) -> bool {
        self.materials.iter().any(|material| match material.microfacet {
            Some(terms) => self.mirrored_share(material, &terms) >= LEAST_MIRRORED_SHARE,
            None => {
                let lobes = &material.lobes;
                lobes.reflection && !lobes.fresnel && material.ks.max_element() >= 0.5 || lobes.refraction
            }
        })
    }

    /// Returns the share of a material's surface that mirrors what is around it, as far as its maps are evenly shown.
    fn mirrored_share(&self, material: &Material, terms: &Microfacet) -> f32 {
        let maps = &material.maps;
        let [metallic, roughness, transmission, specular] =
            [&maps.metallic, &maps.roughness, &maps.transmission, &maps.specular];
        let dielectric = material.ks.max_element() * ((material.ni - 1.0) / (material.ni + 1.0)).powi(2);
        let mirrors = |place: f32| {
            let at = |map: &Option<Texture>| map.as_ref().map_or(1.0, |map| self.value_of_map(map, place));
            let is_metal = terms.metallic * at(metallic) >= 0.5
                || terms.conductor.is_some()
                || dielectric.min(1.0) * specular.as_ref().map_or(1.0, |map| self.colour_of_map(map, place)) >= 0.5;
            terms.roughness * at(roughness) <= ROUGHEST_MIRROR
                && (is_metal || terms.transmission * at(transmission) >= 0.5)
        };
        let n =
            if [metallic, roughness, transmission, specular].iter().any(|map| map.is_some()) { N_PLACES } else { 1 };
        (0..n).filter(|ix| mirrors((*ix as f32 + 0.5) / n as f32)).count() as f32 / n as f32
    }

    /// Returns the value of a map at the pixel that a share of the image's pixels precedes.
    fn value_of_map(&self, map: &Texture, place: f32) -> f32 {
        let Some(image) = self.images.get(map.image_ix as usize) else { return 1.0 };
        map.channel.of(image.pixels.get(pixel_ix(image, place)))
    }

    /// Warns of light that the integrator does not show, and if nothing illuminates the scene, how to add a light.
    /// `path` is the scene's file.
    pub fn warn_of_missing_light(&self, path: &Path, integrator: Integrator) {
        let path = path.display();
        let is_whitted = integrator == Integrator::Whitted;
        let hidden: Vec<_> = [
            (self.lights.iter().any(Light::has_area), "lights with an area"),
            (self.environment.is_some() && self.sky.is_none(), "the environment's image"),
            (self.sky.is_some(), "the sky, but for its sun's light"),
        ]
        .into_iter()
        .filter_map(|(is_there, what)| (is_there && is_whitted).then_some(what))
        .collect();
        if !hidden.is_empty() {
            tracing::warn!("{path}: --integrator whitted does not show {}; path does", hidden.join(" and "));
        }
        let shows = |light: &Light| !(light.is_black() || is_whitted && light.has_area());
        let is_lit = self.ambient != Vec3::ZERO
            || self.ground.is_some_and(|ground| ground.ambient != Vec3::ZERO)
            || self.sky.is_some_and(|sky| sky.has_sun && !sky.sun().is_black())
            || self.lights.iter().any(shows);
        let shines = self.has_shining_surfaces() || self.has_light_beyond() || self.background != Vec3::ZERO;
        if is_lit || (!is_whitted && shines) {
            return;
        }
        let emission = if self.has_shining_surfaces() {
            "; emission (Ke) lights other surfaces only with --integrator path"
        } else {
            ""
        };
        tracing::warn!(
            "{path}: nothing lights the scene, since it has neither a [[light]] nor `ambient` above 0: surfaces are \
             black{emission}; add `ambient = [0.3, 0.3, 0.3]` at the top, or at the end `[[light]]` with `kind = \
             \"directional\"`, `direction = [-1, -2, -1]` and `irradiance = [1, 1, 1]`"
        );
    }
}
