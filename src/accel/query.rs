//! Questions that can be asked about a ray.

/// What is asked of a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Query {
    /// The hit of smallest t; of several at one t, the triangle of the lowest index.
    Closest,
    /// Whether there is a hit: one that need not be the closest.
    Any,
}
