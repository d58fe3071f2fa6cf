//! The search through a world of instances. Twin of `instances/hierarchy.glsl` and of the loop in `search/accel.glsl`.

use glam::Vec3;

use super::{
    counting::table::ReadCounter,
    inputs::{Instanced, KernelInputs},
    search_ray::SearchRay,
    traversal_ray::{max, min},
};
use crate::layout::{Hit, Instance, KD_LEAST_COMPONENT, NO_TRIANGLE, TOP_LEAF, TopNode};

/// The t of a box that the ray misses, above all others.
const MISSES: f32 = 3.0e38;

/// A node, and the pending siblings above it: bit i belongs to the node i levels above. `NO_TRIANGLE` in place of the
/// node: nothing is left.
#[derive(Clone, Copy)]
pub(super) struct TopCell {
    pub node_ix: u32,
    pub pending: u32,
}

/// A ray of the world as boxes see it.
struct TopRay {
    inv_direction: Vec3,
    bias: Vec3,
    t_min: f32,
    /// By how much boxes are too small for a ray from afar, world units.
    pad: f32,
}

impl TopRay {
    fn new(ray: &SearchRay, inputs: &KernelInputs<impl ReadCounter>, instanced: &Instanced) -> Self {
        let tiny = ray.direction.abs().cmplt(Vec3::splat(KD_LEAST_COMPONENT));
        let inv_direction = 1.0 / Vec3::select(tiny, Vec3::splat(KD_LEAST_COMPONENT), ray.direction);
        let farthest = ray.origin.abs().max_element();
        let pad = if farthest > inputs.origin_reach { instanced.two.pad_from_afar() * farthest } else { 0.0 };
        Self { inv_direction, bias: -ray.origin * inv_direction, t_min: ray.t_min, pad }
    }

    /// Returns the t at which the ray enters a node's box, or [`MISSES`] if it misses the box or enters it behind
    /// `t_best`.
    fn entry_of(&self, node: &TopNode, t_best: f32) -> f32 {
        let t0 = (node.box_min - self.pad) * self.inv_direction + self.bias;
        let t1 = (node.box_max + self.pad) * self.inv_direction + self.bias;
        let near = [0, 1, 2].map(|axis| min(t0[axis], t1[axis]));
        let far = [0, 1, 2].map(|axis| max(t0[axis], t1[axis]));
        let t_enter = max(max(near[0], near[1]), max(near[2], self.t_min));
        let t_exit = min(min(far[0], far[1]), min(far[2], t_best));
        if t_enter <= t_exit { t_enter } else { MISSES }
    }
}

impl TopCell {
    /// Goes up to the nearest pending sibling.
    pub fn leave(&mut self, nodes: &[TopNode]) {
        if self.pending == 0 {
            self.node_ix = NO_TRIANGLE;
            return;
        }
        let n_levels = self.pending.trailing_zeros();
        for _ in 0..n_levels {
            self.node_ix = nodes[self.node_ix as usize].parent;
        }
        self.node_ix ^= 1;
        self.pending = (self.pending >> n_levels) & !1;
    }

    /// Goes down to the child of a pair that the ray enters first. Returns false if it meets neither.
    fn enter_child(&mut self, ray: &TopRay, nodes: &[TopNode], pair: u32, t_best: f32) -> bool {
        let [t0, t1] = [2 * pair, 2 * pair + 1].map(|ix| ray.entry_of(&nodes[ix as usize], t_best));
        if min(t0, t1) == MISSES {
            return false;
        }
        self.node_ix = 2 * pair + u32::from(t1 < t0);
        self.pending = self.pending << 1 | u32::from(max(t0, t1) < MISSES);
        true
    }

    /// Goes on to the next instance that may have a hit nearer than `t_best`, and whose flags have a bit of `kind`.
    fn find_instance<'a>(
        &mut self,
        ray: &TopRay,
        instanced: &Instanced<'a>,
        (t_best, kind): (f32, u32),
        count: impl Fn(usize),
    ) -> Option<&'a Instance> {
        let nodes = &instanced.two.top().nodes;
        while self.node_ix != NO_TRIANGLE {
            let node = &nodes[self.node_ix as usize];
            if node.link & TOP_LEAF == 0 {
                count(2);
                if !self.enter_child(ray, nodes, node.link, t_best) {
                    self.leave(nodes);
                }
                continue;
            }
            let instance = &instanced.instances.list[(node.link & !TOP_LEAF) as usize];
            if ray.entry_of(node, t_best) < MISSES && instance.flags & kind != 0 {
                return Some(instance);
            }
            self.leave(nodes);
        }
        None
    }
}

/// Returns v by the rows of the inverse linear map.
pub(super) fn local_vector(instance: &Instance, v: Vec3) -> Vec3 {
    let by_row = |row: Vec3| row.x * v.x + row.y * v.y + row.z * v.z;
    Vec3::new(by_row(instance.local_x), by_row(instance.local_y), by_row(instance.local_z))
}

/// Returns a ray in the space of an instance's geometry, and the factor by which t is multiplied, a power of two.
fn in_geometry(instance: &Instance, ray: &SearchRay, t_best: f32) -> (SearchRay, f32) {
    let local = |v: Vec3| local_vector(instance, v);
    let direction = local(ray.direction);
    let exponent = (direction.abs().max_element().to_bits() >> 23).clamp(1, 253);
    let [scale, inv_scale] = [254 - exponent, exponent].map(|exponent| f32::from_bits(exponent << 23));
    let is_own =
        (instance.first_triangle..instance.first_triangle + instance.n_triangles).contains(&ray.source_triangle);
    let local = SearchRay {
        origin: local(ray.origin - instance.translation),
        t_min: ray.t_min * inv_scale,
        direction: direction * scale,
        t_max: t_best * inv_scale,
        source_triangle: if is_own { ray.source_triangle - instance.first_triangle } else { NO_TRIANGLE },
        alpha_seed: ray.alpha_seed,
    };
    (local, inv_scale)
}

/// Calls `visit` for each instance that a ray may meet: with the inputs of the search through its geometry, the ray in
/// its space, and the factor by which t is multiplied there.
pub fn visit_instances<R: ReadCounter>(
    inputs: &KernelInputs<R>,
    instanced: &Instanced,
    ray: &SearchRay,
    mut visit: impl FnMut(&KernelInputs<R>, &SearchRay, f32),
) {
    let top_ray = TopRay::new(ray, inputs, instanced);
    let mut at = TopCell { node_ix: 0, pending: 0 };
    let wanted = (ray.t_max, inputs.kind_of_rays(false));
    while let Some(instance) = at.find_instance(&top_ray, instanced, wanted, |n| inputs.kd_nodes.count(n)) {
        let (local, inv_scale) = in_geometry(instance, ray, ray.t_max);
        visit(&inputs.of_instance(instanced, instance), &local, inv_scale);
        at.leave(&instanced.two.top().nodes);
    }
}

/// Finds a ray's closest hit in all instances, or with `ANY_HIT` one that need not be the closest. `search` finds that
/// of a ray in a geometry. A miss has t = `t_max`.
pub fn search_instances<R: ReadCounter, const ANY_HIT: bool>(
    inputs: &KernelInputs<R>,
    instanced: &Instanced,
    ray: &SearchRay,
    mut search: impl FnMut(&KernelInputs<R>, &SearchRay) -> Hit,
) -> Hit {
    let mut best = ray.miss();
    let top_ray = TopRay::new(ray, inputs, instanced);
    let mut at = TopCell { node_ix: 0, pending: 0 };
    let kind = inputs.kind_of_rays(ANY_HIT);
    while let Some(instance) = at.find_instance(&top_ray, instanced, (best.t, kind), |n| inputs.kd_nodes.count(n)) {
        let (local, inv_scale) = in_geometry(instance, ray, best.t);
        let geometry = inputs.of_instance(instanced, instance);
        let found = search(&geometry, &local);
        if found.triangle_ix != NO_TRIANGLE {
            let hit = geometry.in_world(&found);
            if found.t < local.t_max || hit.triangle_ix < best.triangle_ix {
                best = Hit { t: min(hit.t / inv_scale, best.t), ..hit };
            }
        }
        if ANY_HIT && best.triangle_ix != NO_TRIANGLE {
            break;
        }
        at.leave(&instanced.two.top().nodes);
    }
    best
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use glam::{DMat3, DMat4, DVec3, vec3};

    use super::*;
    use crate::{
        accel::kdtree::{BuildOptions, Traversal},
        reference::traverser::{Tracer, Traverser},
        scene::{Mesh, Scene, Transform},
        world::{FlatScene, World},
    };

    /// Returns a world of octahedra around a point of their space, each placed by a transform.
    fn world(centre: Vec3, transforms: &[Transform]) -> World {
        let corner = |axis: usize, side: f32| centre + side * Vec3::AXES[axis];
        let positions = (0..6).map(|i| corner(i / 2, if i % 2 == 0 { 1.0 } else { -1.0 })).collect();
        let face = |i: u32| {
            let [x, y, z] = [i & 1, 2 + (i >> 1 & 1), 4 + (i >> 2)];
            if (x + y + z) % 2 == 0 { [x, y, z] } else { [x, z, y] }
        };
        let mut scene = Scene::empty(Path::new("octahedra"));
        scene.meshes = vec![Mesh::of_triangles(positions, (0..8).map(face).collect())];
        let material = scene.push_material(crate::scene::Material::default());
        let instance = |transform: &Transform| crate::scene::Instance {
            transform: transform.clone(),
            materials: vec![material],
            ..Default::default()
        };
        scene.instances = transforms.iter().map(instance).collect();
        World::of_flat(FlatScene::with_instances(&scene).unwrap(), &BuildOptions::default()).unwrap()
    }

    fn number(seed: &mut u32) -> f32 {
        *seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (*seed >> 8) as f32 / (1 << 24) as f32
    }

    /// Casts rays at the corners of instances. (Their hits do not depend on the margins of boxes.) Returns how many hit
    /// an instance when all are searched, and how many of those the hierarchy misses.
    fn grazing(world: &World, n_rays: usize) -> (usize, usize) {
        let inputs = KernelInputs::of_geometry(world.geometry());
        let instanced = &inputs.instanced.unwrap();
        let mut tracer = Traverser::new(&inputs, Traversal::Stack);
        let (mut n_hits, mut n_missed, mut seed) = (0, 0, 1);
        for i in 0..n_rays {
            let scene = world.scene();
            let target = scene.triangle(i % scene.n_triangles()).v0;
            let mut direction = Vec3::from_array([(); 3].map(|()| number(&mut seed) - 0.5));
            // Parallel to two sides of the box.
            direction[i % 3] = 0.0;
            let direction = direction.normalize();
            let ray = SearchRay {
                origin: target - 3.0 * direction,
                t_min: 0.0,
                direction,
                t_max: f32::INFINITY,
                source_triangle: NO_TRIANGLE,
                alpha_seed: 0,
            };
            let mut search = |instance: &Instance| {
                let (local, _) = in_geometry(instance, &ray, f32::MAX);
                let inputs = inputs.of_instance(instanced, instance_of(instanced, instance));
                tracer.traverse::<false>(&inputs, &local).triangle_ix != NO_TRIANGLE
            };
            let is_hit = instanced.instances.list.iter().any(&mut search);
            let found = tracer.traverse::<false>(&inputs, &ray).triangle_ix != NO_TRIANGLE;
            n_hits += usize::from(is_hit);
            n_missed += usize::from(is_hit && !found);
        }
        (n_hits, n_missed)
    }

    fn instance_of<'a>(instanced: &Instanced<'a>, instance: &Instance) -> &'a Instance {
        instanced.instances.of_triangle(instance.first_triangle as usize).1
    }

    #[test]
    fn the_hierarchy_finds_what_a_search_of_all_instances_finds() {
        let turned = |angle: f64, at: DVec3| {
            Transform::new(DVec3::new(1.0, 0.4, 1.7), glam::DQuat::from_rotation_z(angle), at).unwrap()
        };
        let (n_hits, n_missed) =
            grazing(&world(Vec3::ZERO, &[turned(0.3, DVec3::ZERO), turned(1.1, DVec3::splat(40.0))]), 20_000);
        assert!(n_hits > 5000 && n_missed == 0, "{n_missed} of {n_hits}");
    }

    #[test]
    fn the_hierarchy_finds_a_mesh_that_is_far_from_its_own_origin() {
        // The transform moves the mesh back to 0, and magnifies rounding.
        let centre = vec3(1000.0, 1000.0, 0.0);
        for e in [0.1, 0.01, 0.002] {
            let linear = DMat3::from_cols(DVec3::new(1.0, 1.0, 0.0), DVec3::new(1.0, 1.0 + e, 0.0), DVec3::Z);
            let mut affine = DMat4::from_mat3(linear);
            affine.w_axis = (-(linear * centre.as_dvec3())).extend(1.0);
            let (n_hits, n_missed) = grazing(&world(centre, &[Transform::of_affine(affine).unwrap()]), 20_000);
            assert!(n_hits > 1000 && n_missed == 0, "{e}: {n_missed} of {n_hits}");
        }
    }
}
