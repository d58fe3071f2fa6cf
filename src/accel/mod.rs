//! Acceleration structures: what leads a ray to the triangles that it can hit.

pub mod kdtree;
mod query;

pub use self::query::Query;
