//! The structure of a world of instances: a kd-tree or a grid for each geometry, and a hierarchy over the instances.

use std::{
    iter,
    ops::Range,
    sync::{Arc, OnceLock, Weak},
};

use glam::Vec3;
use rayon::prelude::*;

use super::{
    AccelOptions, DeviceBuild, Statistics,
    bottom_level::BottomLevel,
    grid::{self, Lattice},
    kdtree::{self, BuildOptions, KdTree},
    top_level::TopLevel,
};
use crate::{
    layout::{GeometryConstants, Instance, KD_MAX_ORIGIN_DISTANCE, StructurePlace, Triangle},
    util::{once::made_once, progress::Progress},
};

/// Where a geometry's triangles are among all stored ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StoredRange {
    /// Index of the geometry's first triangle.
    pub first_row: u32,
    /// The number of its triangles.
    pub n_triangles: u32,
}

impl StoredRange {
    /// Returns the geometry's elements of an array with an element for each stored triangle.
    pub fn of<'a, T>(&self, stored: &'a [T]) -> &'a [T] {
        &stored[self.rows()]
    }

    /// The indices of the geometry's triangles.
    pub fn rows(&self) -> Range<usize> {
        let first = self.first_row as usize;
        first..first + self.n_triangles as usize
    }
}

/// Identity of the structures of all geometries. It does not keep them.
#[derive(Clone, Debug)]
pub struct StructuresId(Weak<Vec<Arc<BottomLevel>>>);

impl PartialEq for StructuresId {
    fn eq(&self, other: &Self) -> bool {
        Weak::ptr_eq(&self.0, &other.0)
    }
}

/// Identity of a world's geometries and of all worlds in which only their vertices, normals and tangents differ.
#[derive(Clone, Debug)]
pub struct GeometriesId(Arc<()>);

impl PartialEq for GeometriesId {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

/// Where a geometry's structure is in the arrays of all.
#[derive(Clone, Copy, Debug, Default)]
pub struct GeometryPlace {
    pub place: StructurePlace,
    /// The lattice of a grid that a device has built.
    pub lattice: Option<Lattice>,
}

/// The structures of all geometries, and the hierarchy over their instances.
#[derive(Clone, Debug)]
pub struct TwoLevel {
    /// A structure for each geometry, in its own space. All are of one kind.
    structures: Arc<Vec<Arc<BottomLevel>>>,
    /// The index at which each of the host's trees begins where all are stored one after the other. All are even.
    node_begins: Arc<OnceLock<Vec<usize>>>,
    top: TopLevel,
    geometries_id: GeometriesId,
    /// The report of the first device that has built structures for this world.
    on_device: OnceLock<DeviceBuild>,
}

impl PartialEq for TwoLevel {
    fn eq(&self, other: &Self) -> bool {
        self.structures == other.structures && self.top == other.top
    }
}

impl TwoLevel {
    /// Builds all structures, and the hierarchy, on the current rayon pool. `stored`: the triangles of all geometries.
    pub fn build(
        stored: &[Triangle],
        ranges: &[StoredRange],
        instances: &[Instance],
        options: &AccelOptions,
        progress: &Progress,
    ) -> Self {
        Self::build_missing(vec![None; ranges.len()], (stored, ranges), instances, (options, progress))
    }

    /// Does what [`TwoLevel::build`] does, but takes the structures that are given.
    pub(crate) fn build_missing(
        given: Vec<Option<Arc<BottomLevel>>>,
        (stored, ranges): (&[Triangle], &[StoredRange]),
        instances: &[Instance],
        (options, progress): (&AccelOptions, &Progress),
    ) -> Self {
        let n_built = |(range, given): (&StoredRange, &Option<_>)| if given.is_some() { 0 } else { range.n_triangles };
        let subtasks = progress.subtasks(ranges.iter().zip(&given).map(n_built));
        let build = |((range, given), subtask): ((&StoredRange, Option<_>), Progress)| {
            given.unwrap_or_else(|| Arc::new(BottomLevel::build(range.of(stored), options, &subtask)))
        };
        let structures = ranges.par_iter().zip(given).zip(subtasks).map(build).collect();
        Self::of_structures(structures, instances, GeometriesId(Arc::new(())))
    }

    fn of_structures(structures: Vec<Arc<BottomLevel>>, instances: &[Instance], geometries_id: GeometriesId) -> Self {
        let top = Self::top_of(&structures, instances);
        let (node_begins, on_device) = Default::default();
        Self { structures: Arc::new(structures), node_begins, top, geometries_id, on_device }
    }

    /// Returns the structure of geometries some of which have other vertices: the structures of these, with their
    /// indices. Only the hierarchy is built. `instances`: of the same geometries.
    pub fn deformed(&self, deformed: Vec<(usize, BottomLevel)>, instances: &[Instance]) -> Self {
        let mut structures = Vec::clone(&self.structures);
        deformed.into_iter().for_each(|(ix, structure)| structures[ix] = Arc::new(structure));
        Self::of_structures(structures, instances, self.geometries_id.clone())
    }

    /// Returns the structure of the same geometries in other places. Only the hierarchy is built. `instances`: as many
    /// as before, each of the same geometry.
    pub fn moved(&self, instances: &[Instance]) -> Self {
        Self { top: Self::top_of(&self.structures, instances), on_device: OnceLock::new(), ..self.clone() }
    }

    /// Returns what tells these geometries, however they are deformed, from all others.
    pub fn geometries_id(&self) -> &GeometriesId {
        &self.geometries_id
    }

    /// Whether devices build some of the structures.
    pub fn has_device_structures(&self) -> bool {
        self.structures.iter().any(|it| it.as_lazy().is_some())
    }

    /// Builds the structures on the host that only devices have built. `stored`: the triangles of all geometries.
    pub fn build_on_host(&self, stored: &[Triangle]) {
        let geometries = self.with_triangles(stored).collect::<Vec<_>>();
        geometries.into_par_iter().for_each(|(structure, triangles)| structure.build_on_host(triangles));
    }

    /// Returns each structure with its triangles.
    fn with_triangles<'a>(&'a self, stored: &'a [Triangle]) -> impl Iterator<Item = (&'a BottomLevel, &'a [Triangle])> {
        let rows = begins(self.structures.iter().map(|it| it.n_triangles()));
        iter::zip(self.structures.iter(), rows)
            .map(|(structure, row)| (&**structure, &stored[row..][..structure.n_triangles()]))
    }

    /// Keeps a device's report, if it is the first one.
    pub fn note(&self, build: DeviceBuild) {
        let _ = self.on_device.set(build);
    }

    /// The report of the first device that has built structures for this world, if there is one.
    pub fn device_build(&self) -> Option<&DeviceBuild> {
        self.on_device.get()
    }

    /// Returns what tells these structures, and those of all worlds that share them, from all others.
    pub fn structures_id(&self) -> StructuresId {
        StructuresId(Arc::downgrade(&self.structures))
    }

    fn top_of(structures: &[Arc<BottomLevel>], instances: &[Instance]) -> TopLevel {
        let boxes: Vec<_> = structures.iter().map(|it| it.bounds()).collect();
        TopLevel::new(instances, &boxes)
    }

    /// The structure of each geometry.
    pub fn structures(&self) -> &[Arc<BottomLevel>] {
        &self.structures
    }

    /// The host's kd-trees of all geometries; none if they have grids.
    ///
    /// # Panics
    /// The host has not built all.
    pub fn trees(&self) -> impl Iterator<Item = &KdTree> {
        self.structures.iter().filter_map(|it| it.as_kdtree())
    }

    /// The number of levels of the grids' cells, 1 or 2; 0 for kd-trees.
    pub fn n_grid_levels(&self) -> u32 {
        self.structures.first().map_or(0, |it| it.n_grid_levels())
    }

    /// The hierarchy over the instances.
    pub fn top(&self) -> &TopLevel {
        &self.top
    }

    /// The number of stored triangles.
    pub fn n_stored(&self) -> usize {
        self.structures.iter().map(|it| it.n_triangles()).sum()
    }

    /// The least and the greatest corner of a box that holds all instances, world units.
    pub fn bounds(&self) -> [Vec3; 2] {
        [self.top.bounds.min.into(), self.top.bounds.max.into()]
    }

    /// The greatest magnitude of a coordinate of a ray's origin up to which a search does not move the origin, world
    /// units.
    pub fn origin_reach(&self) -> f32 {
        KD_MAX_ORIGIN_DISTANCE * self.top.bounds.largest_coordinate()
    }

    /// The greatest number of levels of a tree below its root.
    pub fn depth(&self) -> u32 {
        self.trees().map(KdTree::depth).max().unwrap_or_default()
    }

    /// Computes the statistics of all structures together. `options`: those that they were built with. `stored`: the
    /// triangles of all geometries. The host builds the structures that only devices build, and none has built.
    pub fn statistics(&self, options: &AccelOptions, stored: &[Triangle]) -> Statistics {
        match options {
            AccelOptions::KdTree(options) | AccelOptions::LazyTree(options) => {
                Statistics::KdTree(self.tree_statistics(options, stored))
            }
            AccelOptions::Grid(_) => Statistics::Grid(self.grid_statistics(stored)),
        }
    }

    /// The cost is the mean over the trees, weighted by their triangles.
    fn tree_statistics(&self, options: &BuildOptions, stored: &[Triangle]) -> kdtree::Statistics {
        let n_stored = self.n_stored().max(1) as f64;
        let own = |(structure, triangles): (&BottomLevel, &[Triangle])| {
            let statistics = match structure {
                BottomLevel::LazyTree(tree) => tree.statistics(triangles),
                _ => Statistics::KdTree(structure.as_kdtree()?.statistics(triangles.len(), options)),
            };
            let Statistics::KdTree(own) = statistics else { return None };
            let share = triangles.len() as f64 / n_stored;
            Some(kdtree::Statistics { sah_cost: own.sah_cost.map(|cost| cost * share), ..own })
        };
        let sum = self.with_triangles(stored).filter_map(own).reduce(|mut sum, own| {
            sum.add(&own);
            sum
        });
        let mut all = sum.unwrap_or_default();
        all.references_per_triangle = all.n_references as f64 / n_stored;
        all.bytes += size_of_val(&self.top.nodes[..]) as u64;
        all
    }

    fn grid_statistics(&self, stored: &[Triangle]) -> grid::Statistics {
        let own = |(structure, triangles): (&BottomLevel, &[Triangle])| {
            let statistics = match structure {
                BottomLevel::LazyGrid(grid) => grid.statistics(triangles),
                _ => Statistics::Grid(structure.as_grid()?.statistics()),
            };
            if let Statistics::Grid(own) = statistics { Some(own) } else { None }
        };
        let none = grid::Statistics { n_levels: self.n_grid_levels(), ..Default::default() };
        let mut all = self.with_triangles(stored).filter_map(own).fold(none, |mut sum, own| {
            sum.add(&own);
            sum
        });
        all.references_per_triangle = all.n_references as f64 / self.n_stored().max(1) as f64;
        all.bytes += size_of_val(&self.top.nodes[..]) as u64;
        all
    }

    /// The index at which each of the host's trees begins where all are stored one after the other, and the number of
    /// all nodes. All are even.
    ///
    /// # Panics
    /// The host has not built all trees.
    pub fn node_begins(&self) -> &[usize] {
        let made: &Vec<usize> =
            made_once(&self.node_begins, || begins(self.structures.iter().map(|it| it.nodes().len())));
        made
    }

    /// The share of the distance of a ray's origin by which the hierarchy's boxes are too small for the ray, if the
    /// origin is beyond [`TwoLevel::origin_reach`].
    pub fn pad_from_afar(&self) -> f32 {
        self.top.pad_from_afar
    }

    /// Returns the index at which the entries of each geometry's leaves or cells begin.
    pub fn entry_begins(&self) -> Vec<usize> {
        begins(self.structures.iter().map(|it| it.leaf_triangles().len()))
    }

    /// Returns the index at which the cells of each grid begin.
    pub fn cell_begins(&self) -> Vec<usize> {
        begins(self.structures.iter().map(|it| it.cells().len()))
    }

    /// Returns the place of each of the host's structures, if they are stored one after the other.
    ///
    /// # Panics
    /// The host has not built all.
    pub fn host_places(&self) -> Vec<GeometryPlace> {
        let rows = begins(self.structures.iter().map(|it| it.n_triangles()));
        let sizes = || self.structures.iter().map(|it| it.sizes());
        let elements = begins(sizes().map(|(n_elements, _)| n_elements));
        let entries = begins(sizes().map(|(_, n_entries)| n_entries));
        let place = |ix: usize| {
            let [first_element, first_entry, first_row] = [elements[ix], entries[ix], rows[ix]].map(|n| n as u32);
            GeometryPlace { place: StructurePlace { first_element, first_entry, first_row }, lattice: None }
        };
        (0..self.structures.len()).map(place).collect()
    }

    /// Returns what a search through each geometry needs beside the arrays.
    pub fn geometry_constants(&self, places: &[GeometryPlace]) -> Vec<GeometryConstants> {
        let constants = |(structure, it): (&Arc<BottomLevel>, &GeometryPlace)| {
            structure.geometry_constants(&it.place, it.lattice.as_ref())
        };
        self.structures.iter().zip(places).map(constants).collect()
    }
}

/// Returns the sum of all lengths before each, and of all.
fn begins(lens: impl Iterator<Item = usize>) -> Vec<usize> {
    let sums = lens.scan(0, |sum, len| {
        *sum += len;
        Some(*sum)
    });
    std::iter::once(0).chain(sums).collect()
}
