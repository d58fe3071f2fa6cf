//! A glTF file whose meshes are posed at one moment after the other. The file is read once, and so are the meshes that
//! nothing deforms, and the vertices of others at rest.

use std::{collections::BTreeMap, path::Path, sync::Arc};

use glam::DVec3;
use hashbrown::HashMap;

use super::{
    Document, Known, LoadedBefore, LoadedPose, Loader, MeshKey, Nodes, cameras, has_targets, lights, pointers, read,
    rest_pose::{ReadMesh, ReadMeshes},
};
use crate::scene::{
    formats::mesh_file::{MeshFile, MeshFormat},
    model::{
        AnimationChoice, Instance, LoadOptions, Mesh, Scene, SceneError,
        deformation::{ChangedMeshes, PosedMesh},
    },
};

/// The meshes of a moment that may be deformed.
struct Deformed {
    /// The index of the first one.
    n_known: usize,
    meshes: Vec<Mesh>,
    /// What some of them are made of, by their indices.
    poses: HashMap<usize, LoadedPose>,
}

/// A glTF file that can be posed.
pub(crate) struct Poser {
    document: Document,
    options: LoadOptions,
    /// All meshes, at the first moment.
    meshes: Vec<Mesh>,
    /// The file's meshes without skins and morph targets, by key.
    rigid: HashMap<MeshKey, Option<Known>>,
    /// The rest poses of the meshes with skins or morph targets.
    read: ReadMeshes,
    /// The rest poses of the scene's meshes that are posed, by the index of the mesh.
    posed: BTreeMap<usize, Arc<ReadMesh>>,
    /// The last poses of the same meshes.
    poses: BTreeMap<usize, Arc<PosedMesh>>,
    /// The number of the file's instances.
    n_instances: usize,
    /// Whether the scene's lights are the file's, and which of the file's cameras is the scene's.
    has_lights: bool,
    camera_ix: Option<usize>,
}

impl Poser {
    /// Takes a file, whose scene at the moment of the options is known. Returns `None` if it is no glTF file, if its
    /// animations change materials, or if the scene's instances are not the file's.
    pub fn new(file: MeshFile, options: &LoadOptions, scene: &Scene) -> Option<Self> {
        if file.format != MeshFormat::Gltf {
            return None;
        }
        let document = read(file, options).ok()?;
        if pointers::change_materials(&document) {
            return None;
        }
        let nodes = Nodes::new(&document, options).ok()?;
        let mut loader = Loader::new(&document, &nodes, LoadedBefore::default(), None);
        loader.read = Some(ReadMeshes::default());
        let first = loader.instances().ok()?;
        let Loader { meshes, poses: loaded, known, read, .. } = loader;
        let n_faces = |instance: &Instance| match loaded.get(&instance.mesh_ix) {
            Some(it) => it.posed.faces().len(),
            None => meshes[instance.mesh_ix].faces.len(),
        };
        let is_same = |(now, before): (&Instance, &Instance)| {
            let place = before.transform.moved(-scene.origin);
            (before.transform == now.transform || place == now.transform)
                && n_faces(before) == scene.meshes[now.mesh_ix].faces.len()
        };
        // The scene may have a ground besides.
        let fits = first.len() <= scene.instances.len() && scene.instances.iter().zip(&first).all(is_same);
        let has_lights = lights::lights(&document, &nodes, scene.origin) == scene.lights;
        let camera_ix = scene.cameras.iter().position(|(_, camera)| *camera == scene.camera);
        let has_targets = |mesh_ix: usize| document.root.meshes[mesh_ix].primitives.iter().any(has_targets);
        let rigid = known.into_iter().filter(|((mesh_ix, skin, ..), _)| skin.is_none() && !has_targets(*mesh_ix));
        let (rigid, options, n_instances) = (rigid.collect(), options.clone(), first.len());
        if !fits {
            return None;
        }
        let mut read = read.unwrap_or_default();
        let (mut posed, mut poses) = (BTreeMap::new(), BTreeMap::new());
        let mesh_ixs: BTreeMap<usize, usize> =
            first.iter().zip(&scene.instances).map(|(of_file, of_scene)| (of_scene.mesh_ix, of_file.mesh_ix)).collect();
        for (scene_ix, mesh_ix) in mesh_ixs {
            let Some(it) = loaded.get(&mesh_ix) else { continue };
            // The scene may have tangents that the file lacks.
            if it.makes(&scene.meshes[scene_ix]) {
                posed.insert(scene_ix, it.read.clone());
                poses.insert(scene_ix, it.posed.clone());
            } else {
                read.insert(it.key, Some(Arc::new(ReadMesh { faces: None, ..ReadMesh::clone(&it.read) })));
            }
        }
        Some(Self { document, options, meshes, rigid, read, posed, poses, n_instances, has_lights, camera_ix })
    }

    /// Chooses the animations that further moments show.
    pub fn set_animation(&mut self, animation: AnimationChoice) {
        self.options.animation = animation;
    }

    /// Poses a scene of the file at a moment, seconds. Returns the meshes that are deformed, or `None` if the moment
    /// has other meshes or instances, and the file must be read again: such as where a node flattens its mesh, or two
    /// nodes weigh the targets of one mesh differently.
    pub fn pose(&mut self, seconds: f64, scene: &mut Scene) -> Result<Option<ChangedMeshes>, SceneError> {
        let options = LoadOptions { at: Some(seconds), ..self.options.clone() };
        let failed = |what: String| SceneError::file(Path::new(&scene.name), what);
        pointers::apply(&mut self.document, &options).map_err(failed)?;
        let nodes = Nodes::new(&self.document, &options).map_err(failed)?;
        let n_known = self.meshes.len();
        let mut loader = Loader::new(&self.document, &nodes, LoadedBefore::default(), None);
        (loader.meshes, loader.known) = (std::mem::take(&mut self.meshes), self.rigid.clone());
        loader.read = Some(std::mem::take(&mut self.read));
        let instances = loader.instances();
        let Loader { mut meshes, poses, read, .. } = loader;
        let deformed = Deformed { n_known, meshes: meshes.split_off(n_known), poses };
        (self.meshes, self.read) = (meshes, read.unwrap_or_default());
        let Some(changed) = instances.ok().and_then(|now| self.put(&now, deformed, scene)) else {
            return Ok(None);
        };
        if self.has_lights {
            scene.lights = lights::lights(&self.document, &nodes, scene.origin);
        }
        let bounds = || scene.posed_bounds(&scene.instances, &self.poses);
        scene.cameras = cameras::cameras(&self.document, &nodes, (bounds, scene.origin));
        if let Some((_, camera)) = self.camera_ix.and_then(|ix| scene.cameras.get(ix)) {
            scene.camera = *camera;
        }
        Ok(Some(changed))
    }

    /// Gives a scene the places and meshes of a moment.
    fn put(&mut self, now: &[Instance], deformed: Deformed, scene: &mut Scene) -> Option<ChangedMeshes> {
        if now.len() != self.n_instances {
            return None;
        }
        // For each mesh of the scene, the one that stands for it.
        let mut mesh_of = HashMap::new();
        let is_same = |(ix, now): (usize, &Instance)| {
            let scene_ix = scene.instances[ix].mesh_ix;
            *mesh_of.entry(scene_ix).or_insert(now.mesh_ix) == now.mesh_ix
        };
        if !now.iter().enumerate().all(is_same) {
            return None;
        }
        for (&scene_ix, mesh_ix) in mesh_of.iter().filter(|(_, mesh_ix)| **mesh_ix >= deformed.n_known) {
            let is_known = match deformed.poses.get(mesh_ix) {
                Some(it) => self.posed.get(&scene_ix).is_some_and(|read| Arc::ptr_eq(read, &it.read)),
                None => has_faces_of(&deformed.meshes[mesh_ix - deformed.n_known], &scene.meshes[scene_ix]),
            };
            if !is_known {
                return None;
            }
        }
        for (instance, now) in scene.instances.iter_mut().zip(now) {
            instance.transform = match scene.origin {
                DVec3::ZERO => now.transform.clone(),
                origin => now.transform.moved(-origin),
            };
        }
        let mut changed = ChangedMeshes::new();
        for (scene_ix, mesh_ix) in mesh_of {
            let (before, Some(ix)) = (&mut scene.meshes[scene_ix], mesh_ix.checked_sub(deformed.n_known)) else {
                continue;
            };
            let mesh = &deformed.meshes[ix];
            match deformed.poses.get(&mesh_ix).map(|it| it.posed.clone()) {
                Some(posed) if self.poses[&scene_ix].pose() != posed.pose() => {
                    self.poses.insert(scene_ix, posed.clone());
                    changed.insert(scene_ix, Some(posed));
                }
                Some(_) => {}
                None if before.positions != mesh.positions || before.normals != mesh.normals => {
                    before.clone_from(mesh);
                    changed.insert(scene_ix, None);
                }
                None => {}
            }
        }
        if changed.values().any(Option::is_none) {
            scene.add_tangents().ok()?;
        }
        Some(changed)
    }
}

impl LoadedPose {
    /// Whether a mesh of a scene is this one in its pose.
    fn makes(&self, mesh: &Mesh) -> bool {
        let mut own = self.read.rest.mesh.clone();
        self.posed.deform(&mut own);
        own.name.clone_from(&mesh.name);
        own.deforms = mesh.deforms;
        own == *mesh
    }
}

/// Whether the faces of two meshes are the same but for their places.
fn has_faces_of(a: &Mesh, b: &Mesh) -> bool {
    a.faces == b.faces && a.slots == b.slots && a.uvs == b.uvs && a.colours == b.colours
}
