//! Chooses what the user leaves open, in one place for all commands: which kd-tree is built, which algorithm
//! traverses it, and how primary rays find their triangles. The structure is a kd-tree unless the user asks for a grid,
//! or meshes deform and few rays are traced.
//!
//! ```text
//! accel    the acceleration structure: a kd-tree or a grid
//! tree     which kd-tree: by rule, from the numbers of rays and of triangles
//! motion   the structure of what deforms: by rule, from the times of build and rays of a frame
//! rule     traversal and primary visibility, by rule, from the device and the sizes of scene and picture
//! trial    traversal and primary visibility, from the times of each candidate on the device
//!   timings  the candidates, their times, the quickest
//!   measure  scene, tree -> times, by a short measurement
//!   cache    times, kept from one run to the next
//! chosen   choices with their reasons, for reports
//! ```
//!
//! Every traversal finds the same hits, bit for bit, so the fastest one may be chosen by measurement. Primary
//! visibility by compute kernels and by tracing may also be chosen by measurement, unless a camera may be so far away
//! that the two round differently. Choices that change bits are made by rule: the choice between graphics and kernels
//! for primary rays, and every choice if the output contains the traversal costs of rays. All choices depend on the
//! size of the whole picture, so that a part of it is rendered as the whole is.
//!
//! A measurement uploads the tree once more, and makes ropes for it if they are a candidate. That takes longer than a
//! frame, but the result is kept, so every later run may profit. Only runs with enough rays to win the time back make
//! a measurement: long casts, many samples, films, windows. Drivers that run kernels on the CPU are never measured,
//! because compiling the candidate kernels takes them longer than another choice could save.

mod accel;
mod cache;
mod chosen;
mod measure;
mod motion;
mod rule;
mod timings;
mod tree;
mod trial;

use std::sync::Arc;

use glam::Vec2;

use self::trial::Trial;
pub use self::{
    accel::ChosenAccel,
    cache::{Cache, Key},
    chosen::{Choices, Chosen, Methods, Reason},
    measure::{measure_primaries, measure_traversals},
    rule::{primary_by_rule, traversal_by_rule},
    timings::{Candidates, Timings},
    tree::{BuildPolicy, TreeKind},
};
use crate::{
    accel::{AccelKind, kdtree::Traversal},
    frame::{Integrator, Primary, RenderOptions},
    gpu::{Context, DeviceInfo, GpuError},
    scene::{Camera, Projection, Scene},
    world::{World, instances::Instancing},
};

/// What the user specifies; `None` and [`BuildPolicy::Auto`] leave a choice open.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Request {
    /// The kind of the acceleration structure.
    pub accel: Option<AccelKind>,
    /// Which tree is built.
    pub build: BuildPolicy,
    /// The algorithm that traverses the kd-tree.
    pub traversal: Option<Traversal>,
    /// How primary rays find their triangles.
    pub primary: Option<Primary>,
    /// Whether meshes that occur several times are stored once.
    pub instances: Instancing,
}

/// The kind of processor that traces rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Processor {
    /// The CPU, without Vulkan.
    Cpu,
    /// A Vulkan driver that runs kernels on the CPU, and executes both sides of each branch.
    SoftwareDriver,
    /// A GPU.
    Gpu,
}

impl Processor {
    /// Returns the processor that an open device is, or without a device the CPU.
    #[doc(hidden)]
    pub fn of(context: Option<&Context>) -> Self {
        match context {
            None => Self::Cpu,
            Some(context) if context.predicates_branches() => Self::SoftwareDriver,
            Some(_) => Self::Gpu,
        }
    }

    /// Returns the processor that a device will be once it is open.
    pub fn of_device(info: &DeviceInfo) -> Self {
        if info.is_software() { Self::SoftwareDriver } else { Self::Gpu }
    }
}

/// An estimate of the work of a run. Choices depend on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Workload {
    /// Width and height of the whole picture in pixels, whatever part of it is rendered.
    pub size: (u32, u32),
    /// Number of rays that the work takes, as far as that is known in advance. If the same work is repeated for
    /// timing, only one repetition counts, so that the choices are those of a single run.
    pub n_rays: u64,
    /// Whether the output contains the traversal costs of rays (AOVs), which depend on tree and traversal.
    pub shows_costs: bool,
    /// The greatest absolute coordinate of the points where cameras' rays begin; infinity where a camera may go
    /// anywhere.
    pub farthest_eye: f32,
    /// Whether paths are traced. Their primary rays are never rasterized.
    pub traces_paths: bool,
}

impl Workload {
    /// Returns the work of `n_pictures` pictures with one sample per pixel, if every pixel's ray hits and is
    /// reflected once.
    pub fn of_pictures(options: &RenderOptions, n_lights: usize, n_pictures: u64) -> Self {
        let size = (options.width, options.height);
        let rays_per_pixel = u64::from(options.max_depth.min(2)) * (1 + n_lights as u64);
        let factors = [u64::from(size.0), u64::from(size.1), rays_per_pixel, n_pictures];
        let n_rays = factors.into_iter().fold(1, u64::saturating_mul);
        let traces_paths = options.integrator == Integrator::Path;
        Self { size, n_rays, shows_costs: options.pixel_aovs, farthest_eye: f32::INFINITY, traces_paths }
    }

    /// Returns the same work with `farthest_eye` set from `cameras`, which are all the cameras of the work.
    #[must_use]
    pub fn with_cameras<'c>(self, cameras: impl Iterator<Item = &'c Camera>) -> Self {
        let aspect = self.size.0 as f32 / self.size.1 as f32;
        let farthest = |camera: &Camera| {
            let beside_eye = match camera.projection {
                Projection::Perspective { .. } => 0.0,
                Projection::Orthographic { height } => Vec2::new(aspect, 1.0).length() * height / 2.0,
            };
            camera.eye.abs().max_element() + beside_eye
        };
        Self { farthest_eye: cameras.map(farthest).fold(0.0, f32::max), ..self }
    }

    /// Tells whether tracing and compute kernels that rasterize find the same primary hits, bit for bit.
    fn primaries_agree(&self, world: &World) -> bool {
        self.farthest_eye <= world.geometry().accel().origin_reach()
    }

    /// Returns the work of an interactive window, whose number of rays and cameras have no bound.
    pub fn of_window(size: (u32, u32)) -> Self {
        Self { size, n_rays: u64::MAX, shows_costs: false, farthest_eye: f32::INFINITY, traces_paths: false }
    }

    /// Returns the work of casting rays without a picture.
    pub fn of_rays(n_rays: u64) -> Self {
        Self { n_rays, ..Self::of_window((0, 0)) }
    }

    fn is_of_rays(&self) -> bool {
        self.size == (0, 0)
    }
}

impl Request {
    /// Returns the request for a scene in which instances move or meshes change: what moves is stored apart from what
    /// does not, and a GPU builds its structures, of the kind that suits a frame, unless the user has chosen otherwise.
    /// Also returns a note that says why a kind was chosen, unless it was pinned or nothing deforms. `workload`: that
    /// of one frame.
    pub fn for_motion(self, processor: Processor, scene: &Scene, workload: &Workload) -> (Self, Option<String>) {
        let instances = match self.instances {
            Instancing::Auto => Instancing::Keep,
            chosen => chosen,
        };
        let is_open = processor == Processor::Gpu && self.build == BuildPolicy::Auto;
        let build = if is_open { BuildPolicy::Gpu } else { self.build };
        let next = Self { instances, build, ..self };
        let may_be_grid = self.accel.is_none() && self.traversal.is_none() && instances == Instancing::Keep;
        match (is_open && may_be_grid).then(|| motion::quickest(scene, workload)).flatten() {
            Some((accel, note)) => (Self { accel: Some(accel), ..next }, Some(note)),
            None => (next, None),
        }
    }

    /// Returns the requested kind of acceleration structure for `n_triangles` triangles. For a kd-tree, it is the
    /// user's tree, or else the rule's. `keeps_instances`: whether meshes are stored once.
    pub fn choose_accel(
        &self,
        processor: Processor,
        n_triangles: usize,
        (workload, keeps_instances): (&Workload, bool),
    ) -> ChosenAccel {
        // Pictures have warnings about the first view, and a metered exposure, which need a tree of the host's. Many
        // meshes are built at once by the host, one by one by a device.
        let is_open_to_gpu = processor == Processor::Gpu && workload.is_of_rays() && !keeps_instances;
        let by_rule = || match TreeKind::by_rule(processor, n_triangles, workload.n_rays) {
            TreeKind::Fast if is_open_to_gpu => TreeKind::Gpu,
            kind => kind,
        };
        match self.accel.unwrap_or_default() {
            AccelKind::KdTree => ChosenAccel::KdTree(Chosen::pinned_or(self.build.pinned(), by_rule)),
            AccelKind::Grid => ChosenAccel::Grid,
            AccelKind::Grid2 => ChosenAccel::Grid2,
        }
    }

    /// Chooses traversal and primary visibility, without any measurement.
    #[doc(hidden)]
    pub fn methods_by_rule(&self, context: Option<&Context>, n_triangles: usize, size: (u32, u32)) -> Methods {
        Methods {
            traversal: Chosen::pinned_or(self.traversal, || traversal_by_rule(Processor::of(context))),
            primary: Chosen::pinned_or(self.primary, || primary_by_rule(context, n_triangles, size)),
            traversal_ns: None,
            primary_ns: None,
        }
    }

    /// Chooses traversal and primary visibility. If the choice changes no bit of the output, the times of an earlier
    /// run decide, or those of a measurement where that pays off. Else the rule decides.
    ///
    /// # Errors
    /// The device is lost. If a measurement fails otherwise, the rule decides.
    #[doc(hidden)]
    pub fn methods(
        &self,
        context: Option<&Arc<Context>>,
        world: &World,
        workload: &Workload,
        cache: &Cache,
    ) -> Result<Methods, GpuError> {
        let n_triangles = world.scene().n_triangles();
        let mut by_rule = self.methods_by_rule(context.map(|context| &**context), n_triangles, workload.size);
        let is_crowded = world.scene().instances.is_some() && rule::traces_instances(n_triangles, workload.size);
        if workload.traces_paths || is_crowded && by_rule.primary.by == Reason::Rule {
            by_rule.primary = Chosen { value: Primary::Trace, by: Reason::Rule };
        }
        let is_gpu = |context: &&Arc<Context>| Processor::of(Some(context)) == Processor::Gpu && !workload.shows_costs;
        let Some(context) = context.filter(is_gpu) else { return Ok(by_rule) };
        let trial = Trial { context, world, workload, cache };
        let mut methods = by_rule;
        if methods.traversal.by == Reason::Rule && world.accel().kind() == AccelKind::KdTree {
            trial.choose_traversal(&mut methods)?;
        }
        let may_trace = methods.primary == Chosen { value: Primary::SoftwareRaster, by: Reason::Rule };
        if may_trace && workload.primaries_agree(world) {
            trial.choose_primary(&mut methods)?;
        }
        Ok(methods)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use glam::Vec3;

    use super::*;
    use crate::{frame::Crop, scene::Mesh};

    #[test]
    fn a_part_is_the_same_work_as_its_whole_picture() {
        let whole = RenderOptions { width: 640, height: 480, max_depth: 5, ..RenderOptions::default() };
        let crop = RenderOptions { crop: Some(Crop { x0: 3, y0: 4, x1: 5, y1: 6 }), ..whole.clone() };
        let [whole, crop] = [whole, crop].map(|options| Workload::of_pictures(&options, 3, 2));
        assert_eq!(whole, crop);
        assert_eq!(whole.n_rays, 640 * 480 * 2 * 4 * 2);
        let request = Request::default();
        for processor in [Processor::Cpu, Processor::SoftwareDriver, Processor::Gpu] {
            let choose = |workload| request.choose_accel(processor, 100_000, (workload, false));
            assert_eq!(choose(&whole), choose(&crop));
        }
        let candidates = [whole, crop].map(|workload| Candidates::of_traversals(100_000, workload.n_rays));
        assert_eq!(candidates[0], candidates[1]);
    }

    #[test]
    fn only_gpus_build_what_moves_and_only_if_nothing_is_pinned() {
        let faces = (0..3000).map(|ix| [ix, ix + 1, ix + 2]).collect();
        let positions = (0..3002).map(|ix| Vec3::new((ix % 50) as f32, (ix / 50) as f32, (ix % 3) as f32)).collect();
        let mesh = Mesh { deforms: true, ..Mesh::of_triangles(positions, faces) };
        let scene = Scene { meshes: vec![mesh], ..Scene::empty(Path::new("scene")) };
        let few = Workload::of_pictures(&RenderOptions { width: 64, height: 64, ..Default::default() }, 1, 1);
        let taken = |request: Request, processor| {
            let (request, note) = request.for_motion(processor, &scene, &few);
            (request.build, request.accel, note.is_some())
        };
        let grid2 = (BuildPolicy::Gpu, Some(AccelKind::Grid2), true);
        assert_eq!(taken(Request::default(), Processor::Gpu), grid2);
        for processor in [Processor::SoftwareDriver, Processor::Cpu] {
            assert_eq!(taken(Request::default(), processor), (BuildPolicy::Auto, None, false));
        }
        for (pinned, build) in [
            (Request { build: BuildPolicy::Best, ..Request::default() }, BuildPolicy::Best),
            (Request { traversal: Some(Traversal::Mask), ..Request::default() }, BuildPolicy::Gpu),
            (Request { instances: Instancing::Flatten, ..Request::default() }, BuildPolicy::Gpu),
        ] {
            assert_eq!(taken(pinned, Processor::Gpu), (build, None, false));
        }
        let kd_tree = Request { accel: Some(AccelKind::KdTree), ..Request::default() };
        assert_eq!(taken(kd_tree, Processor::Gpu), (BuildPolicy::Gpu, kd_tree.accel, false));
    }

    #[test]
    fn only_gpus_build_the_trees_of_few_rays_into_one_mesh() {
        let kind = |processor, workload: Workload, keeps| {
            let accel = Request::default().choose_accel(processor, 1000, (&workload, keeps));
            accel.tree_kind().map(|chosen| chosen.value)
        };
        let (few, many) = (Workload::of_rays(1000), Workload::of_rays(10_000_000));
        assert_eq!(kind(Processor::Gpu, few, false), Some(TreeKind::Gpu));
        assert_eq!(kind(Processor::Gpu, many, false), Some(TreeKind::Best));
        assert_eq!(kind(Processor::Gpu, few, true), Some(TreeKind::Fast));
        assert_eq!(kind(Processor::SoftwareDriver, few, false), Some(TreeKind::Fast));
        let picture = Workload::of_pictures(&RenderOptions { width: 8, height: 8, ..Default::default() }, 1, 1);
        assert_eq!(kind(Processor::Gpu, picture, false), Some(TreeKind::Fast));
    }

    #[test]
    fn what_is_pinned_is_taken() {
        let request = Request {
            build: BuildPolicy::Best,
            traversal: Some(Traversal::Backtrack),
            primary: Some(Primary::Trace),
            ..Request::default()
        };
        let accel = request.choose_accel(Processor::Gpu, usize::MAX, (&Workload::of_rays(0), false));
        assert_eq!(accel, ChosenAccel::KdTree(Chosen { value: TreeKind::Best, by: Reason::Pinned }));
        let Methods { traversal, primary, traversal_ns, .. } = request.methods_by_rule(None, 10, (10, 10));
        assert_eq!(
            (traversal.to_string(), primary.to_string()),
            ("backtrack (pinned)".into(), "trace (pinned)".into())
        );
        assert_eq!(traversal_ns, None);
    }
}
