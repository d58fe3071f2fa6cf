//! The meshes of a scene file: of generators, and of mesh files, each of which is read once, however often it is
//! placed.

use std::{
    collections::{HashMap, HashSet},
    ops::Range,
};

use glam::{DVec3, Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::{
    animations::{Animations, Moving, places_of},
    assemble::File,
    description::{CommonSpec, FileSpec, MeshSpec, Source},
    overrides::NamedMaterials,
    transforms,
};
use crate::{
    scene::{
        files::SourceFile,
        formats::{
            gltf,
            image_cache::Images,
            mesh_file::{Loaded, Loading, MeshFile, MeshFormat, Shape, parse_mesh},
        },
        meshes::{
            generate::{Generator, TriangleBudget},
            smooth::{DEFAULT_CREASE, Shading},
        },
        model::{
            Instance, LoadOptions, Look, Material, MaterialChoice, Mesh, Scene, SceneError, Transform, error::Checked,
            extent::MeshOrigin,
        },
    },
    util::{
        memory::require,
        progress::{Progress, Work},
    },
};

/// A `[[mesh]]` table.
pub(crate) struct MeshTable {
    /// Its number, counted from 1.
    pub number: usize,
    /// Where it is in the scene file's text.
    pub span: Range<usize>,
    pub spec: MeshSpec,
}

/// What decides which meshes a mesh file gives.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Reading {
    pub file: SourceFile,
    /// Name of the scene of a glTF file.
    scene: Option<String>,
    is_smooth: bool,
    /// Bits of the crease angle.
    crease: u32,
    /// Bits of the factors on texture coordinates.
    uv_scale: Option<[u32; 2]>,
    /// Bits of the coordinates of the point that becomes the mesh's origin.
    origin: Option<[u64; 3]>,
    /// Whether the mesh gets an origin of its own if it is far from 0 and the table states no `origin`.
    recentre: bool,
}

/// A mesh file whose meshes are in the scene.
struct Read {
    /// The instances of the file with indices of the scene's meshes. Their materials are indices into `materials`.
    instances: Vec<Instance>,
    /// The materials of the file; `None` is the scene's default material.
    materials: Vec<Option<Material>>,
    /// Indices of the file's materials in the scene: as they are, and overridden. `None` until a mesh has them.
    material_ixs: [Option<Vec<u32>>; 2],
    /// Whether normals depend on the crease angle.
    uses_crease: bool,
}

/// What a file that was read together with others has become.
enum Content {
    /// A mesh.
    Shape(Box<Result<Shape, SceneError>>),
    /// A glTF file.
    Model(Box<Result<gltf::Model, SceneError>>),
    /// Bytes, since their format is not the one that the file's name tells.
    Bytes(MeshFile),
}

/// How glTF files are loaded.
#[derive(Clone, Copy)]
struct Models<'a> {
    /// Which materials are replaced.
    replaced: &'a [MaterialChoice],
    /// The readings whose materials some table shows.
    with_materials: &'a HashSet<Reading>,
    animations: &'a Animations,
}

impl Models<'_> {
    /// Loads the meshes of a file. `before`: what the scene has already.
    fn load(
        &self,
        reading: &Reading,
        mesh: MeshFile,
        (before, progress): (gltf::LoadedBefore, &Progress),
    ) -> Result<gltf::Model, SceneError> {
        let look = Look { materials: self.replaced.to_vec(), ..Look::default() };
        let (scene, progress) = (reading.scene.clone(), progress.clone());
        let (at, animation) = (self.animations.at, self.animations.of_file(reading));
        let options = LoadOptions { scene, at, animation, look, progress, ..LoadOptions::default() };
        gltf::load_meshes(mesh, &options, self.with_materials.contains(reading), before)
    }
}

/// Bytes of memory that reading a byte of a file takes.
const READING_BYTES: u64 = 10;

/// Adds the meshes of a scene file to its scene.
pub(crate) struct Placer<'a> {
    pub file: &'a File<'a>,
    pub scene: Scene,
    pub materials: NamedMaterials<'a>,
    pub images: Images,
    /// Number of triangles that generators have made.
    n_generated: u64,
    read: HashMap<Reading, Read>,
    /// Files that have been read together, and are not in the scene yet.
    shapes: HashMap<Reading, Result<Content, SceneError>>,
    /// The readings whose materials some table shows.
    with_materials: HashSet<Reading>,
    /// Whether meshes that are far from 0 get an origin of their own.
    recentre: bool,
    pub animations: Animations,
    /// The meshes so far that keys move.
    pub moving: Vec<Moving>,
}

impl<'a> Placer<'a> {
    /// `tables`: all those that will be added.
    pub fn new(
        file: &'a File<'a>,
        (scene, images): (Scene, Images),
        materials: NamedMaterials<'a>,
        (tables, recentre, animations): (&[MeshTable], bool, Animations),
    ) -> Self {
        let has_own =
            |table: &&MeshTable| table.spec.common.material.is_none() && table.spec.common.materials.is_empty();
        let with_materials = tables.iter().filter(has_own);
        let with_materials = with_materials.filter_map(|table| Reading::of(file, &table.spec, recentre).ok()?);
        let with_materials = with_materials.collect();
        Self {
            file,
            scene,
            materials,
            images,
            n_generated: 0,
            read: HashMap::new(),
            shapes: HashMap::new(),
            with_materials,
            recentre,
            animations,
            moving: Vec::new(),
        }
    }

    /// Reads the files of all tables at the same time, if there are several and there is memory for them. Errors and
    /// warnings are kept until the table of the file is added, so that they do not depend on the order of reading.
    pub fn read_together(&mut self, tables: &[MeshTable]) {
        let readings = tables.iter().filter_map(|table| Reading::of(self.file, &table.spec, self.recentre).ok()?);
        let mut seen = HashSet::new();
        let readings: Vec<Reading> = readings.filter(|it| seen.insert(it.clone())).collect();
        let n_bytes: u64 = readings.iter().map(Reading::n_bytes).sum();
        if readings.len() < 2 || require("reading files", n_bytes.saturating_mul(READING_BYTES)).is_err() {
            return;
        }
        let meter = self.images.progress().begin(Work::Reading, n_bytes);
        let models = self.models();
        let content = |reading: Reading| {
            let n_bytes = reading.n_bytes();
            let read = MeshFile::read(&reading.file).map(|mesh| match mesh.format {
                MeshFormat::Gltf => {
                    let model = models.load(&reading, mesh, (gltf::LoadedBefore::default(), &Progress::default()));
                    Content::Model(Box::new(model))
                }
                _ if reading.scene.is_some() => Content::Bytes(mesh),
                _ => {
                    let how = (reading.shading(), reading.origin());
                    Content::Shape(Box::new(Shape::parse(mesh, how, (0, &Progress::default()))))
                }
            });
            meter.add(n_bytes);
            (reading, read)
        };
        let read = readings.into_par_iter().map(content).collect::<Vec<_>>();
        self.shapes = read.into_iter().collect();
    }

    /// Returns how glTF files are loaded.
    fn models(&self) -> Models<'_> {
        Models { replaced: self.images.replaced(), with_materials: &self.with_materials, animations: &self.animations }
    }

    /// Adds the meshes of a table.
    pub fn add(&mut self, table: &MeshTable) -> Result<(), SceneError> {
        let failed = |what: String| self.file.at(&table.span, format!("mesh {}: {what}", table.number));
        let MeshSpec { source, common, place } = &table.spec;
        let array = common.instances.as_ref().map(|name| transforms::read(&self.file.source.exact(name)?));
        let array = array.transpose().map_err(failed)?;
        let places = places_of(place.at(self.animations.of_keys).map_err(failed)?, array.as_deref());
        let named = self.materials.of_mesh(common).map_err(failed)?;
        let first_instance = self.scene.instances.len();
        let inner = match source {
            Source::Generator(generator) => {
                self.generate(generator, common, (&places, named)).map_err(failed)?;
                vec![Transform::IDENTITY]
            }
            Source::File(FileSpec { crease, .. }) => {
                let reading =
                    Reading::of(self.file, &table.spec, self.recentre).map_err(failed)?.expect("the source is a file");
                if !self.read.contains_key(&reading) {
                    let read = self.read_file(&reading, table)?;
                    self.read.insert(reading.clone(), read);
                }
                if crease.is_some() && !self.read[&reading].uses_crease {
                    let what = "`crease` has no effect: no normals of the file's faces are computed";
                    tracing::warn!("{}", failed(what.to_owned()));
                }
                self.place(&reading, common, (&places, named)).map_err(failed)?;
                self.read[&reading].instances.iter().map(|instance| instance.transform.clone()).collect()
            }
        };
        if !place.times().is_empty() {
            let (number, place) = (table.number, place.clone());
            self.moving.push(Moving { number, place, array, first_instance, inner });
        }
        Ok(())
    }

    /// Adds a generator's mesh.
    fn generate(
        &mut self,
        generator: &Generator,
        common: &CommonSpec,
        (places, named): (&[Transform], Vec<u32>),
    ) -> Checked<()> {
        let (rays, scene) = (common.rays()?, &mut self.scene);
        let budget = TriangleBudget { n_generated: self.n_generated, n_triangles: scene.n_stored() as u64 };
        let mut mesh = generator.build(&budget)?;
        if mesh.faces.is_empty() {
            return Err("makes no triangles".to_owned());
        }
        if common.smooth == Some(false) {
            mesh.normals.fill([Vec3::ZERO; 3]);
        }
        let slots = if named.is_empty() { vec![scene.default_material(false)] } else { named };
        if !slots.iter().any(|ix| scene.materials[*ix as usize].maps.textures().next().is_some()) {
            mesh.uvs = Default::default();
        }
        scale_uvs(&mut mesh, common.uv_scale)?;
        self.n_generated += mesh.faces.len() as u64;
        let mesh_ix = scene.meshes.len();
        require_for_places(scene, places.len(), 1)?;
        scene.meshes.push(mesh);
        push_instances(scene, Instance { mesh_ix, materials: slots, rays, ..Instance::default() }, places)
    }

    /// Reads a mesh file and adds its meshes, without instances. Of a glTF file, lights and cameras are left out.
    fn read_file(&mut self, reading: &Reading, table: &MeshTable) -> Result<Read, SceneError> {
        let failed = |what: String| self.file.at(&table.span, format!("mesh {}: {what}", table.number));
        // The scene file may misspell the name, so the error names the line in the scene file.
        let read = || MeshFile::read(&reading.file).map_err(|error| failed(error.to_string()));
        let content = match self.shapes.remove(reading) {
            Some(content) => content.map_err(|error| failed(error.to_string()))?,
            None => Content::Bytes(read()?),
        };
        let n_loaded = self.scene.n_stored();
        let first_mesh = self.scene.meshes.len();
        let uv_scale = table.spec.common.uv_scale;
        let before = gltf::LoadedBefore { n_triangles: n_loaded as u64, n_pixels: self.images.n_pixels() };
        let progress = self.images.progress().clone();
        let content = match content {
            Content::Bytes(mesh) if mesh.format == MeshFormat::Gltf => {
                Content::Model(Box::new(self.models().load(reading, mesh, (before, &progress))))
            }
            // Images that were decoded together are limited one by one. If there are too many pixels, those of this
            // file are left out, with its warnings.
            Content::Model(model) if model.as_ref().as_ref().is_ok_and(|model| before.exceeds(&model.scene)) => {
                drop(model);
                Content::Model(Box::new(self.models().load(reading, read()?, (before, &progress))))
            }
            content => content,
        };
        if let Content::Model(model) = content {
            let gltf::Model { scene: mut model, warnings } = (*model)?;
            self.animations.infos.append(&mut model.animations);
            warnings.iter().for_each(|warning| tracing::warn!("{warning}"));
            for mesh in &mut model.meshes {
                if !reading.is_smooth {
                    mesh.normals.fill([Vec3::ZERO; 3]);
                }
                scale_uvs(mesh, uv_scale).map_err(failed)?;
            }
            self.scene.meshes.append(&mut model.meshes);
            let origin = reading.origin().first();
            for instance in &mut model.instances {
                instance.mesh_ix += first_mesh;
                instance.transform = instance.transform.moved(-origin);
            }
            let first_image = self.images.adopt(model.images);
            let own = |mut material: Material| {
                material.maps.change_each(|texture| texture.image_ix += first_image);
                Some(material)
            };
            let materials = model.materials.into_iter().map(own).collect();
            return Ok(Read { instances: model.instances, materials, material_ixs: [None, None], uses_crease: false });
        }
        if let Some(name) = &reading.scene {
            return Err(failed(format!("there is no scene `{name}`: only glTF files name scenes")));
        }
        let (shading, origin) = (reading.shading(), reading.origin());
        let mut loading = Loading { shading, origin, n_loaded, images: &mut self.images };
        let loaded = match content {
            Content::Shape(shape) => (*shape)?.loaded(&mut loading),
            Content::Bytes(mesh) => parse_mesh(mesh, &mut loading),
            Content::Model(_) => unreachable!("models are placed above"),
        };
        let Loaded { mut mesh, origin: own_origin, materials, uses_crease } = loaded?;
        scale_uvs(&mut mesh, uv_scale).map_err(failed)?;
        self.scene.meshes.push(mesh);
        let materials: Vec<_> = materials.into_iter().map(Some).chain([None]).collect();
        let slots = (0..materials.len() as u32).collect();
        // A stated origin moves the mesh, one that was chosen does not.
        let transform = Transform::IDENTITY.moved(own_origin - origin.first());
        let instances = vec![Instance { mesh_ix: first_mesh, transform, materials: slots, ..Instance::default() }];
        Ok(Read { instances, materials, material_ixs: [None, None], uses_crease })
    }

    /// Adds instances of a mesh file's meshes, with the materials that are named or else with those of the file.
    fn place(
        &mut self,
        reading: &Reading,
        common: &CommonSpec,
        (places, named): (&[Transform], Vec<u32>),
    ) -> Checked<()> {
        let read = self.read.get_mut(reading).expect("the file is read");
        let (rays, scene) = (common.rays()?, &mut self.scene);
        if named.is_empty() && read.material_ixs[usize::from(common.overrides)].is_none() {
            let n_materials = scene.materials.len();
            let has_colours = |instance: &Instance| !scene.meshes[instance.mesh_ix].colours.is_empty();
            let has_colours = read.instances.iter().any(has_colours);
            let add = |material: &Option<Material>| match material {
                Some(material) => scene.push_material(material.clone()),
                None => scene.default_material(has_colours),
            };
            let material_ixs = read.materials.iter().map(add).collect();
            read.material_ixs[usize::from(common.overrides)] = Some(material_ixs);
            if common.overrides {
                self.materials.override_from(scene, n_materials)?;
            }
        }
        let own = read.material_ixs[usize::from(common.overrides)].as_ref();
        require_for_places(scene, places.len(), read.instances.len())?;
        for instance in &read.instances {
            let materials = match own.filter(|_| named.is_empty()) {
                Some(own) => instance.materials.iter().map(|ix| own[*ix as usize]).collect(),
                None => named.clone(),
            };
            push_instances(scene, Instance { materials, rays, ..instance.clone() }, places)?;
        }
        Ok(())
    }
}

/// Refuses to place instances if there is not enough memory for all places. The memory of the triangles depends on
/// whether they are copied for each place, and is checked before that.
fn require_for_places(scene: &Scene, n_places: usize, n_instances: usize) -> Checked<()> {
    let n_bytes_of_one = (size_of::<Instance>() + size_of::<u32>() * scene.materials.len()) as u64;
    let n_bytes = (n_places as u64).saturating_mul(n_instances as u64).saturating_mul(n_bytes_of_one);
    Ok(require("placing a mesh many times", n_bytes)?)
}

/// Adds an instance once for each transform that follows its own.
fn push_instances(scene: &mut Scene, instance: Instance, places: &[Transform]) -> Checked<()> {
    let mesh = &scene.meshes[instance.mesh_ix];
    let bounds = mesh.bounds();
    for (ix, place) in places.iter().enumerate() {
        let transform = place.after(&instance.transform);
        let named = |what: String| if places.len() > 1 { format!("instance {ix}: {what}") } else { what };
        mesh.check_place(&transform, bounds).map_err(named)?;
        scene.instances.push(Instance { transform, ..instance.clone() });
    }
    scene.check_n_triangles()
}

impl Reading {
    /// Returns how the file of a mesh is read, or `None` for a generator.
    pub fn of(file: &File, spec: &MeshSpec, recentre: bool) -> Checked<Option<Self>> {
        let Source::File(FileSpec { file: path, crease, scene, origin }) = &spec.source else { return Ok(None) };
        Ok(Some(Self {
            file: file.source.exact(path)?,
            scene: scene.clone(),
            is_smooth: spec.common.smooth.unwrap_or(true),
            crease: crease.unwrap_or(DEFAULT_CREASE).to_bits(),
            uv_scale: spec.common.uv_scale.map(|scale| scale.map(f32::to_bits)),
            origin: origin.map(|origin| origin.map(f64::to_bits)),
            recentre,
        }))
    }

    /// Returns how normals are computed.
    fn shading(&self) -> Shading {
        Shading { smooth: self.is_smooth, crease: f32::from_bits(self.crease) }
    }

    /// Returns which point of the file becomes the mesh's origin.
    fn origin(&self) -> MeshOrigin {
        match self.origin {
            Some(bits) => MeshOrigin::At(DVec3::from_array(bits.map(f64::from_bits))),
            None if self.recentre => MeshOrigin::Near,
            None => MeshOrigin::At(DVec3::ZERO),
        }
    }

    /// Returns the size of the file and of the files beside a glTF file that it names.
    fn n_bytes(&self) -> u64 {
        let is_json = self.file.path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("gltf"));
        let mesh = if is_json { MeshFile::read(&self.file).ok() } else { None };
        let beside = mesh.map(|mesh| gltf::named_files(&mesh)).unwrap_or_default();
        beside.iter().map(SourceFile::n_bytes).fold(self.file.n_bytes(), u64::saturating_add)
    }
}

/// Multiplies all texture coordinates of a mesh. Tangents of its file remain along increasing u, and their bitangents
/// along decreasing v.
fn scale_uvs(mesh: &mut Mesh, scale: Option<[f32; 2]>) -> Checked<()> {
    let Some(scale) = scale.map(Vec2::from_array) else { return Ok(()) };
    if !scale.is_finite() {
        return Err(format!("uv_scale = {:?} is not finite", scale.to_array()));
    }
    mesh.uvs.iter_mut().flatten().flatten().for_each(|uv| *uv *= scale);
    let along = scale.x.signum();
    let signs = Vec4::new(along, along, along, along * scale.y.signum());
    mesh.tangents.as_flattened_mut().iter_mut().for_each(|tangent| *tangent *= signs);
    Ok(())
}
