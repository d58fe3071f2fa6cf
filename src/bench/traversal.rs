//! The benchmark of searches through the kd-tree and through grids on the same rays: their speeds, and whether all
//! find the same hits.

use std::time::Instant;

use bytemuck::Zeroable;
use serde::Serialize;

use super::{
    Spread, WARM_UP,
    chart::{BarChart, Scale, Series},
    difference::Difference,
    rays::{RaySet, RaySetKind},
    stage::Stage,
};
use crate::{
    accel::{
        Query, Search,
        kdtree::{Statistics, Traversal, TraversalLinks},
    },
    cast::{GpuCaster, Ray, cast_ray},
    cpu::{self, CpuSearch},
    gpu::{Device, GpuError, Statistic, StatisticValue},
    layout::{Hit, NO_TRIANGLE},
    reference::{
        counting::steps::{Steps, count_steps},
        inputs::KernelInputs,
    },
    scene::{Instance, Scene},
    world::{InstanceUpdate, Mismatch, World},
};

/// Number of timed casts of one variant before the next variant's turn.
pub const CASTS_PER_TURN: u16 = 5;

/// A search through the stage's scene, or through the same scene as geometries and instances.
struct Variant<'a> {
    search: Search,
    /// None: the stage's scene.
    kept: Option<Kept<'a>>,
}

/// A scene whose meshes are stored once, and what the search through it reads beside the trees.
struct Kept<'a> {
    world: &'a World,
    links: TraversalLinks,
}

impl Variant<'_> {
    fn name(&self) -> String {
        format!("{}{}", self.search, if self.kept.is_some() { ", instances" } else { "" })
    }

    fn inputs<'a>(&'a self, stage: &'a Stage) -> KernelInputs<'a> {
        match &self.kept {
            Some(kept) => KernelInputs::of_geometry(kept.world.geometry()).with_links(&kept.links),
            None => stage.inputs_of(self.search),
        }
    }
}

/// The variants on one stage, ready for rays.
pub struct Tracers<'a> {
    stage: &'a Stage,
    variants: Vec<Variant<'a>>,
    /// One caster per variant; `None` if the CPU casts with all threads of the current rayon pool.
    casters: Option<Vec<GpuCaster>>,
}

impl<'a> Tracers<'a> {
    /// Prepares the variants on a device, or on the current rayon pool if there is none.
    ///
    /// # Errors
    /// Fails as [`GpuCaster::new`] does.
    pub fn new(device: Option<&Device>, stage: &'a Stage, variants: &[Search]) -> Result<Self, GpuError> {
        let caster =
            |device: &Device, variant: Search| GpuCaster::new(device, stage.geometry(variant), variant.traversal());
        let casters = device.map(|device| variants.iter().map(|&variant| caster(device, variant)).collect());
        let casters = casters.transpose()?;
        let variants = variants.iter().map(|&search| Variant { search, kept: None }).collect();
        Ok(Self { stage, variants, casters })
    }

    /// Adds the searches through kd-trees once more, through the geometries and instances of the stage's scene.
    /// `world`: of the same scene, with [`FlatScene::with_instances`](crate::world::FlatScene::with_instances).
    ///
    /// # Errors
    /// Fails as [`GpuCaster::new`] does.
    pub fn with_instances(mut self, device: Option<&Device>, world: &'a World) -> Result<Self, GpuError> {
        let searches: Vec<_> = self.variants.iter().map(|variant| variant.search).collect();
        for search in searches.into_iter().filter(|search| matches!(search, Search::KdTree(_))) {
            if let (Some(device), Some(casters)) = (device, &mut self.casters) {
                casters.push(GpuCaster::new(device, world.geometry(), search.traversal())?);
            }
            let links = TraversalLinks::of(world.accel(), &world.scene().triangles, search.traversal());
            self.variants.push(Variant { search, kept: Some(Kept { world, links }) });
        }
        Ok(self)
    }

    /// Casts the rays `n_times` with each variant, in turns, and compares the hits with those that the CPU finds.
    ///
    /// # Errors
    /// Fails as [`GpuCaster::cast`] does.
    pub fn measure(&mut self, set: &RaySet, n_times: u16) -> Result<SetResult, GpuError> {
        let rays: Vec<_> = set.rays.iter().map(cast_ray).collect();
        let query = query_of(set);
        // Flattening rounds in other ways, so the instances have hits of their own to be compared with.
        let search = Search::KdTree(Traversal::Mask);
        let expected = self.cast_on_cpu(&Variant { search, kept: None }, &rays, query);
        let kept = self.variants.iter().find_map(|variant| variant.kept.as_ref()).map(|kept| kept.world);
        let links = TraversalLinks::default();
        let kept =
            kept.map(|world| self.cast_on_cpu(&Variant { search, kept: Some(Kept { world, links }) }, &rays, query));
        let mut results = vec![(Some(Vec::new()), Difference::default()); self.variants.len()];
        let n_warm_up = self.n_warm_up(set)?;
        for n_casts in turns(n_times) {
            for (variant_ix, (all_ms, difference)) in results.iter_mut().enumerate() {
                let n_untimed = n_warm_up[variant_ix];
                let (hits, ms) = self.cast(variant_ix, &rays, query, n_untimed + n_casts)?;
                *all_ms = all_ms.take().zip(ms).map(|(all, ms)| [all, ms[usize::from(n_untimed)..].to_vec()].concat());
                let of_world = kept.as_ref().filter(|_| self.variants[variant_ix].kept.is_some());
                *difference = difference.max(Difference::of(set.kind, of_world.unwrap_or(&expected), &hits));
            }
        }
        let result = |(variant_ix, (ms, difference)): (usize, (Option<Vec<f64>>, _))| {
            let variant = &self.variants[variant_ix];
            let ms = ms.and_then(Spread::of);
            let mrays_per_s = ms.and_then(|ms| ms.mrays_per_s(rays.len() as u64));
            let inputs = variant.inputs(self.stage);
            let steps = || count_steps(&inputs, variant.search.traversal(), query, &set.rays);
            let steps_a_ray = (variant.search != Search::Wide).then(|| StepsARay::new(&steps(), rays.len()));
            let kernel = match &self.casters {
                Some(casters) => casters[variant_ix].statistics(query)?,
                None => Vec::new(),
            };
            Ok(VariantResult { traversal: variant.name(), ms, mrays_per_s, difference, steps_a_ray, kernel })
        };
        Ok(SetResult {
            rays: set.kind,
            n_rays: rays.len(),
            n_hits: expected.iter().filter(|hit| hit.triangle_ix != NO_TRIANGLE).count(),
            variants: results.into_iter().enumerate().map(result).collect::<Result<_, GpuError>>()?,
        })
    }

    /// Returns, for each variant, the number of untimed casts at the beginning of each of its turns. On a device,
    /// they take about [`WARM_UP`] together, and their number is 1 to 1000. On the CPU, or without timestamps, it is
    /// 1. They are needed because the rays have just been uploaded, the caches hold another variant's structure, and
    /// the device's clock may have fallen while the CPU compared hits. Variants can differ in speed by a factor of a
    /// thousand, so each has a number of its own.
    ///
    /// # Errors
    /// Fails as [`GpuCaster::cast`] does.
    #[doc(hidden)]
    pub fn n_warm_up(&mut self, set: &RaySet) -> Result<Vec<u16>, GpuError> {
        let Some(casters) = &mut self.casters else { return Ok(vec![1; self.variants.len()]) };
        let rays: Vec<_> = set.rays.iter().map(cast_ray).collect();
        let query = query_of(set);
        let n_casts = |caster: &mut GpuCaster| {
            let once_ms = caster.cast(&rays, query, 1)?.gpu_ms.map_or(f64::INFINITY, |ms| ms.iter().sum());
            Ok((WARM_UP.as_secs_f64() * 1e3 / once_ms.max(1e-2)).clamp(1.0, 1000.0) as u16)
        };
        casters.iter_mut().map(n_casts).collect()
    }

    /// Returns the hits, and the milliseconds of each cast (`None` without timestamps).
    fn cast(
        &mut self,
        variant_ix: usize,
        rays: &[Ray],
        query: Query,
        n_times: u16,
    ) -> Result<(Vec<Hit>, Option<Vec<f64>>), GpuError> {
        if let Some(casters) = &mut self.casters {
            let cast = casters[variant_ix].cast(rays, query, n_times.into())?;
            return Ok((cast.hits, cast.gpu_ms));
        }
        let mut hits = Vec::new();
        let once = |_| {
            let begin = Instant::now();
            hits = self.cast_on_cpu(&self.variants[variant_ix], rays, query);
            begin.elapsed().as_secs_f64() * 1e3
        };
        let ms = (0..n_times).map(once).collect();
        Ok((hits, Some(ms)))
    }

    fn cast_on_cpu(&self, variant: &Variant, rays: &[Ray], query: Query) -> Vec<Hit> {
        let mut hits = vec![Hit::zeroed(); rays.len()];
        let wide = (variant.search == Search::Wide).then(|| self.stage.world.wide_bvh()).flatten();
        let search = CpuSearch { traversal: variant.search.traversal(), wide };
        cpu::cast(&variant.inputs(self.stage), search, query, rays, &mut hits);
        hits
    }
}

/// Returns the query that the rays of a set are for.
fn query_of(set: &RaySet) -> Query {
    if set.kind.is_any_hit() { Query::Any } else { Query::Closest }
}

/// Returns the number of casts of each turn; they sum to `n_times`.
pub(super) fn turns(n_times: u16) -> impl Iterator<Item = u16> {
    (0..n_times).step_by(CASTS_PER_TURN.into()).map(move |first| CASTS_PER_TURN.min(n_times - first))
}

/// The results on one set of rays.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SetResult {
    pub rays: RaySetKind,
    pub n_rays: usize,
    /// Number of hits that the CPU finds.
    pub n_hits: usize,
    /// In the order of the variants given to [`Tracers::new`].
    pub variants: Vec<VariantResult>,
}

/// The result of one variant on one set of rays.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VariantResult {
    /// The variant's word: a traversal of the kd-tree, or a grid. Through instances, ", instances" follows.
    pub traversal: String,
    /// Time of the whole set; none where the device has no timestamps.
    pub ms: Option<Spread>,
    /// Million rays per second.
    pub mrays_per_s: Option<Spread>,
    /// Difference from the hits that the CPU finds by `mask` in the same world: the maximum of each number over all
    /// turns.
    #[serde(flatten)]
    pub difference: Difference,
    /// Steps of the same search on the CPU; none for the wide hierarchy, whose steps nobody counts.
    pub steps_a_ray: Option<StepsARay>,
    /// The driver's statistics of the kernel; empty if it has none.
    pub kernel: Vec<Statistic>,
}

impl VariantResult {
    /// Returns the number of registers of an invocation, if the driver reports it.
    pub fn registers(&self) -> Option<StatisticValue> {
        self.kernel.iter().find(|statistic| statistic.name.contains("egister")).map(|statistic| statistic.value)
    }
}

/// Mean numbers of the acceleration structure's elements that a ray of a set reads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct StepsARay {
    /// Nodes and slabs of a kd-tree, or cells of a grid.
    pub nodes: f64,
    /// Links to parents, and ropes.
    pub links: f64,
    /// Boxes of nodes.
    pub boxes: f64,
    /// Triangles in the visited leaves or cells. A triangle counts once for each leaf or cell.
    pub triangles: f64,
}

impl StepsARay {
    fn new(steps: &Steps, n_rays: usize) -> Self {
        let mean = |n: u64| n as f64 / n_rays.max(1) as f64;
        Self {
            nodes: mean(steps.n_nodes),
            links: mean(steps.n_links),
            boxes: mean(steps.n_boxes),
            triangles: mean(steps.n_triangles),
        }
    }
}

/// The suite's report.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Name of the suite: `traversal`.
    pub suite: &'static str,
    /// The device's own name, or the number of CPU threads.
    pub device: String,
    /// The driver's name and version; none on the CPU.
    pub driver: Option<String>,
    pub scene: String,
    /// Whether the scene was put into a closed room.
    pub room: bool,
    /// Width of the picture in pixels, with one primary ray each.
    pub width: u32,
    /// Height of the picture in pixels.
    pub height: u32,
    pub n_triangles: usize,
    pub tree: Statistics,
    /// The same scene as geometries and instances, if it was searched.
    pub instances: Option<InstancesReport>,
    /// Number of timed casts of each set by each variant.
    pub n_times: u16,
    pub sets: Vec<SetResult>,
}

/// What a scene is as geometries and instances.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct InstancesReport {
    pub n_instances: usize,
    /// Number of stored triangles.
    pub n_stored: usize,
    /// Size of all kd-trees and of the hierarchy over the instances.
    pub bytes: u64,
    /// Time to move all instances: a new hierarchy, on the host.
    pub move_ms: Spread,
}

impl InstancesReport {
    /// Moves all instances of a scene that can move `n_times`, each to where it is. `world`: of the scene, with
    /// [`FlatScene::with_instances`](crate::world::FlatScene::with_instances).
    ///
    /// # Errors
    /// Fails as [`World::with_instances_changed`] does.
    pub fn measure(scene: &Scene, world: &World, n_times: u16) -> Result<Self, Mismatch> {
        let fixed = world.scene().instances.as_ref().map_or(&[][..], |instances| &instances.fixed);
        let update = |(instance_ix, instance): (usize, &Instance)| InstanceUpdate {
            instance_ix,
            transform: Some(instance.transform.clone()),
            ..InstanceUpdate::default()
        };
        let can_move = |update: &InstanceUpdate| fixed.binary_search(&update.instance_ix).is_err();
        let updates: Vec<_> = scene.instances.iter().enumerate().map(update).filter(can_move).collect();
        let mut ms = Vec::new();
        for _ in 0..n_times {
            let begin = Instant::now();
            drop(world.with_instances_changed(&updates)?);
            ms.push(begin.elapsed().as_secs_f64() * 1e3);
        }
        Ok(Self {
            n_instances: scene.instances.len(),
            n_stored: world.scene().triangles.len(),
            bytes: world.statistics().bytes(),
            move_ms: Spread::of(ms).expect("at least one time"),
        })
    }
}

impl Report {
    /// Returns a chart of the speeds, with one group per set and one bar per variant.
    pub fn chart(&self) -> BarChart {
        let n_variants = self.sets.first().map_or(0, |set| set.variants.len());
        let series = |variant_ix: usize| Series {
            name: self.sets[0].variants[variant_ix].traversal.clone(),
            values: (self.sets.iter())
                .map(|set| set.variants[variant_ix].mrays_per_s.map(|rate| rate.median))
                .collect(),
        };
        BarChart {
            title: format!("{}, {} triangles, on {}", self.scene, self.n_triangles, self.device),
            unit: "Mrays/s".to_owned(),
            scale: Scale::Linear,
            groups: self.sets.iter().map(|set| set.rays.name().to_owned()).collect(),
            series: (0..n_variants).map(series).collect(),
        }
    }

    /// Returns the first set and variant for which more hits differ from the CPU's than rounding explains.
    pub fn first_wrong(&self) -> Option<(&SetResult, &VariantResult)> {
        let pairs = self.sets.iter().flat_map(|set| set.variants.iter().map(move |variant| (set, variant)));
        pairs.into_iter().find(|(set, variant)| !variant.difference.is_rounding(set.n_rays))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_add_up() {
        for n_times in [1, 4, 5, 6, 25, 10_000] {
            assert_eq!(turns(n_times).sum::<u16>(), n_times);
            assert!(turns(n_times).all(|n| (1..=CASTS_PER_TURN).contains(&n)));
        }
    }
}
