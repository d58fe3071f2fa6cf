//! Exact counts of a traversal's steps: its reads of the acceleration structure.

use rayon::prelude::*;
use serde::Serialize;

use super::table::ReadCounts;
use crate::reference::{
    RAYS_PER_TASK,
    inputs::KernelInputs,
    traverser::{Tracer, Traverser},
};
use crate::{
    accel::{Query, kdtree::Traversal},
    layout::PathRay,
};

/// Reads of one or more rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Steps {
    /// Nodes, both on the way down and on the way back up, slabs, and cells of a grid.
    pub n_nodes: u64,
    /// Links to parents, and ropes.
    pub n_links: u64,
    /// Boxes of nodes.
    pub n_boxes: u64,
    /// Entries of the leaves that were visited. A triangle counts once for each of its leaves.
    pub n_triangles: u64,
}

impl Steps {
    fn plus(self, other: Self) -> Self {
        Self {
            n_nodes: self.n_nodes + other.n_nodes,
            n_links: self.n_links + other.n_links,
            n_boxes: self.n_boxes + other.n_boxes,
            n_triangles: self.n_triangles + other.n_triangles,
        }
    }
}

impl From<ReadCounts> for Steps {
    fn from(counts: ReadCounts) -> Self {
        Self {
            n_nodes: counts.n_nodes.get(),
            n_links: counts.n_links.get(),
            n_boxes: counts.n_boxes.get(),
            n_triangles: counts.n_triangles.get(),
        }
    }
}

/// Returns the reads of all rays together. The kernels' reads are the same, unless rounding sends a ray another way.
/// Brute force counts every triangle for both kinds of query.
pub fn count_steps(inputs: &KernelInputs, traversal: Traversal, query: Query, rays: &[PathRay]) -> Steps {
    if traversal == Traversal::Brute && inputs.instanced.is_none() {
        return Steps { n_triangles: (rays.len() * inputs.triangles.len()) as u64, ..Steps::default() };
    }
    let of_task = |traverser: &mut Traverser, rays: &[PathRay]| {
        let counts = ReadCounts::default();
        let counted = inputs.counted(&counts);
        for ray in rays {
            match query {
                Query::Closest => traverser.traverse::<false>(&counted, &ray.into()),
                Query::Any => traverser.traverse::<true>(&counted, &ray.into()),
            };
        }
        Steps::from(counts)
    };
    rays.par_chunks(RAYS_PER_TASK)
        .map_init(|| Traverser::new(inputs, traversal), of_task)
        .reduce(Steps::default, Steps::plus)
}

#[cfg(test)]
mod tests {
    use glam::{Vec3, vec3};

    use super::*;
    use crate::{
        accel::kdtree::{BuildOptions, KdTree, TraversalLinks},
        layout::{NO_TRIANGLE, Triangle},
    };

    /// Two triangles far apart along x. Split planes are between them and beside them.
    fn two_triangles() -> Vec<Triangle> {
        let at = |x: f32| Triangle {
            v0: vec3(x, 0.0, 0.0),
            v1: vec3(x + 1.0, 0.0, 0.0),
            v2: vec3(x, 1.0, 0.0),
            ..Triangle::default()
        };
        vec![at(0.0), at(10.0)]
    }

    /// Counts the steps through a tree without slabs.
    fn steps(max_depth: u32, traversal: Traversal, query: Query, rays: &[PathRay]) -> Steps {
        let options = BuildOptions { max_depth: Some(max_depth), slabs: false, ..BuildOptions::default() };
        steps_through(options, traversal, query, rays)
    }

    fn steps_through(options: BuildOptions, traversal: Traversal, query: Query, rays: &[PathRay]) -> Steps {
        let triangles = two_triangles();
        let options = BuildOptions { traversal_cost: 1e-3, ..options };
        let tree = KdTree::build(&triangles, &options);
        let links = TraversalLinks::all(&tree);
        count_steps(&KernelInputs::of_tree(&triangles, &tree).with_links(&links), traversal, query, rays)
    }

    fn ray(origin: Vec3, direction: Vec3) -> PathRay {
        let t_max = f32::INFINITY;
        PathRay { origin, pixel_ix: 0, direction, source_triangle: NO_TRIANGLE, throughput: Vec3::ONE, t_max }
    }

    #[test]
    fn a_tree_of_one_leaf_is_one_node_and_all_triangles() {
        let at_first = ray(vec3(0.25, 0.25, 5.0), Vec3::NEG_Z);
        for traversal in [Traversal::Mask, Traversal::Restart, Traversal::ShortStack, Traversal::Stack] {
            let found = steps(0, traversal, Query::Closest, &[at_first; 3]);
            assert_eq!(found, Steps { n_nodes: 3, n_triangles: 6, ..Steps::default() }, "{traversal}");
        }
        let found = steps(0, Traversal::Brute, Query::Closest, &[at_first; 3]);
        assert_eq!(found, Steps { n_triangles: 6, ..Steps::default() });
    }

    #[test]
    fn a_slab_counts_as_a_node() {
        let in_slab = ray(vec3(0.25, 0.25, 5.0), Vec3::NEG_Z);
        let options = BuildOptions { max_depth: Some(0), ..BuildOptions::default() };
        let found = steps_through(options, Traversal::Mask, Query::Closest, &[in_slab]);
        assert_eq!(found, Steps { n_nodes: 2, n_triangles: 2, ..Steps::default() });
    }

    #[test]
    fn the_other_side_of_a_plane_costs_nothing() {
        let at_first = ray(vec3(0.25, 0.25, 5.0), Vec3::NEG_Z);
        for traversal in [Traversal::Mask, Traversal::Restart, Traversal::ShortStack, Traversal::Stack] {
            let found = steps(1, traversal, Query::Closest, &[at_first]);
            assert_eq!(found, Steps { n_nodes: 2, n_triangles: 1, ..Steps::default() }, "{traversal}");
        }
    }

    /// The ray goes to the first leaf, where it misses, and to the second one by the root or by one link.
    #[test]
    fn the_way_to_the_other_side_is_counted() {
        let past_first = [ray(vec3(-5.0, 0.9, 0.0), Vec3::X)];
        let by = |traversal| steps(1, traversal, Query::Closest, &past_first);
        assert_eq!(by(Traversal::Stack).n_nodes + 1, by(Traversal::Restart).n_nodes);
        assert_eq!((by(Traversal::Stack).n_links, by(Traversal::Stack).n_boxes), (0, 0));
        assert!(by(Traversal::Backtrack).n_links > 0 && by(Traversal::Backtrack).n_boxes > 0);
        assert!(by(Traversal::Ropes).n_links > 0);
    }

    #[test]
    fn rays_that_miss_the_root_read_nothing() {
        let beside = ray(vec3(0.25, 9.0, 5.0), Vec3::NEG_Z);
        assert_eq!(steps(1, Traversal::Mask, Query::Any, &[beside]), Steps::default());
    }
}
