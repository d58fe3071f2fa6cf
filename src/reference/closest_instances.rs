//! The search for closest points through a world of instances. Twin of `instances/closest.glsl`, which derives its
//! bounds.

use glam::Vec3;

use super::{
    closest_point::TreeSearch,
    distant_cells::{Query, is_within},
    inputs::{Instanced, KernelInputs},
    instances::{TopCell, local_vector},
};
use crate::layout::{Hit, Instance, NO_TRIANGLE, TOP_LEAF, TopNode};

/// The query point in the space of a geometry. A distance d from the point in the world is at most factor * d + slack
/// there, in units of both queries.
struct LocalQuery {
    query: Query,
    factor: f32,
    slack: f32,
}

/// The largest sum of magnitudes of a row of N N^T, where N is the inverse linear map.
fn norm_squared(&Instance { local_x: x, local_y: y, local_z: z, .. }: &Instance) -> f32 {
    let [xy, yz, zx] = [x.dot(y), y.dot(z), z.dot(x)].map(f32::abs);
    (x.dot(x) + xy + zx).max(y.dot(y) + xy + yz).max(z.dot(z) + yz + zx)
}

impl LocalQuery {
    fn new(instance: &Instance, bounds: [Vec3; 2], position: Vec3, world_scale: f32) -> Self {
        const ROUNDING: f32 = 1.0 / (1 << 21) as f32;
        let offset = position - instance.translation;
        let local = local_vector(instance, offset);
        let is_finite = local.is_finite();
        let norm = norm_squared(instance).sqrt();
        let reach = bounds[0].abs().max(bounds[1].abs());
        let sum = |v: Vec3| v.abs().element_sum();
        let of_corners = sum(instance.translation)
            + reach.x * sum(instance.axis_x)
            + reach.y * sum(instance.axis_y)
            + reach.z * sum(instance.axis_z);
        let of_rows = instance.local_x.abs() + instance.local_y.abs() + instance.local_z.abs();
        let query = Query::at(if is_finite { local } else { Vec3::ZERO }, bounds);
        let slack = ROUNDING * (norm * of_corners + sum(of_rows * offset)) * query.scale;
        let factor = norm * (1.0 + 4.0 * ROUNDING) / world_scale * query.scale;
        Self { query, factor, slack: if is_finite { slack } else { f32::INFINITY } }
    }

    /// The square of the distance in the geometry beyond which no point is as close as the best one.
    fn limit_of(&self, best_squared: f32) -> f32 {
        let d = best_squared.min(3.0e38).sqrt() * self.factor + self.slack;
        d * d
    }
}

/// Searches the trees of all instances that may be closer, of those that rays of casts meet. `position`: the point in
/// the world.
pub(super) fn search_instances(
    inputs: &KernelInputs,
    instanced: &Instanced,
    position: Vec3,
    query: Query,
    best: &mut Hit,
) {
    let nodes = &instanced.two.top().nodes;
    let kind = inputs.kind_of_rays(false);
    let gap_to = |node: &TopNode| query.gap_to([node.box_min, node.box_max]);
    let mut at = TopCell { node_ix: 0, pending: 0 };
    while at.node_ix != NO_TRIANGLE {
        let node = &nodes[at.node_ix as usize];
        let may_be = is_within(gap_to(node), best.t);
        if may_be && node.link & TOP_LEAF == 0 {
            let [first, second] = [2 * node.link, 2 * node.link + 1].map(|ix| gap_to(&nodes[ix as usize]));
            at.node_ix = 2 * node.link + u32::from(second.dot(second) < first.dot(first));
            at.pending = at.pending << 1 | 1;
            continue;
        }
        let instance = may_be.then(|| &instanced.instances.list[(node.link & !TOP_LEAF) as usize]);
        if let Some(instance) = instance.filter(|it| it.flags & kind != 0) {
            let geometry = inputs.of_instance(instanced, instance);
            let local = LocalQuery::new(instance, [geometry.box_min, geometry.box_max], position, query.scale);
            let limit_of = |squared| local.limit_of(squared);
            TreeSearch { query, in_tree: local.query, limit_of }.run(&geometry, best);
        }
        at.leave(nodes);
    }
}
