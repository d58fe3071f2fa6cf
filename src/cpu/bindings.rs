//! What the kernels only read, under the kernels' names.

use crate::{
    kdtree::KdTree,
    layout::{Frame, KdNode, Light, Material, Triangle},
    scene::Scene,
};

/// The scene, its tree and the frame's constants.
#[derive(Clone, Copy, Debug)]
pub struct Bindings<'a> {
    pub frame: &'a Frame,
    pub triangles: &'a [Triangle],
    /// One index into `materials` a triangle.
    pub triangle_materials: &'a [u32],
    pub materials: &'a [Material],
    pub lights: &'a [Light],
    pub kd_nodes: &'a [KdNode],
    /// One a pair of nodes.
    pub kd_parents: &'a [u32],
    pub leaf_triangles: &'a [u32],
}

impl<'a> Bindings<'a> {
    pub fn new(scene: &'a Scene, tree: &'a KdTree, frame: &'a Frame) -> Self {
        Self {
            triangle_materials: &scene.triangle_materials,
            materials: &scene.materials,
            lights: &scene.lights,
            ..Self::of_tree(&scene.triangles, tree, frame)
        }
    }

    /// What the traversal reads, without materials and lights.
    pub fn of_tree(triangles: &'a [Triangle], tree: &'a KdTree, frame: &'a Frame) -> Self {
        Self {
            frame,
            triangles,
            triangle_materials: &[],
            materials: &[],
            lights: &[],
            kd_nodes: &tree.nodes,
            kd_parents: &tree.parents,
            leaf_triangles: &tree.leaf_triangles,
        }
    }
}
