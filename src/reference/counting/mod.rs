//! Counts of a traversal's reads of the acceleration structure.
//!
//! ```text
//! table   slices that count their reads, and slices that do not
//! steps   the reads of all rays together, for benchmarks
//! costs   the reads of each pixel's rays, for false-colour pictures of costs
//! ```

pub mod costs;
pub mod steps;
pub mod table;
