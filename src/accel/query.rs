//! What `cast` looks for. All hits and closest points have kernels of their own (`passes/all_hits.rs`,
//! `passes/closest_point.rs`).

/// Kind of ray query.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Query {
    /// The closest hit: the one of smallest t. If several triangles are hit at this t, the one of the lowest index
    /// counts.
    Closest,
    /// Any hit: whether there is one. The hit that is found need not be the closest.
    Any,
}
