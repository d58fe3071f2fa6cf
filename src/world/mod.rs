//! Worlds: what is rendered. A world is a scene with the acceleration structure over its triangles, and is consistent
//! by construction.

mod alias;
mod ambient_approximation;
mod check;
mod corners;
mod emissive;
mod emitters;
mod environment_map;
mod flat;
mod frame_constants;
mod geometry;
pub mod instances;
mod light_bounds;
mod light_tree;
#[cfg(test)]
mod light_tree_tests;
mod mips;
mod mismatch;
mod moved;
mod path_materials;
mod posed;
mod rebuilt;
mod scene_hash;
#[doc(hidden)]
pub mod texture;
mod texture_arrays;
mod textured;

use std::sync::{Arc, OnceLock};

use glam::Vec3;

use self::ambient_approximation::AmbientApproximation;
#[doc(hidden)]
pub use self::posed::Poses;
#[cfg(test)]
pub(crate) use self::texture_arrays::tests::{arrays_of, scene_of};
pub use self::{
    alias::AliasEntry,
    emitters::Emitters,
    environment_map::EnvironmentMap,
    flat::{FlatScene, Occurrence, TriangleOrigin},
    geometry::Geometry,
    instances::Instances,
    mismatch::Mismatch,
    moved::InstanceUpdate,
    path_materials::path_materials,
    texture_arrays::TextureArrays,
    textured::Textures,
};
use crate::{
    accel::{
        Accel, AccelOptions, DeviceBuild, Statistics,
        kdtree::{BuildOptions, KdTree},
        two_level::TwoLevel,
        wide_bvh::WideBvh,
    },
    scene::{Scene, Up},
    util::{once::made_once, progress::Progress},
};

/// A scene and its acceleration structure.
///
/// Kernels read both without bounds checks. So a world checks every length, index and kind of the scene's arrays. It
/// builds the structure itself, or checks that the structure fits. Nothing can change either of them afterwards: what
/// moves is another world ([`World::with_instances_changed`]). A clone is a second handle to the same world.
#[derive(Clone, Debug)]
pub struct World(Arc<Parts>);

#[derive(Debug)]
struct Parts {
    scene: FlatScene,
    accel: Accel,
    accel_options: AccelOptions,
    poses: Poses,
    /// The tables from which lights are sampled. Like the next two fields, they are made when they are first needed.
    emitters: OnceLock<Arc<Emitters>>,
    /// The wide hierarchy. There is none if the structure is a grid.
    wide_bvh: OnceLock<Option<WideBvh>>,
    /// The ambient light that stands for light of which only paths know, for each axis that may point up.
    ambient_approximations: [OnceLock<AmbientApproximation>; 2],
}

impl World {
    /// Flattens a scene and builds its kd-tree on the current rayon pool.
    ///
    /// # Errors
    /// The scene's parts do not fit together: see [`Mismatch`].
    pub fn new(scene: &Scene, build_options: &BuildOptions) -> Result<Self, Mismatch> {
        Self::of_flat(FlatScene::new(scene)?, build_options)
    }

    /// Builds the kd-tree of a flattened scene on the current rayon pool.
    ///
    /// # Errors
    /// The scene's parts do not fit together, or a corner of a triangle is too far from the origin.
    pub fn of_flat(scene: FlatScene, build_options: &BuildOptions) -> Result<Self, Mismatch> {
        Self::with_accel(scene, &AccelOptions::KdTree(build_options.clone()))
    }

    /// Builds an acceleration structure over a flattened scene on the current rayon pool.
    ///
    /// # Errors
    /// Fails as [`World::of_flat`] does, or if an option is out of range.
    pub fn with_accel(scene: FlatScene, options: &AccelOptions) -> Result<Self, Mismatch> {
        Self::with_accel_observed(scene, options, &Progress::default())
    }

    /// Does what [`World::with_accel`] does, and reports the progress of a kd-tree's build.
    ///
    /// # Errors
    /// Fails as [`World::with_accel`] does.
    pub fn with_accel_observed(
        scene: FlatScene,
        options: &AccelOptions,
        progress: &Progress,
    ) -> Result<Self, Mismatch> {
        check::check(&scene)?;
        options.check().map_err(Mismatch::AccelOptions)?;
        let accel = match &scene.instances {
            Some(Instances { ranges, list, .. }) => {
                let two = TwoLevel::build(&scene.triangles, ranges, list, options, progress);
                Accel::TwoLevel(Box::new(two))
            }
            None => Accel::new_observed(&scene.triangles, options, progress),
        };
        Ok(Self::of_parts(scene, accel, options.clone()))
    }

    /// Joins a scene and a kd-tree that was built elsewhere. `build_options`: the options that the tree was built
    /// with.
    ///
    /// # Errors
    /// Fails as [`World::of_flat`] does, or if the tree was built from more or fewer triangles.
    pub fn with_tree(scene: FlatScene, tree: KdTree, build_options: &BuildOptions) -> Result<Self, Mismatch> {
        check::check(&scene)?;
        if scene.instances.is_some() {
            return Err(Mismatch::AccelOptions("instances need a tree for each geometry".to_owned()));
        }
        let (accel, accel_options) = (Accel::KdTree(tree), AccelOptions::KdTree(build_options.clone()));
        Geometry::new(&scene.triangles, &accel)?;
        Ok(Self::of_parts(scene, accel, accel_options))
    }

    /// Makes a world of parts that fit together.
    fn of_parts(scene: FlatScene, accel: Accel, accel_options: AccelOptions) -> Self {
        let (poses, emitters, wide_bvh, ambient_approximations) = Default::default();
        Self(Arc::new(Parts { scene, accel, accel_options, poses, emitters, wide_bvh, ambient_approximations }))
    }

    /// The flattened scene.
    pub fn scene(&self) -> &FlatScene {
        &self.0.scene
    }

    /// The tables from which the path tracer samples lights. They are made at the first call.
    pub fn emitters(&self) -> &Emitters {
        let made: &Arc<Emitters> =
            made_once(&self.0.emitters, || Arc::new(Emitters::new(&self.0.scene, self.exact_bounds())));
        made
    }

    /// The wide hierarchy, made from the kd-tree, through which the CPU traces single rays. There is none for a grid.
    /// It is made at the first call, on the current rayon pool.
    pub fn wide_bvh(&self) -> Option<&WideBvh> {
        let triangles = &self.0.scene.triangles;
        let make = || Some(WideBvh::new(self.0.accel.as_kdtree(triangles)?, triangles));
        made_once(&self.0.wide_bvh, make).as_ref()
    }

    /// The ambient light that stands for light of which only paths know. It is made at the first call.
    fn ambient_approximation(&self, up: Up) -> AmbientApproximation {
        *made_once(&self.0.ambient_approximations[usize::from(up == Up::Z)], || {
            AmbientApproximation::new(&self.0.scene, || self.exact_bounds(), up)
        })
    }

    /// The acceleration structure over the scene's triangles.
    pub fn accel(&self) -> &Accel {
        &self.0.accel
    }

    /// The kd-tree over the scene's triangles, which the host builds unless it has done so already.
    ///
    /// # Panics
    /// The acceleration structure is a grid.
    pub fn tree(&self) -> &KdTree {
        self.0.accel.as_kdtree(&self.0.scene.triangles).expect("the world has a kd-tree")
    }

    /// The least and the greatest corner of a box that holds all triangles, world units.
    pub fn bounds(&self) -> [Vec3; 2] {
        self.0.accel.bounds()
    }

    /// The options that the acceleration structure was built with.
    pub fn accel_options(&self) -> &AccelOptions {
        &self.0.accel_options
    }

    /// Computes the statistics of the acceleration structure. If devices build the structure, and none has done so,
    /// the host builds it first.
    pub fn statistics(&self) -> Statistics {
        let Parts { scene, accel, accel_options, .. } = &*self.0;
        match (accel, accel_options) {
            (Accel::KdTree(tree), AccelOptions::KdTree(options)) => {
                Statistics::KdTree(tree.statistics(scene.triangles.len(), options))
            }
            (Accel::TwoLevel(two), options) => two.statistics(options, &scene.triangles),
            (Accel::LazyTree(tree), _) => tree.statistics(&scene.triangles),
            (Accel::Grid(grid), _) => grid.statistics(&scene.triangles),
            (Accel::KdTree(_), AccelOptions::LazyTree(_) | AccelOptions::Grid(_)) => {
                unreachable!("a world's structure is of its options' kind")
            }
        }
    }

    /// The report of the first device that has built the world's structure, if there is one; of instances, the sum over
    /// the structures that it has built for this world. Those that it had before do not count.
    pub fn device_build(&self) -> Option<&DeviceBuild> {
        self.0.accel.device_build()
    }

    /// The triangles and their acceleration structure, which are all that a cast of rays needs.
    pub fn geometry(&self) -> Geometry<'_> {
        Geometry::of_world(self)
    }
}
