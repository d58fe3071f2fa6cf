//! Cells of the kd-tree with their distance from a point. Twin of `kdtree/distant_cells.glsl`.

use glam::Vec3;

use super::{cast::exponent_of, inputs::KernelInputs};
use crate::layout::{KD_AXIS_MASK, KD_PAIR_SHIFT, KdNode};

/// A point in units of 1 / `scale`, a power of two that brings all coordinates below 4.
#[derive(Clone, Copy)]
pub struct Query {
    pub position: Vec3,
    pub scale: f32,
}

impl Query {
    /// The query of a point at a box.
    pub fn at(position: Vec3, bounds: [Vec3; 2]) -> Self {
        let exponent = bounds.map(exponent_of).into_iter().fold(exponent_of(position), u32::max).clamp(1, 253);
        let scale = f32::from_bits((254 - exponent) << 23);
        Self { position: position * scale, scale }
    }

    /// Returns the distance from the point to a box on each axis.
    pub fn gap_to(self, [box_min, box_max]: [Vec3; 2]) -> Vec3 {
        (box_min * self.scale - self.position).max(self.position - box_max * self.scale).max(Vec3::ZERO)
    }
}

/// A node, and the distance from the point to the node's cell on each axis, which is 0 within the cell's extent.
#[derive(Clone, Copy)]
pub(super) struct DistantCell {
    pub node_ix: u32,
    pub gap: Vec3,
}

/// The share of a squared distance that counts, 1 - 2^-20: the square as computed may exceed the real one. The kernel's
/// file derives it.
pub const SHARE: f32 = 0.999_999_05;

/// Returns whether what is this far away on each axis may be as close as the best point.
pub(super) fn is_within(gap: Vec3, best_squared: f32) -> bool {
    SHARE * gap.dot(gap) <= best_squared
}

impl DistantCell {
    pub fn root(inputs: &KernelInputs, query: Query) -> Self {
        Self { node_ix: 0, gap: query.gap_to([inputs.box_min, inputs.box_max]) }
    }

    /// Returns whether the cell may hold a point that is as close as the best one.
    pub fn may_be_closer(&self, best_squared: f32) -> bool {
        is_within(self.gap, best_squared)
    }

    /// Returns the children of a split: the one on the point's side of the plane, which is as close as the split's
    /// cell, and the other one, which is as far away as the plane on its axis.
    pub fn split(&self, query: Query, node: KdNode) -> [Self; 2] {
        let axis = (node.axis_and_child & KD_AXIS_MASK) as usize;
        let to_plane = f32::from_bits(node.split_or_first) * query.scale - query.position[axis];
        let lower_ix = 2 * (node.axis_and_child >> KD_PAIR_SHIFT);
        let near = Self { node_ix: if to_plane > 0.0 { lower_ix } else { lower_ix ^ 1 }, gap: self.gap };
        let mut far = Self { node_ix: near.node_ix ^ 1, gap: self.gap };
        far.gap[axis] = to_plane.abs();
        [near, far]
    }
}
