//! A scene: everything that a frame shows.

use std::{collections::BTreeMap, path::Path, sync::Arc};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{
    AnimationInfo, Camera, ChosenLight, Environment, Ground, Image, Light, Material, Mesh, RenderDefaults, Sky,
    Transform,
    deformation::PosedMesh,
    load_options::find_named,
    mesh::{bounds_of, corners_of},
};

/// Name of the material of meshes and faces that name none.
pub(crate) const DEFAULT_MATERIAL: &str = "(default)";
/// The most triangles of all instances of a scene: kernels have so many indices.
pub(crate) const MOST_TRIANGLES: u64 = 1 << 31;
/// Name of the material of the ground below a mesh.
pub(crate) const GROUND: &str = "(ground)";

/// Everything that a frame shows. World space is right-handed, +y up by default.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// The file's name without its folder and extension.
    pub name: String,
    /// The point of the file that is the origin of world space, in the file's coordinates. It is 0, unless the scene
    /// was moved there ([`LoadOptions::recentre`](super::LoadOptions::recentre)).
    pub origin: DVec3,
    /// Meshes, each of which may have several instances.
    pub meshes: Vec<Mesh>,
    /// Placed meshes. A loaded scene has at least one triangle, all triangles lie within `mesh::MAX_COORDINATE`, and
    /// their bounding box has a side of [`MIN_EXTENT`](super::MIN_EXTENT) or more.
    pub instances: Vec<Instance>,
    /// Materials, to which the instances refer by index.
    pub materials: Vec<Material>,
    /// Images, to which the materials' textures refer by index.
    pub images: Vec<Image>,
    /// Lights, possibly none.
    pub lights: Vec<Light>,
    /// Which lights were chosen, if the file has none and the user has not chosen any.
    pub chosen_light: Option<ChosenLight>,
    /// The image of what is seen beyond the scene; without one, that is `background`. Only the path tracer knows it.
    pub environment: Option<Environment>,
    /// The sky and its sun. Paths: replaces `environment`. Whitted: only the sun is used.
    pub sky: Option<Sky>,
    /// Horizontal unit vector to the viewer of the built-in studio environment (a bright ceiling and three soft boxes),
    /// which reflections see and camera rays do not; `None` for no studio.
    pub studio: Option<Vec3>,
    /// The camera that renders the scene unless another one is set.
    pub camera: Camera,
    /// Whether the camera is kdray's choice, since the file has none.
    pub chosen_camera: bool,
    /// The cameras of the scene's file with their names, possibly none.
    pub cameras: Vec<(String, Camera)>,
    /// The animations of the scene's file, possibly none.
    pub animations: Vec<AnimationInfo>,
    /// Irradiance that every point receives, linear RGB. The material's `ka` weights it. If there is a `ground`, this
    /// is the irradiance of surfaces that face up.
    pub ambient: Vec3,
    /// The ambient light from below, if it is not that of all sides.
    pub ground: Option<Ground>,
    /// Radiance of rays that leave the scene, linear RGB.
    pub background: Vec3,
    /// The options that the scene is rendered with unless others are set.
    pub defaults: RenderDefaults,
}

/// Kinds of rays that meet an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RayKinds {
    /// Rays from the camera.
    pub camera: bool,
    /// Rays to lights.
    pub shadow: bool,
    /// All others: reflected, refracted and scattered rays, and those of a cast.
    pub other: bool,
}

impl RayKinds {
    /// All rays.
    pub const ALL: Self = Self { camera: true, shadow: true, other: true };
}

impl Default for RayKinds {
    fn default() -> Self {
        Self::ALL
    }
}

/// A mesh that is placed in the world.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Instance {
    /// Index into the scene's meshes.
    pub mesh_ix: usize,
    /// Transform from object space to world space.
    pub transform: Transform,
    /// Indices into the scene's materials, at least one. A face of slot i has the material at index
    /// `i % materials.len()` of this list.
    pub materials: Vec<u32>,
    /// The rays that meet the instance. Where not all rays do, the scene's instances must be kept.
    pub rays: RayKinds,
}

impl Scene {
    /// Makes one of [`Scene::cameras`] the scene's camera: the first one of this name, or else the one of this index.
    pub(crate) fn choose_camera(&mut self, name: &str) -> Result<(), String> {
        let names: Vec<_> = self.cameras.iter().map(|(name, _)| Some(&**name)).collect();
        self.camera = self.cameras[find_named("camera", name, &names, "the file names no cameras")?].1;
        Ok(())
    }

    /// Returns the name of the scene in a file: the file's name without its folder and extension.
    pub fn name_of(path: &Path) -> String {
        path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default()
    }

    /// Returns the number of triangles of all instances.
    pub fn n_triangles(&self) -> usize {
        let mesh_of = |instance: &Instance| self.meshes.get(instance.mesh_ix);
        self.instances.iter().filter_map(mesh_of).map(|mesh| mesh.faces.len()).sum()
    }

    /// Checks that all triangles can have an index, before work that grows with their number.
    ///
    /// # Errors
    /// There are more than 2^31. The error is a message for people.
    pub(crate) fn check_n_triangles(&self) -> Result<(), String> {
        let mesh_of = |instance: &Instance| self.meshes.get(instance.mesh_ix);
        let n: u64 = self.instances.iter().filter_map(mesh_of).map(|mesh| mesh.faces.len() as u64).sum();
        if n > MOST_TRIANGLES {
            Err(format!("a scene of {n} triangles: there may be {MOST_TRIANGLES}"))
        } else {
            Ok(())
        }
    }

    /// Returns the number of triangles of the meshes that have an instance: each counts once, however often it occurs.
    pub fn n_stored(&self) -> usize {
        let mut occurs = vec![false; self.meshes.len()];
        for instance in &self.instances {
            if let Some(occurs) = occurs.get_mut(instance.mesh_ix) {
                *occurs = true;
            }
        }
        self.meshes.iter().zip(&occurs).filter(|(_, occurs)| **occurs).map(|(mesh, _)| mesh.faces.len()).sum()
    }

    /// Returns the smallest and the largest coordinates of all triangles, world space.
    ///
    /// # Panics
    /// An index of a mesh or of a position is out of range.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.bounds_of(&self.instances)
    }

    /// Returns the bounds of some instances.
    pub(crate) fn bounds_of(&self, instances: &[Instance]) -> (Vec3, Vec3) {
        self.posed_bounds(instances, &BTreeMap::new())
    }

    /// Returns the bounds of some instances of meshes, some of which have poses.
    pub(crate) fn posed_bounds(&self, instances: &[Instance], poses: &BTreeMap<usize, Arc<PosedMesh>>) -> (Vec3, Vec3) {
        // Instances share the list of their mesh's corners, in which each point is once.
        let corners = |(ix, mesh): (usize, &Mesh)| match poses.get(&ix) {
            Some(posed) => corners_of(posed.faces(), posed.positions()),
            None => corners_of(&mesh.faces, &mesh.positions),
        };
        let corners: Vec<Vec<Vec3>> = self.meshes.par_iter().enumerate().map(corners).collect();
        let none = || (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let joined = |a: (Vec3, Vec3), b: (Vec3, Vec3)| (a.0.min(b.0), a.1.max(b.1));
        let of_instance = |Instance { mesh_ix, transform, .. }: &Instance| {
            bounds_of(corners[*mesh_ix].par_iter().map(|p| transform.point(*p)))
        };
        instances.par_iter().map(of_instance).reduce(none, joined)
    }

    /// Adds a mesh and one instance of it. `materials` becomes [`Instance::materials`].
    ///
    /// # Errors
    /// The mesh reaches beyond `mesh::MAX_COORDINATE` in world space. The error is a message for people.
    pub(crate) fn push_mesh(&mut self, mesh: Mesh, transform: Transform, materials: Vec<u32>) -> Result<(), String> {
        mesh.check_place(&transform, mesh.bounds())?;
        self.instances.push(Instance { mesh_ix: self.meshes.len(), transform, materials, rays: RayKinds::ALL });
        self.meshes.push(mesh);
        Ok(())
    }

    /// Returns a scene without meshes, materials and lights, to fill by a program. Its name is that of a file
    /// ([`Scene::name_of`]). Its camera is a placeholder, at the origin: it looks along -z.
    pub fn empty(path: &Path) -> Self {
        Self { name: Self::name_of(path), ..Self::default() }
    }

    /// Adds a material and returns its index.
    pub(crate) fn push_material(&mut self, material: Material) -> u32 {
        self.materials.push(material);
        (self.materials.len() - 1) as u32
    }

    /// Lets the camera see both sides of all surfaces.
    pub(crate) fn show_back_faces(&mut self) {
        self.materials.iter_mut().for_each(|material| material.is_double_sided = true);
    }

    /// Returns the index of the default material, for meshes and faces that name none. Adds it at the first call.
    /// Colours of a mesh are its albedo, so the default material of such a mesh is white.
    pub(crate) fn default_material(&mut self, has_colours: bool) -> u32 {
        let mut default = Material { name: DEFAULT_MATERIAL.to_owned(), ..Material::default() };
        if has_colours {
            (default.ka, default.kd) = (Vec3::ONE, Vec3::ONE);
        }
        let ix = self.materials.iter().position(|material| *material == default);
        ix.map_or_else(|| self.push_material(default), |ix| ix as u32)
    }

    /// Adds the materials of a mesh that came with them. Returns their indices for the slots of the mesh; the last one
    /// is the default material, for faces without one.
    pub(crate) fn push_materials(&mut self, materials: Vec<Material>, mesh: &Mesh) -> Vec<u32> {
        let mut slots: Vec<u32> = materials.into_iter().map(|material| self.push_material(material)).collect();
        slots.push(self.default_material(!mesh.colours.is_empty()));
        slots
    }
}
