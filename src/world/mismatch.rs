//! Parts of a world that do not fit together.

use super::FlatScene;
use crate::gpu::GpuError;

/// Why a scene's arrays, or its triangles and their structure, do not fit together.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Mismatch {
    /// The acceleration structure is one of other triangles.
    #[error("the acceleration structure was built from {accel} triangles, but {triangles} are given with it")]
    Accel {
        /// Triangles that the structure was built from.
        accel: usize,
        /// Triangles that are given.
        triangles: usize,
    },
    /// The scene does not have one entry of `triangle_materials` a triangle.
    #[error("triangle_materials has {triangle_materials} entries for {triangles} triangles")]
    TriangleMaterials {
        /// Entries.
        triangle_materials: usize,
        /// Triangles.
        triangles: usize,
    },
    /// An instance of a scene names a mesh that the scene does not have.
    #[error("instance {instance} of the scene has no mesh")]
    Mesh {
        /// Index of the instance.
        instance: usize,
    },
    /// An instance of a scene cannot be traced.
    #[error("instance {instance} of the scene: {what}")]
    Instance {
        /// Index of the instance.
        instance: usize,
        /// What is wrong with it.
        what: String,
    },
    /// A triangle's material is missing.
    #[error("triangle {triangle} has material {material}, but there are {materials} materials")]
    Material {
        /// Index of the triangle.
        triangle: usize,
        /// Index of its material.
        material: u32,
        /// Number of materials.
        materials: usize,
    },
}

impl From<Mismatch> for GpuError {
    fn from(mismatch: Mismatch) -> Self {
        Self::Mismatch(mismatch.to_string())
    }
}

/// Checks that every triangle has a material, in one pass over `triangle_materials`.
///
/// # Errors
/// The first thing that does not fit.
pub(super) fn check_materials(scene: &FlatScene) -> Result<(), Mismatch> {
    let (triangle_materials, triangles) = (scene.triangle_materials.len(), scene.triangles.len());
    if triangle_materials != triangles {
        return Err(Mismatch::TriangleMaterials { triangle_materials, triangles });
    }
    let materials = scene.materials.len();
    let is_missing = |(_, material): &(usize, &u32)| **material as usize >= materials;
    match scene.triangle_materials.iter().enumerate().find(is_missing) {
        Some((triangle, &material)) => Err(Mismatch::Material { triangle, material, materials }),
        None => Ok(()),
    }
}
