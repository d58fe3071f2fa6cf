//! Whether a scene's arrays and its tree fit together. Kernels run without bounds checks, so whatever uploads a scene
//! asks here first.

use super::Scene;
use crate::{accel::kdtree::KdTree, gpu::GpuError};

/// Parts of a scene that do not fit together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Mismatch {
    #[error("the kd-tree was built from {tree} triangles, but {triangles} are given with it")]
    Tree { tree: usize, triangles: usize },
    #[error("the kd-tree has {nodes} nodes, but the one on the device has {on_device}")]
    OtherTree { nodes: usize, on_device: usize },
    #[error("triangle_materials has {triangle_materials} entries for {triangles} triangles")]
    TriangleMaterials { triangle_materials: usize, triangles: usize },
    #[error("triangle {triangle} has material {material}, but there are {materials} materials")]
    Material { triangle: usize, material: u32, materials: usize },
}

impl From<Mismatch> for GpuError {
    fn from(mismatch: Mismatch) -> Self {
        Self::Mismatch(mismatch.to_string())
    }
}

impl Scene {
    /// Checks that every triangle has a material, and that the tree is one of as many triangles. One pass over
    /// `triangle_materials`.
    ///
    /// # Errors
    /// The first thing that does not fit.
    pub fn check(&self, tree: &KdTree) -> Result<(), Mismatch> {
        tree.check_triangles(self.triangles.len())?;
        let (triangle_materials, triangles) = (self.triangle_materials.len(), self.triangles.len());
        if triangle_materials != triangles {
            return Err(Mismatch::TriangleMaterials { triangle_materials, triangles });
        }
        let materials = self.materials.len();
        let is_missing = |(_, material): &(usize, &u32)| **material as usize >= materials;
        match self.triangle_materials.iter().enumerate().find(is_missing) {
            Some((triangle, &material)) => Err(Mismatch::Material { triangle, material, materials }),
            None => Ok(()),
        }
    }
}

impl KdTree {
    /// Checks that the tree is one of so many triangles: then every index in its leaves names one of them.
    ///
    /// # Errors
    /// It was built from more or fewer.
    pub fn check_triangles(&self, triangles: usize) -> Result<(), Mismatch> {
        let tree = self.n_triangles();
        if tree == triangles { Ok(()) } else { Err(Mismatch::Tree { tree, triangles }) }
    }
}
