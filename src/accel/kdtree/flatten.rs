//! Joins the upper part of a tree and the subtrees below it, in depth-first order.

use glam::Vec3;

use super::{EMPTY_LEAF, KdArrays, Node, subtree::Subtree};
use crate::accel::bounds::Bounds;

/// Node of the upper part of a tree with all nodes below it. Its lowest nodes are whole subtrees.
pub enum UpperTree {
    Split { axis: usize, position: f32, children: Box<[UpperTree; 2]> },
    Subtree(Subtree),
}

/// Makes the tree's arrays as kernels read them, without planes and slabs. `cell`: the root's cell.
pub fn flatten(top: UpperTree, cell: Bounds) -> KdArrays {
    let mut tree = KdArrays {
        nodes: vec![EMPTY_LEAF; 2],
        parents: vec![0],
        box_min: Vec3::from_array(cell.min),
        box_max: Vec3::from_array(cell.max),
        ..KdArrays::default()
    };
    append(&mut tree, 0, top);
    tree
}

/// Writes a node at the index `slot`, and appends all nodes below it.
fn append(tree: &mut KdArrays, slot: usize, top: UpperTree) {
    match top {
        UpperTree::Subtree(subtree) => append_subtree(tree, slot, &subtree),
        UpperTree::Split { axis, position, children } => {
            let child = tree.nodes.len();
            tree.nodes[slot] = Node::Split { axis, position, child: child as u32 }.into();
            tree.nodes.extend([EMPTY_LEAF; 2]);
            tree.parents.push(slot as u32);
            let [below, above] = *children;
            append(tree, child, below);
            append(tree, child + 1, above);
        }
    }
}

/// Writes a subtree's root at the index `slot`, and appends the subtree's other nodes and its entries.
fn append_subtree(tree: &mut KdArrays, slot: usize, subtree: &Subtree) {
    let (first_node, first_triangle) = (tree.nodes.len() as u32, tree.leaf_triangles.len() as u32);
    let relocated = |node| match Node::from(node) {
        Node::Leaf { first, count } => Node::Leaf { first: first + first_triangle, count },
        Node::Split { axis, position, child } => Node::Split { axis, position, child: child - 2 + first_node },
    };
    tree.nodes[slot] = relocated(subtree.nodes[0]).into();
    tree.nodes.extend(subtree.nodes[2..].iter().map(|&node| -> crate::layout::KdNode { relocated(node).into() }));
    tree.parents.resize(tree.nodes.len() / 2, 0);
    for node_ix in std::iter::once(slot).chain(first_node as usize..tree.nodes.len()) {
        if let Node::Split { child, .. } = tree.node(node_ix as u32) {
            tree.parents[child as usize >> 1] = node_ix as u32;
        }
    }
    tree.leaf_triangles.extend_from_slice(&subtree.leaf_triangles);
    tree.depth = tree.depth.max(subtree.depth);
}
