//! The check that something lights a scene.

use std::path::Path;

use glam::Vec3;

use super::{Light, Scene, material::Material};
use crate::frame::Integrator;

/// Roughness of a surface that still shows shapes of what it mirrors.
const ROUGHEST_MIRROR: f32 = 0.5;

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

    /// Returns whether some surfaces are brighter than white paper in full light, as lamps are.
    pub(super) fn has_bright_surfaces(&self) -> bool {
        self.materials.iter().any(|material| material.ke.max_element() > 1.0)
    }

    /// Returns whether some surfaces mirror what is beyond the scene, or show it through them: metals and glass that
    /// are not rough.
    pub(super) fn has_mirrors(&self) -> bool {
        let mirrors = |material: &Material| {
            let Some(it) = material.microfacet else {
                let is_mirror =
                    material.lobes.reflection && !material.lobes.fresnel && material.ks.max_element() >= 0.5;
                return is_mirror || material.lobes.refraction;
            };
            let is_metal = it.metallic >= 0.5 || it.conductor.is_some();
            it.roughness <= ROUGHEST_MIRROR && (is_metal || it.transmission >= 0.5)
        };
        self.materials.iter().any(mirrors)
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
