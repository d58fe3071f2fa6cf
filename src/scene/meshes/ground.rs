//! The ground below a mesh under the user's sky. The plain of a sky is as far away as the sky itself: nothing stands on
//! it, and no shadow falls on it. So a mesh file, which has no ground to stand on, gets a disc of the same albedo. The
//! eye does not tell it from the plain.

use glam::{DQuat, DVec3, Vec3};

use super::generate::{Disc, TriangleBudget};
use crate::scene::model::{Instance, Material, Mesh, Scene, Sky, Transform, Up, error::Checked, scene::GROUND};

/// The ground before it is placed.
const DISC: Disc = Disc { radius: 1.0, segments: 64 };
/// Radius of the ground, in diagonals of the scene's bounding box.
const RADIUS: f32 = 10.0;
/// Distance of the ground below the scene, in the same unit. A flat underside must not be in the plane of the ground.
const GAP: f32 = 1e-4;

/// Where the ground is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ground {
    pub radius: f32,
    /// Rotation about x, degrees.
    pub turn: f32,
    pub centre: Vec3,
}

impl Ground {
    /// Returns the ground below a bounding box.
    pub fn below((min, max): (Vec3, Vec3), up: Up) -> Self {
        let (diagonal, axis) = ((max - min).length(), up.vector());
        let lowest = min.dot(axis) - GAP * diagonal;
        let middle = (min + max) / 2.0;
        let turn = if up == Up::Z { 90.0 } else { 0.0 };
        Self { radius: RADIUS * diagonal, turn, centre: middle + (lowest - middle.dot(axis)) * axis }
    }

    /// Returns the ground of a scene that has one.
    pub fn of(scene: &Scene) -> Option<Self> {
        let (last, others) = scene.instances.split_last()?;
        let material = scene.materials.get(*last.materials.first()? as usize)?;
        let up = scene.sky?.up;
        (material.name == GROUND).then(|| Self::below(scene.bounds_of(others), up))
    }

    fn transform(&self) -> Checked<Transform> {
        let turn = DQuat::from_rotation_x(f64::from(self.turn).to_radians());
        Transform::new(DVec3::splat(self.radius.into()), turn, self.centre.as_dvec3())
    }
}

impl Scene {
    /// Adds a ground below all instances, whose bounds are given. It reflects as much light as the plain of a sky.
    pub(crate) fn add_ground(&mut self, bounds: (Vec3, Vec3), up: Up) -> Checked<()> {
        let mesh = DISC.build(&TriangleBudget::default())?;
        let mesh = Mesh { uvs: Default::default(), ..mesh };
        let transform = Ground::below(bounds, up).transform()?;
        mesh.check_place(&transform, mesh.bounds())?;
        let albedo = Vec3::splat(Sky::GROUND_ALBEDO);
        let material = Material { name: GROUND.to_owned(), ka: albedo, kd: albedo, ..Material::default() };
        let material = self.push_material(material);
        self.instances.push(Instance {
            mesh_ix: self.meshes.len(),
            transform,
            materials: vec![material],
            ..Instance::default()
        });
        self.meshes.push(mesh);
        Ok(())
    }
}
