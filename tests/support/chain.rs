//! A kd-tree of any depth: a chain of splits along x, each with a leaf as its lower child.

use glam::{Vec3, vec3};
use kdray::{
    accel::kdtree::{BuildOptions, KdArrays, KdTree, Node},
    layout::{Plane, Triangle},
};

use super::{MeshWithTree, meshes::triangle};

/// Returns one triangle for each leaf, in a plane across x. They are the lower and the upper half of a square in
/// turn.
fn slabs(n: u32) -> Vec<Triangle> {
    let slab = |ix: u32| {
        let x = ix as f32 + 0.5;
        let (low, high) = (vec3(x, 0.0, 0.0), vec3(x, 40.0, 40.0));
        if ix.is_multiple_of(2) {
            triangle(low, vec3(x, 40.0, 0.0), high)
        } else {
            triangle(low, high, vec3(x, 0.0, 40.0))
        }
    };
    (0..n).map(slab).collect()
}

/// Returns the chain with `n_levels` splits. Rays that come from above, towards smaller x, leave the lower leaf of
/// every level pending.
pub fn chain(n_levels: u32) -> MeshWithTree {
    let triangles = slabs(n_levels + 1);
    let flat = KdTree::build(&triangles, &BuildOptions { max_depth: Some(0), ..BuildOptions::default() });
    let leaf = |ix: u32| Node::Leaf { first: ix, count: 1 }.into();
    let mut arrays = KdArrays {
        nodes: vec![leaf(0); 2],
        parents: vec![0],
        leaf_triangles: (0..triangles.len() as u32).collect(),
        leaf_planes: triangles.iter().map(|t| Plane { normal: Vec3::X, distance: t.v0.x }).collect(),
        slabs: Vec::new(),
        depth: n_levels,
        ..flat.into_arrays()
    };
    let mut node = 0;
    for level in 0..n_levels {
        let child = 2 * level + 2;
        arrays.nodes[node as usize] = Node::Split { axis: 0, position: (level + 1) as f32, child }.into();
        arrays.nodes.extend([leaf(level), leaf(level + 1)]);
        arrays.parents.push(node);
        node = child + 1;
    }
    arrays.nodes[1] = Node::Leaf { first: 0, count: 0 }.into();
    let tree = KdTree::from_arrays(arrays, &triangles).expect("a tree");
    MeshWithTree::with_tree(triangles, tree)
}
