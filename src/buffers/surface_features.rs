//! Which features the surfaces of a scene have. Kernels over a scene are made without the code for features that it
//! lacks.

use rayon::prelude::*;

use crate::{
    gpu::Constants,
    layout::{
        FLAT_NORMAL, LOBE_CLEARCOAT, LOBE_CONDUCTOR, LOBE_INTERFACE, LOBE_METAL, LOBE_SHEEN, LOBE_TRANSMISSION,
        MATERIAL_CONDUCTOR, MATERIAL_MICROFACET, MATERIAL_UNLIT, Material, constants,
    },
    world::{FlatScene, path_materials},
};

/// The features of the surfaces of a scene.
#[derive(Clone, Copy, Debug, Default)]
pub struct SurfaceFeatures {
    /// Whether some materials are not those of MTL: of microfacets, or unlit.
    has_microfacets: bool,
    /// Whether the scene has textures, or colours or opacity at corners.
    is_textured: bool,
    /// Whether some triangles have normals at their corners.
    is_smooth: bool,
    /// Whether rays of all kinds pass through parts of triangles.
    has_alpha_masks: bool,
    /// Whether shadow rays do.
    has_shadow_alpha_test: bool,
    /// Whether rays of paths do.
    has_path_alpha_test: bool,
    /// Whether some surfaces are blended.
    has_blended: bool,
    /// Whether camera rays pass through the back faces of some materials.
    has_back_faces: bool,
    /// The lobes that materials have in the path tracer: `LOBE_INTERFACE` and its like.
    lobes: u32,
}

/// Returns the lobes that a material of the path tracer may have, whatever its textures are: they only multiply.
fn lobes_of(material: &Material) -> u32 {
    // A term that is no number counts.
    let is_there = |term: f32| !(term <= 0.0);
    let (is_metal, passes) = (is_there(material.metallic), is_there(material.transmission));
    let is_conductor = is_metal && material.flags & MATERIAL_CONDUCTOR != 0;
    [
        (LOBE_INTERFACE, is_metal || passes || material.ks.to_array().into_iter().any(is_there)),
        (LOBE_METAL, is_metal),
        (LOBE_CONDUCTOR, is_conductor),
        (LOBE_TRANSMISSION, passes),
        (LOBE_CLEARCOAT, is_there(material.clearcoat)),
        (LOBE_SHEEN, material.sheen_colour.to_array().into_iter().any(is_there)),
    ]
    .into_iter()
    .fold(0, |lobes, (lobe, is_present)| if is_present { lobes | lobe } else { lobes })
}

impl SurfaceFeatures {
    /// Returns the features of a scene.
    pub fn of(scene: &FlatScene) -> Self {
        let is_microfacet = |flags: u32| flags & (MATERIAL_MICROFACET | MATERIAL_UNLIT) != 0;
        Self {
            has_microfacets: scene.materials.iter().any(|material| is_microfacet(material.flags)),
            is_textured: scene.textures.is_in_use(),
            is_smooth: scene.triangles.par_iter().any(|t| ![t.n0, t.n1, t.n2].contains(&FLAT_NORMAL)),
            has_alpha_masks: scene.textures.has_alpha_masks(),
            has_shadow_alpha_test: scene.textures.has_shadow_alpha_test(),
            has_path_alpha_test: scene.textures.has_path_alpha_test(),
            has_blended: scene.has_blended(),
            has_back_faces: scene.has_single_sided(),
            lobes: path_materials(scene).iter().map(lobes_of).fold(0, |lobes, more| lobes | more),
        }
    }

    /// Sets the specialization constants of frames of paths, or of other kernels.
    pub fn set(&self, constants: Constants, of_paths: bool) -> Constants {
        constants
            // All materials of paths are of microfacets.
            .set(constants::MICROFACETS, self.has_microfacets || of_paths)
            .set(constants::TEXTURED, self.is_textured)
            .set(constants::SMOOTH, self.is_smooth)
            .set(constants::LOBES, self.lobes)
            .set(constants::ALPHA_MASKS, self.has_alpha_masks)
            .set(constants::BLENDED, self.has_blended)
            .set(constants::CULLS_BACK_FACES, self.has_back_faces)
            .set(
                constants::SHADOW_ALPHA_TEST,
                if of_paths { self.has_path_alpha_test } else { self.has_shadow_alpha_test },
            )
    }
}
