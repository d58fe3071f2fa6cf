//! A stage, in which benchmarks cast rays: a scene with its acceleration structures, a camera, a light, and
//! optionally a closed room around them.

use std::time::Instant;

use glam::{BVec3, Vec3};

use crate::{
    accel::{
        Accel, AccelOptions, Search, Statistics,
        grid::GridOptions,
        kdtree::{self, BuildOptions, KdTree, TraversalLinks},
    },
    frame::RenderOptions,
    layout::{FLAT_NORMAL, Frame, KD_WORD_DEPTH, LIGHT_DIRECTIONAL, LIGHT_POINT, Light, Triangle},
    reference::inputs::KernelInputs,
    scene::{Camera, Projection},
    world::{FlatScene, Geometry, World},
};

/// Direction from the middle of the scene towards the eye in a room: to the front, the right and above. Not of unit
/// length.
const TOWARDS_EYE: Vec3 = Vec3::new(0.45, 0.35, 1.0);
const VERTICAL_FOV_DEGREES: f32 = 60.0;

/// A scene and its acceleration structures, ready for rays.
pub struct Stage {
    /// The scene and its tree.
    pub world: World,
    /// Wall-clock time of building the tree, in milliseconds.
    pub tree_build_ms: f64,
    /// Data that traversals read beside the tree's nodes, for every traversal.
    pub links: TraversalLinks,
    /// The uniform grid and the grid of two levels.
    grids: [Accel; 2],
    /// A kd-tree with the options of the scene's, which a device builds.
    device_tree: Accel,
    /// The camera's constants. `queue_capacity` is 0: there is no queue.
    pub frame: Frame,
    /// Light to which shadow rays go.
    pub light: Light,
}

impl Stage {
    /// Makes a stage of a scene without a room, seen by its own camera and lit by its first light, or from above if
    /// it has none.
    ///
    /// # Panics
    /// The scene has a triangle without a material.
    pub fn open(scene: FlatScene, size: (u32, u32), build_options: &BuildOptions) -> Self {
        let above = Light { position: Vec3::Y, kind: LIGHT_DIRECTIONAL, intensity: Vec3::ONE, ..Light::default() };
        let light = scene.lights.first().copied().unwrap_or(above);
        let begin = Instant::now();
        let world = World::of_flat(scene, build_options).expect("a material for each triangle");
        let tree_build_ms = begin.elapsed().as_secs_f64() * 1e3;
        let options = RenderOptions { width: size.0, height: size.1, ..RenderOptions::default() };
        let frame = world.frame_constants(&options);
        let grids = [GridOptions::uniform(), GridOptions::two_level()]
            .map(|options| Accel::new(&world.scene().triangles, &AccelOptions::Grid(options)));
        let tree_options = BuildOptions { max_depth: Some(KD_WORD_DEPTH), ..build_options.clone() };
        let device_tree = Accel::new(&world.scene().triangles, &AccelOptions::LazyTree(tree_options));
        Self { links: TraversalLinks::all(world.tree()), world, grids, device_tree, tree_build_ms, frame, light }
    }

    /// Makes a stage of a scene just above the floor of a closed room, seen from inside the room, with a point light
    /// under the ceiling. No ray from inside the room misses.
    pub fn in_room(mut scene: FlatScene, size: (u32, u32), build_options: &BuildOptions) -> Self {
        let room = Room::around(scene.bounds());
        scene.triangles.extend(room.walls());
        scene.triangle_materials.resize(scene.triangles.len(), 0);
        scene.camera = room.camera;
        scene.lights = vec![room.light];
        Self::open(scene, size, build_options)
    }

    /// Returns the scene.
    pub fn scene(&self) -> &FlatScene {
        self.world.scene()
    }

    /// Returns the scene's kd-tree.
    pub fn tree(&self) -> &KdTree {
        self.world.tree()
    }

    /// Returns the kd-tree's statistics.
    pub fn tree_statistics(&self) -> kdtree::Statistics {
        match self.world.statistics() {
            Statistics::KdTree(tree) => tree,
            Statistics::Grid(_) => unreachable!("a stage's world has a kd-tree"),
        }
    }

    /// Returns the triangles with the structure that a variant searches.
    pub fn geometry(&self, variant: Search) -> Geometry<'_> {
        let accel = match variant {
            Search::KdTree(_) | Search::Wide => return self.world.geometry(),
            Search::Grid => &self.grids[0],
            Search::Grid2 => &self.grids[1],
        };
        Geometry::new(&self.scene().triangles, accel).expect("a grid of these triangles")
    }

    /// Returns the triangles with a kd-tree that a device builds.
    pub fn geometry_of_device_tree(&self) -> Geometry<'_> {
        Geometry::new(&self.scene().triangles, &self.device_tree).expect("a tree of these triangles")
    }

    /// Returns the statistics of the structure that a variant searches. If no device has built the grid, the host
    /// builds it.
    pub fn statistics(&self, variant: Search) -> Statistics {
        match self.geometry(variant).accel() {
            Accel::KdTree(_) | Accel::TwoLevel(_) => self.world.statistics(),
            Accel::LazyTree(tree) => tree.statistics(&self.scene().triangles),
            Accel::Grid(grid) => grid.statistics(&self.scene().triangles),
        }
    }

    /// Returns the inputs of a variant on the CPU.
    pub fn inputs_of(&self, variant: Search) -> KernelInputs<'_> {
        KernelInputs::of_geometry(self.geometry(variant)).with_links(&self.links)
    }

    /// Returns the inputs of a traversal of the kd-tree on the CPU.
    pub fn inputs(&self) -> KernelInputs<'_> {
        KernelInputs::new(&self.world, &self.frame).with_links(&self.links)
    }
}

/// An axis-aligned room, its camera and its light.
struct Room {
    min: Vec3,
    max: Vec3,
    camera: Camera,
    light: Light,
}

impl Room {
    /// Makes a room around a mesh with the given bounds. In radii of the sphere around the mesh's bounding box, its
    /// dimensions are:
    ///
    /// | part | position |
    /// |---|---|
    /// | walls | 2 from the middle |
    /// | ceiling | 1.5 above the middle |
    /// | floor | 0.05 below the mesh |
    /// | eye | 2.1 from the middle, from where it sees the whole sphere |
    /// | light | 0.1 below the ceiling |
    fn around((min, max): (Vec3, Vec3)) -> Self {
        let centre = (min + max) / 2.0;
        // If all corners are at one point, the radius only has to be large enough to change the coordinates.
        let radius = ((max - min).length() / 2.0).max(centre.abs().max_element() * 1e-3).max(1e-6);
        let distance = 1.05 / (VERTICAL_FOV_DEGREES / 2.0).to_radians().sin();
        let floor = Vec3::new(centre.x - 2.0 * radius, min.y - 0.05 * radius, centre.z - 2.0 * radius);
        let ceiling = centre + radius * Vec3::new(2.0, 1.5, 2.0);
        Self {
            min: floor,
            max: ceiling,
            camera: Camera {
                eye: centre + TOWARDS_EYE.normalize() * distance * radius,
                target: centre,
                up: Vec3::Y,
                projection: Projection::Perspective { vertical_fov_degrees: VERTICAL_FOV_DEGREES },
            },
            light: Light {
                position: centre + radius * Vec3::new(0.0, 1.4, 0.0),
                kind: LIGHT_POINT,
                intensity: Vec3::ONE,
                ..Light::default()
            },
        }
    }

    /// Returns the room's walls, two triangles per side. Their winding does not matter, since triangles are hit from
    /// both sides.
    fn walls(&self) -> Vec<Triangle> {
        // Bits 0, 1 and 2 of a corner's number are set where its x, y and z are the greatest.
        let corner = |n: u32| Vec3::select(BVec3::new(n & 1 != 0, n & 2 != 0, n & 4 != 0), self.max, self.min);
        let triangle = |v0, v1, v2| Triangle { v0, n0: FLAT_NORMAL, v1, n1: FLAT_NORMAL, v2, n2: FLAT_NORMAL };
        let mut walls = Vec::with_capacity(12);
        for axis in 0..3 {
            let (side, u, v) = (1 << axis, 1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
            for first in [0, side] {
                let [a, b, c, d] = [first, first | u, first | u | v, first | v].map(corner);
                walls.extend([triangle(a, b, c), triangle(a, c, d)]);
            }
        }
        walls
    }
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::*;

    #[test]
    fn camera_light_and_mesh_are_inside_the_room() {
        let corners = [vec3(5.0, -1.0, 2.0), vec3(9.0, 0.0, 2.5), vec3(5.5, 3.0, 2.0)];
        let [v0, v1, v2] = corners;
        let room = Room::around((v0.min(v1).min(v2), v0.max(v1).max(v2)));
        for p in corners.iter().chain([&room.camera.eye, &room.light.position]) {
            assert!(p.cmpgt(room.min).all() && p.cmplt(room.max).all(), "{p} in {} to {}", room.min, room.max);
        }
    }

    #[test]
    fn six_walls_close_the_room() {
        let room = Room::around((Vec3::ZERO, Vec3::ONE));
        let walls = room.walls();
        let area = |t: &Triangle| (t.v1 - t.v0).cross(t.v2 - t.v0).length() / 2.0;
        let size = room.max - room.min;
        let expected = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
        assert_eq!(walls.len(), 12);
        assert!((walls.iter().map(area).sum::<f32>() / expected - 1.0).abs() < 1e-5);
    }

    #[test]
    fn a_mesh_of_one_point_gets_a_room_all_the_same() {
        let v = vec3(100.0, 0.0, 0.0);
        let room = Room::around((v, v));
        assert!(room.min.cmplt(v).all() && room.max.cmpgt(v).all() && room.camera.eye != v);
    }
}
