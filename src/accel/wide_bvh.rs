//! A bounding volume hierarchy with sixteen children a node, for single rays on the CPU: a ray tests all boxes of a
//! node at once, and all triangles of a block (Wald, Benthin, Boulos: "Getting rid of packets: efficient SIMD
//! single-ray traversal using multi-branching BVHs", 2008).
//!
//! It is made from a kd-tree. Leaves become blocks of triangles, and siblings with at most sixteen triangles may become
//! one block. Of the splits above the blocks, up to fifteen become one node. The choice makes the sum of the surface
//! areas of all boxes least, and with it the mean number of nodes and blocks that a random ray visits (Ylitie, Karras,
//! Laine: "Efficient incoherent ray traversal on GPUs through compressed wide BVHs", 2017).
//!
//! # Why no ray misses a triangle
//!
//! The box of a kd-tree's leaf is the piece of the leaf's cell that the bounds of the leaf's triangles, grown by their
//! margins, reach. The builder of the kd-tree could have cut off the rest of the cell as empty by six more splits. So
//! the proof for the leaves of the kd-tree (bounds.rs) holds for the box, too. If a leaf is halved, the same is true of
//! each half and its own triangles. All other boxes contain those of their leaves. A ray that enters the box of a leaf
//! also enters the boxes around it: rounding keeps the order of planes, so the ray enters a larger box at no greater t,
//! and leaves it at no smaller t.

use std::array;

use arrayvec::ArrayVec;
use rayon::prelude::*;

use super::{
    bounds::Bounds,
    kdtree::{KdTree, Node},
};
use crate::layout::{KD_MAX_DEPTH, NO_TRIANGLE, Triangle};

/// The most children of a node, and the most triangles of a block.
pub const WIDTH: usize = 16;
/// This bit is set in a reference to a block. The other bits are the index of the block, or without this bit, of a
/// node.
pub const IS_BLOCK: u32 = 1 << 31;
/// A reference to the first block, which is empty. Unused children refer to it, since a ray whose direction is infinite
/// may seem to meet their boxes.
const EMPTY_BLOCK: u32 = IS_BLOCK;
/// The number of levels below the root of the kd-tree whose subtrees are converted in parallel.
const PARALLEL_LEVELS: u32 = 8;
/// The most levels of nodes. A node is at least one split above its children: one of the kd-tree, of at most
/// `KD_MAX_DEPTH - 2`, or one that halves a leaf of too many triangles, of at most 32. Only the root may have a single
/// child, if no box has an area.
pub const MOST_LEVELS: usize = KD_MAX_DEPTH as usize + 32;

/// The boxes of up to sixteen subtrees, as a structure of arrays. Unused boxes are empty.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub struct WideNode {
    /// On each axis, the boxes' lower sides and their upper sides, world units.
    pub sides: [[[f32; WIDTH]; 2]; 3],
    /// References to the subtrees.
    pub children: [u32; WIDTH],
}

/// Up to sixteen triangles, as a structure of arrays. Unused triangles have corners of NaN, so that no ray hits them.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub struct TriangleBlock {
    /// The coordinates of each corner on each axis, world units.
    pub corners: [[[f32; WIDTH]; 3]; 3],
    /// The indices of the triangles.
    pub triangle_ixs: [u32; WIDTH],
}

/// The hierarchy. Its root is the first node.
#[derive(Clone, Debug)]
pub struct WideBvh {
    nodes: Vec<WideNode>,
    blocks: Vec<TriangleBlock>,
}

/// The triangles of a block, in ascending order.
type BlockList = ArrayVec<u32, WIDTH>;

/// Half of the least surface area that all boxes of a subtree can have together. The element at `i` is for a subtree
/// that takes at most `i + 1` lanes of a node. Each lane has a block or a node.
type LeastAreas = [f64; WIDTH];

/// A subtree before it is written to the arrays.
enum Subtree {
    Empty,
    Block { bounds: Bounds, triangle_ixs: BlockList },
    Inner(Box<Inner>),
}

/// A subtree of two others.
struct Inner {
    bounds: Bounds,
    children: [Subtree; 2],
    /// Whether one block holds all triangles of the subtree.
    fits_a_block: bool,
    least_areas: LeastAreas,
}

/// Returns the piece of a leaf's cell that the bounds of one of the leaf's triangles, grown by its margin, reach.
fn piece_in(tree: &KdTree, triangle: &Triangle, cell: &Bounds) -> Bounds {
    let piece = Bounds::of(triangle).grown(tree.margin_of(triangle)).intersection(cell);
    // A triangle of the leaf reaches the cell. If rounding says otherwise, the piece is the cell.
    if (0..3).all(|axis| piece.min[axis] <= piece.max[axis]) { piece } else { *cell }
}

/// Returns the union of two ascending lists, if it fits into a block.
fn union(a: &BlockList, b: &BlockList) -> Option<BlockList> {
    let mut both: ArrayVec<u32, { 2 * WIDTH }> = a.iter().chain(b).copied().collect();
    both.sort_unstable();
    let mut all = BlockList::new();
    for triangle_ix in both {
        if all.last() != Some(&triangle_ix) {
            all.try_push(triangle_ix).ok()?;
        }
    }
    Some(all)
}

impl Subtree {
    /// Converts the subtree of a kd-tree's node. `level`: the number of splits above the node.
    fn of(tree: &KdTree, triangles: &[Triangle], node_ix: u32, cell: &Bounds, level: u32) -> Self {
        match tree.node(node_ix) {
            Node::Leaf { first, count } => {
                let entries = first as usize..(first + count) as usize;
                Self::of_leaf(tree, triangles, &tree.leaf_triangles()[entries], cell)
            }
            Node::Split { axis, position, child } => {
                let [below, above] = cell.split(axis, position);
                let of_below = || Self::of(tree, triangles, child, &below, level + 1);
                let of_above = || Self::of(tree, triangles, child + 1, &above, level + 1);
                let (below, above) = match level < PARALLEL_LEVELS {
                    true => rayon::join(of_below, of_above),
                    false => (of_below(), of_above()),
                };
                Self::join(below, above)
            }
        }
    }

    /// Converts a leaf. Triangles that do not fit into a block are halved.
    fn of_leaf(tree: &KdTree, triangles: &[Triangle], triangle_ixs: &[u32], cell: &Bounds) -> Self {
        if triangle_ixs.len() > WIDTH {
            let (a, b) = triangle_ixs.split_at(triangle_ixs.len() / 2);
            return Self::join(Self::of_leaf(tree, triangles, a, cell), Self::of_leaf(tree, triangles, b, cell));
        }
        let piece_of = |triangle_ix: &u32| piece_in(tree, &triangles[*triangle_ix as usize], cell);
        let Some(bounds) = triangle_ixs.iter().map(piece_of).reduce(|a, b| a.union(&b)) else { return Self::Empty };
        let mut triangle_ixs: BlockList = triangle_ixs.iter().copied().collect();
        triangle_ixs.sort_unstable();
        Self::Block { bounds, triangle_ixs }
    }

    /// Returns the subtree of two subtrees.
    fn join(a: Self, b: Self) -> Self {
        let bounds = match (a.bounds(), b.bounds()) {
            (Some(a), Some(b)) => a.union(b),
            (None, _) => return b,
            (_, None) => return a,
        };
        let triangle_ixs = a.triangle_ixs().zip(b.triangle_ixs()).and_then(|(a, b)| union(&a, &b));
        let (children, fits_a_block) = ([a, b], triangle_ixs.is_some());
        let below = if fits_a_block { 0.0 } else { share_lanes(&children, WIDTH).1 };
        let of_one = bounds.half_area() + below;
        let least_of = |n_lanes| if n_lanes == 1 { of_one } else { of_one.min(share_lanes(&children, n_lanes).1) };
        let least_areas = array::from_fn(|ix| least_of(ix + 1));
        match triangle_ixs {
            Some(triangle_ixs) if least_areas == [of_one; WIDTH] => Self::Block { bounds, triangle_ixs },
            _ => Self::Inner(Box::new(Inner { bounds, children, fits_a_block, least_areas })),
        }
    }

    fn bounds(&self) -> Option<&Bounds> {
        match self {
            Self::Empty => None,
            Self::Block { bounds, .. } => Some(bounds),
            Self::Inner(inner) => Some(&inner.bounds),
        }
    }

    /// Returns all triangles of the subtree, if one block holds them.
    fn triangle_ixs(&self) -> Option<BlockList> {
        match self {
            Self::Block { triangle_ixs, .. } => Some(triangle_ixs.clone()),
            Self::Inner(inner) if inner.fits_a_block => {
                let [a, b] = &inner.children;
                union(&a.triangle_ixs()?, &b.triangle_ixs()?)
            }
            Self::Empty | Self::Inner(_) => None,
        }
    }

    fn least_areas(&self) -> LeastAreas {
        match self {
            Self::Empty => [0.0; WIDTH],
            Self::Block { bounds, .. } => [bounds.half_area(); WIDTH],
            Self::Inner(inner) => inner.least_areas,
        }
    }

    /// Appends the blocks and nodes that stand for the subtree in the lanes of a node, at most `n_lanes`.
    fn append_to(self, lanes: &mut ArrayVec<Self, WIDTH>, n_lanes: usize) {
        match self {
            Self::Empty => (),
            Self::Inner(inner) if inner.least_areas[n_lanes - 1] < inner.least_areas[0] => {
                append_both(inner.children, lanes, n_lanes);
            }
            one => lanes.push(one),
        }
    }
}

/// Divides lanes of a node among two subtrees, so that all boxes have the least surface area. Returns the number of the
/// first subtree's lanes, and half of that area. `n_lanes`: at least 2.
fn share_lanes([a, b]: &[Subtree; 2], n_lanes: usize) -> (usize, f64) {
    let (of_a, of_b) = (a.least_areas(), b.least_areas());
    let area = |n_of_a: usize| of_a[n_of_a - 1] + of_b[n_lanes - n_of_a - 1];
    let shares = (1..n_lanes).map(|n_of_a| (n_of_a, area(n_of_a)));
    shares.min_by(|a, b| a.1.total_cmp(&b.1)).expect("there are two lanes")
}

/// Appends the blocks and nodes that stand for two subtrees in the lanes of a node, at most `n_lanes`.
fn append_both(subtrees: [Subtree; 2], lanes: &mut ArrayVec<Subtree, WIDTH>, n_lanes: usize) {
    let (n_of_a, _) = share_lanes(&subtrees, n_lanes);
    let [a, b] = subtrees;
    a.append_to(lanes, n_of_a);
    b.append_to(lanes, n_lanes - n_of_a);
}

impl WideNode {
    /// Returns a node with empty boxes.
    fn empty() -> Self {
        Self { sides: [[[f32::MAX; WIDTH], [f32::MIN; WIDTH]]; 3], children: [EMPTY_BLOCK; WIDTH] }
    }

    fn set(&mut self, lane: usize, bounds: &Bounds, child: u32) {
        for axis in 0..3 {
            self.sides[axis][0][lane] = bounds.min[axis];
            self.sides[axis][1][lane] = bounds.max[axis];
        }
        self.children[lane] = child;
    }
}

impl TriangleBlock {
    fn new(triangles: &[Triangle], triangle_ixs: &BlockList) -> Self {
        let mut block = Self { corners: [[[f32::NAN; WIDTH]; 3]; 3], triangle_ixs: [NO_TRIANGLE; WIDTH] };
        for (lane, &triangle_ix) in triangle_ixs.iter().enumerate() {
            let triangle = &triangles[triangle_ix as usize];
            for (columns, corner) in block.corners.iter_mut().zip([triangle.v0, triangle.v1, triangle.v2]) {
                (0..3).for_each(|axis| columns[axis][lane] = corner[axis]);
            }
            block.triangle_ixs[lane] = triangle_ix;
        }
        block
    }
}

/// Writes a node and all nodes below it. Appends the lists of their blocks to `lists`.
fn write(children: ArrayVec<Subtree, WIDTH>, nodes: &mut Vec<WideNode>, lists: &mut Vec<BlockList>) {
    let place = nodes.len();
    nodes.push(WideNode::empty());
    for (lane, child) in children.into_iter().enumerate() {
        let Some(bounds) = child.bounds() else { continue };
        if let Some(triangle_ixs) = child.triangle_ixs() {
            nodes[place].set(lane, bounds, IS_BLOCK | lists.len() as u32);
            lists.push(triangle_ixs);
        } else if let Subtree::Inner(inner) = child {
            let (node_ix, mut lanes) = (nodes.len() as u32, ArrayVec::new());
            nodes[place].set(lane, &inner.bounds, node_ix);
            append_both(inner.children, &mut lanes, WIDTH);
            write(lanes, nodes, lists);
        }
    }
}

impl WideBvh {
    /// Makes the hierarchy of the triangles that a kd-tree was built from, on the current rayon pool.
    pub fn new(tree: &KdTree, triangles: &[Triangle]) -> Self {
        let cell = Bounds::from(tree.bounds());
        let (mut nodes, mut lists) = (Vec::new(), vec![BlockList::new()]);
        let mut lanes = ArrayVec::new();
        Subtree::of(tree, triangles, 0, &cell, 0).append_to(&mut lanes, WIDTH);
        write(lanes, &mut nodes, &mut lists);
        let blocks = lists.par_iter().map(|list| TriangleBlock::new(triangles, list)).collect();
        Self { nodes, blocks }
    }

    /// All nodes, the root first.
    pub fn nodes(&self) -> &[WideNode] {
        &self.nodes
    }

    /// All blocks. The first one is empty.
    pub fn blocks(&self) -> &[TriangleBlock] {
        &self.blocks
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use glam::{Vec3, vec3};

    use super::*;
    use crate::accel::kdtree::BuildOptions;

    /// Triangles of a bumpy sheet, and others that all share a corner.
    fn triangles() -> Vec<Triangle> {
        let at = |i: i32, j: i32| vec3(i as f32, ((i * i + 3 * j) % 7) as f32 * 0.1, j as f32);
        let of_sheet = |i: i32| {
            let (x, y) = (i % 40, i / 40);
            Triangle { v0: at(x, y), v1: at(x + 1, y), v2: at(x, y + 1), ..Triangle::default() }
        };
        let of_fan = |i: i32| {
            let turn = i as f32 * 0.01;
            Triangle { v0: vec3(20.0, 5.0, 20.0), v1: vec3(turn.cos(), 9.0, turn.sin()), ..of_sheet(i) }
        };
        (0..1600).map(of_sheet).chain((0..600).map(of_fan)).collect()
    }

    fn bounds_of(node: &WideNode, lane: usize) -> Bounds {
        let side = |side: usize| [0, 1, 2].map(|axis| node.sides[axis][side][lane]);
        Bounds { min: side(0), max: side(1) }
    }

    /// Calls `visit` with each block and the boxes around it, from the root's child on.
    fn visit_blocks(bvh: &WideBvh, node_ix: u32, boxes: &mut Vec<Bounds>, visit: &mut impl FnMut(u32, &[Bounds])) {
        let node = &bvh.nodes()[node_ix as usize];
        for lane in 0..WIDTH {
            let bounds = bounds_of(node, lane);
            if bounds.min[0] > bounds.max[0] {
                continue;
            }
            boxes.push(bounds);
            match node.children[lane] {
                child if child & IS_BLOCK != 0 => visit(child & !IS_BLOCK, boxes),
                child => visit_blocks(bvh, child, boxes, visit),
            }
            boxes.pop();
        }
    }

    /// Calls `visit` with the triangles of each leaf of the tree and the leaf's cell.
    fn visit_leaves(tree: &KdTree, node_ix: u32, cell: &Bounds, visit: &mut impl FnMut(&[u32], &Bounds)) {
        match tree.node(node_ix) {
            Node::Leaf { first, count } => visit(&tree.leaf_triangles()[first as usize..][..count as usize], cell),
            Node::Split { axis, position, child } => {
                let [below, above] = cell.split(axis, position);
                visit_leaves(tree, child, &below, visit);
                visit_leaves(tree, child + 1, &above, visit);
            }
        }
    }

    #[test]
    fn each_block_is_in_its_boxes() {
        let triangles = triangles();
        for options in [BuildOptions::default(), BuildOptions::fast()] {
            let bvh = WideBvh::new(&KdTree::build(&triangles, &options), &triangles);
            let mut n_visits = vec![0; bvh.blocks().len()];
            visit_blocks(&bvh, 0, &mut Vec::new(), &mut |block_ix, boxes| {
                n_visits[block_ix as usize] += 1;
                let innermost = boxes.last().unwrap();
                assert!(boxes.len() <= MOST_LEVELS && boxes.iter().all(|around| around.union(innermost) == *around));
                let block = &bvh.blocks()[block_ix as usize];
                for (lane, &triangle_ix) in block.triangle_ixs.iter().enumerate() {
                    let corner = |i: usize| Vec3::from_array([0, 1, 2].map(|axis| block.corners[i][axis][lane]));
                    if triangle_ix == NO_TRIANGLE {
                        assert!(corner(0).is_nan());
                        continue;
                    }
                    let triangle = &triangles[triangle_ix as usize];
                    assert_eq!([corner(0), corner(1), corner(2)], [triangle.v0, triangle.v1, triangle.v2]);
                    assert!(Bounds::of(triangle).touches(innermost));
                }
            });
            assert!(n_visits[0] == 0 && n_visits[1..].iter().all(|n| *n == 1));
            assert!(bvh.nodes().len() > 10, "{}", bvh.nodes().len());
        }
    }

    /// For each entry of a leaf, the piece of the triangle's bounds in the leaf's cell is in the box of a block that
    /// has the triangle.
    #[test]
    fn boxes_hold_what_leaves_hold() {
        let triangles = triangles();
        let tree = KdTree::build(&triangles, &BuildOptions::default());
        let bvh = WideBvh::new(&tree, &triangles);
        let mut boxes_of = vec![Vec::new(); triangles.len()];
        visit_blocks(&bvh, 0, &mut Vec::new(), &mut |block_ix, boxes| {
            let triangle_ixs = bvh.blocks()[block_ix as usize].triangle_ixs;
            for triangle_ix in triangle_ixs.into_iter().filter(|ix| *ix != NO_TRIANGLE) {
                boxes_of[triangle_ix as usize].push(*boxes.last().unwrap());
            }
        });
        let mut n_entries = 0;
        let cell = Bounds::from(tree.bounds());
        visit_leaves(&tree, 0, &cell, &mut |triangle_ixs, cell| {
            for &triangle_ix in triangle_ixs {
                let triangle = &triangles[triangle_ix as usize];
                let piece = Bounds::of(triangle).grown(tree.margin_of(triangle)).intersection(cell);
                assert!(boxes_of[triangle_ix as usize].iter().any(|around| around.union(&piece) == *around));
                n_entries += 1;
            }
        });
        assert!(n_entries > triangles.len());
    }

    /// Half of the surface area of each box in the nodes.
    fn areas_of(bvh: &WideBvh) -> Vec<f64> {
        let boxes = bvh.nodes().iter().flat_map(|node| (0..WIDTH).map(|lane| bounds_of(node, lane)));
        boxes.filter(|of| of.min[0] <= of.max[0]).map(|of| of.half_area()).collect()
    }

    /// Returns the number of lanes and the area of every way to put a subtree into lanes of a node, and its triangles.
    fn all_ways(subtree: &Subtree) -> (Vec<(usize, f64)>, BTreeSet<u32>) {
        let bounds = subtree.bounds().expect("a subtree of triangles");
        let inner = match subtree {
            Subtree::Inner(inner) => inner,
            one => return (vec![(1, bounds.half_area())], one.triangle_ixs().unwrap().into_iter().collect()),
        };
        let [(of_a, in_a), (of_b, in_b)] = inner.children.each_ref().map(all_ways);
        let triangle_ixs = &in_a | &in_b;
        let both = of_a.iter().flat_map(|a| of_b.iter().map(move |b| (a.0 + b.0, a.1 + b.1)));
        let mut ways: Vec<_> = both.filter(|way| way.0 <= WIDTH).collect();
        let below = ways.iter().map(|way| way.1).fold(f64::INFINITY, f64::min);
        ways.push((1, bounds.half_area() + if triangle_ixs.len() > WIDTH { below } else { 0.0 }));
        (ways, triangle_ixs)
    }

    #[test]
    fn boxes_have_the_least_area_of_all_ways_to_choose_them() {
        let triangles = &triangles()[..220];
        let tree = KdTree::build(triangles, &BuildOptions::default());
        let root = Subtree::of(&tree, triangles, 0, &Bounds::from(tree.bounds()), 0);
        let (ways, _) = all_ways(&root);
        assert!(ways.len() > 10_000, "{} ways", ways.len());
        let least = ways.iter().map(|way| way.1).fold(f64::INFINITY, f64::min);
        let bvh = WideBvh::new(&tree, triangles);
        assert!(bvh.nodes().len() > 1);
        let found: f64 = areas_of(&bvh).iter().sum();
        assert!((found / least - 1.0).abs() < 1e-9, "{found} for {least}");
    }

    /// The area that decided what becomes a node is that of the boxes that were written.
    #[test]
    fn nodes_and_blocks_are_full() {
        let triangles = triangles();
        let tree = KdTree::build(&triangles, &BuildOptions::default());
        let [.., least] = Subtree::of(&tree, &triangles, 0, &Bounds::from(tree.bounds()), 0).least_areas();
        let bvh = WideBvh::new(&tree, &triangles);
        let areas = areas_of(&bvh);
        assert!((areas.iter().sum::<f64>() / least - 1.0).abs() < 1e-9);
        assert!(areas.len() > 8 * bvh.nodes().len(), "{} boxes in {} nodes", areas.len(), bvh.nodes().len());
        let entries = bvh.blocks().iter().flat_map(|block| block.triangle_ixs).filter(|ix| *ix != NO_TRIANGLE);
        let (n_entries, n_blocks) = (entries.count(), bvh.blocks().len());
        assert!(n_entries > 6 * n_blocks, "{n_entries} triangles in {n_blocks} blocks");
    }

    #[test]
    fn coinciding_triangles_make_few_levels() {
        let triangles = vec![triangles()[0]; 1 << 17];
        let bvh = WideBvh::new(&KdTree::build(&triangles, &BuildOptions::default()), &triangles);
        let (mut n_levels, mut n_blocks) = (0, 0);
        visit_blocks(&bvh, 0, &mut Vec::new(), &mut |_, boxes| {
            (n_levels, n_blocks) = (n_levels.max(boxes.len()), n_blocks + 1);
        });
        assert!(n_levels > 3 && n_levels <= MOST_LEVELS && n_blocks >= triangles.len() / WIDTH, "{n_levels}");
    }

    #[test]
    fn a_world_without_triangles_has_a_root_without_children() {
        let bvh = WideBvh::new(&KdTree::build(&[], &BuildOptions::default()), &[]);
        visit_blocks(&bvh, 0, &mut Vec::new(), &mut |_, _| panic!("a block"));
        assert_eq!((bvh.nodes().len(), bvh.blocks().len()), (1, 1));
    }
}
