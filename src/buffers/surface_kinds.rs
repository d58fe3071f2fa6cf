//! Which kinds of surfaces a scene has. Kernels over a scene are made without the code for kinds that it lacks.

use rayon::prelude::*;

use crate::{
    gpu::Constants,
    layout::{FLAT_NORMAL, MATERIAL_MICROFACET, MATERIAL_UNLIT, constants},
    world::FlatScene,
};

/// The kinds of surfaces of a scene.
#[derive(Clone, Copy, Debug, Default)]
pub struct SurfaceKinds {
    /// Whether some materials are not those of MTL: of microfacets, or unlit.
    has_microfacets: bool,
    /// Whether the scene has textures, or colours or opacity at corners.
    is_textured: bool,
    /// Whether some triangles have normals at their corners.
    is_smooth: bool,
    /// Whether rays of all kinds pass through parts of triangles.
    has_cutouts: bool,
    /// Whether shadow rays do.
    has_shadow_gaps: bool,
    /// Whether rays of paths do.
    has_path_gaps: bool,
}

impl SurfaceKinds {
    /// Returns the kinds of a scene.
    pub fn of(scene: &FlatScene) -> Self {
        let is_microfacet = |flags: u32| flags & (MATERIAL_MICROFACET | MATERIAL_UNLIT) != 0;
        Self {
            has_microfacets: scene.materials.iter().any(|material| is_microfacet(material.flags)),
            is_textured: scene.textures.is_in_use(),
            is_smooth: scene.triangles.par_iter().any(|t| ![t.n0, t.n1, t.n2].contains(&FLAT_NORMAL)),
            has_cutouts: scene.textures.has_cutouts(),
            has_shadow_gaps: scene.textures.has_shadow_gaps(),
            has_path_gaps: scene.textures.has_path_gaps(),
        }
    }

    /// Sets the specialization constants of frames of paths, or of other kernels.
    pub fn set(&self, constants: Constants, of_paths: bool) -> Constants {
        constants
            // All materials of paths are of microfacets.
            .set(constants::MICROFACETS, self.has_microfacets || of_paths)
            .set(constants::TEXTURED, self.is_textured)
            .set(constants::SMOOTH, self.is_smooth)
            .set(constants::CUTOUTS, self.has_cutouts)
            .set(constants::SHADOW_GAPS, if of_paths { self.has_path_gaps } else { self.has_shadow_gaps })
    }
}
