//! The check that something lights a scene.

use std::path::Path;

use glam::Vec3;

use super::{Light, Scene};

impl Scene {
    /// Warns if neither a light nor the ambient term illuminates the scene, and says how to add a light. `path` is
    /// the scene's file.
    pub fn warn_if_unlit(&self, path: &Path) {
        let is_lit = self.ambient != Vec3::ZERO
            || self.ground.is_some_and(|ground| ground.ambient != Vec3::ZERO)
            || !self.lights.iter().all(Light::is_black);
        if is_lit {
            return;
        }
        let emission = if self.materials.iter().any(|material| material.ke != Vec3::ZERO) {
            "; emission (Ke) shows on its own surface but lights no other one"
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
