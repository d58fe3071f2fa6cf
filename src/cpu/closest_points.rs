//! The search for closest points through a [`WideBvh`]: of one query point after the other, sixteen boxes or triangles
//! at once, the nearest box first. The points are those of the [reference](crate::reference::closest_point), but for
//! distances that are equal up to the rounding that it allows: it visits other triangles.

use fearless_simd::{Level, Simd, dispatch, f32x16, prelude::*};
use glam::Vec3;

use super::{
    point_triangles::closest_on_triangles,
    vec3x16::Vec3x16,
    wide_traverser::{Entered, Stack, lanes_of},
};
use crate::{
    accel::wide_bvh::{IS_BLOCK, TriangleBlock, WideBvh, WideNode},
    layout::{Hit, NO_TRIANGLE, QueryPoint},
    reference::{
        closest_point::{PointSearch, closest_point_by, keep_closest, test},
        distant_cells::{Query, SHARE},
        inputs::KernelInputs,
        point_triangle::PointOnTriangle,
    },
};

/// Does what [`closest_point`](crate::reference::closest_point::closest_point) does, through a hierarchy of the same
/// triangles.
pub fn closest_points(inputs: &KernelInputs, bvh: &WideBvh, points: &[QueryPoint], hits: &mut [Hit]) {
    closest_point_by(inputs, || WidePointSearch::new(bvh, Level::new()), points, hits);
}

/// The search of one thread, with its working memory.
pub struct WidePointSearch<'a> {
    bvh: &'a WideBvh,
    simd_level: Level,
    stack: Stack,
    /// The triangle that is closest to the point before. It is tested first, since the next point is often near.
    last: u32,
}

/// A query as columns that are the same in all lanes.
struct QueryColumns<S: Simd> {
    position: Vec3x16<S>,
    scale: f32x16<S>,
}

impl<S: Simd> QueryColumns<S> {
    /// Returns the boxes that may hold a point that is as close as the best one, and the squares of their distances,
    /// which are rounded down as those of the kd-tree's cells are.
    #[inline(always)]
    fn near(&self, node: &WideNode, best_squared: f32) -> Entered {
        let simd = self.scale.simd;
        let [lower, upper] = [0, 1].map(|side| {
            Vec3x16([0, 1, 2].map(|axis| f32x16::load_array_ref(simd, &node.sides[axis][side]))) * self.scale
        });
        let ([below_x, below_y, below_z], [above_x, above_y, above_z]) =
            ((lower - self.position).0, (self.position - upper).0);
        let gap =
            Vec3x16([below_x.max(above_x), below_y.max(above_y), below_z.max(above_z)]).max(f32x16::splat(simd, 0.0));
        let squared = gap.dot(gap) * SHARE;
        Entered { lanes: lanes_of(squared.simd_le(best_squared)), t_enter: squared.to_array() }
    }

    /// Tests a block's triangles, as `reference::closest_point` does with each.
    #[inline(always)]
    fn test(&self, inputs: &KernelInputs, block: &TriangleBlock, best: &mut Hit) {
        let corners = |corner: &_| Vec3x16::load(self.scale.simd, corner) * self.scale - self.position;
        let [a, b, c] = &block.corners;
        let found = closest_on_triangles([corners(a), corners(b), corners(c)]);
        let mut lanes = lanes_of(found.squared.simd_le(best.t));
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            let [squared, u, v] = [found.squared, found.u, found.v].map(|column| column.as_array()[lane]);
            keep_closest(inputs, block.triangle_ixs[lane], PointOnTriangle { squared, u, v }, best);
            lanes &= lanes - 1;
        }
    }
}

impl<'a> WidePointSearch<'a> {
    /// Creates a search that uses the instructions of `simd_level`, which the machine must have. The points are the
    /// same at every SIMD level, bit for bit.
    pub fn new(bvh: &'a WideBvh, simd_level: Level) -> Self {
        Self { bvh, simd_level, stack: Stack::new(), last: NO_TRIANGLE }
    }

    /// Visits all blocks whose boxes may hold the closest point.
    #[inline(always)]
    fn search_by<S: Simd>(&mut self, simd: S, inputs: &KernelInputs, query: Query, best: &mut Hit) {
        let columns =
            QueryColumns { position: Vec3x16::splat(simd, query.position), scale: f32x16::splat(simd, query.scale) };
        let mut subtree = Some(0);
        self.stack.clear();
        while let Some(reference) = subtree {
            let nearest = if reference & IS_BLOCK != 0 {
                columns.test(inputs, &self.bvh.blocks()[(reference & !IS_BLOCK) as usize], best);
                None
            } else {
                let node = &self.bvh.nodes()[reference as usize];
                self.stack.push_all_but_nearest(node, &columns.near(node, best.t))
            };
            subtree = nearest.or_else(|| self.stack.pop(best.t));
        }
    }
}

impl PointSearch for WidePointSearch<'_> {
    fn search(&mut self, inputs: &KernelInputs, _: Vec3, query: Query, best: &mut Hit) {
        if self.last != NO_TRIANGLE {
            test(inputs, query, self.last, best);
        }
        dispatch!(self.simd_level, simd => self.search_by(simd, inputs, query, best));
        self.last = best.triangle_ix;
    }
}
