//! Tests that the validator finds each planted error and names it.

use glam::Vec3;
use kdray::{
    accel::kdtree::{BuildOptions, Invalid, KdArrays, KdTree, Node},
    layout::{KD_HAS_SLAB, KD_MAX_DEPTH, KdNode, Slab, Triangle},
};

use crate::meshes::{boxed, room, triangle};

/// A valid tree into which a test plants an error.
struct Plant {
    triangles: Vec<Triangle>,
    tree: KdArrays,
}

impl Plant {
    fn new() -> Self {
        let triangles = room(12);
        let tree = KdTree::build(&triangles, &BuildOptions::default());
        assert_eq!(tree.validate(&triangles), Ok(()));
        Self { triangles, tree: tree.into_arrays() }
    }

    /// Returns the validator's error after a change.
    fn after(mut self, change: impl FnOnce(&mut KdArrays)) -> Invalid {
        change(&mut self.tree);
        KdTree::from_arrays(self.tree, &self.triangles).expect_err("the planted error")
    }
}

/// Returns the last split: node, axis, position, child.
fn last_split(tree: &KdArrays) -> (u32, usize, f32, u32) {
    let split = |node| match tree.node(node) {
        Node::Split { axis, position, child } => Some((node, axis, position, child)),
        Node::Leaf { .. } => None,
    };
    (0..tree.nodes.len() as u32).rev().find_map(split).expect("a split")
}

/// Returns the last leaf with at least `least` triangles: node, first, count.
fn last_leaf(tree: &KdArrays, least: u32) -> (u32, u32, u32) {
    let leaf = |node| match tree.node(node) {
        Node::Leaf { first, count } if count >= least => Some((node, first, count)),
        _ => None,
    };
    (0..tree.nodes.len() as u32).rev().find_map(leaf).expect("a leaf")
}

fn set(tree: &mut KdArrays, node: u32, to: Node) {
    tree.nodes[node as usize] = to.into();
}

/// Removes an entry of a leaf, and adapts the ranges of the leaves after it.
fn drop_entry(tree: &mut KdArrays, entry: u32) {
    tree.leaf_triangles.remove(entry as usize);
    tree.leaf_planes.remove(entry as usize);
    for node in (0..tree.nodes.len() as u32).filter(|&node| node != 1) {
        if let Node::Leaf { first, count } = tree.node(node) {
            let has_it = first <= entry && entry < first + count;
            let leaf = Node::Leaf { first: first - u32::from(first > entry), count: count - u32::from(has_it) };
            set(tree, node, leaf);
        }
    }
}

#[test]
fn any_dropped_reference() {
    let plant = Plant::new();
    let n_entries = plant.tree.leaf_triangles.len() as u32;
    let mut n_missing = 0;
    for entry in (0..n_entries).step_by(7) {
        let mut tree = plant.tree.clone();
        let triangle = tree.leaf_triangles[entry as usize];
        drop_entry(&mut tree, entry);
        match KdTree::from_arrays(tree, &plant.triangles) {
            Err(Invalid::Missing { triangle: missing, .. }) => n_missing += u32::from(missing == triangle),
            // A leaf may hold a triangle that does not meet it, because the triangle's bounds are conservative.
            other => assert_eq!(other.err(), None),
        }
    }
    assert!(n_missing * 10 >= n_entries.div_ceil(7) * 9, "{n_missing} of {n_entries} / 7");
}

#[test]
fn a_dropped_triangle_in_a_split_plane() {
    // All triangles lie in planes perpendicular to an axis, and an inner wall lies exactly in a split plane.
    let walls = boxed(Vec3::ZERO, Vec3::ONE, 2);
    let inner = boxed(Vec3::splat(0.25), Vec3::splat(0.75), 2);
    let triangles = [walls, inner].concat();
    let options = BuildOptions { intersection_cost: 4.0, ..Default::default() };
    let tree = KdTree::build(&triangles, &options);
    assert_eq!(tree.validate(&triangles), Ok(()));
    let tree = tree.into_arrays();
    for entry in 0..tree.leaf_triangles.len() as u32 {
        let mut tree = tree.clone();
        let triangle = tree.leaf_triangles[entry as usize];
        drop_entry(&mut tree, entry);
        let found = KdTree::from_arrays(tree, &triangles);
        assert!(matches!(found, Err(Invalid::Missing { triangle: t, .. }) if t == triangle), "{entry}: {found:?}");
    }
}

#[test]
fn a_moved_split() {
    let after = |share: f32| {
        Plant::new().after(|tree| {
            let Node::Split { axis, position, child } = tree.node(0) else { panic!("the root is a split") };
            let position = position + share * (tree.box_max[axis] - position);
            set(tree, 0, Node::Split { axis, position, child });
        })
    };
    for share in [1e-3, 0.5, -0.01] {
        let found = after(share);
        let is_found = matches!(
            found,
            Invalid::Missing { .. } | Invalid::Stray { .. } | Invalid::Position { .. } | Invalid::OutsideSlab { .. }
        );
        assert!(is_found, "{found}");
    }
    for share in [2.0, f32::NAN, f32::INFINITY] {
        assert!(matches!(after(share), Invalid::Position { node: 0, .. }), "{share}");
    }
}

#[test]
fn a_swapped_axis() {
    let found = Plant::new().after(|tree| {
        let Node::Split { axis, position, child } = tree.node(0) else { panic!("the root is a split") };
        set(tree, 0, Node::Split { axis: (axis + 1) % 3, position, child });
    });
    assert!(matches!(found, Invalid::Missing { .. } | Invalid::Stray { .. } | Invalid::Position { .. }), "{found}");
}

#[test]
fn swapped_children() {
    let found = Plant::new().after(|tree| {
        let (_, _, _, child) = last_split(tree);
        tree.nodes.swap(child as usize, child as usize + 1);
    });
    assert!(matches!(found, Invalid::LeafRange { .. } | Invalid::Missing { .. } | Invalid::Stray { .. }), "{found}");
}

#[test]
fn a_broken_parent() {
    let found = Plant::new().after(|tree| *tree.parents.last_mut().unwrap() -= 1);
    assert!(matches!(found, Invalid::Parent { found, expected, .. } if found + 1 == expected), "{found}");
    assert_eq!(Plant::new().after(|tree| tree.parents[0] = 2), Invalid::Unused);
    assert!(matches!(Plant::new().after(|tree| _ = tree.parents.pop()), Invalid::Length { .. }));
    assert!(matches!(Plant::new().after(|tree| _ = tree.nodes.pop()), Invalid::Length { .. }));
    assert!(matches!(Plant::new().after(|tree| tree.nodes.clear()), Invalid::Length { nodes: 0, .. }));
}

#[test]
fn a_used_second_node() {
    assert_eq!(Plant::new().after(|tree| set(tree, 1, Node::Leaf { first: 0, count: 1 })), Invalid::Unused);
}

#[test]
fn a_split_along_no_axis() {
    let found = Plant::new().after(|tree| {
        let (node, _, position, child) = last_split(tree);
        set(tree, node, Node::Split { axis: 3, position, child });
    });
    assert!(matches!(found, Invalid::Axis { .. }), "{found}");
}

#[test]
fn a_child_that_cannot_be_one() {
    for wrong in [0, (1 << 29) - 2, 1 << 28] {
        let found = Plant::new().after(|tree| {
            let (node, axis, position, _) = last_split(tree);
            set(tree, node, Node::Split { axis, position, child: wrong });
        });
        assert!(matches!(found, Invalid::Child { child, .. } if child == wrong), "{found}");
    }
}

#[test]
fn a_circle_and_an_orphan() {
    let found = Plant::new().after(|tree| {
        let (node, axis, position, _) = last_split(tree);
        let Node::Split { child, .. } = tree.node(0) else { panic!("the root is a split") };
        set(tree, node, Node::Split { axis, position, child });
        // The children now have two parents, of which `parents` names only one.
        tree.parents[child as usize / 2] = node;
    });
    assert!(matches!(found, Invalid::Parent { .. } | Invalid::Shared { .. }), "{found}");
    let found = Plant::new().after(|tree| {
        tree.nodes.extend([KdNode::from(Node::Leaf { first: 0, count: 0 }); 2]);
        tree.parents.push(0);
    });
    assert!(matches!(found, Invalid::Orphan { .. }), "{found}");
}

#[test]
fn wrong_leaf_entries() {
    let leaf_with = |triangle: u32| {
        Plant::new().after(|tree| {
            let (_, first, count) = last_leaf(tree, 2);
            tree.leaf_triangles[(first + count - 1) as usize] = triangle;
        })
    };
    assert!(matches!(leaf_with(u32::MAX), Invalid::LeafOrder { triangle: u32::MAX, .. }));
    // The entries are in ascending order, so triangle 0 cannot come after another one.
    assert!(matches!(leaf_with(0), Invalid::LeafOrder { triangle: 0, .. }));
    let doubled = Plant::new().after(|tree| {
        let (_, first, _) = last_leaf(tree, 2);
        tree.leaf_triangles[first as usize + 1] = tree.leaf_triangles[first as usize];
    });
    assert!(matches!(doubled, Invalid::LeafOrder { .. }), "{doubled}");
    let swapped = Plant::new().after(|tree| {
        let (_, first, _) = last_leaf(tree, 2);
        tree.leaf_triangles.swap(first as usize, first as usize + 1);
    });
    assert!(matches!(swapped, Invalid::LeafOrder { .. }), "{swapped}");
}

#[test]
fn wrong_leaf_ranges() {
    let leaf_of = |first_by: u32, count_by: u32| {
        Plant::new().after(|tree| {
            let (node, first, count) = last_leaf(tree, 2);
            set(tree, node, Node::Leaf { first: first + first_by, count: count + count_by });
        })
    };
    assert!(matches!(leaf_of(1, 0), Invalid::LeafRange { .. }));
    assert!(matches!(leaf_of(0, 1 << 20), Invalid::LeafRange { .. }));
    let found = Plant::new().after(|tree| tree.leaf_triangles.push(0));
    assert_eq!(found, Invalid::UnusedEntries { n_unused: 1 });
}

#[test]
fn a_wrong_plane() {
    assert_eq!(Plant::new().after(|tree| tree.leaf_planes[5].distance += 1e-3), Invalid::Planes);
    assert_eq!(Plant::new().after(|tree| tree.leaf_planes.truncate(9)), Invalid::Planes);
}

/// Returns the last node with a slab, and its slab.
fn last_slab(tree: &KdArrays) -> (u32, Slab) {
    let slab = |node: u32| {
        let is_marked = tree.nodes[node as usize].axis_and_child & KD_HAS_SLAB != 0;
        is_marked.then(|| (node, tree.slabs[node as usize]))
    };
    (0..tree.nodes.len() as u32).rev().find_map(slab).expect("a slab")
}

#[test]
fn a_slab_too_thin_or_elsewhere() {
    let change: [fn(&mut Slab); 4] = [
        |slab| slab.offset += 1.0,
        |slab| slab.offset -= 0.2,
        |slab| *slab = Slab { normal: 1.5 * slab.normal, offset: 1.5 * slab.offset },
        |slab| slab.normal = slab.normal.any_orthogonal_vector(),
    ];
    for change in change {
        let found = Plant::new().after(|tree| {
            let (node, _) = last_slab(tree);
            change(&mut tree.slabs[node as usize]);
        });
        assert!(matches!(found, Invalid::OutsideSlab { .. }), "{found}");
    }
}

#[test]
fn a_slab_that_is_not_there() {
    let found = Plant::new().after(|tree| tree.slabs.clear());
    assert!(matches!(found, Invalid::NoSlab { slabs: 0, .. }), "{found}");
}

#[test]
fn a_stray_triangle() {
    let mut plant = Plant::new();
    plant.triangles[20] = plant.triangles[0];
    let found = plant.after(|_| ());
    assert!(matches!(found, Invalid::Stray { triangle: 20, .. } | Invalid::RootCell), "{found}");
    let mut plant = Plant::new();
    plant.triangles[20].v0.x = f32::NAN;
    let found = plant.after(|_| ());
    assert!(matches!(found, Invalid::Stray { triangle: 20, .. }), "{found}");
}

#[test]
fn a_wrong_cell() {
    assert_eq!(Plant::new().after(|tree| tree.box_max.y = tree.box_max.y.next_down()), Invalid::RootCell);
    assert_eq!(Plant::new().after(|tree| tree.box_min.z = -1.0), Invalid::RootCell);
}

#[test]
fn a_wrong_depth() {
    assert!(matches!(Plant::new().after(|tree| tree.depth += 1), Invalid::Depth { .. }));
    // A chain of splits with one level more than the traversal supports.
    let n_levels = KD_MAX_DEPTH - 1;
    let triangles = [triangle([Vec3::ZERO, Vec3::X, Vec3::Y])];
    let mut tree = KdTree::build(&triangles, &BuildOptions { max_depth: Some(0), ..Default::default() }).into_arrays();
    let end = tree.box_max.x;
    for level in 0..n_levels {
        let child = 2 * level + 2;
        let node = if level == 0 { 0 } else { child - 2 };
        set(&mut tree, node, Node::Split { axis: 0, position: end, child });
        tree.nodes.extend([KdNode::from(Node::Leaf { first: 0, count: 1 }), Node::Leaf { first: 1, count: 0 }.into()]);
        tree.parents.push(node);
    }
    tree.depth = n_levels;
    let found = KdTree::from_arrays(tree, &triangles).expect_err("too deep");
    assert_eq!(found, Invalid::Depth { recorded: n_levels, found: n_levels });
}

#[test]
fn other_triangles() {
    let Plant { mut triangles, tree } = Plant::new();
    let built = KdTree::from_arrays(tree, &triangles).expect("the tree as it was built");
    let built_of = triangles.len();
    triangles.pop();
    assert_eq!(built.validate(&triangles), Err(Invalid::Triangles { built_of, given: built_of - 1 }));
}
