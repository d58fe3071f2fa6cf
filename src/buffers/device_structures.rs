//! Kd-trees or grids of geometries that a device builds. The arrays of the scene hold the structures of all geometries,
//! each in a region with some room. If a geometry is deformed, its structure alone is built again and put into its
//! region.

use std::{
    ops::Range,
    sync::{Arc, Mutex, MutexGuard, PoisonError, Weak},
};

use bytemuck::cast_slice;

use super::{
    geometries::{Arrays, Geometries},
    scene_arrays::{Content, Contents},
    structure_builder::{StructureBuilder, kind},
    two_level::{leaf_triangle, relocated, relocated_cell},
};
use crate::{
    accel::{
        DeviceBuild,
        bottom_level::{BottomLevel, LazyStructure},
        grid::Lattice,
        kdtree::{Traversal, TraversalLinks},
        two_level::{GeometriesId, GeometryPlace, TwoLevel},
    },
    gpu::{Buffer, BufferUse, Context, GpuError},
    layout::{
        GeometryConstants, GridCell, InstanceRow, KD_LEAF, KD_NODE_BYTES, KD_PAIR_SHIFT, KdBox, KdNode, KdRope,
        LeafTriangle, Plane, Slab, StructurePlace, Triangle,
    },
    passes::structures::{BufferCopy, Source, StructureArrays, StructureKind, Target},
};

/// A region is larger than its first structure by this part of it. The structures of a deformed mesh differ a little in
/// size.
const ROOM: usize = 4;

/// The part of the arrays that holds a geometry's structure.
#[derive(Clone, Debug, Default)]
struct Region {
    /// Nodes of a kd-tree, or cells of a grid. They begin and end at even indices.
    elements: Range<usize>,
    entries: Range<usize>,
    first_row: usize,
}

impl Region {
    /// Returns the region behind `end`, with room for a structure of so many elements and entries and a little more.
    fn after(end: &Self, first_row: usize, (n_elements, n_entries): (usize, usize)) -> Self {
        let behind = |range: &Range<usize>, n: usize| range.end..range.end + (n + n / ROOM).next_multiple_of(2);
        Self { elements: behind(&end.elements, n_elements), entries: behind(&end.entries, n_entries), first_row }
    }

    fn holds(&self, (n_elements, n_entries): (usize, usize)) -> bool {
        n_elements <= self.elements.len() && n_entries <= self.entries.len()
    }

    fn place(&self) -> StructurePlace {
        let [first_element, first_entry, first_row] =
            [self.elements.start, self.entries.start, self.first_row].map(|n| n as u32);
        StructurePlace { first_element, first_entry, first_row }
    }
}

/// What a region holds.
#[derive(Clone)]
struct Shown {
    /// Gone before the first upload.
    structure: Weak<BottomLevel>,
    n_elements: usize,
    /// The lattice of a grid that the device has built.
    lattice: Option<Lattice>,
}

/// Where the structures of geometries are in the arrays, and what builds them again.
pub struct DeviceStructures {
    geometries_id: GeometriesId,
    regions: Vec<Region>,
    /// Behind all regions.
    end: Region,
    kind: StructureKind,
    state: Mutex<State>,
}

struct State {
    /// What each region holds.
    shown: Vec<Shown>,
    /// Builds structures again. It is kept from the first time on, with room for the largest geometry so far.
    builder: Option<StructureBuilder>,
}

/// Returns the contents with room for structures of so many elements and entries, and for their links.
pub(super) fn with_room_for(
    (n_elements, n_entries): (usize, usize),
    kind: StructureKind,
    contents: Contents<'_>,
) -> Contents<'_> {
    let (n_nodes, n_cells) = if kind == StructureKind::Grid { (0, n_elements) } else { (n_elements, 0) };
    let has_slabs = kind == StructureKind::KdTree { has_slabs: true };
    Contents {
        grid_cells: Content::Reserved(n_cells),
        kd_nodes: Content::Reserved(n_nodes),
        kd_parents: Content::Reserved(n_nodes / 2),
        leaf_triangles: Content::Reserved(n_entries),
        leaf_planes: Content::Reserved(n_entries),
        kd_slabs: Content::Reserved(if has_slabs { n_nodes } else { 0 }),
        kd_links: Content::Reserved(6 * n_nodes),
        ..contents
    }
}

/// The structures that a device has built for a new world, until they are in the arrays: the index of each geometry,
/// its numbers of elements and entries, and its structure.
pub type NewStructures = Vec<(usize, (usize, usize), StructureArrays)>;

impl DeviceStructures {
    /// Builds all structures that devices build. `triangles`: the stored triangles.
    ///
    /// # Errors
    /// The structures exceed the device's limits or memory, or a call fails.
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
        for (ix, structure) in all.of_host(0..regions.len()) {
            regions[ix] = reserve(ix, structure.sizes());
        }
        let largest = all.lazy().max_by_key(|(_, structure)| structure.n_triangles());
        let (_, largest) = largest.expect("a structure that devices build");
        let builder = StructureBuilder::new(context, (largest.n_triangles(), 0), largest)?;
        let mut shown = vec![Shown { structure: Weak::new(), n_elements: 0, lattice: None }; regions.len()];
        let (mut structures, mut reports) = (Vec::new(), Vec::new());
        for (ix, structure) in all.lazy() {
            builder.take_stored(triangles, instances.ranges[ix])?;
            let built = builder.build(structure, &mut reports)?;
            regions[ix] = reserve(ix, built.sizes());
            let copy = builder.copy_relocated(&built, &regions[ix].place())?;
            shown[ix].lattice = built.lattice();
            structures.push((ix, built.sizes(), copy));
        }
        if let Some(sum) = DeviceBuild::sum(reports) {
            two.note(sum);
        }
        let kind = kind(context, largest);
        match kind {
            StructureKind::KdTree { .. } => {
                check("nodes of all kd-trees", end.elements.end, u32::MAX / KD_NODE_BYTES)?;
            }
            StructureKind::Grid => check("cells of all grids", end.elements.end, u32::MAX)?,
        }
        check("entries of all leaves", end.entries.end, u32::MAX)?;
        let made = Self {
            geometries_id: two.geometries_id().clone(),
            regions,
            end,
            kind,
            state: Mutex::new(State { shown, builder: None }),
        };
        Ok((made, structures))
    }

    /// The numbers of elements and entries for which there is room.
    fn room(&self) -> (usize, usize) {
        (self.end.elements.end, self.end.entries.end)
    }

    /// Returns the contents with room for the structures and their links.
    pub fn reserved<'a>(&self, contents: Contents<'a>) -> Contents<'a> {
        with_room_for(self.room(), self.kind, contents)
    }

    /// Makes the arrays of all structures.
    ///
    /// # Errors
    /// An array exceeds the device's limits, memory runs out, or a copy fails.
    pub fn arrays(
        &self,
        context: &Arc<Context>,
        usage: BufferUse,
        (all, new): (&Geometries, NewStructures),
    ) -> Result<StructureArrays, GpuError> {
        let arrays = StructureArrays::new(context, self.kind, self.room(), usage)?;
        let mut state = self.lock();
        let of_host = all.of_host(0..self.regions.len());
        self.upload(context, &arrays, (all, &of_host, &[]))?;
        for (ix, structure) in of_host {
            state.shown[ix].show(all.structure(ix), structure.sizes().0);
        }
        for (ix, sizes, structure) in new {
            let target = Target { arrays: &arrays, place: self.regions[ix].place(), more: &[] };
            structure.copy_to(context, sizes, &target)?;
            state.shown[ix].show(all.structure(ix), sizes.0);
        }
        drop(state);
        Ok(arrays)
    }

    /// The places of all structures that are in the arrays now.
    pub fn places(&self) -> Vec<GeometryPlace> {
        let shown = &self.lock().shown;
        let place =
            |(region, shown): (&Region, &Shown)| GeometryPlace { place: region.place(), lattice: shown.lattice };
        self.regions.iter().zip(shown).map(place).collect()
    }

    /// Builds the structures of geometries that have changed since the last time, and puts them, their triangles and
    /// what textures need at the corners into the arrays. Commands that were submitted before still see the previous
    /// ones. Returns whether that was possible. It is not if a structure has no room, if the geometries are not those
    /// of the world before, or if something has changed and `others_read` the arrays.
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
            let placed = match all.structure(ix).as_lazy() {
                Some(structure) => {
                    let Some(builder) = state.builder_for(context, structure, arrays.n_corner_words())? else {
                        return Ok(false);
                    };
                    self.rebuild(builder, arrays, (all, ix, structure), &mut reports)?
                }
                None => self.replace(context, arrays, (all, ix))?,
            };
            let Some(placed) = placed else {
                tracing::info!(
                    "the {} of geometry {ix} has outgrown its room, so everything is uploaded again",
                    self.name()
                );
                return Ok(false);
            };
            state.shown[ix] = placed;
        }
        if let Some(sum) = DeviceBuild::sum(reports) {
            all.two.note(sum);
        }
        Ok(true)
    }

    /// The name of a structure in a sentence.
    fn name(&self) -> &'static str {
        if self.kind == StructureKind::Grid { "grid" } else { "kd-tree" }
    }

    /// Builds a structure on the device and puts it into its region. Returns what the region holds then; none if there
    /// was no room.
    fn rebuild(
        &self,
        builder: &mut StructureBuilder,
        arrays: &Arrays,
        (all, ix, structure): (&Geometries, usize, LazyStructure),
        reports: &mut Vec<DeviceBuild>,
    ) -> Result<Option<Shown>, GpuError> {
        let region = &self.regions[ix];
        let n_words = builder.take(arrays, (all, ix))?;
        let built = builder.build(structure, reports)?;
        if !region.holds(built.sizes()) {
            return Ok(None);
        }
        let mut more = arrays.copies(
            (builder.triangles(), structure.n_triangles()),
            (&builder.corners, n_words),
            region.first_row,
        );
        let placed = Shown {
            structure: Arc::downgrade(all.structure(ix)),
            n_elements: built.sizes().0,
            lattice: built.lattice(),
        };
        more.extend(self.constants(arrays, (all, ix), placed.lattice));
        builder.place(&built, &Target { arrays: &arrays.structures(), place: region.place(), more: &more })?;
        Ok(Some(placed))
    }

    /// Returns the copies of a grid's lattice to the rows of the geometry, in which searches find it. They come
    /// together with the grid, so that no search takes one for another. A kd-tree has none.
    fn constants(
        &self,
        arrays: &Arrays,
        (all, ix): (&Geometries, usize),
        lattice: Option<Lattice>,
    ) -> impl Iterator<Item = BufferCopy> {
        let constants = all.structure(ix).geometry_constants(&self.regions[ix].place(), lattice.as_ref());
        let begin = arrays.geometries_begin * size_of::<InstanceRow>() + ix * size_of::<GeometryConstants>();
        let copy = move |rows: &Buffer<InstanceRow>| BufferCopy {
            from: Source::Words(cast_slice(&[constants]).to_vec()),
            to: (rows.any().clone(), begin),
        };
        let rows = [&arrays.arrays.instance_rows, arrays.rows_before].map(copy);
        rows.into_iter().take(if self.kind == StructureKind::Grid { 2 } else { 0 })
    }

    /// Uploads a structure that the host has built. Returns what the region holds then; none if there was no room.
    fn replace(
        &self,
        context: &Arc<Context>,
        arrays: &Arrays,
        (all, ix): (&Geometries, usize),
    ) -> Result<Option<Shown>, GpuError> {
        let (structure, region) = (all.structure(ix), &self.regions[ix]);
        if !region.holds(structure.sizes()) {
            return Ok(None);
        }
        let own = all.triangles(ix);
        let triangles = Buffer::with(context, "new triangles", &own, BufferUse::Storage)?;
        let own_corners = arrays.corners_of(region.first_row, own.len());
        let corners = Buffer::with(context, "new corners", own_corners, BufferUse::Storage)?;
        let mut more = arrays.copies((&triangles, own.len()), (&corners, own_corners.len()), region.first_row);
        more.extend(self.constants(arrays, (all, ix), None));
        self.upload(context, &arrays.structures(), (all, &[(ix, &**structure)], &more))?;
        let n_elements = structure.sizes().0;
        Ok(Some(Shown { structure: Arc::downgrade(structure), n_elements, lattice: None }))
    }

    /// Uploads structures that the host has built, all at once. `structures`: with the indices of their geometries,
    /// whose regions follow one another. `more`: what is copied together with them.
    fn upload(
        &self,
        context: &Arc<Context>,
        arrays: &StructureArrays,
        (all, structures, more): (&Geometries, &[(usize, &BottomLevel)], &[BufferCopy]),
    ) -> Result<(), GpuError> {
        let Some(&(first, _)) = structures.first() else { return Ok(()) };
        let begin = &self.regions[first];
        let (mut nodes, mut parents, mut slabs, mut cells) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let (mut entries, mut planes) = (Vec::new(), Vec::new());
        for &(ix, structure) in structures {
            let (region, place) = (&self.regions[ix], self.regions[ix].place());
            let [n_elements, n_entries] =
                [region.elements.start - begin.elements.start, region.entries.start - begin.entries.start];
            if let Some(grid) = structure.as_grid() {
                cells.resize(n_elements, GridCell::default());
                cells.extend((0..grid.cells().len()).map(|ix| relocated_cell(grid, ix, &place)));
            } else {
                nodes.resize(n_elements, KdNode::default());
                nodes.extend(structure.nodes().iter().map(|node| relocated(*node, &place)));
                parents.resize(n_elements / 2, 0);
                parents.extend(structure.parents().iter().map(|parent| parent + place.first_element));
            }
            entries.resize(n_entries, LeafTriangle::default());
            let triangles = all.triangles(ix);
            let entry = |&triangle_ix: &u32| LeafTriangle {
                triangle_ix: place.first_row + triangle_ix,
                ..leaf_triangle(&triangles, triangle_ix)
            };
            entries.extend(structure.leaf_triangles().iter().map(entry));
            planes.resize(n_entries, Plane::default());
            planes.extend(structure.leaf_planes());
            if self.kind == (StructureKind::KdTree { has_slabs: true }) {
                slabs.resize(n_elements, Slab::default());
                slabs.extend(structure.slabs());
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
            cells: Buffer::with(context, "new cells", &cells, usage)?,
        };
        let target = Target { arrays, place: begin.place(), more };
        new.copy_to(context, (nodes.len() + cells.len(), entries.len()), &target)
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
            all.boxes.resize(self.end.elements.end, KdBox::default());
        }
        if traversal.needs_ropes() {
            all.ropes.resize(6 * self.end.elements.end, KdRope::default());
        }
        let state = self.lock();
        for ((region, shown), structure) in self.regions.iter().zip(&state.shown).zip(two.structures()) {
            let first = region.elements.start;
            let TraversalLinks { boxes, mut ropes } = match structure.as_lazy() {
                Some(LazyStructure::KdTree(tree)) => {
                    let mut nodes = nodes.download_range(first, shown.n_elements)?;
                    let splits = nodes.iter_mut().filter(|node| node.axis_and_child & KD_LEAF == 0);
                    splits.for_each(|node| node.axis_and_child -= (first as u32 / 2) << KD_PAIR_SHIFT);
                    tree.links_of(nodes, traversal)
                }
                _ => structure.as_kdtree().map(|it| TraversalLinks::new(it, traversal)).unwrap_or_default(),
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
    fn show(&mut self, structure: &Arc<BottomLevel>, n_elements: usize) {
        (self.structure, self.n_elements) = (Arc::downgrade(structure), n_elements);
    }

    fn is_of(&self, structure: &Arc<BottomLevel>) -> bool {
        Weak::ptr_eq(&self.structure, &Arc::downgrade(structure))
    }
}

impl State {
    /// Returns what builds a structure again; none if the device has too little room. It is made if there is none, or
    /// none large enough.
    fn builder_for(
        &mut self,
        context: &Arc<Context>,
        structure: LazyStructure,
        n_corner_words: usize,
    ) -> Result<Option<&mut StructureBuilder>, GpuError> {
        let n_triangles = structure.n_triangles();
        let sizes = (n_triangles, n_triangles * n_corner_words);
        let is_enough = |it: &StructureBuilder| it.triangles().len() >= sizes.0 && it.corners.len() >= sizes.1;
        if !self.builder.as_ref().is_some_and(is_enough) {
            self.builder = None; // its memory serves the larger one
            match StructureBuilder::new(context, sizes, structure) {
                Err(error) if error.is_lack_of_room() => return Ok(None),
                made => self.builder = Some(made?),
            }
        }
        Ok(self.builder.as_mut())
    }
}

fn check(what: &'static str, value: usize, limit: u32) -> Result<(), GpuError> {
    let (value, limit) = (value as u64, u64::from(limit));
    if value > limit { Err(GpuError::Limit { what, value, limit }) } else { Ok(()) }
}
