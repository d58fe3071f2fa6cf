//! What a traversal reads of a tree, counted exactly.

use rayon::prelude::*;
use serde::Serialize;

use super::{RAYS_PER_TASK, bindings::Bindings, kdtree::Traverser, table::ReadCounts};
use crate::{cast::Query, frame::Traversal, layout::Ray};

/// Reads for one or more rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Steps {
    /// Nodes, on the way down and on the way back alike.
    pub n_nodes: u64,
    /// Links from nodes to their parents.
    pub n_parents: u64,
    /// Triangles that were tested, once a leaf.
    pub n_triangles: u64,
}

impl Steps {
    fn plus(self, other: Self) -> Self {
        Self {
            n_nodes: self.n_nodes + other.n_nodes,
            n_parents: self.n_parents + other.n_parents,
            n_triangles: self.n_triangles + other.n_triangles,
        }
    }
}

impl From<ReadCounts> for Steps {
    fn from(counts: ReadCounts) -> Self {
        Self { n_nodes: counts.n_nodes.get(), n_parents: counts.n_parents.get(), n_triangles: counts.n_triangles.get() }
    }
}

/// The reads of all rays together. The kernels' are the same, but where rounding sends a ray another way.
pub fn count_steps(bindings: &Bindings, traversal: Traversal, query: Query, rays: &[Ray]) -> Steps {
    let of_task = |traverser: &mut Traverser, rays: &[Ray]| {
        let counts = ReadCounts::default();
        let counted = bindings.counted(&counts);
        for ray in rays {
            match query {
                Query::Closest => traverser.traverse::<false>(&counted, ray, 0.0),
                Query::Any => traverser.traverse::<true>(&counted, ray, 0.0),
            };
        }
        Steps::from(counts)
    };
    rays.par_chunks(RAYS_PER_TASK).map_init(|| Traverser::new(traversal), of_task).reduce(Steps::default, Steps::plus)
}

#[cfg(test)]
mod tests {
    use glam::{Vec3, vec3};

    use super::*;
    use crate::{
        kdtree::{BuildOptions, KdTree},
        layout::{Frame, NO_TRIANGLE, Triangle},
    };

    /// Two triangles far apart along x: split planes lie between and beside them.
    fn two_triangles() -> Vec<Triangle> {
        let at = |x: f32| Triangle {
            v0: vec3(x, 0.0, 0.0),
            v1: vec3(x + 1.0, 0.0, 0.0),
            v2: vec3(x, 1.0, 0.0),
            ..Triangle::default()
        };
        vec![at(0.0), at(10.0)]
    }

    fn steps(max_depth: u32, traversal: Traversal, query: Query, rays: &[Ray]) -> Steps {
        let triangles = two_triangles();
        let options = BuildOptions { traversal_cost: 1e-3, max_depth: Some(max_depth), ..BuildOptions::default() };
        let tree = KdTree::build(&triangles, &options);
        let frame = Frame { cell_min: tree.cell_min, cell_max: tree.cell_max, ..Frame::default() };
        count_steps(&Bindings::of_tree(&triangles, &tree, &frame), traversal, query, rays)
    }

    fn ray(origin: Vec3, direction: Vec3) -> Ray {
        let t_max = f32::INFINITY;
        Ray { origin, pixel_ix: 0, direction, source_triangle: NO_TRIANGLE, throughput: Vec3::ONE, t_max }
    }

    #[test]
    fn a_tree_of_one_leaf_is_one_node_and_all_triangles() {
        let at_first = ray(vec3(0.25, 0.25, 5.0), Vec3::NEG_Z);
        for &traversal in Traversal::ALL {
            let found = steps(0, traversal, Query::Closest, &[at_first; 3]);
            assert_eq!(found, Steps { n_nodes: 3, n_parents: 0, n_triangles: 6 }, "{traversal}");
        }
    }

    #[test]
    fn the_other_side_of_a_plane_costs_nothing() {
        let at_first = ray(vec3(0.25, 0.25, 5.0), Vec3::NEG_Z);
        for &traversal in Traversal::ALL {
            let found = steps(1, traversal, Query::Closest, &[at_first]);
            assert_eq!(found, Steps { n_nodes: 2, n_parents: 0, n_triangles: 1 }, "{traversal}");
        }
    }

    #[test]
    fn rays_that_miss_the_root_read_nothing() {
        let beside = ray(vec3(0.25, 9.0, 5.0), Vec3::NEG_Z);
        assert_eq!(steps(1, Traversal::Mask, Query::Any, &[beside]), Steps::default());
    }
}
