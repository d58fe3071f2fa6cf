//! Kd-trees of geometries that a device builds. The arrays of the scene hold the trees of all geometries, each in a
//! region with some room. If a geometry is deformed, its tree alone is built again and put into its region.

use std::{
    borrow::Cow,
    ops::Range,
    sync::{Arc, Mutex, MutexGuard, PoisonError, Weak},
};

use bytemuck::cast_slice;

use super::{
    scene_arrays::{Content, Contents, SceneArrays},
    structure_builder::{StructureBuilder, has_slabs},
    two_level::{leaf_triangle, relocated},
};
use crate::{
    accel::{
        DeviceBuild,
        bottom_level::BottomLevel,
        kdtree::{KdTree, LazyTree, Traversal, TraversalLinks},
        two_level::{GeometriesId, TwoLevel},
    },
    gpu::{AnyBuffer, Buffer, BufferUse, Context, GpuError},
    layout::{
        CornerSurface, KD_LEAF, KD_NODE_BYTES, KD_PAIR_SHIFT, KdBox, KdNode, KdRope, LeafTriangle, Plane, Slab,
        StructurePlace, Triangle,
    },
    passes::{
        kdtree::BuiltTree,
        structures::{BufferCopy, StructureArrays, Target},
    },
    util::Shared,
    world::{Geometry, Instances, Poses},
};

/// A region is larger than its first tree by this part of it. The trees of a deformed mesh differ a little in size.
const ROOM: usize = 4;

/// The part of the arrays that holds a geometry's tree. Nodes begin and end at even indices.
#[derive(Clone, Debug, Default)]
struct Region {
    nodes: Range<usize>,
    entries: Range<usize>,
    first_row: usize,
}

impl Region {
    /// Returns the region behind `end`, with room for a tree of so many nodes and entries and a little more.
    fn after(end: &Self, first_row: usize, (n_nodes, n_entries): (usize, usize)) -> Self {
        let behind = |range: &Range<usize>, n: usize| range.end..range.end + (n + n / ROOM).next_multiple_of(2);
        Self { nodes: behind(&end.nodes, n_nodes), entries: behind(&end.entries, n_entries), first_row }
    }

    fn holds(&self, (n_nodes, n_entries): (usize, usize)) -> bool {
        n_nodes <= self.nodes.len() && n_entries <= self.entries.len()
    }

    fn place(&self) -> StructurePlace {
        let [first_element, first_entry, first_row] =
            [self.nodes.start, self.entries.start, self.first_row].map(|n| n as u32);
        StructurePlace { first_element, first_entry, first_row }
    }
}

/// What a region holds.
#[derive(Clone)]
struct Shown {
    /// The structure whose tree this is; none after a failure.
    structure: Weak<BottomLevel>,
    n_nodes: usize,
}

/// Where the trees of geometries are in the arrays, and what builds them again.
pub struct DeviceStructures {
    geometries_id: GeometriesId,
    regions: Vec<Region>,
    /// Behind all regions.
    end: Region,
    has_slabs: bool,
    state: Mutex<State>,
}

struct State {
    /// What each region holds.
    shown: Vec<Shown>,
    /// Builds trees again. It is kept from the first time on, with room for the largest geometry so far.
    builder: Option<StructureBuilder>,
}

/// Returns the contents with room for trees of so many nodes and entries, and for their links.
pub(super) fn with_room_for(
    (n_nodes, n_entries): (usize, usize),
    has_slabs: bool,
    contents: Contents<'_>,
) -> Contents<'_> {
    Contents {
        kd_nodes: Content::Reserved(n_nodes),
        kd_parents: Content::Reserved(n_nodes / 2),
        leaf_triangles: Content::Reserved(n_entries),
        leaf_planes: Content::Reserved(n_entries),
        kd_slabs: Content::Reserved(if has_slabs { n_nodes } else { 0 }),
        kd_links: Content::Reserved(6 * n_nodes),
        ..contents
    }
}

/// The geometries of a world, and their triangles.
#[derive(Clone, Copy)]
pub struct Geometries<'a> {
    pub two: &'a TwoLevel,
    pub instances: &'a Instances,
    /// All of them. Their triangles are made where they are first asked for.
    pub geometry: Geometry<'a>,
    /// What the device makes the triangles of some of them of, when they change.
    pub poses: &'a Poses,
}

impl<'a> Geometries<'a> {
    fn structure(&self, ix: usize) -> &'a Arc<BottomLevel> {
        &self.two.structures()[ix]
    }

    pub fn triangles(&self, ix: usize) -> Cow<'a, [Triangle]> {
        match self.poses.get(ix) {
            Some(posed) => posed.triangles().into(),
            None => self.instances.ranges[ix].of(self.geometry.triangles()).into(),
        }
    }

    fn lazy(&self) -> impl Iterator<Item = (usize, &'a LazyTree)> {
        self.two.structures().iter().enumerate().filter_map(|(ix, it)| Some((ix, it.as_lazy()?)))
    }

    /// The host's trees among those with these indices.
    fn of_host(&self, ixs: impl IntoIterator<Item = usize>) -> Vec<(usize, &'a KdTree)> {
        let of_host = |ix: usize| match &**self.structure(ix) {
            BottomLevel::KdTree(tree) => Some((ix, tree)),
            _ => None,
        };
        ixs.into_iter().filter_map(of_host).collect()
    }
}

/// The trees that a device has built for a new world, until they are in the arrays: the index of each geometry, and its
/// tree.
pub type NewStructures = Vec<(usize, BuiltTree, StructureArrays)>;

impl DeviceStructures {
    /// Builds all trees that devices build. `triangles`: the stored triangles.
    ///
    /// # Errors
    /// The trees exceed the device's limits or memory, or a call fails.
    pub fn build(
        context: &Arc<Context>,
        triangles: &Buffer<Triangle>,
        all: &Geometries,
    ) -> Result<(Self, NewStructures), GpuError> {
        let Geometries { two, instances, .. } = all;
        let mut regions = vec![Region::default(); two.structures().len()];
        let mut end = Region::default();
        let mut reserve = |ix: usize, sizes: (usize, usize)| {
            end = Region::after(&end, instances.ranges[ix].first_row as usize, sizes);
            end.clone()
        };
        // Those of the host come first, so that they are uploaded together.
        for (ix, tree) in all.of_host(0..regions.len()) {
            regions[ix] = reserve(ix, (tree.nodes().len(), tree.leaf_triangles().len()));
        }
        let largest = all.lazy().max_by_key(|(_, tree)| tree.n_triangles());
        let (_, largest) = largest.expect("a tree that devices build");
        let builder = StructureBuilder::new(context, (largest.n_triangles(), 0), largest)?;
        let (mut trees, mut reports) = (Vec::new(), Vec::new());
        for (ix, tree) in all.lazy() {
            let first_row = instances.ranges[ix].first_row as usize;
            builder.kernels.take(triangles, (first_row, tree.n_triangles()))?;
            let (built, sizes) = builder.build(tree.n_triangles(), tree, &mut reports)?;
            regions[ix] = reserve(ix, sizes);
            let copy = builder.kernels.copy_relocated(&built, &regions[ix].place(), BufferUse::Storage)?;
            trees.push((ix, built, copy));
        }
        if let Some(sum) = DeviceBuild::sum(reports) {
            two.note(sum);
        }
        check("nodes of all kd-trees", end.nodes.end, u32::MAX / KD_NODE_BYTES)?;
        check("entries of all leaves", end.entries.end, u32::MAX)?;
        let shown = vec![Shown { structure: Weak::new(), n_nodes: 0 }; regions.len()];
        let made = Self {
            geometries_id: two.geometries_id().clone(),
            regions,
            end,
            has_slabs: has_slabs(context, largest),
            state: Mutex::new(State { shown, builder: None }),
        };
        Ok((made, trees))
    }

    /// Returns the contents with room for the trees and their links.
    pub fn reserved<'a>(&self, contents: Contents<'a>) -> Contents<'a> {
        with_room_for((self.end.nodes.end, self.end.entries.end), self.has_slabs, contents)
    }

    /// Makes the arrays of all trees.
    ///
    /// # Errors
    /// An array exceeds the device's limits, memory runs out, or a copy fails.
    pub fn arrays(
        &self,
        context: &Arc<Context>,
        usage: BufferUse,
        (all, new): (&Geometries, NewStructures),
    ) -> Result<StructureArrays, GpuError> {
        let [n_nodes, n_entries] = [self.end.nodes.end, self.end.entries.end];
        let arrays = StructureArrays::new(context, (n_nodes, n_entries), self.has_slabs, usage)?;
        let mut state = self.lock();
        let of_host = all.of_host(0..self.regions.len());
        self.upload(context, &arrays, (all, &of_host, &[]))?;
        for (ix, tree) in of_host {
            state.shown[ix] = Shown::of(all.structure(ix), tree.nodes().len());
        }
        for (ix, built, tree) in new {
            let sizes = (built.n_nodes as usize, built.n_entries as usize);
            let target = Target { trees: &arrays, place: self.regions[ix].place(), more: &[] };
            tree.copy_to(context, sizes, &target)?;
            state.shown[ix] = Shown::of(all.structure(ix), sizes.0);
        }
        drop(state);
        Ok(arrays)
    }

    /// The place of each geometry's root among all nodes.
    pub fn roots(&self) -> Vec<usize> {
        self.regions.iter().map(|region| region.nodes.start).collect()
    }

    /// Builds the trees of geometries that have changed since the last time, and puts them, their triangles and what
    /// textures need at the corners into the arrays. Commands that were submitted before still see the previous ones.
    /// Returns whether that was possible. It is not if a tree has no room, if the geometries are not those of the
    /// world before, or if something has changed and `others_read` the arrays.
    ///
    /// # Errors
    /// Memory runs out, or a call fails. Those geometries that have not changed then change at the next call.
    pub fn update(
        &self,
        context: &Arc<Context>,
        arrays: &Arrays,
        (all, others_read): (&Geometries, bool),
    ) -> Result<bool, GpuError> {
        if *all.two.geometries_id() != self.geometries_id {
            return Ok(false);
        }
        let mut state = self.lock();
        let is_other = |ix: &usize| !state.shown[*ix].is_of(all.structure(*ix));
        let changed: Vec<usize> = (0..self.regions.len()).filter(is_other).collect();
        if !changed.is_empty() && others_read {
            return Ok(false);
        }
        let mut reports = Vec::new();
        for ix in changed {
            let placed = match &**all.structure(ix) {
                BottomLevel::LazyTree(tree) => {
                    let Some(builder) = state.builder_for(context, tree, arrays.n_corner_words())? else {
                        return Ok(false);
                    };
                    self.rebuild(builder, arrays, (all, ix, tree), &mut reports)?
                }
                _ => self.replace(context, arrays, (all, ix))?,
            };
            let Some(n_nodes) = placed else {
                tracing::info!("the kd-tree of geometry {ix} has outgrown its room, so everything is uploaded again");
                return Ok(false);
            };
            state.shown[ix] = Shown::of(all.structure(ix), n_nodes);
        }
        if let Some(sum) = DeviceBuild::sum(reports) {
            all.two.note(sum);
        }
        Ok(true)
    }

    /// Builds a tree on the device and puts it into its region. Returns the number of its nodes; none if there was no
    /// room.
    fn rebuild(
        &self,
        builder: &mut StructureBuilder,
        arrays: &Arrays,
        (all, ix, tree): (&Geometries, usize, &LazyTree),
        reports: &mut Vec<DeviceBuild>,
    ) -> Result<Option<usize>, GpuError> {
        let region = &self.regions[ix];
        let n_words = builder.take(arrays, (all, ix))?;
        let (built, sizes) = builder.build(tree.n_triangles(), tree, reports)?;
        if !region.holds(sizes) {
            return Ok(None);
        }
        let triangles = (builder.kernels.triangles(), tree.n_triangles());
        let more = arrays.copies(triangles, (&builder.corners, n_words), region);
        builder.kernels.place(&built, &Target { trees: &arrays.trees(), place: region.place(), more: &more })?;
        Ok(Some(sizes.0))
    }

    /// Uploads a tree that the host has built. Returns the number of its nodes; none if there was no room.
    fn replace(
        &self,
        context: &Arc<Context>,
        arrays: &Arrays,
        (all, ix): (&Geometries, usize),
    ) -> Result<Option<usize>, GpuError> {
        let (of_host, region) = (all.of_host([ix]), &self.regions[ix]);
        let sizes = of_host.first().map(|(_, tree)| (tree.nodes().len(), tree.leaf_triangles().len()));
        let Some(sizes) = sizes.filter(|sizes| region.holds(*sizes)) else { return Ok(None) };
        let own = all.triangles(ix);
        let triangles = Buffer::with(context, "new triangles", &own, BufferUse::Storage)?;
        let own_corners = arrays.corners_of(region.first_row, own.len());
        let corners = Buffer::with(context, "new corners", own_corners, BufferUse::Storage)?;
        let more = arrays.copies((&triangles, own.len()), (&corners, own_corners.len()), region);
        self.upload(context, &arrays.trees(), (all, &of_host, &more))?;
        Ok(Some(sizes.0))
    }

    /// Uploads trees that the host has built, all at once. `trees`: with the indices of their geometries, whose regions
    /// follow one another. `more`: what is copied together with them.
    fn upload(
        &self,
        context: &Arc<Context>,
        arrays: &StructureArrays,
        (all, trees, more): (&Geometries, &[(usize, &KdTree)], &[BufferCopy]),
    ) -> Result<(), GpuError> {
        let Some(&(first, _)) = trees.first() else { return Ok(()) };
        let begin = &self.regions[first];
        let (mut nodes, mut parents, mut slabs) = (Vec::new(), Vec::new(), Vec::new());
        let (mut entries, mut planes) = (Vec::new(), Vec::new());
        for &(ix, tree) in trees {
            let (region, place) = (&self.regions[ix], self.regions[ix].place());
            let [n_nodes, n_entries] =
                [region.nodes.start - begin.nodes.start, region.entries.start - begin.entries.start];
            nodes.resize(n_nodes, KdNode::default());
            nodes.extend(tree.nodes().iter().map(|node| relocated(*node, &place)));
            parents.resize(n_nodes / 2, 0);
            parents.extend(tree.parents().iter().map(|parent| parent + place.first_element));
            entries.resize(n_entries, LeafTriangle::default());
            let triangles = all.triangles(ix);
            let entry = |&triangle_ix: &u32| LeafTriangle {
                triangle_ix: place.first_row + triangle_ix,
                ..leaf_triangle(&triangles, triangle_ix)
            };
            entries.extend(tree.leaf_triangles().iter().map(entry));
            planes.resize(n_entries, Plane::default());
            planes.extend(tree.leaf_planes());
            if self.has_slabs {
                slabs.resize(n_nodes, Slab::default());
                slabs.extend(tree.slabs());
                slabs.resize(nodes.len(), Slab::default());
            }
        }
        let usage = BufferUse::Texels;
        let new = StructureArrays {
            nodes: Buffer::with(context, "new nodes", &nodes, usage)?,
            parents: Buffer::with(context, "new parents", &parents, usage)?,
            leaf_triangles: Buffer::with(context, "new leaf_triangles", &entries, usage)?,
            leaf_planes: Buffer::with(context, "new leaf_planes", &planes, usage)?,
            slabs: Buffer::with(context, "new slabs", &slabs, usage)?,
        };
        let target = Target { trees: arrays, place: begin.place(), more };
        new.copy_to(context, (nodes.len(), entries.len()), &target)
    }

    /// Returns what a traversal reads beside the trees, in their regions.
    ///
    /// # Errors
    /// A copy fails.
    pub fn links(
        &self,
        nodes: &Buffer<KdNode>,
        two: &TwoLevel,
        traversal: Traversal,
    ) -> Result<TraversalLinks, GpuError> {
        let mut all = TraversalLinks::default();
        if !traversal.needs_boxes() && !traversal.needs_ropes() {
            return Ok(all);
        }
        if traversal.needs_boxes() {
            all.boxes.resize(self.end.nodes.end, KdBox::default());
        }
        if traversal.needs_ropes() {
            all.ropes.resize(6 * self.end.nodes.end, KdRope::default());
        }
        let state = self.lock();
        for ((region, shown), structure) in self.regions.iter().zip(&state.shown).zip(two.structures()) {
            let first = region.nodes.start;
            let TraversalLinks { boxes, mut ropes } = match structure.as_lazy() {
                Some(tree) => {
                    let mut nodes = nodes.download_range(first, shown.n_nodes)?;
                    let splits = nodes.iter_mut().filter(|node| node.axis_and_child & KD_LEAF == 0);
                    splits.for_each(|node| node.axis_and_child -= (first as u32 / 2) << KD_PAIR_SHIFT);
                    tree.links_of(nodes, traversal)
                }
                None => structure.as_kdtree().map(|it| TraversalLinks::new(it, traversal)).unwrap_or_default(),
            };
            // 0 leads out of the geometry.
            ropes.iter_mut().filter(|rope| rope.node_ix != 0).for_each(|rope| rope.node_ix += first as u32);
            if !boxes.is_empty() {
                all.boxes[first..][..boxes.len()].copy_from_slice(&boxes);
            }
            if !ropes.is_empty() {
                all.ropes[6 * first..][..ropes.len()].copy_from_slice(&ropes);
            }
        }
        Ok(all)
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // The state says of each region on its own what it holds.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Shown {
    fn of(structure: &Arc<BottomLevel>, n_nodes: usize) -> Self {
        Self { structure: Arc::downgrade(structure), n_nodes }
    }

    fn is_of(&self, structure: &Arc<BottomLevel>) -> bool {
        Weak::ptr_eq(&self.structure, &Arc::downgrade(structure))
    }
}

impl State {
    /// Returns what builds a tree again; none if the device has too little room. It is made if there is none, or none
    /// large enough.
    fn builder_for(
        &mut self,
        context: &Arc<Context>,
        tree: &LazyTree,
        n_corner_words: usize,
    ) -> Result<Option<&mut StructureBuilder>, GpuError> {
        let n_triangles = tree.n_triangles();
        let sizes = (n_triangles, n_triangles * n_corner_words);
        let is_enough = |it: &StructureBuilder| it.kernels.triangles().len() >= sizes.0 && it.corners.len() >= sizes.1;
        if !self.builder.as_ref().is_some_and(is_enough) {
            self.builder = None; // its memory serves the larger one
            match StructureBuilder::new(context, sizes, tree) {
                Err(error) if error.is_lack_of_room() => return Ok(None),
                made => self.builder = Some(made?),
            }
        }
        Ok(self.builder.as_mut())
    }
}

/// The scene's arrays, and what textures need at the corners of all stored triangles.
pub struct Arrays<'a> {
    pub arrays: &'a SceneArrays,
    /// Tangents and colours; none if the scene has none.
    pub corners: Option<&'a Shared<Vec<[CornerSurface; 3]>>>,
    /// Where the corners are in `texture_words`.
    pub corners_begin: usize,
}

impl Arrays<'_> {
    /// Returns the arrays that hold trees.
    fn trees(&self) -> StructureArrays {
        StructureArrays {
            nodes: self.arrays.kd_nodes.clone(),
            parents: self.arrays.kd_parents.clone(),
            leaf_triangles: self.arrays.leaf_triangles.clone(),
            leaf_planes: self.arrays.leaf_planes.clone(),
            slabs: self.arrays.kd_slabs.clone(),
        }
    }

    /// The number of words of a triangle's corners.
    pub fn n_corner_words(&self) -> usize {
        self.corners.map_or(0, |_| size_of::<[CornerSurface; 3]>() / size_of::<u32>())
    }

    /// The words of the corners of some triangles.
    pub fn corners_of(&self, first_row: usize, n_triangles: usize) -> &[u32] {
        self.corners.map_or(&[], |corners| cast_slice(&corners[first_row..][..n_triangles]))
    }

    /// The place of the first corner of a triangle in `texture_words`.
    pub fn first_word(&self, row: usize) -> usize {
        self.corners_begin + row * self.n_corner_words()
    }

    /// Returns the copies of a geometry's first triangles, and of the words of their corners, to their places.
    fn copies(
        &self,
        (triangles, n_triangles): (&Buffer<Triangle>, usize),
        (corners, n_words): (&Buffer<u32>, usize),
        region: &Region,
    ) -> [BufferCopy; 2] {
        let copy = |from: &Arc<AnyBuffer>, to: &Arc<AnyBuffer>, begin: usize, bytes: usize| BufferCopy {
            from: from.clone(),
            to: (to.clone(), begin),
            bytes,
        };
        let bytes_of = |n_triangles: usize| n_triangles * size_of::<Triangle>();
        [
            copy(triangles.any(), self.arrays.triangles.any(), bytes_of(region.first_row), bytes_of(n_triangles)),
            copy(
                corners.any(),
                self.arrays.texture_words.any(),
                self.first_word(region.first_row) * size_of::<u32>(),
                n_words * size_of::<u32>(),
            ),
        ]
    }
}

fn check(what: &'static str, value: usize, limit: u32) -> Result<(), GpuError> {
    let (value, limit) = (value as u64, u64::from(limit));
    if value > limit { Err(GpuError::Limit { what, value, limit }) } else { Ok(()) }
}
