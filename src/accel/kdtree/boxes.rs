//! Cells of all nodes, which some traversals read.

use super::{KdTree, Node};
use crate::{accel::bounds::Bounds, layout::KdBox};

impl KdTree {
    /// Returns the cell of each node, zeros for the unused node 1.
    pub fn boxes(&self) -> Vec<KdBox> {
        let mut cells = vec![Bounds { min: [0.0; 3], max: [0.0; 3] }; self.nodes().len()];
        cells[0] = Bounds::from(self.bounds());
        // Parents come before their children.
        for node_ix in 0..self.nodes().len() {
            if let Node::Split { axis, position, child } = self.node(node_ix as u32) {
                let children = cells[node_ix].split(axis, position);
                cells[child as usize..][..2].copy_from_slice(&children);
            }
        }
        cells.into_iter().map(KdBox::from).collect()
    }
}

impl From<Bounds> for KdBox {
    fn from(Bounds { min, max }: Bounds) -> Self {
        let ([min_x, min_y, min_z], [max_x, max_y, max_z]) = (min, max);
        Self { min_x, min_y, min_z, max_x, max_y, max_z }
    }
}

impl From<KdBox> for Bounds {
    fn from(cell: KdBox) -> Self {
        Self { min: [cell.min_x, cell.min_y, cell.min_z], max: [cell.max_x, cell.max_y, cell.max_z] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::kdtree::{BuildOptions, tests::staircase};

    #[test]
    fn leaves_touch_their_triangles_and_fill_the_root() {
        let triangles = staircase(100);
        let tree = KdTree::build(&triangles, &BuildOptions::default());
        let boxes = tree.boxes();
        let volume = |cell: &KdBox| Bounds::from(*cell).extent().iter().product::<f64>();
        let mut filled = 0.0;
        for (node_ix, cell) in boxes.iter().enumerate().filter(|&(node_ix, _)| node_ix != 1) {
            let Node::Leaf { first, count } = tree.node(node_ix as u32) else { continue };
            filled += volume(cell);
            for &triangle_ix in &tree.leaf_triangles()[first as usize..][..count as usize] {
                assert!(Bounds::of(&triangles[triangle_ix as usize]).touches(&Bounds::from(*cell)));
            }
        }
        assert!(tree.nodes().len() > 40 && (filled / volume(&boxes[0]) - 1.0).abs() < 1e-6);
    }
}
