//! Meshes before they are posed, which are read once for all poses.

use std::sync::Arc;

use glam::DVec3;
use hashbrown::HashMap;

use super::deform::Skin;
use crate::scene::model::{
    Mesh,
    deformation::{Deformation, Pose},
    extent::MeshOrigin,
};

/// A mesh before it is posed.
#[derive(Clone, Debug, Default)]
pub(super) struct Rest {
    /// The mesh without positions, normals and tangents.
    pub mesh: Mesh,
    /// Its vertices, and what moves them.
    pub deformation: Deformation,
    /// Whether a skin moves some of them.
    pub is_skinned: bool,
    /// The point of the mesh's space that is the origin of the vertices.
    pub origin: DVec3,
}

impl Rest {
    /// Adds another mesh.
    pub fn append(&mut self, mut other: Self) {
        let first = self.deformation.positions.len() as u32;
        other.mesh.faces.as_flattened_mut().iter_mut().for_each(|ix| *ix += first);
        self.mesh.append(other.mesh);
        self.deformation.append(other.deformation);
        self.is_skinned |= other.is_skinned;
    }

    /// Moves vertices near the origin, if a skin moves them and they are so far from it that single precision is
    /// coarse: the joints' transforms take back most of their coordinates, but not the rounding of products with them.
    pub fn recentre(&mut self) {
        let far = MeshOrigin::Near.second(&self.deformation.positions).filter(|_| self.is_skinned);
        if let Some(origin) = far {
            self.origin = origin;
            self.deformation.positions.iter_mut().for_each(|p| *p = (p.as_dvec3() - origin).as_vec3());
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
}

/// The meshes that have been read; `None` for those that must be read for each pose.
pub(super) type ReadMeshes = HashMap<RestKey, Option<Arc<ReadMesh>>>;

/// Returns a mesh in a pose, and the point of world space that is its origin.
pub(super) fn posed(read: Arc<ReadMesh>, (weights, skin): (&[f32], Option<&Skin>)) -> (Mesh, DVec3) {
    if !read.rest.deformation.is_deformed() {
        let Rest { mut mesh, deformation, .. } = Arc::unwrap_or_clone(read).rest;
        deformation.rest(&mut mesh);
        return (mesh, DVec3::ZERO);
    }
    let Rest { mesh, deformation, is_skinned, origin: rest_origin } = &read.rest;
    let mut mesh = mesh.clone();
    let mut deform = |origin: DVec3| {
        let joints = skin.map(|skin| skin.joints(*rest_origin, origin)).unwrap_or_default();
        deformation.deform(&Pose { weights: weights.to_vec(), joints }, &mut mesh);
        MeshOrigin::Near.second(&mesh.positions).filter(|_| *is_skinned)
    };
    let origin = deform(DVec3::ZERO).unwrap_or_default();
    if origin != DVec3::ZERO {
        deform(origin);
    }
    (mesh, origin)
}
