//! Meshes before they are posed, which are read once for all poses.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use hashbrown::HashMap;

use super::deform::Skin;
use crate::scene::{
    meshes::coincident,
    model::{
        Mesh,
        deformation::{Deformation, Pose, PosedMesh},
        extent::MeshOrigin,
    },
};

/// A mesh before it is posed.
#[derive(Clone, Debug, Default)]
pub(super) struct Rest {
    /// The mesh without positions, normals and tangents.
    pub mesh: Mesh,
    /// Its vertices, and what moves them.
    pub deformation: Arc<Deformation>,
    /// Whether a skin moves some of them.
    pub is_skinned: bool,
    /// Whether it has morph targets, also those that change nothing or have not been read.
    pub has_targets: bool,
    /// The point of the mesh's space that is the origin of the vertices.
    pub origin: DVec3,
}

impl Rest {
    /// Adds another mesh.
    pub fn append(&mut self, mut other: Self) {
        let first = self.deformation.positions.len() as u32;
        other.mesh.faces.as_flattened_mut().iter_mut().for_each(|ix| *ix += first);
        self.mesh.append(other.mesh);
        Arc::make_mut(&mut self.deformation).append(Arc::unwrap_or_clone(other.deformation));
        self.is_skinned |= other.is_skinned;
        self.has_targets |= other.has_targets;
    }

    /// Moves vertices near the origin, if a skin moves them and they are so far from it that single precision is
    /// coarse: the joints' transforms take back most of their coordinates, but not the rounding of products with them.
    pub fn recentre(&mut self) {
        let far = MeshOrigin::Near.second(&self.deformation.positions).filter(|_| self.is_skinned);
        if let Some(origin) = far {
            self.origin = origin;
            let positions = &mut Arc::make_mut(&mut self.deformation).positions;
            positions.iter_mut().for_each(|p| *p = (p.as_dvec3() - origin).as_vec3());
        }
    }
}

/// What makes two poses share what is read of a mesh: the mesh's index, the skin's, and whether its faces are turned.
pub(super) type RestKey = (usize, Option<usize>, bool);

/// What is read of a mesh.
#[derive(Clone, Default)]
pub(super) struct ReadMesh {
    pub rest: Rest,
    /// The material of each slot.
    pub materials: Vec<u32>,
    /// The faces, if more poses follow and only the vertices of the mesh change with them.
    pub faces: Option<Arc<[[u32; 3]]>>,
}

/// The meshes that have been read; `None` for those that must be read for each pose.
pub(super) type ReadMeshes = HashMap<RestKey, Option<Arc<ReadMesh>>>;

/// A mesh in a pose, and the point of world space that is its origin.
pub(super) enum Posed {
    Mesh(Mesh, DVec3),
    /// What its arrays are made of, and what has been read of it.
    Pose {
        posed: PosedMesh,
        read: Arc<ReadMesh>,
        origin: DVec3,
    },
}

/// Returns a mesh in a pose: its arrays, unless more poses follow.
pub(super) fn posed(read: Arc<ReadMesh>, (weights, skin): (&[f32], Option<&Skin>)) -> Posed {
    // The normals of a mesh with targets are the same whether their weights are 0 or none is read.
    if !(read.rest.deformation.is_deformed() || read.rest.has_targets) {
        let Rest { mut mesh, deformation, .. } = Arc::unwrap_or_clone(read).rest;
        Arc::unwrap_or_clone(deformation).rest(&mut mesh);
        coincident::separate(&mut mesh);
        return Posed::Mesh(mesh, DVec3::ZERO);
    }
    let Rest { mesh, deformation, is_skinned, origin: rest_origin, .. } = &read.rest;
    let pose_at = |origin: DVec3| {
        let joints = skin.map(|skin| skin.joints(*rest_origin, origin)).unwrap_or_default();
        Pose { weights: weights.to_vec(), joints }
    };
    let origin_of = |positions: &[Vec3]| MeshOrigin::Near.second(positions).filter(|_| *is_skinned);
    if let Some(faces) = &read.faces {
        let posed_at = |origin: DVec3| PosedMesh::new(deformation.clone(), faces.clone(), pose_at(origin));
        let near = posed_at(DVec3::ZERO);
        let far = origin_of(near.positions()).map(|origin| (posed_at(origin), origin));
        let (posed, origin) = far.unwrap_or((near, DVec3::ZERO));
        return Posed::Pose { posed, read, origin };
    }
    let mut mesh = mesh.clone();
    deformation.deform(&pose_at(DVec3::ZERO), &mut mesh);
    let origin = origin_of(&mesh.positions).unwrap_or_default();
    if origin != DVec3::ZERO {
        deformation.deform(&pose_at(origin), &mut mesh);
    }
    // Faces that are in one place at rest are so in all poses. Others may meet for a moment.
    if coincident::has_several(&mesh, &deformation.positions) {
        coincident::separate(&mut mesh);
    }
    Posed::Mesh(mesh, origin)
}

impl ReadMesh {
    /// Notes that more poses follow.
    pub fn with_poses(mut self) -> Self {
        let Rest { mesh, deformation, .. } = &self.rest;
        let has_same_faces = deformation.is_deformed() && !coincident::has_several(mesh, &deformation.positions);
        self.faces = has_same_faces.then(|| mesh.faces.clone().into());
        self
    }
}
