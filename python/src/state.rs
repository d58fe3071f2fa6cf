//! The geometries of a scene, and the world that is made of them when rays need it.

use std::{path::Path, sync::Arc};

use glam::{DMat4, Vec3};
use kdray::{
    accel::{Accel, AccelOptions, kdtree::Traversal},
    engine::{
        Caster, Engine, LoadRequest, Opened, Source, Work,
        choices::{Request, Workload},
    },
    gpu::GpuError,
    scene::{Instance, Material, Mesh, Scene, Transform},
    util::progress::Progress,
    world::{InstanceUpdate, Mismatch, World, instances::Instancing},
};
use pyo3::{
    exceptions::{PyIndexError, PyRuntimeError, PyValueError},
    prelude::*,
};
use rayon::prelude::*;

use super::{columns::FaceTable, process::failed};

/// Number of rays for which a structure is built when it is not known how many will follow.
const EXPECTED_RAYS: u64 = 1 << 24;

/// Batches of fewer rays or points are cast by the CPU, also where the scene has a GPU: a submission and the copies of
/// rays and hits take longer.
const SMALL_BATCH: usize = 4096;

/// Number of small batches that a GPU casts if it builds the structure itself: the CPU would first build its own, which
/// takes as long as some thousand submissions.
const BATCHES_BEFORE_BUILD: u32 = 1000;

/// The mask of geometries that all rays meet.
const ALL: u8 = 0xff;

/// Triangles that belong together, and their place.
#[derive(Clone)]
pub struct Geometry {
    pub vertices: Vec<Vec3>,
    pub faces: Vec<[u32; 3]>,
    /// From the vertices to the world.
    pub transform: DMat4,
    /// Rays meet the geometry if their mask has a bit in common with it.
    pub mask: u8,
    /// The scene's counter of changes when the transform or the mask was last set, and when the vertices were.
    moved_at: u64,
    shaped_at: u64,
}

/// The geometry of an instance of a world.
pub struct Place {
    pub geometry_id: u32,
    /// Whether the world has the corners of triangles in another order.
    pub mirrors: bool,
}

/// A world of the scene's geometries as they were, and what casts into it.
pub struct Ready {
    pub world: World,
    /// One per instance of the world.
    pub places: Vec<Place>,
    table: FaceTable,
    traversal: Traversal,
    on_device: Option<Caster<'static>>,
    on_cpu: Option<Caster<'static>>,
    /// Number of small batches so far that the device has cast.
    n_small: u32,
    /// Whether each geometry has a structure of its own.
    keeps: bool,
    shapes_at: u64,
    places_at: u64,
}

/// What hits are in.
#[derive(Clone, Copy)]
pub struct Placed<'a> {
    pub world: &'a World,
    pub places: &'a [Place],
    pub table: &'a FaceTable,
}

/// A scene.
pub struct State {
    engine: Engine,
    cpu: Engine,
    /// By identifier; `None` where a geometry was removed.
    geometries: Vec<Option<Geometry>>,
    /// Counts changes.
    now: u64,
    /// The last change that added, removed or deformed a geometry.
    shapes_at: u64,
    /// The last change of a transform or a mask.
    places_at: u64,
    /// The last change of a transform.
    transforms_at: u64,
    /// The world of the last query.
    ready: Option<Ready>,
    /// Whether each geometry of the last world has a structure of its own, and how the world is searched.
    last: Option<(bool, Traversal)>,
}

impl State {
    pub fn new(engine: Engine) -> Self {
        let (now, shapes_at, places_at, transforms_at) = Default::default();
        let cpu = Engine::on_cpu();
        Self { engine, cpu, geometries: Vec::new(), now, shapes_at, places_at, transforms_at, ready: None, last: None }
    }

    /// Returns the number of identifiers that were given out.
    pub fn n_ids(&self) -> usize {
        self.geometries.len()
    }

    /// Returns a geometry, or none where one was removed.
    pub fn geometry(&self, id: u32) -> Option<&Geometry> {
        self.geometries.get(id as usize)?.as_ref()
    }

    fn geometry_mut(&mut self, id: u32) -> PyResult<&mut Geometry> {
        let n_ids = self.geometries.len();
        let removed = || PyIndexError::new_err(format!("id: the geometry {id} was removed"));
        let missing = || PyIndexError::new_err(format!("id: there is no geometry {id} among {n_ids}"));
        self.geometries.get_mut(id as usize).ok_or_else(missing)?.as_mut().ok_or_else(removed)
    }

    /// Adds a geometry and returns its identifier.
    pub fn add(&mut self, vertices: Vec<Vec3>, faces: Vec<[u32; 3]>, mask: u8) -> PyResult<u32> {
        check_finite("vertex_positions", &vertices)?;
        if let Some(ix) = faces.as_flattened().par_iter().find_first(|ix| **ix as usize >= vertices.len()) {
            let what = format!("triangle_indices: has the index {ix}, but there are {} vertices", vertices.len());
            return Err(PyIndexError::new_err(what));
        }
        self.now += 1;
        self.shapes_at = self.now;
        if mask != ALL {
            self.places_at = self.now;
        }
        let (transform, [moved_at, shaped_at]) = (DMat4::IDENTITY, [self.now; 2]);
        self.geometries.push(Some(Geometry { vertices, faces, transform, mask, moved_at, shaped_at }));
        Ok(self.geometries.len() as u32 - 1)
    }

    /// Leaves room for an identifier that has no geometry.
    pub fn add_removed(&mut self) {
        self.geometries.push(None);
    }

    pub fn remove(&mut self, id: u32) -> PyResult<()> {
        self.geometry_mut(id)?;
        self.geometries[id as usize] = None;
        self.now += 1;
        self.shapes_at = self.now;
        Ok(())
    }

    /// Replaces vertices of a geometry from `first` on.
    pub fn set_vertices(&mut self, id: u32, first: usize, vertices: &[Vec3]) -> PyResult<()> {
        check_finite("vertex_positions", vertices)?;
        let now = self.now + 1;
        let geometry = self.geometry_mut(id)?;
        let n = geometry.vertices.len();
        let Some(range) = first.checked_add(vertices.len()).and_then(|end| geometry.vertices.get_mut(first..end))
        else {
            let what = format!("first: vertices {first} to {} of {n}", first.saturating_add(vertices.len()));
            return Err(PyIndexError::new_err(what));
        };
        range.copy_from_slice(vertices);
        geometry.shaped_at = now;
        (self.now, self.shapes_at) = (now, now);
        Ok(())
    }

    /// Sets the transforms of geometries. If one of them is refused, none is set.
    pub fn set_transforms(&mut self, ids: &[u32], transforms: &[DMat4]) -> PyResult<()> {
        for (row, (id, transform)) in ids.iter().zip(transforms).enumerate() {
            self.geometry_mut(*id)?;
            let wrong = |what| PyValueError::new_err(format!("transforms[{row}]: {what}"));
            Transform::of_affine(*transform).map_err(wrong)?;
        }
        self.now += 1;
        let now = self.now;
        for (id, transform) in ids.iter().zip(transforms) {
            let geometry = self.geometry_mut(*id)?;
            (geometry.transform, geometry.moved_at) = (*transform, now);
        }
        (self.places_at, self.transforms_at) = (now, now);
        Ok(())
    }

    /// Sets the masks of geometries. If one of them is refused, none is set.
    pub fn set_masks(&mut self, ids: &[u32], masks: &[u8]) -> PyResult<()> {
        ids.iter().try_for_each(|id| self.geometry_mut(*id).map(|_| ()))?;
        self.now += 1;
        let now = self.now;
        for (id, mask) in ids.iter().zip(masks) {
            let geometry = self.geometry_mut(*id)?;
            (geometry.mask, geometry.moved_at) = (*mask, now);
        }
        self.places_at = now;
        Ok(())
    }

    /// Whether the scene casts on a GPU.
    pub fn has_gpu(&self) -> bool {
        self.engine.device().is_some_and(|device| !device.is_software())
    }

    /// Sees to a world of the geometries as they are now. `n`: the rays or points that are about to be cast.
    pub fn prepare(&mut self, n: usize, progress: &Progress) -> PyResult<()> {
        if !self.geometries.iter().flatten().any(|geometry| !geometry.faces.is_empty()) {
            return Err(PyRuntimeError::new_err("the scene has no triangles: add_triangles adds some"));
        }
        // Where the world cannot be moved, another one is built.
        if let Some(ready) = self
            .ready
            .take_if(|ready| ready.keeps && ready.shapes_at == self.shapes_at && ready.places_at < self.places_at)
        {
            self.ready = self.moved(ready).ok();
        }
        if !self.is_built() {
            let ready = self.build(n, progress)?;
            self.last = Some((ready.keeps, ready.traversal));
            self.ready = Some(ready);
        }
        Ok(())
    }

    /// Whether there is a world of the geometries as they are now.
    pub fn is_built(&self) -> bool {
        let is_current = |ready: &Ready| (ready.shapes_at, ready.places_at) == (self.shapes_at, self.places_at);
        self.ready.as_ref().is_some_and(is_current)
    }

    /// Whether the CPU casts `n` rays or points, and its caster has been made. The scene is prepared.
    pub fn cpu_is_ready(&self, n: usize) -> bool {
        goes_to_cpu(&self.engine, n) && self.ready.as_ref().is_some_and(|ready| ready.on_cpu.is_some())
    }

    /// Returns what casts `n` rays or points with a mask, and what their hits are in. The scene is prepared.
    pub fn caster(&mut self, n: usize, mask: u8) -> PyResult<(&mut Caster<'static>, Placed<'_>)> {
        let ready = self.ready.as_mut().expect("the scene is prepared");
        let (caster, placed) = ready.caster([&self.engine, &self.cpu], n)?;
        caster.set_mask(mask).map_err(failed)?;
        Ok((caster, placed))
    }

    /// The addresses of the structures of geometries, none if they have one together.
    pub fn structures(&self) -> Vec<usize> {
        match self.ready.as_ref().map(|ready| ready.world.accel()) {
            Some(Accel::TwoLevel(two)) => two.structures().iter().map(|it| Arc::as_ptr(it).addr()).collect(),
            _ => Vec::new(),
        }
    }

    /// Whether each geometry has a structure of its own, which changes of others keep. Geometries that never moved,
    /// that all rays meet, and that no query has seen change are flattened: one structure is quicker than many.
    fn keeps(&self) -> bool {
        let n_geometries = self.geometries.iter().flatten().filter(|geometry| !geometry.faces.is_empty()).count();
        self.places_at > 0 || (self.last.is_some() && n_geometries > 1)
    }

    /// Gives the instances of a world the transforms and masks that their geometries have now.
    fn moved(&self, mut ready: Ready) -> Result<Ready, GpuError> {
        let mut updates = Vec::new();
        for (instance_ix, place) in ready.places.iter_mut().enumerate() {
            let geometry = self.geometry(place.geometry_id).expect("the shapes are those of the world");
            if geometry.moved_at > ready.places_at {
                let transform = Transform::of_affine(geometry.transform).expect("checked when it was set");
                place.mirrors = transform.mirrors();
                let (transform, mask) = (Some(transform), Some(geometry.mask));
                updates.push(InstanceUpdate { instance_ix, transform, mask, ..InstanceUpdate::default() });
            }
        }
        ready.world = ready.world.with_instances_changed(&updates)?;
        for caster in ready.on_device.iter_mut().chain(&mut ready.on_cpu) {
            caster.set_world(&ready.world)?;
        }
        if self.transforms_at > ready.places_at {
            ready.table = FaceTable::default();
        }
        ready.places_at = self.places_at;
        Ok(ready)
    }

    /// Builds a world. The world before is freed first, unless its structures are taken over.
    fn build(&mut self, n_rays: usize, progress: &Progress) -> PyResult<Ready> {
        let keeps = self.keeps();
        self.ready = self.ready.take().filter(|before| keeps && before.keeps).map(Ready::without_casters);
        // If shapes have changed, they may do so again before many rays are cast.
        let n_rays = if self.last.is_some() && self.places_at == 0 { n_rays as u64 } else { EXPECTED_RAYS };
        let (scene, places) = self.scene();
        let world = match &self.ready {
            Some(before) => {
                let same: Vec<_> = places.iter().map(|place| before.same(place, self)).collect();
                before.world.rebuilt(scene, &same, progress).map_err(wrong)?
            }
            None => self.load(scene, n_rays, keeps, progress)?,
        };
        let world = if keeps { self.masked(&world, &places).map_err(wrong)? } else { world };
        let traversal = match self.last {
            Some((kept, traversal)) if kept == keeps => traversal,
            _ => {
                let methods = self.engine_of(keeps).methods(&world, &Workload::of_rays(n_rays));
                methods.map_err(failed)?.traversal.value
            }
        };
        let (shapes_at, places_at) = (self.shapes_at, self.places_at);
        let (table, on_device, on_cpu, n_small) = Default::default();
        Ok(Ready { world, places, table, traversal, on_device, on_cpu, n_small, keeps, shapes_at, places_at })
    }

    /// Makes a world of which nothing is there.
    fn load(&self, scene: Scene, n_rays: u64, keeps: bool, progress: &Progress) -> PyResult<World> {
        let engine = self.engine_of(keeps).with_progress(progress.clone());
        let opened = Opened::read(Source::Scene(Box::new(scene)), &LoadRequest::rays(n_rays)).map_err(wrong)?;
        Ok(engine.builder().build(opened, &Work::Rays(n_rays)).map_err(wrong)?.world)
    }

    fn engine_of(&self, keeps: bool) -> Engine {
        let instances = if keeps { Instancing::Keep } else { Instancing::Flatten };
        self.engine.clone().with_request(Request { instances, ..Request::default() })
    }

    /// Returns a world with the masks of the geometries.
    fn masked(&self, world: &World, places: &[Place]) -> Result<World, Mismatch> {
        let mask_of = |place: &Place| self.geometry(place.geometry_id).map(|it| it.mask);
        let update = |(instance_ix, place)| InstanceUpdate { instance_ix, mask: mask_of(place), ..Default::default() };
        let updates: Vec<_> = places.iter().enumerate().map(update).filter(|it| it.mask != Some(ALL)).collect();
        if updates.is_empty() { Ok(world.clone()) } else { world.with_instances_changed(&updates) }
    }

    /// Returns the geometries as a scene, each moved by its instance.
    fn scene(&self) -> (Scene, Vec<Place>) {
        let (mut meshes, mut instances, mut places) = (Vec::new(), Vec::new(), Vec::new());
        for (id, geometry) in self.geometries.iter().enumerate() {
            let Some(geometry) = geometry.as_ref().filter(|geometry| !geometry.faces.is_empty()) else { continue };
            let transform = Transform::of_affine(geometry.transform).expect("checked when it was set");
            places.push(Place { geometry_id: id as u32, mirrors: transform.mirrors() });
            instances.push(Instance { mesh_ix: meshes.len(), transform, materials: vec![0], ..Instance::default() });
            meshes.push(Mesh::of_triangles(geometry.vertices.clone(), geometry.faces.clone()));
        }
        let materials = vec![Material::default()];
        (Scene { meshes, instances, materials, ..Scene::empty(Path::new("scene")) }, places)
    }
}

impl Ready {
    fn without_casters(self) -> Self {
        Self { on_device: None, on_cpu: None, table: FaceTable::default(), ..self }
    }

    /// Returns the index of the mesh that a geometry has in this world, if it has not changed since.
    fn same(&self, place: &Place, state: &State) -> Option<usize> {
        let geometry = state.geometry(place.geometry_id)?;
        let mesh_ix = self.places.binary_search_by_key(&place.geometry_id, |it| it.geometry_id).ok()?;
        (geometry.shaped_at <= self.shapes_at).then_some(mesh_ix)
    }

    /// Returns what casts `n` rays: the device, or the CPU if they are few and its structure costs little or has been
    /// waited for. It is made at the first use.
    fn caster(&mut self, [engine, cpu]: [&Engine; 2], n: usize) -> PyResult<(&mut Caster<'static>, Placed<'_>)> {
        let Self { world, places, table, traversal, on_device, on_cpu, n_small, .. } = self;
        let goes_to_cpu = goes_to_cpu(engine, n);
        let lacks_structure = on_cpu.is_none() && matches!(world.accel_options(), AccelOptions::LazyTree(_));
        let may_stay = engine.device().is_some() && lacks_structure && *n_small < BATCHES_BEFORE_BUILD;
        let stays_on_device = goes_to_cpu && may_stay;
        *n_small += u32::from(stays_on_device);
        let caster = if goes_to_cpu && !stays_on_device {
            made(on_cpu, || cpu.caster_of_world(world, Traversal::OF_CPU))
        } else {
            made(on_device, || engine.caster_of_world(world, *traversal))
        };
        Ok((caster?, Placed { world, places, table }))
    }
}

/// Whether the CPU casts `n` rays or points: there is no device, or there is a GPU and they are few.
fn goes_to_cpu(engine: &Engine, n: usize) -> bool {
    engine.device().is_none_or(|device| !device.is_software() && n < SMALL_BATCH)
}

fn made<T>(place: &mut Option<T>, make: impl FnOnce() -> Result<T, GpuError>) -> PyResult<&mut T> {
    match place {
        Some(caster) => Ok(caster),
        None => Ok(place.insert(make().map_err(failed)?)),
    }
}

fn wrong(error: impl std::error::Error) -> PyErr {
    PyValueError::new_err(error.to_string())
}

fn check_finite(name: &str, vertices: &[Vec3]) -> PyResult<()> {
    let not_finite = |vertex: &Vec3| !vertex.is_finite();
    match vertices.par_iter().position_first(not_finite) {
        Some(ix) => Err(PyValueError::new_err(format!("{name}: vertex {ix} is {}, not finite", vertices[ix]))),
        None => Ok(()),
    }
}
