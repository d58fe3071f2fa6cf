//! Errors of worlds whose parts do not fit together.

use crate::gpu::GpuError;

/// Why a scene's arrays, or its triangles and their structure, do not fit together.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Mismatch {
    /// The acceleration structure was built from more or fewer triangles.
    #[error("the acceleration structure was built from {accel} triangles, but {triangles} are given with it")]
    Accel {
        /// The number of triangles that the structure was built from.
        accel: usize,
        /// The number of triangles that are given.
        triangles: usize,
    },
    /// The scene's `triangle_materials` does not have one entry for each triangle.
    #[error("triangle_materials has {triangle_materials} entries for {triangles} triangles")]
    TriangleMaterials {
        /// The number of entries.
        triangle_materials: usize,
        /// The number of triangles.
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
    /// The material of a triangle, or with instances of an entry of their list, is missing.
    #[error("triangle {triangle} has material {material}, but there are {materials} materials")]
    Material {
        /// Index of the triangle.
        triangle: usize,
        /// Index of the triangle's material.
        material: u32,
        /// Number of materials.
        materials: usize,
    },
    /// A part of a flattened scene does not fit the others, or is out of range. The text names the array and the
    /// element.
    #[error("{0}")]
    Scene(String),
    /// The build options of an acceleration structure are out of range. The text names the option and its range.
    #[error("{0}")]
    AccelOptions(String),
    /// An image of a scene cannot be shown.
    #[error("image {image} of the scene, `{name}`: {what}")]
    Image {
        /// Index of the image.
        image: usize,
        /// The image's name.
        name: String,
        /// What is wrong with it.
        what: String,
    },
    /// A texture of a material cannot be shown.
    #[error("a texture of material {material}: {what}")]
    Texture {
        /// Index of the material.
        material: usize,
        /// What is wrong with it.
        what: String,
    },
    /// The images of a scene are too large together.
    #[error("the textures of the scene: {0}")]
    Textures(String),
}

impl From<Mismatch> for GpuError {
    fn from(mismatch: Mismatch) -> Self {
        Self::Mismatch(mismatch.to_string())
    }
}
