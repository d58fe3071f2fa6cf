//! The check that something lights a scene.

use std::path::Path;

use glam::Vec3;

use super::{Light, Scene};
use crate::frame::Integrator;

impl Scene {
    /// Returns whether some surfaces give off light. Only paths show it on other surfaces.
    pub fn has_shining_surfaces(&self) -> bool {
        self.materials.iter().any(|material| material.ke != Vec3::ZERO)
    }

    /// Returns whether some surfaces are brighter than white paper in full light, as lamps are.
    pub(super) fn has_bright_surfaces(&self) -> bool {
        self.materials.iter().any(|material| material.ke.max_element() > 1.0)
    }

    /// Warns if neither a light nor the ambient term illuminates the scene, and says how to add a light. `path` is
    /// the scene's file.
    pub fn warn_if_unlit(&self, path: &Path) {
        let is_lit = self.ambient != Vec3::ZERO || !self.lights.iter().all(Light::is_black);
        if is_lit || (self.defaults.integrator == Integrator::Path && self.has_shining_surfaces()) {
            return;
        }
        let emission = if self.has_shining_surfaces() {
            "; emission (Ke) shows on its own surface but lights no other one, except with --integrator path"
        } else {
            ""
        };
        tracing::warn!(
            "{}: nothing lights the scene, since it has neither a [[light]] nor `ambient` above 0: surfaces are \
             black{emission}; add `ambient = [0.3, 0.3, 0.3]` at the top, or at the end `[[light]]` with `kind = \
             \"directional\"`, `direction = [-1, -2, -1]` and `irradiance = [1, 1, 1]`",
            path.display()
        );
    }
}
