//! Shared code of the tests: random numbers from a seed, small meshes, and their trees without a scene.

#![allow(dead_code, unused_imports)] // each test target uses a part of it

pub mod animated;
pub mod arrays;
pub mod chain;
pub mod closest;
pub mod command;
pub mod compare;
pub mod devices;
#[cfg(target_os = "linux")]
pub mod display;
pub mod kept;
pub mod lists;
pub mod meshes;
pub mod packets;
pub mod random;
pub mod rays;
pub mod scenes;
pub mod textured;

pub use devices::{assert_silent, device, n_outliers, pretended, with_lanes, without_wide_atomics};

use glam::Vec3;
use kdray::{
    accel::{
        Accel, AccelOptions,
        grid::GridOptions,
        kdtree::{BuildOptions, KdTree, TraversalLinks},
    },
    layout::{Hit, NO_TRIANGLE, PathRay, Triangle},
    reference::{brute, inputs::KernelInputs, search_ray::SearchRay, traversal_ray::near_scene},
    world::{FlatScene, Geometry, World},
};

/// Returns the scene with its best tree.
pub fn world_of(scene: &FlatScene) -> World {
    world_by(scene, &BuildOptions::default())
}

/// Returns the scene with a tree that is built with these options.
pub fn world_by(scene: &FlatScene, build_options: &BuildOptions) -> World {
    World::of_flat(kept::if_asked_for(scene), build_options).expect("a material for each triangle")
}

/// Returns the scene with a grid of each kind.
pub fn grid_worlds(scene: &FlatScene) -> [World; 2] {
    [GridOptions::uniform(), GridOptions::two_level()].map(|options| {
        let scene = kept::if_asked_for(scene);
        World::with_accel(scene, &AccelOptions::Grid(options)).expect("a material for each triangle")
    })
}

/// A mesh, its kd-tree, and the links that traversals read beside the tree.
pub struct MeshWithTree {
    pub triangles: Vec<Triangle>,
    pub accel: Accel,
    pub links: TraversalLinks,
    /// The triangles as an instance, if instances are asked for ([`kept`]) and the triangles are not refused.
    pub instance: Option<World>,
}

impl MeshWithTree {
    pub fn new(triangles: Vec<Triangle>) -> Self {
        let tree = KdTree::build(&triangles, &BuildOptions::default());
        Self::with_tree(triangles, tree)
    }

    pub fn with_tree(triangles: Vec<Triangle>, tree: KdTree) -> Self {
        let instance = kept::is_asked_for().then(|| kept::mesh(&triangles)).flatten();
        Self { triangles, links: TraversalLinks::all(&tree), accel: Accel::KdTree(tree), instance }
    }

    pub fn tree(&self) -> &KdTree {
        self.accel.as_kdtree(&self.triangles).expect("a mesh with a kd-tree")
    }

    pub fn inputs(&self) -> KernelInputs<'_> {
        KernelInputs::of_tree(&self.triangles, self.tree()).with_links(&self.links)
    }

    /// Returns the triangles and the tree as a cast takes them.
    pub fn geometry(&self) -> Geometry<'_> {
        match &self.instance {
            Some(world) => world.geometry(),
            None => Geometry::new(&self.triangles, &self.accel).expect("a tree of these triangles"),
        }
    }

    /// Returns the closest hit beyond `t_min` among all triangles. The ray's origin is first moved near the scene, as
    /// a traversal moves it.
    pub fn by_brute_force(&self, ray: &PathRay, t_min: f32) -> Hit {
        let (near, t_start) = near_scene(&self.inputs(), &SearchRay { t_min, ..SearchRay::from(ray) });
        let hit = brute::closest_hit(&self.triangles, &near);
        Hit { t: if hit.triangle_ix == NO_TRIANGLE { ray.t_max } else { (hit.t + t_start).min(ray.t_max) }, ..hit }
    }

    /// Returns the centre of the root's cell.
    pub fn centre(&self) -> Vec3 {
        (self.tree().box_min() + self.tree().box_max()) / 2.0
    }

    /// Returns half of the root cell's diagonal.
    pub fn radius(&self) -> f32 {
        (self.tree().box_max() - self.tree().box_min()).length() / 2.0
    }
}
