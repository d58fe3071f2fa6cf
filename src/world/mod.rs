//! What is rendered: a scene with the acceleration structure over its triangles, consistent by construction.

mod flat;
mod frame_constants;
mod geometry;
mod mismatch;

use std::sync::Arc;

use glam::Vec3;

pub use self::{flat::FlatScene, geometry::Geometry, mismatch::Mismatch};
use crate::{
    accel::{
        Accel,
        kdtree::{BuildOptions, KdTree},
    },
    scene::Scene,
};

/// A scene and its acceleration structure.
///
/// Kernels read both without bounds checks. So a world checks that every index of the scene names an element of its
/// arrays, builds the structure itself or checks that it fits, and nothing can change either of them afterwards. A clone
/// is a second handle to the same world.
#[derive(Clone, Debug)]
pub struct World(Arc<Parts>);

#[derive(Debug)]
struct Parts {
    scene: FlatScene,
    accel: Accel,
    build_options: BuildOptions,
}

impl World {
    /// Flattens a scene and builds its kd-tree on the current rayon pool.
    ///
    /// # Errors
    /// The scene does not fit together: see [`Mismatch`].
    pub fn new(scene: &Scene, build_options: &BuildOptions) -> Result<Self, Mismatch> {
        Self::of_flat(FlatScene::new(scene)?, build_options)
    }

    /// Builds the kd-tree of a flattened scene on the current rayon pool.
    ///
    /// # Errors
    /// The scene has a triangle without a material.
    pub fn of_flat(scene: FlatScene, build_options: &BuildOptions) -> Result<Self, Mismatch> {
        mismatch::check_materials(&scene)?;
        let tree = KdTree::build(&scene.triangles, build_options);
        Self::with_tree(scene, tree, build_options)
    }

    /// Joins a scene and a kd-tree that was built elsewhere, with `build_options`.
    ///
    /// # Errors
    /// The scene has a triangle without a material; the tree is one of more or fewer triangles.
    pub fn with_tree(scene: FlatScene, tree: KdTree, build_options: &BuildOptions) -> Result<Self, Mismatch> {
        mismatch::check_materials(&scene)?;
        Geometry::new(&scene.triangles, &tree)?;
        Ok(Self(Arc::new(Parts { scene, accel: Accel::KdTree(tree), build_options: build_options.clone() })))
    }

    /// The scene as it is traced.
    pub fn scene(&self) -> &FlatScene {
        &self.0.scene
    }

    /// The acceleration structure over the scene's triangles.
    pub fn accel(&self) -> &Accel {
        &self.0.accel
    }

    /// The kd-tree over the scene's triangles.
    pub fn tree(&self) -> &KdTree {
        let Accel::KdTree(tree) = &self.0.accel;
        tree
    }

    /// The least and the greatest corner of a box that holds all triangles (world units).
    pub fn bounds(&self) -> [Vec3; 2] {
        self.0.accel.bounds()
    }

    /// The options that the acceleration structure was built with.
    pub fn build_options(&self) -> &BuildOptions {
        &self.0.build_options
    }

    /// The triangles and their acceleration structure, which is all that casting rays needs.
    pub fn geometry(&self) -> Geometry<'_> {
        Geometry::of_world(self)
    }
}
