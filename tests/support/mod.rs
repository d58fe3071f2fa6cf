//! What several tests share: random numbers from a seed, small meshes, and their trees without a scene.

#![allow(dead_code)] // each test target uses its own part

pub mod compare;
pub mod meshes;
pub mod random;
pub mod rays;
pub mod scenes;

use glam::Vec3;
use kdray::{
    cpu::bindings::Bindings,
    kdtree::{BuildOptions, Extras, KdTree},
    layout::{Frame, Triangle},
};

/// Triangles and their tree, with no more of a frame than rays need.
pub struct World {
    pub triangles: Vec<Triangle>,
    pub tree: KdTree,
    pub extras: Extras,
    pub frame: Frame,
}

impl World {
    pub fn new(triangles: Vec<Triangle>) -> Self {
        let tree = KdTree::build(&triangles, &BuildOptions::default());
        let frame = Frame { cell_min: tree.cell_min, cell_max: tree.cell_max, ..Frame::default() };
        Self { triangles, extras: Extras::all(&tree), tree, frame }
    }

    pub fn bindings(&self) -> Bindings<'_> {
        Bindings {
            frame: &self.frame,
            triangles: &self.triangles,
            triangle_materials: &[],
            materials: &[],
            lights: &[],
            kd_nodes: &self.tree.nodes,
            kd_parents: &self.tree.parents,
            leaf_triangles: &self.tree.leaf_triangles,
            kd_boxes: &self.extras.boxes,
            kd_ropes: &self.extras.ropes,
        }
    }

    /// The middle of the root's cell.
    pub fn centre(&self) -> Vec3 {
        (self.tree.cell_min + self.tree.cell_max) / 2.0
    }

    /// Half of the root cell's diagonal.
    pub fn radius(&self) -> f32 {
        (self.tree.cell_max - self.tree.cell_min).length() / 2.0
    }
}
