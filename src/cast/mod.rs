//! Casts the caller's rays on a device or on the CPU, and returns their hits. Likewise finds the closest points of the
//! triangles to the caller's points. No frame is involved.
//!
//! ```text
//! RayReader ─> batches ─> GpuCaster (runs the kernel once for each repetition) ─> HitWriter
//!   .npy                                                                         .npz
//! ```

mod all_hits;
mod closest_point;
mod kernel;
pub(crate) mod leaving;
#[cfg(feature = "files")]
mod read;
mod recorded;
mod rounds;
mod stream;
#[cfg(feature = "files")]
mod write;
#[cfg(feature = "files")]
mod write_lists;

use std::{
    mem,
    sync::{
        Arc, OnceLock,
        atomic::{AtomicUsize, Ordering},
    },
    time::Instant,
};

use bytemuck::{Pod, Zeroable, cast_slice_mut};
use glam::Vec3;
use rayon::prelude::*;

pub(crate) use self::rounds::time_in_turn;
pub use self::{
    all_hits::AllHits,
    closest_point::count_invalid_points,
    recorded::RecordedCast,
    stream::{RAYS_PER_CHUNK, StreamHit, StreamRay},
};
#[doc(hidden)]
pub use self::{kernel::Kernel, rounds::Contender};
#[cfg(feature = "files")]
pub use self::{
    read::{PointReader, RayFileError, RayReader},
    write::HitWriter,
    write_lists::HitListWriter,
};
pub use crate::layout::{Hit, NO_TRIANGLE, QueryPoint, Ray};
use crate::{
    accel::{
        AccelKind, Query,
        kdtree::{Traversal, TraversalLinks},
        two_level::{GeometriesId, StructuresId},
        wide_bvh::WideBvh,
    },
    buffers::{AccelBuffers, CastResources, ResumePass, hidden_words},
    cpu::{self, CpuSearch},
    frame::{BadOptions, check::check},
    gpu::{
        Access, BindingLayout, Buffer, CommandBuffer, Commands, Context, Device, GpuError, Limits, Statistic, Timer,
    },
    layout::{PathRay, RAY_GROUP_SIZE},
    passes::{self, Masked},
    reference::{self, inputs::KernelInputs},
    world::{Geometry, Mismatch, World},
};

/// The result of a cast.
#[derive(Clone, Debug, PartialEq)]
pub struct CastResult {
    /// One hit for each ray, at origin + t * direction: t is a distance in world units only if the direction has unit
    /// length. A miss has an infinite t and the index `NO_TRIANGLE`.
    pub hits: Vec<Hit>,
    /// Milliseconds of each repetition, summed over batches. They are the kernel's GPU time, or wall-clock time if
    /// the CPU casts. None where the device has no timestamps.
    pub gpu_ms: Option<Vec<f64>>,
    /// Number of rays that can only miss: see [`count_invalid`].
    pub n_invalid: u64,
}

/// Number of rays in a batch: 64 MiB of rays and 32 MiB of hits, enough to fill a large GPU many times over.
pub const RAYS_PER_BATCH: usize = 1 << 21;

/// The most repetitions of a cast.
pub const MOST_REPETITIONS: u32 = 10_000;

/// Casts rays on a device, which holds the triangles and their acceleration structure.
pub struct GpuCaster {
    context: Arc<Context>,
    /// The triangles and their acceleration structure, which may also be a grid.
    tree: AccelBuffers,
    /// What tells the structures of geometries from others; none without instances.
    structures_id: Option<StructuresId>,
    /// What tells the geometries from others, however they are deformed.
    geometries_id: Option<GeometriesId>,
    bindings: Arc<BindingLayout>,
    traversal: Traversal,
    /// The kernel for [`Query::Closest`], created at its first use.
    closest: Option<Arc<passes::Cast>>,
    /// The kernel for [`Query::Any`], created at its first use.
    any: Option<Arc<passes::Cast>>,
    resources: CastResources,
    /// The search for closest points, created at its first use.
    point_search: Option<closest_point::PointSearch>,
    /// The kind of the structure, or of that of each geometry.
    accel_kind: AccelKind,
    rays_per_batch: usize,
    mask: u8,
    /// What chunks of a stream need, made at its first use.
    lanes: stream::Lanes,
}

impl GpuCaster {
    /// Uploads the triangles and their acceleration structure.
    ///
    /// # Errors
    /// The triangles are beyond the device's limits or memory, or too many for brute force.
    pub fn new(device: impl Into<Device>, geometry: Geometry, traversal: Traversal) -> Result<Self, GpuError> {
        let device = device.into();
        let context = device.inner();
        let mut buffers = AccelBuffers::new(context, geometry)?;
        buffers.add_links(context, geometry, traversal)?;
        let bindings = CastResources::bindings(context, &buffers)?;
        Ok(Self {
            resources: CastResources::new(context, &bindings, &buffers, 0)?,
            rays_per_batch: RAYS_PER_BATCH.min(most_rays(context.limits())),
            mask: ALL_INSTANCES,
            context: Arc::clone(context),
            tree: buffers,
            structures_id: geometry.accel().structures_id(),
            geometries_id: geometry.accel().geometries_id().cloned(),
            bindings,
            traversal,
            closest: None,
            any: None,
            point_search: None,
            accel_kind: geometry.accel().kind(),
            lanes: Default::default(),
        })
    }

    /// Makes rays pass through the triangles with these indices. A second call replaces the indices of the first.
    ///
    /// # Errors
    /// There is no triangle with one of the indices, or the buffers are beyond the device's limits or memory.
    pub fn hiding(mut self, triangles: &[u32]) -> Result<Self, GpuError> {
        check_indices(self.tree.n_triangles, triangles)?;
        self.tree.hide(&self.context, triangles)?;
        self.bindings = CastResources::bindings(&self.context, &self.tree)?;
        self.resources = CastResources::new(&self.context, &self.bindings, &self.tree, 0)?;
        (self.closest, self.any, self.point_search) = (None, None, None);
        self.unbind_lanes();
        Ok(self)
    }

    /// Casts rays into a world whose instances have changed ([`World::with_instances_changed`]), or into another moment
    /// of the same film. Only the instances are uploaded. Where meshes are deformed and the device builds their
    /// structures, it builds these again.
    ///
    /// # Errors
    /// The world was not made of this caster's, or memory runs out. Then nothing has changed, unless several meshes are
    /// deformed: some of them may have changed until a world is set again.
    pub fn set_world(&mut self, world: &World) -> Result<(), GpuError> {
        let geometry = world.geometry();
        check_geometries(self.geometries_id.as_ref(), geometry)?;
        let shares_structures = self.structures_id == geometry.accel().structures_id();
        self.unbind_lanes();
        let mut tree = self.tree.clone();
        if tree.shared().is_some() || shares_structures {
            tree.set_instances(&self.context, geometry)?;
            let resources = self.resources.with_accel(&self.bindings, &tree)?;
            if tree.shared().is_none() || tree.set_pose(&self.context, world, &self.tree)? {
                (self.resources, self.tree, self.point_search) = (resources, tree, None);
                self.structures_id = geometry.accel().structures_id();
                return Ok(());
            }
        }
        let mut next = Self::new(&self.context, geometry, self.traversal)?;
        next.tree.hide_as(&self.context, &self.tree)?;
        next.bindings = CastResources::bindings(&next.context, &next.tree)?;
        next.resources = CastResources::new(&next.context, &next.bindings, &next.tree, 0)?;
        next.lanes = mem::take(&mut self.lanes);
        *self = next.with_batches_of(self.rays_per_batch);
        Ok(())
    }

    /// Makes later rays and points meet the instances alone whose masks
    /// ([`InstanceUpdate::mask`](crate::world::InstanceUpdate::mask)) have a bit in common with `mask`. At first it is
    /// 0xff. Without instances, they meet everything. Casts that were recorded keep the mask before.
    ///
    /// # Errors
    /// The mask is 0.
    pub fn set_mask(&mut self, mask: u8) -> Result<(), BadOptions> {
        self.mask = checked_mask(mask)?;
        Ok(())
    }

    /// Returns the first `n` rays or points of a buffer, for a kernel.
    fn masked(&self, n: u32) -> Masked {
        Masked { n, mask: self.mask }
    }

    /// Limits batches to `n_rays` rays, at least 1 and at most what the device allows.
    #[must_use]
    pub fn with_batches_of(self, n_rays: usize) -> Self {
        Self { rays_per_batch: n_rays.clamp(1, most_rays(self.context.limits())), ..self }
    }

    /// Casts rays, batch by batch. Each batch runs `n_times` (at least once), and every repetition finds the same
    /// hits.
    ///
    /// # Errors
    /// There are more than [`MOST_REPETITIONS`], memory runs out, or a call fails.
    pub fn cast(&mut self, rays: &[Ray], query: Query, n_times: u32) -> Result<CastResult, GpuError> {
        check_repetitions(n_times)?;
        let kernel = self.prepare(query, rays.len())?;
        let CastResources { cast_rays, cast_hits, set } = &self.resources;
        let record = |commands: &Commands, n_rays, pass| kernel.record(commands, set, self.masked(n_rays), pass);
        let (hits, gpu_ms) = self.run_batches(rays, (cast_rays, cast_hits), n_times.max(1), record)?;
        Ok(CastResult { hits, gpu_ms, n_invalid: count_invalid(rays) })
    }

    /// Returns the driver's statistics of the query's kernel. They are empty before the first cast.
    ///
    /// # Errors
    /// Memory runs out.
    #[doc(hidden)]
    pub fn statistics(&self, query: Query) -> Result<Vec<Statistic>, GpuError> {
        let kernel = match query {
            Query::Closest => &self.closest,
            Query::Any => &self.any,
        };
        kernel.as_ref().map_or(Ok(Vec::new()), |kernel| kernel.statistics())
    }

    /// Returns the query's kernel, which is created at its first use.
    fn prepare_kernel(&mut self, query: Query) -> Result<Arc<passes::Cast>, GpuError> {
        let kernel = match query {
            Query::Closest => &mut self.closest,
            Query::Any => &mut self.any,
        };
        if let Some(kernel) = kernel {
            return Ok(Arc::clone(kernel));
        }
        let made = Arc::new(passes::Cast::new(&self.context, &self.bindings, self.traversal, query)?);
        Ok(Arc::clone(kernel.insert(made)))
    }

    /// Creates the query's kernel and buffers for a batch, unless they exist. Returns the kernel.
    fn prepare(&mut self, query: Query, n_rays: usize) -> Result<Arc<passes::Cast>, GpuError> {
        let kernel = self.prepare_kernel(query)?;
        let len = n_rays.min(self.rays_per_batch);
        if self.resources.cast_rays.len() < len {
            self.resources = CastResources::new(&self.context, &self.bindings, &self.tree, len)?;
        }
        Ok(kernel)
    }

    /// Runs a kernel for all queries (rays or points), batch by batch. Returns their hits, and the milliseconds of each
    /// repetition. `buffers`: the queries of a batch, and their hits. `record`: records the kernel for the first
    /// queries of the buffer.
    fn run_batches<Q: Pod>(
        &self,
        queries: &[Q],
        buffers: (&Buffer<Q>, &Buffer<Hit>),
        n_times: u32,
        record: impl Fn(&Commands, u32, ResumePass),
    ) -> Result<(Vec<Hit>, Option<Vec<f64>>), GpuError> {
        let mut hits = vec![Hit::zeroed(); queries.len()];
        let mut gpu_ms = Some(vec![0.0; n_times as usize]);
        for (batch, hits) in queries.chunks(self.rays_per_batch).zip(hits.chunks_mut(self.rays_per_batch)) {
            buffers.0.upload(batch)?;
            let batch_ms =
                self.run(&self.tree, n_times, |commands, pass| record(commands, batch.len() as u32, pass))?;
            gpu_ms = gpu_ms.zip(batch_ms).map(|(sums, batch)| sums.iter().zip(batch).map(|(a, b)| a + b).collect());
            buffers.1.download_bytes(0, cast_slice_mut(hits))?;
        }
        Ok((hits, gpu_ms))
    }

    /// Runs the kernel on the uploaded batch, with one command buffer for each repetition. Returns the milliseconds
    /// of each repetition.
    /// `tree`: the structure of the kernel's set.
    fn run(
        &self,
        tree: &AccelBuffers,
        n_times: u32,
        record_kernel: impl Fn(&Commands, ResumePass),
    ) -> Result<Option<Vec<f64>>, GpuError> {
        let timer = Timer::new(&self.context, n_times)?;
        let record = |repetition| {
            CommandBuffer::record(&self.context, "cast", Some(&timer), |commands| {
                if repetition == 0 {
                    commands.reset_timer();
                }
                // This repetition overwrites what the previous one has written: cast_hits.
                commands.barrier(Access::ComputeWrite, Access::ComputeUpdate);
                tree.suspended_rays.reset(commands);
                record_kernel(commands, ResumePass::Begin);
            })
        };
        let buffers = (0..n_times).map(record).collect::<Result<Vec<_>, _>>()?;
        self.context.wait_for(self.context.submit(buffers)?)?;
        let began_ms = Instant::now();
        let n_resume_passes = tree.suspended_rays.finish(&self.context, record_kernel)?;
        // The same rays are suspended in every repetition, but they are resumed only once, after the last repetition.
        // The wall-clock time of resuming them is added to each repetition.
        let suspended_ms = if n_resume_passes > 0 { began_ms.elapsed().as_secs_f64() * 1e3 } else { 0.0 };
        let rows = timer.rows()?;
        Ok(rows.iter().map(|row| row.span_ms.map(|(begin, end)| end - begin + suspended_ms)).collect())
    }
}

/// Checks the number of repetitions of a cast.
pub(crate) fn check_repetitions(n_times: u32) -> Result<(), BadOptions> {
    check("n_times", n_times, n_times <= MOST_REPETITIONS, || format!("at most {MOST_REPETITIONS}"))
}

/// The mask that has a bit in common with all others but 0.
const ALL_INSTANCES: u8 = 0xff;

fn checked_mask(mask: u8) -> Result<u8, BadOptions> {
    check("mask", mask, mask != 0, || "at least 1".to_owned())?;
    Ok(mask)
}

/// Checks that a world differs in its instances, and in the shapes of its geometries, at most. `geometries_id`: that of
/// the world before.
fn check_geometries(geometries_id: Option<&GeometriesId>, geometry: Geometry) -> Result<(), GpuError> {
    let is_same = geometries_id.is_some() && geometries_id == geometry.accel().geometries_id();
    let wrong = || Mismatch::Scene("the world has other geometries than the caster's".to_owned());
    if is_same { Ok(()) } else { Err(wrong().into()) }
}

/// Checks the indices of triangles that are to be hidden.
fn check_indices(n_triangles: usize, triangles: &[u32]) -> Result<(), BadOptions> {
    let missing = triangles.iter().find(|triangle_ix| **triangle_ix as usize >= n_triangles);
    let error = |ix: &u32| BadOptions(format!("triangle {ix} cannot be hidden: there are {n_triangles} triangles"));
    missing.map_or(Ok(()), |ix| Err(error(ix)))
}

/// Returns the largest number of rays in a batch on a device.
fn most_rays(limits: &Limits) -> usize {
    let bytes_per_ray = mem::size_of::<Ray>().max(mem::size_of::<Hit>()) as u64;
    let in_groups = u64::from(limits.n_groups) * u64::from(RAY_GROUP_SIZE);
    (limits.storage_range / bytes_per_ray).min(in_groups) as usize
}

/// Counts the rays that can only miss. They have a NaN, an infinite origin or direction, or a direction that is zero
/// or so short that all its components are denormal (less than 2^-126).
pub fn count_invalid(rays: &[Ray]) -> u64 {
    rays.par_iter().with_min_len(1024).filter(|ray| !reference::cast::is_ray(ray)).count() as u64
}

/// Casts rays on the current rayon pool, as [`GpuCaster`] does on a device.
pub struct CpuCaster<'a> {
    held: Held<'a>,
    traversal: Traversal,
    links: TraversalLinks,
    /// The hierarchy for scattered rays, made after so many of them that it pays.
    wide: OnceLock<WideBvh>,
    n_scattered: AtomicUsize,
    /// For each triangle, `TRIANGLE_HIDDEN` or 0. None if no triangle is hidden.
    hidden: Option<Vec<u32>>,
    mask: u8,
}

/// The triangles and their structure: the caller's, or those of a world that the caster keeps.
enum Held<'a> {
    Borrowed(Geometry<'a>),
    Kept(World),
}

impl<'a> CpuCaster<'a> {
    /// Creates a caster, and computes the links (such as ropes) that the traversal reads in addition to the tree.
    pub fn new(geometry: Geometry<'a>, traversal: Traversal) -> Self {
        Self::of_held(Held::Borrowed(geometry), geometry, traversal)
    }

    /// Creates a caster that keeps the world.
    pub fn of_world(world: &World, traversal: Traversal) -> CpuCaster<'static> {
        CpuCaster::of_held(Held::Kept(world.clone()), world.geometry(), traversal)
    }

    fn of_held(held: Held<'a>, geometry: Geometry, traversal: Traversal) -> Self {
        let links = TraversalLinks::of(geometry.accel(), geometry.triangles(), traversal);
        Self {
            held,
            traversal,
            links,
            wide: OnceLock::new(),
            n_scattered: AtomicUsize::new(0),
            hidden: None,
            mask: ALL_INSTANCES,
        }
    }

    fn geometry(&self) -> Geometry<'_> {
        match &self.held {
            Held::Borrowed(geometry) => *geometry,
            Held::Kept(world) => world.geometry(),
        }
    }

    /// Casts rays into a world whose instances have changed, as [`GpuCaster::set_world`] does.
    ///
    /// # Errors
    /// The world was not made of this caster's.
    pub fn set_world(&mut self, world: &World) -> Result<(), GpuError> {
        let (before, geometry) = (self.geometry().accel(), world.geometry());
        check_geometries(before.geometries_id(), geometry)?;
        if before.structures_id() != geometry.accel().structures_id() {
            self.links = TraversalLinks::of(geometry.accel(), geometry.triangles(), self.traversal);
        }
        self.held = Held::Kept(world.clone());
        Ok(())
    }

    /// Makes rays pass through the triangles with these indices. A second call replaces the indices of the first.
    ///
    /// # Errors
    /// There is no triangle with one of the indices.
    pub fn hiding(self, triangles: &[u32]) -> Result<Self, BadOptions> {
        let n_triangles = self.geometry().n_triangles();
        check_indices(n_triangles, triangles)?;
        Ok(Self { hidden: Some(hidden_words(n_triangles, triangles)), ..self })
    }

    /// Makes later rays and points meet some instances alone, as [`GpuCaster::set_mask`] does.
    ///
    /// # Errors
    /// The mask is 0.
    pub fn set_mask(&mut self, mask: u8) -> Result<(), BadOptions> {
        self.mask = checked_mask(mask)?;
        Ok(())
    }

    /// Casts rays, and returns one hit for each.
    pub fn cast(&self, rays: &[Ray], query: Query) -> Vec<Hit> {
        let mut hits = vec![Hit::zeroed(); rays.len()];
        cpu::cast(&self.inputs(), self.search_for(rays), query, rays, &mut hits);
        hits
    }

    /// Returns what the searches read.
    fn inputs(&self) -> KernelInputs<'_> {
        let inputs = KernelInputs::of_geometry(self.geometry());
        let inputs = match &self.hidden {
            Some(words) => inputs.with_hidden(words),
            None => inputs,
        };
        inputs.with_links(&self.links).with_mask(self.mask)
    }

    /// Returns how the rays are traced: scattered rays through the wide hierarchy, if it exists or making it pays. The
    /// hits are the same either way.
    fn search_for(&self, rays: &[Ray]) -> CpuSearch<'_> {
        let (geometry, traversal) = (self.geometry(), self.traversal);
        let packets = CpuSearch::from(traversal);
        let n_triangles = geometry.triangles().len();
        if !cpu::suits_scattered_rays(n_triangles, traversal) || !are_scattered(rays, geometry.accel().bounds()) {
            return packets;
        }
        CpuSearch { wide: self.wide_after(rays.len()), ..packets }
    }

    /// Returns the wide hierarchy, if it exists or if making it pays after so many more scattered rays. None for a
    /// grid or instances.
    fn wide_after(&self, n_rays: usize) -> Option<&WideBvh> {
        let geometry = self.geometry();
        let tree = geometry.accel().as_kdtree(geometry.triangles())?;
        let n_scattered = self.n_scattered.fetch_add(n_rays, Ordering::Relaxed).saturating_add(n_rays);
        // Two threads may both make it. `get_or_init` could make a thread of rayon wait for itself.
        if self.wide.get().is_none() && n_scattered >= geometry.triangles().len().saturating_mul(RAYS_PER_TRIANGLE) {
            drop(self.wide.set(WideBvh::new(tree, geometry.triangles())));
        }
        self.wide.get()
    }
}

/// Number of scattered rays, as a multiple of the triangles, after which a wide hierarchy is made. The time of making
/// it is won back by 2 to 23 rays a triangle (docs/experiments.md).
const RAYS_PER_TRIANGLE: usize = 4;

/// Returns whether the hierarchy is for these rays. It knows the t of a ray by the length of its direction, which must
/// not underflow.
fn are_scattered(rays: &[Ray], bounds: [Vec3; 2]) -> bool {
    let underflows = |ray: &Ray| ray.direction != Vec3::ZERO && ray.direction.length_squared() < f32::MIN_POSITIVE;
    cpu::are_scattered(rays, bounds, |ray| (ray.origin, ray.direction))
        && !rays.par_iter().with_min_len(1024).any(underflows)
}

/// Casts rays by a [`CpuCaster`], and returns one hit for each. The hits are those that a [`GpuCaster`] finds.
pub fn cast_on_cpu(geometry: Geometry, traversal: Traversal, rays: &[Ray], query: Query) -> Vec<Hit> {
    CpuCaster::new(geometry, traversal).cast(rays, query)
}

/// Converts a ray of the renderer to a ray to cast, with `t_min` = 0.
pub(crate) fn cast_ray(ray: &PathRay) -> Ray {
    Ray { origin: ray.origin, t_min: 0.0, direction: ray.direction, t_max: ray.t_max }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        accel::{
            Accel,
            kdtree::{BuildOptions, KdTree},
        },
        layout::Triangle,
    };

    const N_TRIANGLES: u32 = 4096;

    /// Small triangles at pseudo-random places of a cube.
    fn soup() -> Vec<Triangle> {
        let mixed = |i: u32| (i ^ (i >> 15)).wrapping_mul(0x7feb_352d);
        let number = |i: u32| (mixed(mixed(mixed(i + 1))) >> 8) as f32 / (1 << 24) as f32;
        let point = |i: u32| Vec3::new(number(3 * i), number(3 * i + 1), number(3 * i + 2));
        let triangle = |i: u32| {
            let at = point(i);
            let [a, b] = [1, 2].map(|k| at + 0.1 * point(i + k * N_TRIANGLES));
            Triangle { v0: at, v1: a, v2: b, ..Triangle::default() }
        };
        (0..N_TRIANGLES).map(triangle).collect()
    }

    /// Rays from the middle: all in about one direction, or each in another.
    fn rays(is_scattered: bool) -> Vec<Ray> {
        let direction = |i: u32| match is_scattered {
            true => Vec3::new((i as f32).sin(), (1.7 * i as f32).cos(), (0.3 * i as f32).sin()),
            false => Vec3::new(1.0, 1e-5 * i as f32, 0.0),
        };
        let ray = |i| Ray { origin: Vec3::splat(0.5), t_min: 0.0, direction: direction(i), t_max: f32::INFINITY };
        (0..N_TRIANGLES * RAYS_PER_TRIANGLE as u32).map(ray).collect()
    }

    #[test]
    fn many_points_take_the_hierarchy_and_find_the_same_points() {
        let triangles = soup();
        let accel = Accel::KdTree(KdTree::build(&triangles, &BuildOptions::default()));
        let caster = CpuCaster::new(Geometry::new(&triangles, &accel).unwrap(), Traversal::OF_CPU);
        let position = |ray: &Ray| QueryPoint { position: ray.origin + 0.6 * ray.direction, t_max: f32::INFINITY };
        let points: Vec<_> = rays(true).iter().map(position).collect();
        let few = caster.closest_points(&points[..100]).unwrap();
        assert!(caster.wide.get().is_none(), "a hierarchy for few points would not pay");
        let many = caster.closest_points(&points).unwrap();
        assert!(caster.wide.get().is_some() && many[..100] == few && few.iter().all(|hit| hit.t.is_finite()));
    }

    #[test]
    fn scattered_rays_take_the_hierarchy_and_find_the_same_hits() {
        let triangles = soup();
        let accel = Accel::KdTree(KdTree::build(&triangles, &BuildOptions::default()));
        let geometry = Geometry::new(&triangles, &accel).unwrap();
        let caster = CpuCaster::new(geometry, Traversal::OF_CPU);
        let takes_wide = |rays: &[Ray]| caster.search_for(rays).wide.is_some();
        let (scattered, coherent) = (rays(true), rays(false));
        assert!(!takes_wide(&coherent) && !takes_wide(&scattered[..5000]), "a hierarchy for few rays would not pay");
        assert_eq!(takes_wide(&scattered), cpu::suits_scattered_rays(triangles.len(), Traversal::OF_CPU));
        let mut tiny = scattered.clone();
        tiny[7].direction *= 1e-25;
        assert!(!takes_wide(&tiny) && !takes_wide(&coherent));
        let by_mask = CpuCaster::new(geometry, Traversal::Mask);
        assert!(by_mask.search_for(&scattered).wide.is_none(), "another algorithm was asked for");
        for rays in [&scattered, &coherent, &tiny] {
            let hits = caster.cast(rays, Query::Closest);
            assert_eq!(hits, by_mask.cast(rays, Query::Closest));
            assert!(hits.iter().filter(|hit| hit.triangle_ix != NO_TRIANGLE).count() > 1000);
        }
    }
}
