//! glTF 2.0: `.gltf` and `.glb`.
//!
//! A glTF mesh becomes a mesh, each of its primitives one slot of it. A node with a mesh becomes an instance. Skins and
//! morph targets are shown in the pose that the file gives, or that its animations have at a moment: such a mesh has a
//! copy for each pose. Points and lines are not shown.
//!
//! The crate `gltf` parses the JSON. All indices, sizes and offsets are checked here, since its own readers panic on
//! files that are wrong. Errors name the JSON path.

mod accessor;
mod animation;
mod cameras;
mod deform;
mod document;
mod draco;
mod geometry;
mod glb;
mod glossiness;
mod instancing;
mod lenient;
mod lights;
mod materials;
mod meshopt;
mod nodes;
mod pointers;
mod poser;
mod rest_pose;
mod textures;
mod uri;

use std::{path::Path, sync::Arc};

use glam::{DVec3, Vec3};
use gltf::json::{Node, mesh::Primitive};
use hashbrown::{HashMap, HashSet};
use rayon::prelude::*;

use self::{
    deform::{Skin, Weights},
    document::{Document, item},
    geometry::{Part, Reading},
    instancing::Places,
    materials::Materials,
    nodes::Nodes,
    rest_pose::{Posed, ReadMesh, ReadMeshes, RestKey, posed},
};
pub(crate) use self::{document::named_files, poser::Poser};
use super::{image::MAX_PIXELS, mesh_file::MeshFile};
use crate::{
    scene::model::{
        AnimationChoice, AnimationInfo, Camera, Instance, Light, LoadOptions, MaterialChoice, Mesh, Scene, SceneError,
        Transform, Up,
        deformation::PosedMesh,
        error::Checked,
        extent,
        lacks::{Lacks, SAMPLES},
        mesh::{bounds_of, check_place},
    },
    util::{
        progress::{Meter, Work},
        text::one_line,
    },
};

/// Loads a glTF file as a scene with its lights and cameras.
pub(crate) fn load(file: MeshFile, options: &LoadOptions) -> Result<(Scene, Lacks), SceneError> {
    let document = read(file, options)?;
    let (path, failed) = (&*document.source.path, |what: String| document.source.error(what));
    let nodes = Nodes::new(&document, options).map_err(failed)?;
    let replaced = &options.look.materials[..];
    let mut scene =
        Loader::new(&document, &nodes, LoadedBefore::default(), Some(replaced)).load(path).map_err(failed)?;
    if options.recentre {
        extent::recentre(path, &mut scene);
    }
    let bounds = scene.bounds();
    extent::check(path, bounds)?;
    scene.lights = lights::lights(&document, &nodes, scene.origin);
    scene.animations = animation::infos(&document);
    scene.cameras = cameras::cameras(&document, &nodes, (|| bounds, scene.origin));
    let first = camera_that_sees(path, &scene, (bounds, options));
    let lacks_camera = first.is_none();
    scene.camera = first.unwrap_or(scene.camera);
    // The light of emissive surfaces does not reach others. Some exporters write lights of intensity 0.
    let lacks_light = scene.lights.iter().all(Light::is_black);
    scene.defaults.is_metered = !lacks_light;
    scene.defaults.samples = SAMPLES;
    document.warnings().iter().for_each(|warning| tracing::warn!("{warning}"));
    let lacks = Lacks { camera: lacks_camera, light: lacks_light, background: lacks_light, ..Lacks::all(Up::Y) };
    Ok((scene, lacks))
}

/// Returns the first camera whose picture can show something of the scene. A note tells of cameras before it.
fn camera_that_sees(path: &Path, scene: &Scene, (bounds, options): ((Vec3, Vec3), &LoadOptions)) -> Option<Camera> {
    let aspect = options.aspect.unwrap_or(scene.defaults.width as f32 / scene.defaults.height as f32);
    let ix = scene.cameras.iter().position(|(_, camera)| camera.may_see(bounds, aspect));
    if let (Some((name, _)), None | Some(1..)) = (scene.cameras.first(), ix) {
        let (path, name) = (path.display(), one_line(name));
        let taken =
            ix.map_or("one is chosen".to_owned(), |ix| format!("`{}` is taken", one_line(&scene.cameras[ix].0)));
        tracing::info!("{path}: the first camera, `{name}`, sees nothing of the scene: {taken}; --camera 0 keeps it");
    }
    ix.map(|ix| scene.cameras[ix].1)
}

/// What a scene has before a glTF file is loaded.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LoadedBefore {
    pub n_triangles: u64,
    /// Number of pixels of all images.
    pub n_pixels: u64,
}

impl LoadedBefore {
    /// Whether the images of a scene are too many beside those that there are.
    pub fn exceeds(&self, scene: &Scene) -> bool {
        let n_pixels =
            scene.images.iter().map(|image| image.pixels.len() as u64).fold(self.n_pixels, u64::saturating_add);
        self.n_pixels > 0 && n_pixels > MAX_PIXELS
    }
}

/// The meshes of a glTF file.
pub(crate) struct Model {
    /// Instances, materials, images and what is known of animations, without lights and cameras.
    pub scene: Scene,
    /// What the user has to be told of the file.
    pub warnings: Vec<String>,
}

/// Loads the meshes of a scene of a glTF file with their materials and images, without its lights and cameras. If
/// `has_materials` is false, the materials and images are left out, and the instances' materials have no meaning.
/// `options` name the scene.
pub(crate) fn load_meshes(
    file: MeshFile,
    options: &LoadOptions,
    has_materials: bool,
    before: LoadedBefore,
) -> Result<Model, SceneError> {
    let document = read(file, options)?;
    let (path, failed) = (&*document.source.path, |what: String| document.source.error(what));
    let nodes = Nodes::new(&document, options).map_err(failed)?;
    let replaced = has_materials.then_some(&options.look.materials[..]);
    let mut scene = Loader::new(&document, &nodes, before, replaced).load(path).map_err(failed)?;
    scene.animations = animation::infos(&document);
    Ok(Model { scene, warnings: document.warnings() })
}

/// Returns what is known of all animations of a file, without its meshes.
pub(crate) fn animations(file: MeshFile, options: &LoadOptions) -> Result<Vec<AnimationInfo>, SceneError> {
    let options = LoadOptions { at: None, animation: AnimationChoice::All, ..options.clone() };
    Ok(animation::infos(&read(file, &options)?))
}

fn read(MeshFile { source, bytes, .. }: MeshFile, options: &LoadOptions) -> Result<Document, SceneError> {
    let mut document = Document::read(source.clone(), bytes).map_err(|what| source.error(what))?;
    document.progress = options.progress.clone();
    pointers::apply(&mut document, options).map_err(|what| source.error(what))?;
    Ok(document)
}

/// Begins the warning that lists nodes which flatten their meshes.
const FLATTENED: &str = "meshes that their nodes flatten, which are left out";

/// What makes two instances share a mesh: the mesh's index, the skin's, whether its faces are turned, and the bits of
/// the weights of morph targets.
type MeshKey = (usize, Option<usize>, bool, Vec<u32>);

/// A mesh that has been made.
#[derive(Clone)]
struct Known {
    mesh_ix: usize,
    materials: Vec<u32>,
    /// Whether its vertices are in world space, where a skin moves them.
    is_skinned: bool,
    /// The point of world space that is the origin of a mesh with a skin.
    origin: DVec3,
}

/// A mesh in a pose, and what was read of it.
#[derive(Clone)]
struct LoadedPose {
    posed: Arc<PosedMesh>,
    key: RestKey,
    read: Arc<ReadMesh>,
}

fn has_targets(primitive: &Primitive) -> bool {
    primitive.targets.as_ref().is_some_and(|targets| !targets.is_empty())
}

/// Loads the meshes of a scene's nodes.
struct Loader<'a> {
    document: &'a Document,
    nodes: &'a Nodes,
    before: LoadedBefore,
    /// Number of triangles of the meshes so far, and of those that were loaded before, with the faces without area that
    /// join strips.
    n_read: u64,
    has_materials: bool,
    materials: Materials<'a>,
    meshes: Vec<Mesh>,
    /// Meshes that are kept as poses, by their indices in `meshes`, where they are empty.
    poses: HashMap<usize, LoadedPose>,
    /// `None` for meshes without triangles.
    known: HashMap<MeshKey, Option<Known>>,
    /// The meshes that have been read, if more poses follow.
    read: Option<ReadMeshes>,
}

impl<'a> Loader<'a> {
    /// `replaced`: which materials are replaced, or `None` to read none of them.
    fn new(
        document: &'a Document,
        nodes: &'a Nodes,
        before: LoadedBefore,
        replaced: Option<&'a [MaterialChoice]>,
    ) -> Self {
        let has_materials = replaced.is_some();
        let materials = Materials::new(document, replaced.unwrap_or_default());
        let n_read = before.n_triangles;
        let (meshes, poses, known, read) = Default::default();
        Self { document, nodes, before, n_read, has_materials, materials, meshes, poses, known, read }
    }

    fn load(mut self, path: &Path) -> Checked<Scene> {
        let mut scene = Scene::empty(path);
        scene.instances = self.instances()?;
        scene.meshes = self.meshes;
        scene.check_n_triangles()?;
        scene.materials = self.materials.materials;
        scene.images = self.materials.textures.decode(&mut scene.materials, self.before.n_pixels);
        Ok(scene)
    }

    /// Adds the meshes of all nodes that are shown. Returns the instances.
    fn instances(&mut self) -> Checked<Vec<Instance>> {
        let mut instances = Vec::new();
        let meter = self.document.progress.begin(Work::Reading, self.n_primitives());
        for &ix in &self.nodes.shown {
            let Some(instance) = self.instance(ix, &meter)? else { continue };
            let positions = match self.poses.get(&instance.mesh_ix) {
                Some(it) => it.posed.positions(),
                None => &self.meshes[instance.mesh_ix].positions,
            };
            let places = self.document.or_left_out(instancing::places(self.document, ix)).flatten();
            let transforms = match &places {
                Some(places) => self.instanced(ix, places),
                None => vec![instance.transform.clone()],
            };
            let bounds = bounds_of(positions.par_iter().copied());
            for transform in transforms {
                let placed = check_place(positions, &transform, bounds).map_err(|what| format!("nodes[{ix}]: {what}"));
                if self.document.or_left_out(placed).is_some() {
                    instances.push(Instance { transform, ..instance.clone() });
                }
            }
        }
        if instances.is_empty() {
            let why = self.document.first_left_out();
            let why = why.unwrap_or_else(|| "points and lines are not shown".to_owned());
            return Err(format!("has no triangles: {why}"));
        }
        Ok(instances)
    }

    /// Returns the transforms of the instances of a node. Those that flatten the mesh are left out.
    fn instanced(&self, node_ix: usize, places: &Places) -> Vec<Transform> {
        let world_from_node = self.nodes.world_from_node(node_ix).unwrap_or_default();
        let place = |ix: usize| self.document.or_left_out(places.node_from_instance(ix));
        let transform = |ix: usize| Transform::of_affine(world_from_node * place(ix)?).ok();
        (0..places.n).filter_map(transform).collect()
    }

    /// Returns the number of the primitives that are read if each mesh is read once.
    fn n_primitives(&self) -> u64 {
        let nodes = self.nodes.shown.iter().filter_map(|ix| self.document.root.nodes[*ix].mesh);
        let meshes: HashSet<usize> = nodes.map(|mesh| mesh.value()).collect();
        let json = |ix: usize| self.document.root.meshes.get(ix);
        meshes.into_iter().filter_map(json).map(|mesh| mesh.primitives.len() as u64).sum()
    }

    /// Returns the instance that a node is, if it has a mesh with triangles. `meter` counts the primitives that are
    /// read.
    fn instance(&mut self, node_ix: usize, meter: &Meter) -> Checked<Option<Instance>> {
        let document = self.document;
        let node = self.nodes.node(document, node_ix);
        let Some(mesh) = node.mesh else { return Ok(None) };
        let world_from_node = self.nodes.world_from_node(node_ix).unwrap_or_default();
        // The joints of a skin place it. Its node does not, but as with every mesh, the node says which side of the
        // faces is outside: Blender writes vertices that are mirrored already below a node that mirrors.
        let is_turned = node.skin.is_some() && world_from_node.determinant() < 0.0;
        let transform = Transform::of_affine(world_from_node).ok();
        if transform.is_none() && node.skin.is_none() {
            document.note(FLATTENED, format!("nodes[{node_ix}]"));
            return Ok(None);
        }
        let json = item(&document.root.meshes, "meshes", mesh.value(), &format_args!("nodes[{node_ix}].mesh"));
        let Some(json) = document.or_left_out(json) else { return Ok(None) };
        let weights = node.weights.as_ref().or(json.weights.as_ref()).map(|weights| &weights[..]).unwrap_or_default();
        let bits = weights.iter().map(|weight| weight.to_bits()).collect();
        let key = (mesh.value(), node.skin.map(|skin| skin.value()), is_turned, bits);
        let known = match self.known.get(&key) {
            Some(known) => known.clone(),
            None => {
                let known = self.mesh((mesh.value(), meter), node, node_ix, (weights, is_turned))?;
                self.known.insert(key, known.clone());
                known
            }
        };
        let is_flattened = |known: &Known| !known.is_skinned && transform.is_none();
        if known.as_ref().is_some_and(is_flattened) {
            document.note(FLATTENED, format!("nodes[{node_ix}]"));
            return Ok(None);
        }
        Ok(known.map(|Known { mesh_ix, materials, is_skinned, origin }| {
            let transform = transform.filter(|_| !is_skinned).unwrap_or(Transform::IDENTITY);
            let transform = if origin == DVec3::ZERO { transform } else { transform.moved(origin) };
            Instance { mesh_ix, transform, materials, ..Instance::default() }
        }))
    }

    /// Adds the mesh of a node in its pose, or returns `None` if it has no triangles. A mesh that its skin moves far
    /// from the origin is made around a point near it, so that its vertices are not rounded at their far places.
    fn mesh(
        &mut self,
        (mesh_ix, meter): (usize, &Meter),
        node: &Node,
        node_ix: usize,
        (weights, is_turned): (&[f32], bool),
    ) -> Checked<Option<Known>> {
        let document = self.document;
        let primitives = &document.root.meshes[mesh_ix].primitives;
        self.note_morphs(mesh_ix);
        let skin = node.skin.map(|skin| match primitives.iter().any(deform::has_joints) {
            true => self.skin(skin.value(), node_ix),
            false => Err(format!("nodes[{node_ix}].skin: meshes[{mesh_ix}] has no joints")),
        });
        let skin = skin.and_then(|skin| document.or_left_out(skin));
        let key = (mesh_ix, node.skin.map(|skin| skin.value()).filter(|_| skin.is_some()), is_turned && skin.is_some());
        let read = self.read_mesh(key, (weights, skin.as_ref()), meter)?;
        if read.rest.mesh.faces.is_empty() {
            return Ok(None);
        }
        let (is_skinned, materials) = (read.rest.is_skinned, read.materials.clone());
        let (mut mesh, origin) = match posed(read, (weights, skin.as_ref())) {
            Posed::Mesh(mesh, origin) => (mesh, origin),
            Posed::Pose { posed, read, origin } => {
                self.poses.insert(self.meshes.len(), LoadedPose { posed: posed.into(), key, read });
                (Mesh::default(), origin)
            }
        };
        mesh.name = document.root.meshes[mesh_ix].name.clone().unwrap_or_default();
        let may_move = !document.root.animations.is_empty();
        mesh.deforms = may_move && (skin.is_some() || primitives.iter().any(has_targets));
        self.meshes.push(mesh);
        Ok(Some(Known { mesh_ix: self.meshes.len() - 1, materials, is_skinned, origin }))
    }

    /// Returns a mesh as it is read. A mesh that serves all poses is read once.
    fn read_mesh(
        &mut self,
        key: RestKey,
        (weights, skin): (&[f32], Option<&Skin>),
        meter: &Meter,
    ) -> Checked<Arc<ReadMesh>> {
        let (mesh_ix, _, is_turned) = key;
        let reading = |reads_all| Reading { weights: Weights { now: weights, reads_all }, skin, is_turned };
        let known = self.read.as_ref().map(|known| known.get(&key).cloned());
        match known {
            Some(Some(Some(read))) => return Ok(read),
            Some(None) if !self.document.morph_targets.change_surfaces(mesh_ix) => {
                let n_notes = self.document.n_notes();
                let read = Arc::new(self.read_parts(mesh_ix, reading(true), meter)?.with_poses());
                // What is left out may depend on the weights: targets of weight 0 are not asked for.
                let serves_all = self.document.n_notes() == n_notes && read.rest.deformation.is_deformed();
                if let Some(known) = &mut self.read {
                    known.insert(key, serves_all.then(|| read.clone()));
                }
                if serves_all {
                    return Ok(read);
                }
            }
            _ => {}
        }
        self.read_parts(mesh_ix, reading(false), meter).map(Arc::new)
    }

    /// Reads the primitives of a mesh. `meter` counts them.
    fn read_parts(&mut self, mesh_ix: usize, reading: Reading, meter: &Meter) -> Checked<ReadMesh> {
        let document = self.document;
        let primitives = &document.root.meshes[mesh_ix].primitives;
        let whole = geometry::attributes_of(primitives);
        let mut read = ReadMesh::default();
        for (ix, primitive) in primitives.iter().enumerate() {
            let path = format!("meshes[{mesh_ix}].primitives[{ix}]");
            let material = if self.has_materials { self.materials.index(primitive.material, &path) } else { 0 };
            let targets = document.morph_targets.of(mesh_ix, ix);
            let part = Part { primitive, targets, path, slot: read.materials.len() as u32, whole };
            let rest = geometry::mesh(document, &part, reading, &mut self.n_read)?;
            meter.add(1);
            if let Some(rest) = rest {
                read.materials.push(material);
                read.rest.append(rest);
            }
        }
        read.rest.recentre();
        Ok(read)
    }

    /// Returns a skin in the pose of its joints.
    fn skin(&self, skin_ix: usize, node_ix: usize) -> Checked<Skin> {
        let skin = item(&self.document.root.skins, "skins", skin_ix, &format_args!("nodes[{node_ix}].skin"))?;
        let joint = |(ix, joint): (usize, &gltf::json::Index<Node>)| {
            let transform = self.nodes.world_from_node(joint.value());
            transform.ok_or_else(|| format!("skins[{skin_ix}].joints[{ix}]: nodes[{joint}] is not in the scene"))
        };
        let joints = skin.joints.iter().enumerate().map(joint).collect::<Checked<Vec<_>>>()?;
        if joints.is_empty() {
            return Err(format!("skins[{skin_ix}]: has no joints"));
        }
        let name = skin.name.clone().unwrap_or_else(|| format!("skins[{skin_ix}]"));
        if !self.nodes.is_posed {
            self.document.note("skins, which are shown in their rest pose", name);
        }
        Skin::new(self.document, skin_ix, joints)
    }

    fn note_morphs(&self, mesh_ix: usize) {
        let primitives = &self.document.root.meshes[mesh_ix].primitives;
        for (ix, _) in primitives.iter().enumerate().filter(|(_, it)| !self.nodes.is_posed && has_targets(it)) {
            let path = format!("meshes[{mesh_ix}].primitives[{ix}]");
            self.document.note("morph targets, which are shown with their default weights", path);
        }
    }
}
