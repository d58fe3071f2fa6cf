//! Flat scenes: world-space triangles, and materials and lights as kernels read them.

use std::f32::consts::PI;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{Mismatch, Textures};
use crate::{
    layout::{
        AREA_DISK, AREA_RECTANGLE, AREA_SPHERE, AreaLight, FLAT_NORMAL, LIGHT_DIRECTIONAL, LIGHT_POINT, LIGHT_SPOT,
        Light, MATERIAL_CONDUCTOR, MATERIAL_FRESNEL, MATERIAL_MICROFACET, MATERIAL_REFLECT, MATERIAL_REFRACT,
        MATERIAL_SINGLE_SCATTERING, MATERIAL_SOLID, MATERIAL_SPECULAR, MATERIAL_UNLIT, Material, Triangle,
        normal::encode_octahedral,
    },
    scene::{
        self, Alpha, Camera, Conductor, Environment, Ground, Instance, Lobes, Mesh, Microfacet, RenderDefaults, Scene,
        Sky, Transform,
    },
};

/// Scene as it is traced: everything that a frame shows, with all meshes in world space.
#[derive(Clone, Debug, PartialEq)]
pub struct FlatScene {
    /// The scene's name.
    pub name: String,
    /// The point of the scene's file that is the origin of world space ([`Scene::origin`]).
    pub origin: DVec3,
    /// The triangles in world space. Those of the first instance come first, in the order of its mesh's faces, then
    /// those of the next instance.
    pub triangles: Vec<Triangle>,
    /// For each triangle, the index of its material in `materials`.
    pub triangle_materials: Vec<u32>,
    /// The materials.
    pub materials: Vec<Material>,
    /// The name of each material.
    pub material_names: Vec<String>,
    /// The textures, with what leads from triangles to them.
    pub textures: Textures,
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
    /// An index names nothing, arrays have different lengths, an instance with faces has no material, or a vertex is
    /// too far from the origin.
    pub fn new(scene: &Scene) -> Result<Self, Mismatch> {
        let mut triangles = Vec::with_capacity(scene.n_triangles());
        let mut triangle_materials = Vec::with_capacity(triangles.capacity());
        for (instance_ix, instance) in scene.instances.iter().enumerate() {
            let mesh = scene.meshes.get(instance.mesh_ix).ok_or(Mismatch::Mesh { instance: instance_ix })?;
            check(mesh, instance).map_err(|what| Mismatch::Instance { instance: instance_ix, what })?;
            push_triangles(mesh, instance, &mut triangles)
                .map_err(|what| Mismatch::Instance { instance: instance_ix, what })?;
            // An instance with fewer materials than the mesh has slots repeats its materials.
            let material_of = |slot: &u32| instance.materials[*slot as usize % instance.materials.len()];
            triangle_materials.extend(mesh.slots.iter().map(material_of));
        }
        let sky = scene.sky.as_ref().map(Sky::environment);
        let sun = scene.sky.filter(|sky| sky.has_sun).map(|sky| sky.sun());
        Ok(Self {
            name: scene.name.clone(),
            origin: scene.origin,
            triangles,
            triangle_materials,
            materials: scene.materials.iter().map(Material::from).collect(),
            material_names: scene.materials.iter().map(|material| material.name.clone()).collect(),
            textures: Textures::new(scene)?,
            lights: scene.lights.iter().chain(&sun).filter_map(flat_light).collect(),
            area_lights: scene.lights.iter().filter_map(area_light).collect(),
            environment: sky.or_else(|| scene.environment.clone()),
            studio: scene.studio,
            camera: scene.camera,
            ambient: scene.ambient,
            ground: scene.ground,
            background: scene.background,
            defaults: scene.defaults,
        })
    }

    /// Returns the smallest and the largest coordinates of all triangles, world units. Without triangles these are
    /// infinity and minus infinity.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let corners = self.triangles.iter().flat_map(|t| [t.v0, t.v1, t.v2]);
        corners.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(min, max), p| (min.min(p), max.max(p)))
    }
}

/// Checks that a mesh's arrays belong together, and that its faces have a material.
fn check(mesh: &Mesh, instance: &Instance) -> Result<(), String> {
    if instance.materials.is_empty() && !mesh.faces.is_empty() {
        return Err("it has no material".to_owned());
    }
    mesh.check().map_err(|what| format!("its mesh {what}"))
}

/// Returns the order of a face's corners in the world. A mirroring transform reverses the winding, so two corners are
/// swapped.
pub(super) fn corners_of(transform: &Transform) -> [usize; 3] {
    if transform.mirrors() { [0, 2, 1] } else { [0, 1, 2] }
}

/// Appends a world-space triangle for each face, in the order of the faces.
fn push_triangles(mesh: &Mesh, instance: &Instance, triangles: &mut Vec<Triangle>) -> Result<(), String> {
    let transform = &instance.transform;
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

impl From<&scene::Material> for Material {
    fn from(material: &scene::Material) -> Self {
        let &scene::Material { kd, d, ks, ni, ke, is_unlit, microfacet, alpha, clearcoat, sheen, .. } = material;
        let unlit = if is_unlit { MATERIAL_UNLIT } else { 0 };
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
            return Self { ka, ns, kd, d, ks, ni, ke, flags: flags_of(lobes) | unlit, tf, ..layers };
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
            flags: MATERIAL_MICROFACET | unlit | solid | single | conductor_flag,
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
