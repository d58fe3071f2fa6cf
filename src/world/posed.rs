//! Worlds of a scene whose meshes are deformed and whose instances, lights and camera have moved. They share with the
//! world before the textures, and the triangles and structures of meshes that keep their shapes. The triangles of a
//! mesh in a pose are made on the host only where something asks for them: devices make their own.

use std::{
    collections::{BTreeMap, HashMap},
    sync::{Arc, OnceLock},
};

use glam::Vec3;
use rayon::prelude::*;

use super::{
    FlatScene, Instances, Mismatch, World,
    ambient_approximation::is_lit_within,
    corners::corner_surfaces,
    flat::{Parts, area_lights, bounds_of, flat_lights},
    moved::place,
};
use crate::{
    accel::{
        Accel,
        bottom_level::BottomLevel,
        two_level::{StoredRange, TwoLevel},
    },
    layout::{CornerSurface, Instance, Triangle},
    scene::{
        Scene, Transform,
        deformation::{ChangedMeshes, PosedMesh, Vertex, triangle_of},
        mesh::{self, MAX_COORDINATE},
    },
    util::{Shared, progress::Progress},
};

/// The geometries of a world that are meshes in poses, by their indices, and where the triangles of the others are.
#[doc(hidden)]
#[derive(Clone, Debug, Default)]
pub struct Poses {
    of_geometries: BTreeMap<usize, Arc<PosedMesh>>,
    base: Base,
}

/// Stored triangles, and what textures need at their corners. Those of posed meshes are of other moments.
#[derive(Clone, Debug, Default)]
struct Base {
    triangles: Shared<Vec<Triangle>>,
    corners: Shared<Vec<[CornerSurface; 3]>>,
}

/// A mesh that differs from that of the world before.
struct Changed<'a> {
    mesh_ix: usize,
    geometry_ix: usize,
    /// None if the scene's mesh has the new arrays.
    pose: Option<&'a Arc<PosedMesh>>,
}

impl Poses {
    /// Returns the pose of a geometry, if it is a mesh in a pose.
    pub fn get(&self, geometry_ix: usize) -> Option<&Arc<PosedMesh>> {
        self.of_geometries.get(&geometry_ix)
    }
}

impl World {
    /// Returns the world of a scene that differs from this one's only in its camera and lights, the transforms of its
    /// instances, and the vertices, normals and tangents of some meshes. `deformed`: these meshes. Only their
    /// structures and the hierarchy are built. Returns `None` if this world is flattened, if an instance needs a
    /// geometry in world space, if a vertex is too far from the origin, or if the scene differs in more.
    ///
    /// # Errors
    /// A mesh's own parts do not fit together.
    #[doc(hidden)]
    pub fn posed(&self, scene: &Scene, deformed: &ChangedMeshes) -> Result<Option<Self>, Mismatch> {
        let (Some(before), Accel::TwoLevel(two)) = (&self.scene().instances, self.accel()) else { return Ok(None) };
        let Some(geometry_of) = self.geometries_of(scene) else { return Ok(None) };
        scene.camera.check().map_err(|what| Mismatch::Scene(format!("camera: {what}")))?;
        let changed = deformed.iter().filter_map(|(&mesh_ix, pose)| {
            let geometry_ix = *geometry_of.get(&mesh_ix)?;
            Some(Changed { mesh_ix, geometry_ix, pose: pose.as_ref() })
        });
        let changed: Vec<Changed> = changed.collect();
        let Some((mut flat, poses)) = self.with_triangles(scene, (&changed, &before.ranges))? else { return Ok(None) };
        let options = self.accel_options();
        let structure = |&Changed { geometry_ix, pose, .. }: &Changed| {
            let build = |triangles: &[Triangle]| BottomLevel::build(triangles, options, &Progress::default());
            let structure = match pose {
                Some(pose) => BottomLevel::of_corners(pose.faces().len(), |ix| pose.corners(ix), options)
                    .unwrap_or_else(|| build(&pose.triangles())),
                None => build(before.ranges[geometry_ix].of(&flat.triangles)),
            };
            (geometry_ix, structure)
        };
        let structures: Vec<(usize, BottomLevel)> = changed.par_iter().map(structure).collect();
        let Some(instances) = placed((before, two), scene, &structures) else { return Ok(None) };
        let accel = Accel::TwoLevel(Box::new(two.deformed(structures, &instances.list)));
        flat.instances = Some(instances);
        Ok(Some(self.with_pose(flat, accel, poses)))
    }

    /// Returns this world's scene with the camera, the lights and the changed meshes of another one, and the poses;
    /// none if a mesh has other faces or is too far from the origin.
    fn with_triangles(
        &self,
        scene: &Scene,
        (changed, ranges): (&[Changed], &[StoredRange]),
    ) -> Result<Option<(FlatScene, Poses)>, Mismatch> {
        let mut flat = FlatScene {
            lights: flat_lights(scene),
            area_lights: area_lights(scene),
            camera: scene.camera,
            ..self.scene().clone()
        };
        let mut poses = self.0.poses.clone();
        let (posed, replaced): (Vec<&Changed>, Vec<&Changed>) = changed.iter().partition(|it| it.pose.is_some());
        for it in &replaced {
            if !flat.replace((scene, it.mesh_ix), ranges[it.geometry_ix])? {
                return Ok(None);
            }
            poses.of_geometries.remove(&it.geometry_ix);
        }
        if poses.of_geometries.is_empty() || !replaced.is_empty() {
            poses.base = Base { triangles: flat.triangles.clone(), corners: flat.textures.corners.clone() };
        }
        for (geometry_ix, pose) in posed.iter().filter_map(|it| Some((it.geometry_ix, it.pose?))) {
            if pose.faces().len() != ranges[geometry_ix].n_triangles as usize || !is_near(pose.positions()) {
                return Ok(None);
            }
            poses.of_geometries.insert(geometry_ix, pose.clone());
        }
        if !posed.is_empty() {
            flat.pose(&poses, ranges);
        }
        Ok(Some((flat, poses)))
    }

    /// Makes the world of another pose. The ambient approximations stay if nothing shines within the scene: they do not
    /// depend on its bounds then.
    fn with_pose(&self, scene: FlatScene, accel: Accel, poses: Poses) -> Self {
        let mut parts = super::Parts {
            scene,
            accel,
            accel_options: self.accel_options().clone(),
            poses,
            emitters: OnceLock::new(),
            wide_bvh: OnceLock::new(),
            ambient_approximations: Default::default(),
        };
        if ![self.scene(), &parts.scene].into_iter().any(is_lit_within) {
            parts.ambient_approximations.clone_from(&self.0.ambient_approximations);
        }
        Self(Arc::new(parts))
    }

    /// Returns the index of the geometry of each mesh that has instances; none if the scene has other instances than
    /// this world, or if one has a geometry of its own.
    fn geometries_of(&self, scene: &Scene) -> Option<HashMap<usize, usize>> {
        let instances = self.scene().instances.as_ref()?;
        let occurrences = &self.scene().occurrences;
        let is_same = occurrences.len() == scene.instances.len()
            && occurrences.iter().zip(&scene.instances).all(|(it, now)| it.mesh_ix as usize == now.mesh_ix);
        let of_instance = |(it, now): (&Instance, &crate::scene::Instance)| (now.mesh_ix, it.geometry_ix as usize);
        let all = || instances.list.iter().zip(&scene.instances).map(of_instance).collect();
        (is_same && instances.fixed.is_empty()).then(all)
    }

    /// Whether both worlds have the same geometries, but for vertices, normals and tangents: one was made of the other
    /// by [`World::posed`] or [`World::with_instances_changed`].
    pub(crate) fn is_pose_of(&self, other: &Self) -> bool {
        let own = self.accel().geometries_id();
        self.shares_geometries(other) || own.is_some() && own == other.accel().geometries_id()
    }

    /// The geometries that are meshes in poses.
    #[doc(hidden)]
    pub fn poses(&self) -> &Poses {
        &self.0.poses
    }

    /// Returns what [`FlatScene::bounds`] does, without making the triangles of posed meshes.
    pub(super) fn exact_bounds(&self) -> (Vec3, Vec3) {
        let (scene, poses) = (self.scene(), self.poses());
        let Some(instances) = scene.instances.as_ref().filter(|_| !poses.of_geometries.is_empty()) else {
            return scene.bounds();
        };
        let of_geometry = |(ix, range): (usize, &StoredRange)| match poses.get(ix) {
            Some(posed) => {
                let corners = posed.faces().as_flattened().par_iter();
                mesh::bounds_of(corners.map(|ix| posed.positions()[*ix as usize]))
            }
            None => bounds_of(range.of(&poses.base.triangles)),
        };
        let boxes: Vec<_> = instances.ranges.par_iter().enumerate().map(of_geometry).collect();
        instances.bounds(&boxes)
    }
}

/// Returns the instances of a world in the places of a scene, whose geometries may have new structures; none if one
/// cannot be placed.
fn placed(
    (before, two): (&Instances, &TwoLevel),
    scene: &Scene,
    structures: &[(usize, BottomLevel)],
) -> Option<Instances> {
    let mut bounds: Vec<[Vec3; 2]> = two.structures().iter().map(|it| it.bounds()).collect();
    structures.iter().for_each(|(ix, structure)| bounds[*ix] = structure.bounds());
    let mut instances = before.clone();
    let put = |(instance, now): (&mut Instance, &crate::scene::Instance)| {
        let bounds = bounds[instance.geometry_ix as usize];
        place(instance, Instance::of_transform(&now.transform), bounds).ok()
    };
    instances.list.par_iter_mut().zip(&scene.instances).try_for_each(put)?;
    Some(instances)
}

/// Whether all positions may be those of a geometry.
fn is_near(positions: &[Vec3]) -> bool {
    positions.par_iter().all(|p| p.is_finite() && p.abs().max_element() <= MAX_COORDINATE)
}

impl FlatScene {
    /// Replaces the triangles of a geometry, and what belongs to their corners, by those of a mesh of a scene. Returns
    /// whether its faces are those of the geometry.
    fn replace(&mut self, (scene, mesh_ix): (&Scene, usize), range: StoredRange) -> Result<bool, Mismatch> {
        let mesh = &scene.meshes[mesh_ix];
        let instance = scene.instances.iter().position(|it| it.mesh_ix == mesh_ix).unwrap_or_default();
        mesh.check().map_err(|what| Mismatch::Instance { instance, what: format!("its mesh {what}") })?;
        if range.of(&self.triangle_materials) != mesh.slots || !is_near(&mesh.positions) {
            return Ok(false);
        }
        let mut parts = Parts::default();
        parts.push(mesh, &Transform::IDENTITY, instance)?;
        self.triangles[range.rows()].copy_from_slice(&parts.triangles);
        if !self.textures.corners.is_empty() {
            let corners = corner_surfaces(&[(mesh, &Transform::IDENTITY)]);
            if range.of(&self.textures.corners) != corners {
                self.textures.corners[range.rows()].copy_from_slice(&corners);
            }
        }
        Ok(true)
    }

    /// Gives posed meshes their triangles, and the tangents of their corners, which are made when they are needed.
    fn pose(&mut self, poses: &Poses, ranges: &[StoredRange]) {
        let posed: Vec<(StoredRange, Arc<PosedMesh>)> =
            poses.of_geometries.iter().map(|(ix, posed)| (ranges[*ix], posed.clone())).collect();
        let Base { triangles, corners } = poses.base.clone();
        let has_tangents = |(_, posed): &(_, Arc<PosedMesh>)| !posed.deformation().tangents.is_empty();
        if !corners.is_empty() && posed.iter().any(has_tangents) {
            let with_tangents: Vec<_> = posed.iter().filter(|it| has_tangents(it)).cloned().collect();
            let write = |row: &mut [CornerSurface; 3], face: &[u32; 3], vertices: &[Vertex]| {
                let tangents = triangle_of(face, vertices).1;
                row.iter_mut().zip(tangents).for_each(|(corner, tangent)| corner.tangent = tangent);
            };
            self.textures.corners = Shared::lazy(move || with_posed(&corners, &with_tangents, write));
        }
        let write = |row: &mut Triangle, face: &[u32; 3], vertices: &[Vertex]| *row = triangle_of(face, vertices).0;
        self.triangles = Shared::lazy(move || with_posed(&triangles, &posed, write));
    }
}

/// Returns an array of stored triangles, in which the rows of posed meshes are written. `write`: writes that of a face.
fn with_posed<T: Copy + Send>(
    base: &[T],
    posed: &[(StoredRange, Arc<PosedMesh>)],
    write: impl Fn(&mut T, &[u32; 3], &[Vertex]) + Sync,
) -> Vec<T> {
    let mut all = base.to_vec();
    for (range, posed) in posed {
        let vertices = posed.vertices();
        let rows = all[range.rows()].par_iter_mut().zip(&posed.faces()[..]);
        rows.for_each(|(row, face)| write(row, face, &vertices));
    }
    all
}
