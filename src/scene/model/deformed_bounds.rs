//! Boxes around deformed meshes, without their deformed vertices.

use std::collections::BTreeMap;

use glam::{DVec3, Vec3};

use super::deformation::{Deformation, JointMatrix, Pose};

/// What is known of a deformation to bound its poses: for each joint a box around the vertices that it influences.
///
/// The weights of a vertex add up to 1. If none is negative, the vertex is a convex combination of the places at which
/// its joints alone would have it, so it lies in every convex set that holds these places: in the box U around the
/// boxes of all joints, each transformed by its joint. If negative weights add up to -e, the vertex is (1 + e) a - e b
/// with a and b in U. On each axis it lies beyond U by at most e times the length of U.
///
/// Morph targets move the box of a joint by the sum of the ranges of their deltas there, each times its weight.
#[derive(Clone, Debug)]
pub struct DeformedBounds {
    /// Without joints, the first one's range is that of all vertices.
    joints: BTreeMap<u32, JointRange>,
    has_joints: bool,
    /// The largest sum of a vertex's negative weights, without its sign.
    excess: f64,
    /// A bound of the number of roundings of which each number of a vertex is the result.
    n_roundings: usize,
}

/// An interval on each axis.
#[derive(Clone, Copy, Debug)]
struct Range {
    min: DVec3,
    max: DVec3,
}

/// Ranges over the vertices that a joint influences.
#[derive(Clone, Debug)]
struct JointRange {
    positions: Range,
    /// The deltas of each target, with 0.
    deltas: BTreeMap<u32, Range>,
}

impl Range {
    const NONE: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };
    const ZERO: Self = Self { min: DVec3::ZERO, max: DVec3::ZERO };

    fn joined(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    fn with(self, p: Vec3) -> Self {
        self.joined(Self { min: p.as_dvec3(), max: p.as_dvec3() })
    }

    fn plus(self, other: Self) -> Self {
        Self { min: self.min + other.min, max: self.max + other.max }
    }

    fn times(self, factor: f64) -> Self {
        let (a, b) = (factor * self.min, factor * self.max);
        Self { min: a.min(b), max: a.max(b) }
    }

    fn widened(self, by: DVec3) -> Self {
        Self { min: self.min - by, max: self.max + by }
    }

    /// Returns the greatest absolute values.
    fn reach(&self) -> DVec3 {
        self.min.abs().max(self.max.abs())
    }
}

impl DeformedBounds {
    /// Notes what the boxes of poses need.
    pub fn new(deformation: &Deformation) -> Self {
        let mut joints = BTreeMap::<u32, JointRange>::new();
        let (mut excess, mut most_deltas) = (0.0_f64, 0);
        for ix in 0..deformation.positions.len() {
            let deltas = deformation.deltas_of(ix);
            most_deltas = most_deltas.max(deltas.len());
            let influences = deformation.influences_of(ix);
            excess = excess.max(influences.iter().map(|it| f64::from(-it.weight).max(0.0)).sum());
            let of_joints = influences.iter().filter(|it| it.weight != 0.0).map(|it| it.joint);
            let alone = (deformation.n_influences == 0).then_some(0);
            for joint in of_joints.chain(alone) {
                let none = || JointRange { positions: Range::NONE, deltas: BTreeMap::new() };
                let range = joints.entry(joint).or_insert_with(none);
                range.positions = range.positions.with(deformation.positions[ix]);
                for delta in deltas {
                    let of_target = range.deltas.entry(delta.target).or_insert(Range::ZERO);
                    *of_target = of_target.with(delta.position);
                }
            }
        }
        let n_roundings = 8 + 2 * most_deltas + 2 * deformation.n_influences;
        Self { joints, has_joints: deformation.n_influences > 0, excess, n_roundings }
    }

    /// Returns the least and the greatest corner of a box that holds all vertices of a pose as they are computed in
    /// single precision. Without vertices these are infinity and minus infinity.
    ///
    /// Each number of a vertex is a sum of products. All of them together are, without their signs, at most (1 + 2 e)
    /// times the reach of a joint: its matrix times the reach of its box, all without signs. Each rounding changes the
    /// sum by at most 2^-24 of that, and the sum of the weights is 1 but for the roundings of each. The box is wider by
    /// twice as much.
    ///
    /// # Panics
    /// The pose lacks a joint.
    pub fn at(&self, pose: &Pose) -> (Vec3, Vec3) {
        if self.joints.is_empty() {
            return (Vec3::INFINITY, Vec3::NEG_INFINITY);
        }
        let (mut union, mut reach) = (Range::NONE, DVec3::ZERO);
        for (joint, range) in &self.joints {
            let (mut at_rest, mut rest_reach) = (range.positions, range.positions.reach());
            for (target, deltas) in &range.deltas {
                let weight = f64::from(pose.weights.get(*target as usize).copied().unwrap_or(0.0));
                let moved = deltas.times(weight);
                (at_rest, rest_reach) = (at_rest.plus(moved), rest_reach + moved.reach());
            }
            let placed = match self.has_joints {
                true => placed(&pose.joints[*joint as usize], at_rest, rest_reach),
                false => (at_rest, rest_reach),
            };
            (union, reach) = (union.joined(placed.0), reach.max(placed.1));
        }
        let length = union.max - union.min;
        let rounding = (1.0 + 2.0 * self.excess) * self.n_roundings as f64 * f64::from(f32::EPSILON);
        let widened = union.widened(self.excess * length + rounding * reach + DVec3::splat(f32::MIN_POSITIVE.into()));
        (rounded(widened.min, f32::next_down), rounded(widened.max, f32::next_up))
    }
}

/// Returns where a joint takes a range, and the reach of all that is added up there.
fn placed(matrix: &JointMatrix, at_rest: Range, rest_reach: DVec3) -> (Range, DVec3) {
    let translation = matrix.translation.as_dvec3();
    let (mut range, mut reach) = (Range { min: translation, max: translation }, translation.abs());
    for (axis, image) in matrix.axes.iter().enumerate() {
        let image = image.as_dvec3();
        let (a, b) = (image * at_rest.min[axis], image * at_rest.max[axis]);
        range = range.plus(Range { min: a.min(b), max: a.max(b) });
        reach += image.abs() * rest_reach[axis];
    }
    (range, reach)
}

/// Rounds to single precision, and one step further in the direction of `next`.
fn rounded(v: DVec3, next: fn(f32) -> f32) -> Vec3 {
    Vec3::from_array(v.as_vec3().to_array().map(next))
}
