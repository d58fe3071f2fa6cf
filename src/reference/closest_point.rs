//! Closest point: the point of the triangles that is closest to each query point. Twin of `closest_point.comp`.

use glam::Vec3;
use rayon::prelude::*;

use super::{
    RAYS_PER_TASK,
    cast::MISS,
    closest_instances::search_instances,
    distant_cells::{DistantCell, Query},
    inputs::KernelInputs,
    kdtree::is_leaf,
    leaf::entries_of,
    point_triangle::{PointOnTriangle, closest_on_triangle},
};
use crate::layout::{Hit, KD_MAX_DEPTH, KdNode, NO_TRIANGLE, QueryPoint, TRIANGLE_HIDDEN};

/// Returns whether a point can have a closest point: its position is finite, and its greatest distance a number from 0
/// on.
pub fn is_point(point: &QueryPoint) -> bool {
    point.position.is_finite() && point.t_max >= 0.0
}

/// The cells that wait, at most one for each level.
struct Pending {
    cells: [DistantCell; KD_MAX_DEPTH as usize],
    n: usize,
}

impl Pending {
    fn push_if_closer(&mut self, cell: DistantCell, best_squared: f32) {
        if cell.may_be_closer(best_squared) {
            self.cells[self.n] = cell;
            self.n += 1;
        }
    }

    fn pop(&mut self) -> Option<DistantCell> {
        self.n = self.n.checked_sub(1)?;
        Some(self.cells[self.n])
    }
}

/// Descends to the leaf of a cell that is closest to the point.
fn descend(inputs: &KernelInputs, query: Query, limit: f32, mut cell: DistantCell, pending: &mut Pending) -> KdNode {
    loop {
        let node = inputs.kd_nodes[cell.node_ix as usize];
        if is_leaf(node) {
            return node;
        }
        let [near, far] = cell.split(query, node);
        pending.push_if_closer(far, limit);
        cell = near;
    }
}

/// Keeps a point of a triangle in `best` if it is closer and the triangle is not hidden. Of two that are equally close,
/// the one of the lower index counts. `best.t` is the square of the distance.
pub fn keep_closest(inputs: &KernelInputs, triangle_ix: u32, at: PointOnTriangle, best: &mut Hit) {
    let is_closer = at.squared < best.t || at.squared == best.t && triangle_ix < best.triangle_ix;
    let is_hidden = |ix: u32| inputs.triangle_materials[ix as usize] & TRIANGLE_HIDDEN != 0;
    if is_closer && !(inputs.filters && is_hidden(triangle_ix)) {
        *best = Hit { t: at.squared, triangle_ix, u: at.u, v: at.v };
    }
}

/// Tests a triangle of an instance or of the world. `best.t` is the square of the distance.
pub fn test(inputs: &KernelInputs, Query { position, scale }: Query, entry: u32, best: &mut Hit) {
    let triangle_ix = inputs.inside.map_or(entry, |instance| instance.first_triangle + entry);
    let at = closest_on_triangle(inputs.corners(entry).map(|v| v * scale - position));
    keep_closest(inputs, triangle_ix, at, best);
}

/// A search through a tree: the point in the world and in the tree's space, and what gives the square of the distance
/// there beyond which no point is as close as the best one. `best.t` is the square of the distance in the world.
pub(super) struct TreeSearch<L: Fn(f32) -> f32> {
    pub query: Query,
    pub in_tree: Query,
    pub limit_of: L,
}

impl<L: Fn(f32) -> f32> TreeSearch<L> {
    pub fn run(&self, inputs: &KernelInputs, best: &mut Hit) {
        let root = DistantCell::root(inputs, self.in_tree);
        let mut pending = Pending { cells: [root; KD_MAX_DEPTH as usize], n: 0 };
        let mut next = Some(root);
        while let Some(cell) = next {
            let limit = (self.limit_of)(best.t);
            if cell.may_be_closer(limit) {
                let leaf = descend(inputs, self.in_tree, limit, cell, &mut pending);
                entries_of(leaf).for_each(|entry_ix| test(inputs, self.query, inputs.leaf_triangles[entry_ix], best));
            }
            next = pending.pop();
        }
    }
}

/// A search for closest points. Each thread has its own.
pub trait PointSearch {
    /// Keeps the closest point in `best`, if it is closer. `point` is the query's point without its scale. `best.t` is
    /// the square of the distance.
    fn search(&mut self, inputs: &KernelInputs, point: Vec3, query: Query, best: &mut Hit);
}

/// The search through the kd-trees, of the world or of its geometries.
struct Trees;

impl PointSearch for Trees {
    fn search(&mut self, inputs: &KernelInputs, point: Vec3, query: Query, best: &mut Hit) {
        match &inputs.instanced {
            Some(instanced) => search_instances(inputs, instanced, point, query, best),
            None => TreeSearch { query, in_tree: query, limit_of: |squared| squared }.run(inputs, best),
        }
    }
}

/// Returns the closest point of the triangles, for a point that [`is_point`].
fn find_closest(inputs: &KernelInputs, point: &QueryPoint, search: &mut impl PointSearch) -> Hit {
    let query = Query::at(point.position, [inputs.box_min, inputs.box_max]);
    let most: f32 = point.t_max * query.scale;
    let mut best = Hit { t: most * most, triangle_ix: NO_TRIANGLE, u: 0.0, v: 0.0 };
    search.search(inputs, point.position, query, &mut best);
    let to_world = 1.0 / query.scale;
    if best.triangle_ix == NO_TRIANGLE { MISS } else { Hit { t: (best.t.sqrt() * to_world).min(point.t_max), ..best } }
}

/// Finds the closest point of each of `points`, through the kd-trees, and writes one hit for each: the
/// distance is `t`. A point without a closest one gets a miss, as a ray does.
pub fn closest_point(inputs: &KernelInputs, points: &[QueryPoint], hits: &mut [Hit]) {
    closest_point_by(inputs, || Trees, points, hits);
}

/// Does what [`closest_point`] does, by searches that `new_search` makes, at least one for each thread that works.
pub fn closest_point_by<T: PointSearch>(
    inputs: &KernelInputs,
    new_search: impl Fn() -> T + Sync + Send,
    points: &[QueryPoint],
    hits: &mut [Hit],
) {
    let tasks = points.par_chunks(RAYS_PER_TASK).zip(hits.par_chunks_mut(RAYS_PER_TASK));
    tasks.for_each_init(new_search, |search, (points, hits)| {
        for (point, hit) in points.iter().zip(hits) {
            let is_any = is_point(point) && !inputs.triangles.is_empty();
            *hit = if is_any { find_closest(inputs, point, search) } else { MISS };
        }
    });
}
