//! Tests `kdray bench driver` under the validation layer: contenders take turns on the device, their differences are
//! counted, and a device without ray tracing is refused. If the device has ray tracing, the suite itself runs.

mod support;

use std::{fs, path::Path, rc::Rc, sync::Arc};

use kdray::{
    accel::{
        Query,
        kdtree::{BuildOptions, KdTree, Traversal},
    },
    bench::{
        Spread,
        difference::DriverDifference,
        driver::{
            contest::{ContenderResult, run_contest},
            raster::Raster,
            report::{RasterResult, SetResult},
        },
        rays::{RaySet, RaySetKind, ray_sets},
        stage::Stage,
    },
    buffers::{AccelBuffers, CastResources},
    cast::{Contender, Kernel, Ray},
    gpu::{Access, Commands, Context, ContextOptions, Device, GpuError},
    layout::NO_TRIANGLE,
    world::World,
};
use serde_json::Value;
use support::{
    command::{fail, names, stdout, succeed},
    device, scenes,
};
use tempfile::TempDir;

const SIZE: (u32, u32) = (40, 30);

fn stage() -> Stage {
    Stage::in_room(scenes::mixed(), SIZE, &BuildOptions::default())
}

/// A kernel, and the tree that it searches.
struct Walker {
    kernel: Kernel,
    _tree: AccelBuffers,
}

/// Returns a kernel that casts the rays of a set into a stage's scene.
fn walker(context: &Arc<Context>, stage: &Stage, set: &RaySet, traversal: Traversal) -> Box<dyn Contender> {
    let query = if set.kind.is_any_hit() { Query::Any } else { Query::Closest };
    let tree = AccelBuffers::new(context, stage.world.geometry()).expect("a tree");
    let bindings = CastResources::bindings(context, &tree).expect("bindings");
    let resources = CastResources::new(context, &bindings, &tree, set.rays.len()).expect("resources");
    let cast = |ray: &kdray::layout::PathRay| Ray {
        origin: ray.origin,
        t_min: 0.0,
        direction: ray.direction,
        t_max: ray.t_max,
    };
    resources.cast_rays.upload(&set.rays.iter().map(cast).collect::<Vec<_>>()).expect("an upload");
    let kernel = Kernel::new(context, &bindings, &Rc::new(resources), (traversal, query)).expect("a kernel");
    Box::new(Walker { kernel, _tree: tree })
}

impl Contender for Walker {
    fn name(&self) -> String {
        self.kernel.name()
    }
    fn access(&self) -> Access {
        self.kernel.access()
    }
    fn record(&self, commands: &Commands) {
        self.kernel.record(commands);
    }
    fn resources(&self) -> &Rc<CastResources> {
        self.kernel.resources()
    }
}

/// A contender that does no work of its own and otherwise behaves as another one.
struct Idle(Box<dyn Contender>);

impl Contender for Idle {
    fn name(&self) -> String {
        "idle".into()
    }
    fn access(&self) -> Access {
        self.0.access()
    }
    fn record(&self, _: &Commands) {}
    fn resources(&self) -> &Rc<CastResources> {
        self.0.resources()
    }
}

/// Runs two kernels on the same set of rays, in place of the driver and its rival.
fn trials(stage: &Stage, rivals: &Stage, set: &RaySet) -> Vec<ContenderResult> {
    let context = device();
    let contenders =
        vec![walker(&context, stage, set, Traversal::Stack), walker(&context, rivals, set, Traversal::Mask)];
    let mut pauses = Vec::new();
    let trials = run_contest(&context, &contenders, 7, |n_rounds| {
        pauses.push(n_rounds);
        Ok(())
    });
    assert_eq!(pauses.iter().sum::<u16>(), 7);
    assert_eq!(context.validation_messages(), Vec::<String>::new());
    trials.expect("a contest")
}

#[test]
fn contenders_are_timed_and_agree() {
    let stage = stage();
    for set in &ray_sets(&stage) {
        let trials = trials(&stage, &stage, set);
        let result = SetResult::new(set.kind, &trials);
        assert_eq!((result.n_rays, result.kdray.len()), (set.rays.len(), 1));
        assert_eq!(result.n_hits, trials[0].hits.iter().filter(|hit| hit.triangle_ix != NO_TRIANGLE).count());
        assert!(result.n_hits > 0, "{}", set.kind.name());
        let rival = &result.kdray[0];
        assert_eq!((rival.traversal.as_str(), rival.apart), ("mask", DriverDifference::default()));
        let (own, other) = (rival.timing.mrays_per_s.unwrap(), result.driver.mrays_per_s.unwrap());
        assert!(own.min > 0.0 && own.min <= own.median && own.median <= own.max);
        assert_eq!(rival.ratio, Some(own.median / other.median));
    }
}

#[test]
fn a_wrong_tree_is_noticed() {
    let (stage, mut wrong) = (stage(), stage());
    // The tree is built with triangles of the mesh in place of the walls, so that rays that should hit the walls miss
    // or hit elsewhere.
    let first_wall = wrong.scene().triangles.len() - 12;
    let mut swapped = wrong.scene().triangles.clone();
    (0..12).for_each(|i| swapped.swap(i, first_wall + i));
    let options = BuildOptions::default();
    let tree = KdTree::build(&swapped, &options);
    wrong.world = World::with_tree(wrong.scene().clone(), tree, &options).expect("a world");
    for set in &ray_sets(&stage) {
        let result = SetResult::new(set.kind, &trials(&stage, &wrong, set));
        let apart = result.kdray[0].apart;
        assert!(!apart.is_rounding(result.n_rays) || set.kind == RaySetKind::Shadow, "{} {apart:?}", set.kind.name());
    }
}

#[test]
fn a_contender_that_writes_nothing_is_noticed() {
    let (stage, context) = (stage(), device());
    for set in &ray_sets(&stage) {
        let mut contenders = [walker(&context, &stage, set, Traversal::Mask)];
        let right = run_contest(&context, &contenders, 1, |_| Ok(())).expect("a contest").remove(0).hits;
        // The buffer holds the right hits of the previous run.
        contenders = contenders.map(|walker| Box::new(Idle(walker)) as Box<dyn Contender>);
        let idle = run_contest(&context, &contenders, 0, |_| Ok(())).expect("a contest").remove(0).hits;
        let apart = DriverDifference::of(set.kind, &right, &idle);
        assert_eq!(apart, DriverDifference { n_hit_or_miss: right.len() as u64, n_distance: 0 }, "{}", set.kind.name());
    }
}

#[test]
fn rasterized_primary_rays_are_timed() {
    let (stage, context) = (stage(), device());
    let set = &ray_sets(&stage)[0];
    let primary = SetResult::new(set.kind, &trials(&stage, &stage, set));
    let mut rasters = Raster::all(&context, &stage).expect("renderers");
    assert_eq!(rasters.len(), if context.has_int64_atomics() { 2 } else { 1 });
    for raster in &mut rasters {
        raster.draw(3).expect("frames");
        raster.draw(2).expect("frames");
        let RasterResult { passes, timing, ratio, .. } = raster.result(&primary);
        let ms = timing.ms.unwrap();
        let sum = |of: fn(&Spread) -> f64| passes.iter().map(|pass| of(&pass.ms)).sum::<f64>();
        assert!(passes.len() > 1 && passes.last().unwrap().name == "primary_hit");
        assert!(passes[0].ms.min > 0.0 && ms.min >= sum(|ms| ms.min) && ms.max <= sum(|ms| ms.max));
        assert!((ratio.unwrap() / (primary.driver.ms.unwrap().median / ms.median) - 1.0).abs() < 1e-9);
    }
    assert_eq!(context.validation_messages(), Vec::<String>::new());
}

/// Writes a scene file of a box.
fn write_scene(directory: &Path) {
    let scene = "[[mesh]]\ngenerator = \"box\"\nsize = [1.0, 1.0, 1.0]\n";
    fs::write(directory.join("box.toml"), scene).unwrap();
}

#[test]
fn the_suite_runs_or_says_what_the_device_lacks() {
    let directory = TempDir::new().unwrap();
    write_scene(directory.path());
    let suite = ["bench", "driver", "box.toml", "--size", "40x30", "--repeat", "3"];
    let suite = [&suite[..], &["--json", "x.json", "--svg", "x.svg"]].concat();
    match Device::with_ray_tracing(&ContextOptions::default()) {
        Err(GpuError::Lacks { missing, .. }) => {
            assert!(missing.contains("VK_KHR_ray_tracing_pipeline"), "{missing}");
            fail(directory.path(), &suite, 4, "lacks VK_KHR_acceleration_structure, VK_KHR_ray_tracing_pipeline");
            assert_eq!(names(directory.path()), ["box.toml"]);
        }
        Err(error) => panic!("{error}"),
        Ok(_) => {
            let text = stdout(&succeed(directory.path(), &suite));
            let json: Value = serde_json::from_slice(&fs::read(directory.path().join("x.json")).unwrap()).unwrap();
            for (set, kind) in json["sets"].as_array().unwrap().iter().zip(RaySetKind::ALL) {
                assert!(set["rays"] == kind.name() && text.contains(kind.name()));
                assert!(set["n_hits"].as_u64() > Some(0) || kind == RaySetKind::Shadow);
                assert!(set["kdray"].as_array().unwrap().iter().all(|rival| rival["ratio"].as_f64() > Some(0.0)));
            }
            assert!(json["builds"]["bvh_ms"]["median"].as_f64() > Some(0.0));
            assert!(fs::read_to_string(directory.path().join("x.svg")).unwrap().starts_with("<svg"));
        }
    }
}

#[test]
fn mistakes_are_told_first() {
    let directory = TempDir::new().unwrap();
    write_scene(directory.path());
    let cases: [(&[&str], i32, &str); 4] = [
        (&["bench", "driver"], 2, "MESH"),
        (&["bench", "driver", "box.toml", "--size", "1"], 2, "--size"),
        (&["bench", "driver", "box.toml", "--json", "none/x.json"], 5, "none/x.json"),
        (&["bench", "driver", "box.toml", "--device", "abacus"], 4, "abacus"),
    ];
    for (arguments, code, named) in cases {
        fail(directory.path(), arguments, code, named);
    }
}
