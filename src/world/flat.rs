//! Flat scenes: world-space triangles, and materials and lights as kernels read them.

use std::f32::consts::PI;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{
    Mismatch, Textures,
    instances::{Instances, Kept, Stored},
    rebuilt::Reused,
};
use crate::{
    accel::two_level::StoredRange,
    layout::{
        AREA_DISK, AREA_RECTANGLE, AREA_SPHERE, AreaLight, FLAT_NORMAL, Instance, LIGHT_DIRECTIONAL, LIGHT_POINT,
        LIGHT_SPOT, Light, MATERIAL_CONDUCTOR, MATERIAL_FRESNEL, MATERIAL_MICROFACET, MATERIAL_REFLECT,
        MATERIAL_REFRACT, MATERIAL_SINGLE_SCATTERING, MATERIAL_SINGLE_SIDED, MATERIAL_SOLID, MATERIAL_SPECULAR,
        MATERIAL_UNLIT, Material, Triangle, normal::encode_octahedral,
    },
    scene::{
        self, Alpha, Camera, Conductor, Environment, Ground, Lobes, Mesh, Microfacet, RayKinds, RenderDefaults, Scene,
        Sky, Transform,
    },
    util::Shared,
};

/// Where the triangles of a scene's instance begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Occurrence {
    /// The index of the instance's first triangle in the world.
    pub first_triangle: u32,
    /// The index of its mesh in [`Scene::meshes`].
    pub mesh_ix: u32,
}

/// What a triangle of the world is in the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TriangleOrigin {
    /// The index of its instance in [`Scene::instances`].
    pub instance_ix: u32,
    /// The index of the instance's mesh in [`Scene::meshes`].
    pub mesh_ix: u32,
    /// The index of the face in the mesh.
    pub face_ix: u32,
}

/// Scene as it is traced: everything that a frame shows, with all meshes in world space.
///
/// Clones share the large arrays. A clone that changes one gets one of its own ([`Shared`]).
#[derive(Clone, Debug, PartialEq)]
pub struct FlatScene {
    /// The scene's name.
    pub name: String,
    /// The point of the scene's file that is the origin of world space ([`Scene::origin`]).
    pub origin: DVec3,
    /// The triangles that are stored: those of the world, instance after instance, each in the order of its mesh's
    /// faces; or with `instances`, those of the geometries, each in its own space.
    pub triangles: Shared<Vec<Triangle>>,
    /// For each stored triangle, the index of its material in `materials`; with `instances`, its slot.
    pub triangle_materials: Shared<Vec<u32>>,
    /// The world's triangles that come from each instance of the scene, in their order. Without any, all triangles
    /// count as those of one mesh.
    pub occurrences: Shared<Vec<Occurrence>>,
    /// The instances of the geometries. `None`: the stored triangles are those of the world.
    pub instances: Option<Instances>,
    /// The materials.
    pub materials: Vec<Material>,
    /// The name of each material.
    pub material_names: Vec<String>,
    /// The textures, with what leads from triangles to them.
    pub textures: Shared<Textures>,
    /// The lights without an area; there may be none.
    pub lights: Vec<Light>,
    /// Rectangles, disks and spheres that shine. Only the path tracer knows them.
    pub area_lights: Vec<AreaLight>,
    /// The image of what is beyond the scene, or of its sky. Only the path tracer knows it.
    pub environment: Option<Environment>,
    /// The studio that metals and glass mirror ([`Scene::studio`]).
    pub studio: Option<Vec3>,
    /// The camera that renders the scene unless another one is set.
    pub camera: Camera,
    /// The irradiance that every point receives, which is weighted by the point's Ka.
    pub ambient: Vec3,
    /// The ambient light from below, if it is not that of all sides.
    pub ground: Option<Ground>,
    /// The radiance of rays that leave the scene.
    pub background: Vec3,
    /// The options that the scene is rendered with unless others are set.
    pub defaults: RenderDefaults,
}

impl FlatScene {
    /// Places all meshes of a scene in the world, on the current rayon pool.
    ///
    /// # Errors
    /// An index names nothing, arrays have different lengths, an instance with faces has no material, some rays pass
    /// through an instance, or a vertex is too far from the origin.
    pub fn new(scene: &Scene) -> Result<Self, Mismatch> {
        check_instances(scene)?;
        if let Some(instance) = scene.instances.iter().position(|instance| instance.rays != RayKinds::ALL) {
            let what = "some rays pass through it, which needs --instances keep".to_owned();
            return Err(Mismatch::Instance { instance, what });
        }
        let mut parts = Parts { triangles: Vec::with_capacity(scene.n_triangles()), ..Parts::default() };
        for (instance_ix, instance) in scene.instances.iter().enumerate() {
            let mesh = &scene.meshes[instance.mesh_ix];
            parts.push(mesh, &instance.transform, instance_ix)?;
            // An instance with fewer materials than the mesh has slots repeats its materials.
            let material_of = |slot: &u32| instance.materials[*slot as usize % instance.materials.len()];
            parts.materials.extend(mesh.slots.iter().map(material_of));
        }
        let placed: Vec<_> = scene.instances.iter().map(|it| (&scene.meshes[it.mesh_ix], &it.transform)).collect();
        let textures = Textures::new(scene, &placed)?;
        Ok(Self::of_parts(scene, parts, textures, None))
    }

    /// Stores each mesh of a scene once, however many instances it has. A scene without triangles is flattened.
    ///
    /// # Errors
    /// Fails as [`FlatScene::new`] does, or if the instances have more triangles than there are indices.
    pub fn with_instances(scene: &Scene) -> Result<Self, Mismatch> {
        Ok(Self::with_reused(scene, |_| None)?.0)
    }

    /// Does what [`Self::with_instances`] does, but takes the triangles of some meshes over. Returns the scene, and for
    /// each geometry what it has taken over.
    pub(super) fn with_reused<'a>(
        scene: &Scene,
        reused: impl Fn(usize) -> Option<Reused<'a>>,
    ) -> Result<(Self, Vec<Option<Reused<'a>>>), Mismatch> {
        if scene.n_triangles() == 0 {
            return Ok((Self::new(scene)?, Vec::new()));
        }
        check_instances(scene)?;
        let (instances, kept) = Instances::of_scene(scene)?;
        let n_stored = kept.iter().map(|it| scene.meshes[it.mesh_ix].faces.len()).sum();
        let mut parts = Parts { triangles: Vec::with_capacity(n_stored), ..Parts::default() };
        let in_own_space = |it: &Kept| Some(it.mesh_ix).filter(|_| it.transform == Transform::IDENTITY);
        let reused: Vec<_> = kept.iter().map(|it| in_own_space(it).and_then(&reused)).collect();
        for (Kept { mesh_ix, transform, instance_ix }, reused) in kept.iter().zip(&reused) {
            match reused {
                Some(Reused { triangles, .. }) => parts.triangles.extend_from_slice(triangles),
                None => parts.push(&scene.meshes[*mesh_ix], transform, *instance_ix)?,
            }
            parts.materials.extend(&scene.meshes[*mesh_ix].slots);
        }
        let placed: Vec<_> = kept.iter().map(|it| (&scene.meshes[it.mesh_ix], &it.transform)).collect();
        let textures = Textures::new(scene, &placed)?;
        Ok((Self::of_parts(scene, parts, textures, Some(instances)), reused))
    }

    fn of_parts(scene: &Scene, parts: Parts, textures: Textures, instances: Option<Instances>) -> Self {
        let sky = scene.sky.as_ref().map(Sky::environment);
        let mut n_before = 0;
        let occurrences = scene.instances.iter().map(|instance| {
            let first_triangle = n_before as u32;
            n_before += scene.meshes[instance.mesh_ix].faces.len();
            Occurrence { first_triangle, mesh_ix: instance.mesh_ix as u32 }
        });
        let occurrences: Vec<_> = occurrences.collect();
        Self {
            name: scene.name.clone(),
            origin: scene.origin,
            triangles: parts.triangles.into(),
            triangle_materials: parts.materials.into(),
            occurrences: occurrences.into(),
            instances,
            materials: scene.materials.iter().map(Material::from).collect(),
            material_names: scene.materials.iter().map(|material| material.name.clone()).collect(),
            textures: textures.into(),
            lights: flat_lights(scene),
            area_lights: area_lights(scene),
            environment: sky.or_else(|| scene.environment.clone()),
            studio: scene.studio,
            camera: scene.camera,
            ambient: scene.ambient,
            ground: scene.ground,
            background: scene.background,
            defaults: scene.defaults,
        }
    }

    /// The number of triangles in the world.
    pub fn n_triangles(&self) -> usize {
        self.instances.as_ref().map_or_else(|| self.triangles.len(), Instances::n_triangles)
    }

    /// Returns where a triangle of the world is stored.
    pub fn stored(&self, triangle_ix: usize) -> Stored<'_> {
        match &self.instances {
            Some(instances) => instances.stored(triangle_ix),
            None => Stored { row: triangle_ix, instance: None },
        }
    }

    /// Returns what a triangle of the world is in the scene.
    pub fn origin_of(&self, triangle_ix: u32) -> TriangleOrigin {
        let n_begun = self.occurrences.partition_point(|it| it.first_triangle <= triangle_ix);
        let Some(instance_ix) = n_begun.checked_sub(1) else {
            return TriangleOrigin { instance_ix: 0, mesh_ix: 0, face_ix: triangle_ix };
        };
        let Occurrence { first_triangle, mesh_ix } = self.occurrences[instance_ix];
        TriangleOrigin { instance_ix: instance_ix as u32, mesh_ix, face_ix: triangle_ix - first_triangle }
    }

    /// Returns a triangle in world space.
    pub fn triangle(&self, triangle_ix: usize) -> Triangle {
        let Stored { row, instance } = self.stored(triangle_ix);
        instance.map_or(self.triangles[row], |it| it.triangle(&self.triangles[row]))
    }

    /// Returns the number of triangles of each material in the world.
    pub fn triangles_of_materials(&self) -> Vec<usize> {
        let mut counts = vec![0; self.materials.len()];
        let Some(instances) = &self.instances else {
            self.triangle_materials.iter().for_each(|ix| counts[*ix as usize] += 1);
            return counts;
        };
        let of_slots = |range: &StoredRange| {
            let mut counts = Vec::new();
            for &slot in range.of(&self.triangle_materials) {
                counts.resize(counts.len().max(slot as usize + 1), 0);
                counts[slot as usize] += 1;
            }
            counts
        };
        let slots: Vec<Vec<usize>> = instances.ranges.iter().map(of_slots).collect();
        for instance in &instances.list {
            let materials = instances.materials_of(instance);
            for (n, material_ix) in slots[instance.geometry_ix as usize].iter().zip(materials) {
                counts[*material_ix as usize] += n;
            }
        }
        counts
    }

    /// Returns the indices of the world's triangles whose materials are wanted, in their order. `is_wanted`: for each
    /// material.
    pub(super) fn triangles_with(&self, is_wanted: &[bool]) -> Vec<usize> {
        let Some(instances) = &self.instances else {
            let all = self.triangle_materials.par_iter().enumerate();
            return all.filter(|(_, ix)| is_wanted[**ix as usize]).map(|(triangle_ix, _)| triangle_ix).collect();
        };
        let of_instance = |instance: &Instance| {
            let first = instance.first_triangle as usize;
            let slots = instances.ranges[instance.geometry_ix as usize].of(&self.triangle_materials);
            let materials = instances.materials_of(instance);
            // Most instances have no such material at all.
            if !materials.iter().any(|material| is_wanted[*material as usize]) {
                return Vec::new();
            }
            let is_wanted = |slot: u32| is_wanted[materials[slot as usize] as usize];
            slots.iter().enumerate().filter(|(_, slot)| is_wanted(**slot)).map(|(ix, _)| first + ix).collect()
        };
        instances.list.par_iter().flat_map_iter(|it| -> Vec<usize> { of_instance(it) }).collect()
    }

    /// Returns the index of the material of a triangle of the world.
    pub fn material_ix_of(&self, triangle_ix: usize) -> u32 {
        let Stored { row, instance } = self.stored(triangle_ix);
        let word = self.triangle_materials[row];
        match (instance, &self.instances) {
            (Some(instance), Some(all)) => all.materials[(instance.first_material + word) as usize],
            _ => word,
        }
    }

    /// Returns whether camera rays pass through the back faces of some materials.
    pub(crate) fn has_single_sided(&self) -> bool {
        self.materials.iter().any(Material::is_single_sided)
    }

    /// Returns whether rays pass straight through some surfaces that are neither clear nor opaque.
    pub(crate) fn has_blended(&self) -> bool {
        let is_blended = |material: &Material| material.d < 1.0 && material.flags & MATERIAL_REFRACT == 0;
        self.textures.has_blended() || self.materials.iter().any(is_blended)
    }

    /// Returns the smallest and the largest coordinates of all triangles, world units; with instances, those of boxes
    /// around them. Without triangles these are infinity and minus infinity.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let triangles = &self.triangles[..];
        let Some(instances) = &self.instances else { return bounds_of(triangles) };
        let boxes: Vec<_> = instances.ranges.par_iter().map(|range| bounds_of(range.of(triangles))).collect();
        instances.bounds(&boxes)
    }
}

/// Returns the least and the greatest coordinates of triangles.
pub(super) fn bounds_of(triangles: &[Triangle]) -> (Vec3, Vec3) {
    let corners = triangles.iter().flat_map(|t| [t.v0, t.v1, t.v2]);
    corners.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(min, max), p| (min.min(p), max.max(p)))
}

/// The triangles that are stored, and the word of each that leads to its material.
#[derive(Default)]
pub(super) struct Parts {
    pub triangles: Vec<Triangle>,
    pub materials: Vec<u32>,
}

impl Parts {
    /// Appends the triangles of a mesh. `instance_ix`: the instance that an error names.
    pub fn push(&mut self, mesh: &Mesh, transform: &Transform, instance_ix: usize) -> Result<(), Mismatch> {
        push_triangles(mesh, transform, &mut self.triangles)
            .map_err(|what| Mismatch::Instance { instance: instance_ix, what })
    }
}

/// Checks each instance, and each mesh that has one.
fn check_instances(scene: &Scene) -> Result<(), Mismatch> {
    let mut is_checked = vec![false; scene.meshes.len()];
    for (instance_ix, instance) in scene.instances.iter().enumerate() {
        let mesh = scene.meshes.get(instance.mesh_ix).ok_or(Mismatch::Mesh { instance: instance_ix })?;
        let wrong = |what| Mismatch::Instance { instance: instance_ix, what };
        if instance.materials.is_empty() && !mesh.faces.is_empty() {
            return Err(wrong("it has no material".to_owned()));
        }
        if !std::mem::replace(&mut is_checked[instance.mesh_ix], true) {
            mesh.check().map_err(|what| wrong(format!("its mesh {what}")))?;
        }
    }
    Ok(())
}

/// Returns the order of a face's corners in the world. A mirroring transform reverses the winding, so two corners are
/// swapped.
pub(super) fn corners_of(transform: &Transform) -> [usize; 3] {
    if transform.mirrors() { [0, 2, 1] } else { [0, 1, 2] }
}

/// Appends a world-space triangle for each face, in the order of the faces.
fn push_triangles(mesh: &Mesh, transform: &Transform, triangles: &mut Vec<Triangle>) -> Result<(), String> {
    let world = mesh.placed(transform)?;
    let encoded = |n: Vec3| match transform.normal(n) {
        Vec3::ZERO => FLAT_NORMAL,
        normal => encode_octahedral(normal),
    };
    let [a, b, c] = corners_of(transform);
    let triangle = |(face, normals): (&[u32; 3], &[Vec3; 3])| Triangle {
        v0: world[face[a] as usize],
        n0: encoded(normals[a]),
        v1: world[face[b] as usize],
        n1: encoded(normals[b]),
        v2: world[face[c] as usize],
        n2: encoded(normals[c]),
    };
    triangles.par_extend(mesh.faces.par_iter().zip(&mesh.normals).map(triangle));
    Ok(())
}

impl Material {
    /// Returns whether camera rays pass through the back faces of the surface.
    pub(crate) fn is_single_sided(&self) -> bool {
        self.flags & MATERIAL_SINGLE_SIDED != 0
    }
}

impl From<&scene::Material> for Material {
    fn from(material: &scene::Material) -> Self {
        let &scene::Material { kd, d, ks, ni, ke, is_unlit, microfacet, alpha, clearcoat, sheen, .. } = material;
        let unlit = if is_unlit { MATERIAL_UNLIT } else { 0 };
        let sides = if material.is_double_sided { 0 } else { MATERIAL_SINGLE_SIDED };
        let d = if alpha == Alpha::Blend { d } else { 1.0 };
        let layers = Self {
            clearcoat: clearcoat.factor,
            clearcoat_roughness: clearcoat.roughness,
            sheen_colour: sheen.colour,
            sheen_roughness: sheen.roughness,
            ..Self::default()
        };
        let Some(microfacet) = microfacet else {
            let &scene::Material { ka, tf, ns, lobes, .. } = material;
            return Self { ka, ns, kd, d, ks, ni, ke, flags: flags_of(lobes) | unlit | sides, tf, ..layers };
        };
        let Microfacet { metallic, roughness, transmission, is_solid, conductor, has_single_scattering, .. } =
            microfacet;
        let flag = |is_set: bool, flag: u32| if is_set { flag } else { 0 };
        let solid = flag(is_solid, MATERIAL_SOLID);
        let single = flag(has_single_scattering, MATERIAL_SINGLE_SCATTERING);
        let conductor_flag = flag(conductor.is_some(), MATERIAL_CONDUCTOR);
        let Conductor { eta, k } = conductor.unwrap_or_default();
        Self {
            ka: Vec3::ONE,
            ns: 1.0,
            kd,
            d,
            ks,
            ni,
            ke,
            flags: MATERIAL_MICROFACET | unlit | sides | solid | single | conductor_flag,
            tf: Vec3::ONE,
            transmission,
            absorption: absorption(&microfacet),
            metallic,
            roughness,
            conductor_eta: eta,
            conductor_k: k,
            ..layers
        }
    }
}

/// Returns the coefficients of absorption by which light has the attenuation colour after the attenuation distance, per
/// world unit (Beer's law).
fn absorption(microfacet: &Microfacet) -> Vec3 {
    let Microfacet { attenuation_colour, attenuation_distance, .. } = *microfacet;
    if attenuation_distance.is_infinite() {
        return Vec3::ZERO;
    }
    // Black would absorb at once; 2^-24 is darker than what a display shows.
    -attenuation_colour.max(Vec3::splat(f32::EPSILON / 2.0)).ln() / attenuation_distance
}

/// Returns the flags of a [`Material`].
fn flags_of(lobes: Lobes) -> u32 {
    let flag = |is_set: bool, flag: u32| if is_set { flag } else { 0 };
    flag(lobes.highlight, MATERIAL_SPECULAR)
        | flag(lobes.reflection, MATERIAL_REFLECT)
        | flag(lobes.refraction, MATERIAL_REFRACT)
        | flag(lobes.fresnel, MATERIAL_FRESNEL)
}

/// Returns the lights of a scene that have no area, and its sun.
pub(super) fn flat_lights(scene: &Scene) -> Vec<Light> {
    let sun = scene.sky.filter(|sky| sky.has_sun).map(|sky| sky.sun());
    scene.lights.iter().chain(&sun).filter_map(flat_light).collect()
}

/// Returns the lights of a scene that have an area.
pub(super) fn area_lights(scene: &Scene) -> Vec<AreaLight> {
    scene.lights.iter().filter_map(area_light).collect()
}

/// Returns a light as kernels read it, or `None` if it has an area.
fn flat_light(light: &scene::Light) -> Option<Light> {
    Some(match *light {
        scene::Light::Point { position, intensity } => {
            Light { position, kind: LIGHT_POINT, intensity, ..Light::default() }
        }
        scene::Light::Spot { position, towards, intensity, inner_cos, outer_cos } => {
            Light { position, kind: LIGHT_SPOT, intensity, inner_cos, axis: towards, outer_cos }
        }
        scene::Light::Directional { towards, irradiance } => {
            Light { position: towards, kind: LIGHT_DIRECTIONAL, intensity: irradiance, ..Light::default() }
        }
        scene::Light::Sun { towards, irradiance, angle_degrees } => {
            let outer_cos = f64::from(angle_degrees / 2.0).to_radians().cos() as f32;
            Light { position: towards, kind: LIGHT_DIRECTIONAL, intensity: irradiance, outer_cos, ..Light::default() }
        }
        scene::Light::Rectangle { .. } | scene::Light::Disk { .. } | scene::Light::Sphere { .. } => return None,
    })
}

/// Returns a light that has an area, as kernels read it. A light without area or radiance is left out.
fn area_light(light: &scene::Light) -> Option<AreaLight> {
    let of_disk = |axis: Vec3| axis.any_orthonormal_pair();
    let made = match *light {
        scene::Light::Rectangle { position, edge_u, edge_v, radiance } => {
            let doubled = edge_u.cross(edge_v);
            let (axis, area) = (doubled.normalize_or_zero(), 4.0 * doubled.length());
            let kind = AREA_RECTANGLE;
            AreaLight { position, kind, radiance, axis, area, edge_u, edge_v, ..AreaLight::default() }
        }
        scene::Light::Disk { position, towards: axis, radius, radiance } => {
            let ((edge_u, edge_v), area) = (of_disk(axis), PI * radius * radius);
            let kind = AREA_DISK;
            AreaLight { position, kind, radiance, radius, axis, area, edge_u, edge_v, ..AreaLight::default() }
        }
        scene::Light::Sphere { position, radius, radiance } => {
            let area = 4.0 * PI * radius * radius;
            AreaLight { position, kind: AREA_SPHERE, radiance, radius, area, ..AreaLight::default() }
        }
        _ => return None,
    };
    (!light.is_black()).then_some(made)
}
