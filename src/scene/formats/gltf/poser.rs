//! A glTF file whose meshes are posed at one moment after the other. The file is read once, and so are the meshes that
//! nothing deforms, and the vertices of others at rest.

use std::path::Path;

use glam::DVec3;
use hashbrown::HashMap;

use super::{Document, Known, LoadedBefore, Loader, MeshKey, Nodes, cameras, lights, pointers, read, rest::ReadMeshes};
use crate::scene::{
    formats::mesh_file::{MeshFile, MeshFormat},
    model::{AnimationChoice, Instance, LoadOptions, Mesh, Scene, SceneError},
};

/// A glTF file that can be posed.
pub(crate) struct Poser {
    document: Document,
    options: LoadOptions,
    /// The meshes at the first moment.
    meshes: Vec<Mesh>,
    /// Those of them that no skin and no morph target deforms.
    rigid: HashMap<MeshKey, Option<Known>>,
    /// What has been read of the others.
    read: ReadMeshes,
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
        let first = loader.instances().ok()?;
        let Loader { meshes, known, .. } = loader;
        let n_faces = |instance: &Instance| meshes[instance.mesh_ix].faces.len();
        let is_same = |(now, before): (&Instance, &Instance)| {
            let place = before.transform.moved(-scene.origin);
            (before.transform == now.transform || place == now.transform)
                && n_faces(before) == scene.meshes[now.mesh_ix].faces.len()
        };
        // The scene may have a ground besides.
        let fits = first.len() <= scene.instances.len() && scene.instances.iter().zip(&first).all(is_same);
        let has_lights = lights::lights(&document, &nodes, scene.origin) == scene.lights;
        let camera_ix = scene.cameras.iter().position(|(_, camera)| *camera == scene.camera);
        let rigid = known.into_iter().filter(|((_, skin, _, weights), _)| skin.is_none() && weights.is_empty());
        let (rigid, read, options) = (rigid.collect(), ReadMeshes::default(), options.clone());
        let n_instances = first.len();
        fits.then_some(Self { document, options, meshes, rigid, read, n_instances, has_lights, camera_ix })
    }

    /// Chooses the animations that further moments show.
    pub fn set_animation(&mut self, animation: AnimationChoice) {
        self.options.animation = animation;
    }

    /// Poses a scene of the file at a moment, seconds. Returns the indices of the meshes whose vertices have changed,
    /// or `None` if the moment has other meshes or instances, and the file must be read again: such as where a node
    /// flattens its mesh, or two nodes weigh the targets of one mesh differently.
    pub fn pose(&mut self, seconds: f64, scene: &mut Scene) -> Result<Option<Vec<usize>>, SceneError> {
        let options = LoadOptions { at: Some(seconds), ..self.options.clone() };
        let failed = |what: String| SceneError::file(Path::new(&scene.name), what);
        pointers::apply(&mut self.document, &options).map_err(failed)?;
        let nodes = Nodes::new(&self.document, &options).map_err(failed)?;
        let n_known = self.meshes.len();
        let mut loader = Loader::new(&self.document, &nodes, LoadedBefore::default(), None);
        (loader.meshes, loader.known) = (std::mem::take(&mut self.meshes), self.rigid.clone());
        loader.read = Some(std::mem::take(&mut self.read));
        let instances = loader.instances();
        let Loader { mut meshes, read, .. } = loader;
        let deformed = meshes.split_off(n_known);
        (self.meshes, self.read) = (meshes, read.unwrap_or_default());
        let Some(changed) = instances.ok().and_then(|now| self.put(&now, (n_known, deformed), scene)) else {
            return Ok(None);
        };
        if self.has_lights {
            scene.lights = lights::lights(&self.document, &nodes, scene.origin);
        }
        scene.cameras = cameras::cameras(&self.document, &nodes, (scene.bounds(), scene.origin));
        if let Some((_, camera)) = self.camera_ix.and_then(|ix| scene.cameras.get(ix)) {
            scene.camera = *camera;
        }
        Ok(Some(changed))
    }

    /// Gives a scene the places and meshes of a moment. Of `deformed`, the first mesh has the index `n_known`.
    fn put(&self, now: &[Instance], (n_known, deformed): (usize, Vec<Mesh>), scene: &mut Scene) -> Option<Vec<usize>> {
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
        let of_new = |(&scene_ix, &mesh_ix): (&usize, &usize)| Some((scene_ix, mesh_ix.checked_sub(n_known)?));
        let mut new: Vec<(usize, usize)> = mesh_of.iter().filter_map(of_new).collect();
        new.sort_unstable();
        if new.iter().any(|(scene_ix, ix)| !has_faces_of(&deformed[*ix], &scene.meshes[*scene_ix])) {
            return None;
        }
        for (instance, now) in scene.instances.iter_mut().zip(now) {
            instance.transform = match scene.origin {
                DVec3::ZERO => now.transform.clone(),
                origin => now.transform.moved(-origin),
            };
        }
        let mut changed = Vec::new();
        for (scene_ix, ix) in new {
            let (before, mesh) = (&mut scene.meshes[scene_ix], &deformed[ix]);
            if before.positions != mesh.positions || before.normals != mesh.normals {
                before.clone_from(mesh);
                changed.push(scene_ix);
            }
        }
        scene.add_tangents().ok()?;
        Some(changed)
    }
}

/// Whether the faces of two meshes are the same but for their places.
fn has_faces_of(a: &Mesh, b: &Mesh) -> bool {
    a.faces == b.faces && a.slots == b.slots && a.uvs == b.uvs && a.colours == b.colours
}
