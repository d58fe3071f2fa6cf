//! Worlds of a scene some of whose meshes are those of the world before: only other meshes get new structures.

use std::{collections::HashMap, sync::Arc};

use super::{FlatScene, Mismatch, World, check::check};
use crate::{
    accel::{Accel, bottom_level::BottomLevel, two_level::TwoLevel},
    layout::Triangle,
    scene::Scene,
    util::progress::Progress,
};

/// A geometry that is taken from the world before.
#[derive(Clone, Copy)]
pub(super) struct Reused<'a> {
    pub triangles: &'a [Triangle],
    structure: &'a Arc<BottomLevel>,
}

impl World {
    /// Returns the world of another scene, whose meshes are stored once, with the options of this world. `same`: for
    /// each mesh of the scene, the index of the mesh that it equals in this world's scene, if there is one. Their
    /// triangles and structures are taken over. All others are built, on the current rayon pool, and the hierarchy.
    /// The scene is freed before the builds.
    ///
    /// # Errors
    /// This world is flattened, or the scene has no triangles. A mesh has another number of faces than the one that it
    /// is said to equal. Otherwise fails as [`FlatScene::with_instances`] does.
    pub fn rebuilt(&self, scene: Scene, same: &[Option<usize>], progress: &Progress) -> Result<Self, Mismatch> {
        let flattened = || Mismatch::Scene("the world is flattened, so it has no structures of meshes".to_owned());
        let geometries = self.geometries().ok_or_else(flattened)?;
        let reused = |mesh_ix: usize| geometries.get(&(*same.get(mesh_ix)?)?).copied();
        for (mesh_ix, mesh) in scene.meshes.iter().enumerate() {
            let n_before = reused(mesh_ix).map(|it| it.triangles.len());
            if n_before.is_some_and(|n| n != mesh.faces.len()) {
                return Err(Mismatch::Scene(format!("mesh {mesh_ix} does not equal the mesh before")));
            }
        }
        let (flat, reused) = FlatScene::with_reused(&scene, reused)?;
        check(&flat)?;
        let instances = flat.instances.as_ref().ok_or_else(flattened)?;
        let given: Vec<_> = reused.iter().map(|it| it.map(|it| Arc::clone(it.structure))).collect();
        drop(scene);
        let stored = (&flat.triangles[..], &instances.ranges[..]);
        let two = TwoLevel::build_missing(given, stored, &instances.list, (self.accel_options(), progress));
        let accel = Accel::TwoLevel(Box::new(two));
        Ok(Self::of_parts(flat, accel, self.accel_options().clone()))
    }

    /// Returns the geometry of each mesh that has one in its own space; none in a flattened world.
    fn geometries(&self) -> Option<HashMap<usize, Reused<'_>>> {
        let (scene, Accel::TwoLevel(two)) = (self.scene(), self.accel()) else { return None };
        let instances = scene.instances.as_ref()?;
        let of_instance = |instance_ix: usize| {
            let geometry_ix = instances.list[instance_ix].geometry_ix as usize;
            let triangles = instances.ranges[geometry_ix].of(&scene.triangles);
            let geometry = Reused { triangles, structure: &two.structures()[geometry_ix] };
            (scene.occurrences[instance_ix].mesh_ix as usize, geometry)
        };
        let is_in_own_space = |instance_ix: &usize| instances.fixed.binary_search(instance_ix).is_err();
        Some((0..instances.list.len()).filter(is_in_own_space).map(of_instance).collect())
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use glam::{DVec3, Vec3};

    use super::*;
    use crate::{
        accel::kdtree::BuildOptions,
        scene::{Instance, Material, Mesh, Transform},
    };

    fn scene(sizes: &[f32]) -> Scene {
        let mut scene = Scene::empty(Path::new("triangles"));
        let materials = vec![scene.push_material(Material::default())];
        for (ix, size) in sizes.iter().enumerate() {
            let corners = vec![Vec3::ZERO, *size * Vec3::X, *size * Vec3::Y];
            scene.meshes.push(Mesh::of_triangles(corners, vec![[0, 1, 2]]));
            let mut at = glam::DMat4::IDENTITY;
            at.w_axis = DVec3::splat(ix as f64).extend(1.0);
            let transform = Transform::of_affine(at).unwrap();
            scene.instances.push(Instance {
                mesh_ix: ix,
                transform,
                materials: materials.clone(),
                ..Default::default()
            });
        }
        scene
    }

    fn structures(world: &World) -> &[Arc<BottomLevel>] {
        let Accel::TwoLevel(two) = world.accel() else { panic!("instances") };
        two.structures()
    }

    #[test]
    fn structures_of_the_same_meshes_are_shared() {
        let options = BuildOptions::default();
        let new = |sizes: &[f32]| World::of_flat(FlatScene::with_instances(&scene(sizes)).unwrap(), &options).unwrap();
        let before = new(&[1.0, 2.0, 3.0]);
        let after = [3.0, 5.0, 1.0, 4.0];
        let same = [Some(2), None, Some(0)];
        let world = before.rebuilt(scene(&after), &same, &Progress::default()).unwrap();
        assert!(world.scene() == new(&after).scene() && world.accel() == new(&after).accel());
        let is_shared =
            |(of_before, of_after)| Arc::ptr_eq(&structures(&before)[of_before], &structures(&world)[of_after]);
        assert!([(2, 0), (0, 2)].into_iter().all(is_shared) && ![(1, 1), (1, 3)].into_iter().any(is_shared));
    }

    #[test]
    fn what_cannot_be_taken_over_is_refused() {
        let world =
            World::of_flat(FlatScene::with_instances(&scene(&[1.0])).unwrap(), &BuildOptions::default()).unwrap();
        let mut other = scene(&[1.0]);
        other.meshes[0].push_flat([0, 1, 2], 0);
        let error = world.rebuilt(other.clone(), &[Some(0)], &Progress::default()).unwrap_err();
        assert!(error.to_string().contains("mesh 0 does not equal the mesh before"), "{error}");
        let flat = World::new(&other, &BuildOptions::default()).unwrap();
        assert!(flat.rebuilt(other, &[], &Progress::default()).unwrap_err().to_string().contains("flattened"));
    }
}
