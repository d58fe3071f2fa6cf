//! Ropes: links from the faces of cells to their neighbours. The rope of a face leads to the smallest node whose cell
//! contains all that is on the other side of the face, or to node 0 where that is outside the root's cell (Popov,
//! Günther, Seidel, Slusallek: Stackless KD-Tree Traversal for High Performance GPU Ray Tracing, Eurographics 2007,
//! section 3).

use super::{KdTree, Node};
use crate::{
    accel::bounds::Bounds,
    layout::{KdBox, KdRope},
};

/// The number of a cell's faces: below and above on x, y, z.
const N_FACES: usize = 6;

impl KdTree {
    /// Returns six ropes for each node: below and above on x, y, z. `boxes`: the cells of the nodes.
    pub fn ropes(&self, boxes: &[KdBox]) -> Vec<KdRope> {
        let mut ropes = vec![[KdRope::default(); N_FACES]; self.nodes().len()];
        // Parents come before their children.
        for node_ix in 0..self.nodes().len() {
            let cell: Bounds = boxes[node_ix].into();
            for (face, rope) in ropes[node_ix].iter_mut().enumerate() {
                let position = if face % 2 == 1 { cell.max[face / 2] } else { cell.min[face / 2] };
                *rope = KdRope { position, node_ix: self.tightened(rope.node_ix, face, &cell) };
            }
            if let Node::Split { axis, child, .. } = self.node(node_ix as u32) {
                let [below, above] = [child as usize, child as usize + 1];
                ropes[below] = ropes[node_ix];
                ropes[above] = ropes[node_ix];
                ropes[below][2 * axis + 1].node_ix = child + 1;
                ropes[above][2 * axis].node_ix = child;
            }
        }
        ropes.into_flattened()
    }

    /// Descends from the node at a rope's end while one child contains all of the face's other side. Returns the node
    /// where the descent ends.
    fn tightened(&self, mut rope: u32, face: usize, cell: &Bounds) -> u32 {
        let (face_axis, is_above) = (face / 2, face % 2 == 1);
        while rope != 0 {
            let Node::Split { axis, position, child } = self.node(rope) else { break };
            rope = if axis == face_axis {
                if is_above { child } else { child + 1 }
            } else if position >= cell.max[axis] {
                child
            } else if position <= cell.min[axis] {
                child + 1
            } else {
                break;
            };
        }
        rope
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::kdtree::{BuildOptions, tests::staircase};

    /// Returns a node and all its ancestors, the root last.
    fn path(tree: &KdTree, node: u32) -> Vec<u32> {
        let above = |&node: &u32| (node != 0).then(|| tree.parents()[node as usize / 2]);
        std::iter::successors(Some(node), above).collect()
    }

    /// Returns the leaves on the other side of a face that have more than an edge in common with it.
    fn neighbours(tree: &KdTree, cells: &[Bounds], leaf: usize, face: usize) -> Vec<u32> {
        let (axis, cell) = (face / 2, cells[leaf]);
        let is_neighbour = |other: &Bounds| {
            let is_across =
                if face % 2 == 1 { other.min[axis] == cell.max[axis] } else { other.max[axis] == cell.min[axis] };
            let overlaps = |i: usize| other.min[i] < cell.max[i] && other.max[i] > cell.min[i];
            is_across && (0..3).all(|i| i == axis || overlaps(i))
        };
        let is_leaf = |node: u32| node != 1 && matches!(tree.node(node), Node::Leaf { .. });
        (0..cells.len() as u32).filter(|&node| is_leaf(node) && is_neighbour(&cells[node as usize])).collect()
    }

    #[test]
    fn a_rope_ends_at_the_neighbours_last_common_ancestor() {
        let tree = KdTree::build(&staircase(200), &BuildOptions::default());
        let boxes = tree.boxes();
        let ropes = tree.ropes(&boxes);
        let cells: Vec<Bounds> = boxes.into_iter().map(Bounds::from).collect();
        let mut n_checked = 0;
        for leaf in (0..cells.len()).filter(|&leaf| leaf != 1) {
            if matches!(tree.node(leaf as u32), Node::Split { .. }) {
                continue;
            }
            for face in 0..N_FACES {
                let paths: Vec<_> =
                    neighbours(&tree, &cells, leaf, face).iter().map(|&node| path(&tree, node)).collect();
                let is_common = |node: &&u32| paths.iter().all(|path| path.contains(node));
                let expected = paths.first().map_or(0, |path| *path.iter().find(is_common).expect("the root"));
                assert_eq!(ropes[N_FACES * leaf + face].node_ix, expected, "leaf {leaf}, face {face}");
                n_checked += usize::from(expected != 0);
            }
        }
        assert!(n_checked > 200, "{n_checked} ropes");
    }
}
