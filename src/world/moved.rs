//! Worlds whose instances have changed: other places, materials, or rays that meet them. Everything else is shared with
//! the world before: triangles, textures, and the structures of the geometries. Only the hierarchy is built.

use std::{
    collections::HashMap,
    sync::{Arc, OnceLock},
};

use glam::Vec3;
use rayon::prelude::*;

use super::{Instances, Mismatch, Parts, World, emissive::is_emissive, instances::flags_of};
use crate::{
    accel::{Accel, two_level::TwoLevel},
    layout::{INSTANCE_FOR_OTHERS, INSTANCE_MASK_SHIFT, INSTANCE_MIRRORED, Instance},
    scene::{
        RayKinds, Transform,
        mesh::{MAX_COORDINATE, box_corners},
    },
};

/// What changes of an instance. A part that is `None` stays as it is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct InstanceUpdate {
    /// The index of the instance in [`Scene::instances`](crate::scene::Scene::instances). It is the same in all worlds
    /// that come from this scene.
    pub instance_ix: usize,
    /// The transform from object space to world space.
    pub transform: Option<Transform>,
    /// The materials of the slots, as those of [`Instance::materials`](crate::scene::Instance::materials).
    pub materials: Option<Vec<u32>>,
    /// The rays that meet the instance. [`RayKinds::other`] also sets all bits of the mask, or none.
    pub rays: Option<RayKinds>,
    /// The mask: a cast meets the instance if the cast's mask
    /// ([`Caster::set_mask`](crate::engine::Caster::set_mask)) has a bit in common with it. At first it is 0xff, or 0
    /// if `other` rays pass through the instance. With 0, paths pass through it as well.
    pub mask: Option<u8>,
}

impl World {
    /// Returns the world with some of its instances changed. It shares all but the list of instances and the hierarchy
    /// over them with this one, so that a renderer uploads no more
    /// ([`Renderer::set_world`](crate::engine::Renderer::set_world)). What rays hit is what they hit in a new world of
    /// the changed scene.
    ///
    /// # Errors
    /// The world is flattened ([`FlatScene::with_instances`](super::FlatScene::with_instances) keeps instances). There
    /// is no instance of an index, or an instance has two updates. A transform magnifies rounding too much, moves
    /// triangles too far from the origin, or is that of one of [`Instances::fixed`]. A material is missing.
    pub fn with_instances_changed(&self, updates: &[InstanceUpdate]) -> Result<Self, Mismatch> {
        let scene = self.scene();
        let (Some(before), Accel::TwoLevel(two)) = (&scene.instances, self.accel()) else {
            return Err(Mismatch::Scene("the world is flattened, so its instances cannot change".to_owned()));
        };
        let mut instances = before.clone();
        let mut is_updated = vec![false; instances.list.len()];
        let mut lists = OwnLists::default();
        let is_emissive: Vec<bool> = scene.materials.iter().map(is_emissive).collect();
        let mut keeps_emitters = true;
        let at = |update: &InstanceUpdate| update.transform.as_ref().map(Instance::of_transform);
        let at: Vec<_> = updates.par_iter().map(at).collect();
        for (update, at) in updates.iter().zip(at) {
            let wrong = |what: String| Mismatch::Instance { instance: update.instance_ix, what };
            match is_updated.get_mut(update.instance_ix) {
                None => return Err(wrong(format!("there are {} instances", before.list.len()))),
                Some(true) => return Err(wrong("it has two updates".to_owned())),
                Some(is_updated) => *is_updated = true,
            }
            let emits = |instances: &Instances| {
                let materials = instances.materials_of(&instances.list[update.instance_ix]);
                materials.iter().any(|material| is_emissive[*material as usize])
            };
            let changes_light = is_emissive.contains(&true)
                && (update.transform.is_some()
                    || update.materials.is_some()
                    || update.rays.is_some()
                    || update.mask.is_some());
            keeps_emitters &= !(changes_light && emits(&instances));
            if let Some(materials) = &update.materials {
                check_materials(materials, scene.materials.len()).map_err(wrong)?;
                lists.replace(&mut instances, update.instance_ix, materials);
                keeps_emitters &= !(changes_light && emits(&instances));
            }
            let instance = &mut instances.list[update.instance_ix];
            if let Some(at) = at {
                if before.fixed.binary_search(&update.instance_ix).is_ok() {
                    return Err(wrong("its triangles are stored in the world, so it cannot move".to_owned()));
                }
                let bounds = two.structures()[instance.geometry_ix as usize].bounds();
                place(instance, at, bounds).map_err(wrong)?;
            }
            if let Some(rays) = update.rays {
                instance.flags = instance.flags & INSTANCE_MIRRORED | flags_of(rays);
            }
            if let Some(mask) = update.mask {
                instance.flags = instance.flags & !INSTANCE_FOR_OTHERS | u32::from(mask) << INSTANCE_MASK_SHIFT;
            }
        }
        Ok(self.with_instances(two, instances, keeps_emitters))
    }

    fn with_instances(&self, two: &TwoLevel, instances: Instances, keeps_emitters: bool) -> Self {
        let accel = Accel::TwoLevel(Box::new(two.moved(&instances.list)));
        let mut scene = self.scene().clone();
        scene.instances = Some(instances);
        let emitters = if keeps_emitters { self.0.emitters.clone() } else { OnceLock::new() };
        let (wide_bvh, ambient_approximations) = Default::default();
        let (accel_options, poses) = (self.accel_options().clone(), self.0.poses.clone());
        Self(Arc::new(Parts { scene, accel, accel_options, poses, emitters, wide_bvh, ambient_approximations }))
    }

    /// Returns whether both worlds differ in their instances at most: one was made of the other by
    /// [`World::with_instances_changed`].
    pub fn shares_geometries(&self, other: &Self) -> bool {
        let own = self.accel().structures_id();
        Arc::ptr_eq(&self.0, &other.0) || own.is_some() && own == other.accel().structures_id()
    }
}

/// Puts an instance in another place. `at`: an instance of its transform. `bounds`: those of its geometry.
pub(super) fn place(instance: &mut Instance, at: Option<Instance>, [min, max]: [Vec3; 2]) -> Result<(), String> {
    let at = at.ok_or("its transform magnifies rounding too much")?;
    let is_near = |p: Vec3| p.is_finite() && p.abs().max_element() <= MAX_COORDINATE;
    if instance.n_triangles > 0 && !box_corners(min, max).into_iter().all(|p| is_near(at.point(p))) {
        return Err(format!("its new place is beyond {MAX_COORDINATE:e}"));
    }
    let &mut Instance { first_triangle, geometry_ix, first_material, first_row, n_triangles, flags, .. } = instance;
    let flags = flags & !INSTANCE_MIRRORED | at.flags & INSTANCE_MIRRORED;
    *instance = Instance { first_triangle, geometry_ix, first_material, first_row, n_triangles, flags, ..at };
    Ok(())
}

fn check_materials(materials: &[u32], n_materials: usize) -> Result<(), String> {
    match materials.iter().find(|material| **material as usize >= n_materials) {
        _ if materials.is_empty() => Err("it has no material".to_owned()),
        Some(missing) => Err(format!("it has material {missing}, but there are {n_materials} materials")),
        None => Ok(()),
    }
}

/// Finds or makes the list of materials that is an instance's own. So all updates together make at most one list for
/// each instance.
#[derive(Default)]
struct OwnLists {
    /// The number of instances that have the list that begins at this place.
    n_users: HashMap<u32, usize>,
}

impl OwnLists {
    fn replace(&mut self, instances: &mut Instances, instance_ix: usize, materials: &[u32]) {
        if self.n_users.is_empty() {
            instances.list.iter().for_each(|it| *self.n_users.entry(it.first_material).or_default() += 1);
        }
        let n_before = instances.materials.len() as u32;
        let instance = &mut instances.list[instance_ix];
        let n_slots = instances.n_slots[instance.geometry_ix as usize];
        let n_users = self.n_users.get_mut(&instance.first_material).expect("the list of an instance");
        // Instances without slots have empty lists, which begin where other lists do.
        if *n_users > 1 {
            *n_users -= 1;
            instance.first_material = n_before;
            self.n_users.insert(n_before, 1);
            instances.materials.extend((0..n_slots).map(|_| 0));
        }
        let own = &mut instances.materials[instance.first_material as usize..][..n_slots as usize];
        own.iter_mut().zip(materials.iter().cycle()).for_each(|(own, material)| *own = *material);
    }
}
