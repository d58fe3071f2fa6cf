//! Worlds of a scene whose meshes are deformed and whose instances, lights and camera have moved. They share the
//! textures with the world before, and the structures of meshes that keep their shapes.

use super::{
    FlatScene, Instances, Mismatch, World,
    check::check,
    corners::corner_surfaces,
    flat::{Parts, area_lights, flat_lights},
    instances::Kept,
};
use crate::{
    accel::Accel,
    scene::{Scene, Transform},
};

impl World {
    /// Returns the world of a scene that differs from this one's only in its camera and lights, the transforms of its
    /// instances, and the vertices, normals and tangents of some meshes. `deformed`: the indices of these meshes, in
    /// ascending order. Only their structures and the hierarchy are built. Returns `None` if this world is flattened,
    /// if an instance needs a geometry in world space, or if the scene differs in more.
    ///
    /// # Errors
    /// The scene's parts do not fit together, or a vertex is too far from the origin.
    #[doc(hidden)]
    pub fn posed(&self, scene: &Scene, deformed: &[usize]) -> Result<Option<Self>, Mismatch> {
        let Accel::TwoLevel(two) = self.accel() else { return Ok(None) };
        let Some((flat, changed)) = self.scene().posed(scene, deformed)? else { return Ok(None) };
        check(&flat)?;
        let instances = flat.instances.as_ref().expect("a world of instances");
        let two = two.deformed(&changed, (&flat.triangles, &instances.ranges), &instances.list, self.accel_options());
        let accel = Accel::TwoLevel(Box::new(two));
        Ok(Some(Self::of_parts(flat, accel, self.accel_options().clone())))
    }
}

impl World {
    /// Whether both worlds have the same geometries, but for vertices, normals and tangents: one was made of the other
    /// by [`World::posed`] or [`World::with_instances_changed`].
    pub(crate) fn is_pose_of(&self, other: &Self) -> bool {
        let own = self.accel().geometries_id();
        self.shares_geometries(other) || own.is_some() && own == other.accel().geometries_id()
    }
}

impl FlatScene {
    /// Does what [`World::posed`] does. Returns the scene, and the indices of the geometries that have changed.
    fn posed(&self, scene: &Scene, deformed: &[usize]) -> Result<Option<(Self, Vec<usize>)>, Mismatch> {
        let Some(before) = &self.instances else { return Ok(None) };
        let (instances, kept) = Instances::of_scene(scene)?;
        let is_placed = |it: &Kept| it.transform != Transform::IDENTITY;
        if instances.ranges != before.ranges || instances.n_slots != before.n_slots || kept.iter().any(is_placed) {
            return Ok(None);
        }
        let mut posed = Self {
            lights: flat_lights(scene),
            area_lights: area_lights(scene),
            camera: scene.camera,
            instances: None,
            ..self.clone()
        };
        let is_deformed = |(_, it): &(usize, &Kept)| deformed.binary_search(&it.mesh_ix).is_ok();
        let mut changed = Vec::new();
        for (geometry_ix, kept) in kept.iter().enumerate().filter(is_deformed) {
            let (mesh, range) = (&scene.meshes[kept.mesh_ix], &instances.ranges[geometry_ix]);
            let wrong = |what: String| Mismatch::Instance { instance: kept.instance_ix, what };
            mesh.check().map_err(|what| wrong(format!("its mesh {what}")))?;
            if range.of(&self.triangle_materials) != mesh.slots {
                return Ok(None);
            }
            let mut parts = Parts::default();
            parts.push(mesh, &kept.transform, kept.instance_ix)?;
            let rows = range.first_row as usize..(range.first_row + range.n_triangles) as usize;
            posed.triangles[rows.clone()].copy_from_slice(&parts.triangles);
            if !self.textures.corners.is_empty() {
                let corners = corner_surfaces(&[(mesh, &kept.transform)]);
                // A change makes a copy of all that textures need.
                if self.textures.corners[rows.clone()] != corners {
                    posed.textures.corners[rows].copy_from_slice(&corners);
                }
            }
            changed.push(geometry_ix);
        }
        posed.instances = Some(instances);
        Ok(Some((posed, changed)))
    }
}
