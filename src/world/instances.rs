//! Instances: geometries that are stored once and placed many times. Twin of `glsl/shared/instances/placed.glsl`.
//!
//! A triangle of the world has an index of 32 bits: its instance's first index plus its index in the geometry. So a hit
//! is as small as in a flat world, and the index is that of the flattened copy. The triangle itself is computed when it
//! is needed.

use std::collections::HashMap;

use glam::{DMat3, Vec3};

use super::Mismatch;
use crate::{
    accel::{
        top_level::{MAX_CONDITION, condition_of},
        two_level::StoredRange,
    },
    layout::{
        FLAT_NORMAL, INSTANCE_FOR_CAMERA, INSTANCE_FOR_OTHERS, INSTANCE_FOR_SHADOWS, INSTANCE_MIRRORED, Instance,
        NO_TRIANGLE, Triangle,
        normal::{decode_octahedral, encode_octahedral},
    },
    scene::{
        MOST_TRIANGLES, Mesh, RayKinds, Scene, Transform,
        mesh::{MAX_COORDINATE, box_corners},
    },
};

/// Whether meshes that occur several times are stored once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Instancing {
    /// By the rule of [`Instancing::keeps`].
    #[default]
    Auto,
    /// Each occurrence is stored.
    Flatten,
    /// Each mesh is stored once.
    Keep,
}

named_enum!(Instancing {
    Auto = "auto": "keep meshes that occur several times if that saves half of a large scene's memory",
    Flatten = "flatten": "store each occurrence of a mesh: rays are fastest",
    Keep = "keep": "store each mesh once, however often it occurs",
});

/// Triangles of the flattened scene up to which [`Instancing::Auto`] flattens. They take some 2 GB with their tree.
const FEW_TRIANGLES: usize = 1 << 22;

impl Instancing {
    /// Returns whether the meshes of a scene are stored once: by the rule, if an instance is hidden from some rays, or
    /// if the instances have more than 2^22 triangles and at least twice as many as the meshes.
    pub fn keeps(self, scene: &Scene) -> bool {
        match self {
            Self::Flatten => false,
            Self::Keep => true,
            Self::Auto => {
                let n_triangles = scene.n_triangles();
                let saves_half = n_triangles > FEW_TRIANGLES && n_triangles / 2 >= scene.n_stored();
                saves_half || scene.instances.iter().any(|instance| instance.rays != RayKinds::ALL)
            }
        }
    }
}

/// The geometries of a world and their places in it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Instances {
    /// Where the triangles of each geometry are stored.
    pub ranges: Vec<StoredRange>,
    /// The number of slots of each geometry: 1 more than the greatest of its triangles.
    pub n_slots: Vec<u32>,
    /// The instances, in the order of their first triangles.
    pub list: Vec<Instance>,
    /// The materials of the instances' slots (`Instance::first_material`).
    pub materials: Vec<u32>,
    /// The indices of the instances that cannot move, in their order: their triangles are stored where the world has
    /// them, since their transforms would magnify rounding too much.
    pub fixed: Vec<usize>,
}

/// A mesh of a scene that becomes a geometry.
pub(super) struct Kept {
    pub mesh_ix: usize,
    /// What moves the mesh to the geometry's space: nothing, but where an instance cannot keep its own.
    pub transform: Transform,
    /// Its first instance, which errors name.
    pub instance_ix: usize,
}

/// Where a triangle of the world is stored, and how it is placed.
#[derive(Clone, Copy, Debug)]
pub struct Stored<'a> {
    /// The place among the stored triangles.
    pub row: usize,
    /// Its instance; none in a flat world.
    pub instance: Option<&'a Instance>,
}

impl Stored<'_> {
    /// Returns what belongs to the stored triangle's corners in the order of the world's.
    #[inline(always)]
    pub fn corners<T: Copy>(&self, [a, b, c]: [T; 3]) -> [T; 3] {
        if self.instance.is_some_and(Instance::is_mirrored) { [a, c, b] } else { [a, b, c] }
    }

    /// Returns the code of a corner's tangent in the world.
    pub fn tangent(&self, code: u32) -> u32 {
        match self.instance {
            Some(instance) if code != FLAT_NORMAL => {
                let side = code & 1 ^ u32::from(instance.is_mirrored());
                let t = decode_octahedral(code & !1);
                encode_octahedral(t.x * instance.axis_x + t.y * instance.axis_y + t.z * instance.axis_z) & !1 | side
            }
            _ => code,
        }
    }

    /// Returns a length whose roundings are above those of the way of a ray that leaves a point of the triangle into
    /// the geometry's space (world units). 0 in a flat world.
    pub fn placement_error(&self, t: &Triangle, weights: Vec3) -> f32 {
        let Some(instance) = self.instance else { return 0.0 };
        let offset = |weight: f32, corner: Vec3| (weight * (corner - instance.translation)).abs();
        let offset = offset(weights.x, t.v0) + offset(weights.y, t.v1) + offset(weights.z, t.v2);
        instance.condition * offset.max_element()
    }
}

impl Instance {
    /// Makes the instance of a transform, whose coefficients are rounded. `None`: the transform magnifies rounding too
    /// much for a space of its own.
    pub(crate) fn of_transform(transform: &Transform) -> Option<Self> {
        let (linear, translation) = (transform.linear(), transform.translation());
        let [axis_x, axis_y, axis_z] = [linear.x_axis, linear.y_axis, linear.z_axis].map(|axis| axis.as_vec3());
        let rounded = DMat3::from_cols(axis_x.as_dvec3(), axis_y.as_dvec3(), axis_z.as_dvec3());
        let inverse = rounded.inverse();
        let rows = inverse.transpose();
        let [local_x, local_y, local_z] = [rows.x_axis, rows.y_axis, rows.z_axis].map(|row| row.as_vec3());
        let condition = condition_of(rounded, inverse);
        let all = [axis_x, axis_y, axis_z, local_x, local_y, local_z, translation.as_vec3()];
        let is_in_range = all.iter().all(|v| v.is_finite() && v.abs().max_element() <= MOST);
        (is_in_range && condition <= MAX_CONDITION).then(|| Self {
            axis_x,
            axis_y,
            axis_z,
            translation: translation.as_vec3(),
            local_x,
            local_y,
            local_z,
            condition: condition as f32,
            flags: flags_of(RayKinds::ALL) | if rounded.determinant() < 0.0 { INSTANCE_MIRRORED } else { 0 },
            ..Self::default()
        })
    }

    /// Returns whether the linear map is a reflection.
    pub(crate) fn is_mirrored(&self) -> bool {
        self.flags & INSTANCE_MIRRORED != 0
    }

    /// Returns where a triangle of the world, one of this instance, is stored.
    pub(crate) fn stored(&self, triangle_ix: u32) -> Stored<'_> {
        Stored { row: (self.first_row + (triangle_ix - self.first_triangle)) as usize, instance: Some(self) }
    }

    /// Returns a point of the geometry in the world.
    pub(crate) fn point(&self, p: Vec3) -> Vec3 {
        p.x * self.axis_x + p.y * self.axis_y + p.z * self.axis_z + self.translation
    }

    fn normal(&self, code: u32) -> u32 {
        if code == FLAT_NORMAL {
            return FLAT_NORMAL;
        }
        let n = decode_octahedral(code);
        encode_octahedral(n.x * self.local_x + n.y * self.local_y + n.z * self.local_z)
    }

    /// Returns a triangle of the geometry in the world.
    pub(crate) fn triangle(&self, t: &Triangle) -> Triangle {
        let corner = |p: Vec3, n: u32| (self.point(p), self.normal(n));
        let corners = [corner(t.v0, t.n0), corner(t.v1, t.n1), corner(t.v2, t.n2)];
        let [(v0, n0), (v1, n1), (v2, n2)] = Stored { row: 0, instance: Some(self) }.corners(corners);
        Triangle { v0, n0, v1, n1, v2, n2 }
    }
}

/// Returns the flags of an instance that these rays meet.
pub(super) fn flags_of(rays: RayKinds) -> u32 {
    let flag = |is_set: bool, flag: u32| if is_set { flag } else { 0 };
    flag(rays.camera, INSTANCE_FOR_CAMERA)
        | flag(rays.shadow, INSTANCE_FOR_SHADOWS)
        | flag(rays.other, INSTANCE_FOR_OTHERS)
}

/// The most slots of a mesh that is stored once. Each of its lists of materials has an entry for every slot.
const MOST_SLOTS: u64 = 1 << 16;

/// What the placing of a mesh depends on.
#[derive(Clone, Copy)]
struct MeshFacts {
    bounds: (Vec3, Vec3),
    /// Whether its own space may be that of a geometry.
    is_near: bool,
    n_slots: u64,
}

impl MeshFacts {
    fn of(mesh: &Mesh) -> Self {
        let bounds = mesh.bounds();
        let is_near = bounds.0.abs().max(bounds.1.abs()).max_element() <= MAX_COORDINATE || mesh.positions.is_empty();
        let n_slots = mesh.slots.iter().max().map_or(0, |slot| u64::from(*slot) + 1);
        Self { bounds, is_near, n_slots }
    }
}

/// The greatest coefficient of an instance's maps. Beyond it, squares of lengths could overflow.
const MOST: f32 = 1e15;

impl Instances {
    /// Chooses the geometries of a scene, one for each mesh that occurs, and makes the instances. An instance that
    /// cannot keep its own space gets a geometry of its own, which is placed in the world. Each instance's mesh exists.
    ///
    /// # Errors
    /// The instances have more triangles than there are indices.
    pub(super) fn of_scene(scene: &Scene) -> Result<(Self, Vec<Kept>), Mismatch> {
        let (mut made, mut kept) = (Self::default(), Vec::<Kept>::new());
        let mut geometry_of_mesh = HashMap::new();
        let mut first_material_of = HashMap::<(usize, &[u32]), u32>::new();
        let mut facts_of_mesh = vec![None; scene.meshes.len()];
        let (mut first_row, mut first_triangle) = (0_u64, 0_u64);
        for (instance_ix, instance) in scene.instances.iter().enumerate() {
            let mesh = &scene.meshes[instance.mesh_ix];
            let facts = facts_of_mesh[instance.mesh_ix].get_or_insert_with(|| MeshFacts::of(mesh));
            let wrong = |what| Mismatch::Instance { instance: instance_ix, what };
            mesh.check_place(&instance.transform, facts.bounds).map_err(wrong)?;
            if facts.n_slots > MOST_SLOTS {
                return Err(wrong(format!(
                    "its mesh has slot {}, of which there may be {MOST_SLOTS}",
                    facts.n_slots - 1
                )));
            }
            let (mesh_ix, n_triangles) = (instance.mesh_ix, scene.meshes[instance.mesh_ix].faces.len());
            let own_space = Instance::of_transform(&instance.transform).filter(|_| facts.is_near);
            let geometry_ix = match own_space.and_then(|_| geometry_of_mesh.get(&mesh_ix)) {
                Some(&geometry_ix) => geometry_ix,
                None => {
                    let range = StoredRange { first_row: first_row as u32, n_triangles: n_triangles as u32 };
                    first_row += n_triangles as u64;
                    made.ranges.push(range);
                    made.n_slots.push(facts.n_slots as u32);
                    let transform = match own_space {
                        Some(_) => Transform::IDENTITY,
                        None => instance.transform.clone(),
                    };
                    kept.push(Kept { mesh_ix, transform, instance_ix });
                    let geometry_ix = kept.len() - 1;
                    if own_space.is_some() {
                        geometry_of_mesh.insert(mesh_ix, geometry_ix);
                    }
                    geometry_ix
                }
            };
            let at = own_space.unwrap_or_else(|| {
                made.fixed.push(instance_ix);
                Instance::of_transform(&Transform::IDENTITY).expect("the identity is a transform")
            });
            let first_material = *first_material_of.entry((mesh_ix, &instance.materials)).or_insert_with(|| {
                let first = made.materials.len() as u32;
                let of_slot = |slot| instance.materials[slot as usize % instance.materials.len()];
                made.materials.extend((0..facts.n_slots).map(of_slot));
                first
            });
            made.list.push(Instance {
                first_triangle: first_triangle.min(u64::from(u32::MAX)) as u32,
                geometry_ix: geometry_ix as u32,
                first_material,
                first_row: made.ranges[geometry_ix].first_row,
                n_triangles: n_triangles as u32,
                flags: at.flags & INSTANCE_MIRRORED | flags_of(instance.rays),
                ..at
            });
            first_triangle += n_triangles as u64;
        }
        if first_triangle > MOST_TRIANGLES || first_row > u64::from(NO_TRIANGLE) {
            return Err(Mismatch::Scene(format!(
                "the instances have {first_triangle} triangles, of which there may be {MOST_TRIANGLES}"
            )));
        }
        Ok((made, kept))
    }

    /// The number of triangles of all instances.
    pub fn n_triangles(&self) -> usize {
        self.list.last().map_or(0, |last| last.first_triangle as usize + last.n_triangles as usize)
    }

    /// Returns the least and the greatest corner of a box around all instances. `boxes`: those of the geometries.
    pub(super) fn bounds(&self, boxes: &[(Vec3, Vec3)]) -> (Vec3, Vec3) {
        let corners = self.list.iter().filter(|it| it.n_triangles > 0).flat_map(|instance| {
            let (min, max) = boxes[instance.geometry_ix as usize];
            box_corners(min, max).map(|p| instance.point(p))
        });
        corners.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(min, max), p| (min.min(p), max.max(p)))
    }

    /// Returns the materials of an instance's slots.
    pub fn materials_of(&self, instance: &Instance) -> &[u32] {
        &self.materials[instance.first_material as usize..][..self.n_slots[instance.geometry_ix as usize] as usize]
    }

    /// Returns the instance of a triangle: its index, and itself.
    pub fn of_triangle(&self, triangle_ix: usize) -> (usize, &Instance) {
        let n_before = self.list.partition_point(|it| it.first_triangle as usize <= triangle_ix);
        (n_before - 1, &self.list[n_before - 1])
    }

    /// Returns where a triangle of the world is stored.
    pub fn stored(&self, triangle_ix: usize) -> Stored<'_> {
        self.of_triangle(triangle_ix).1.stored(triangle_ix as u32)
    }
}
