//! Counts of what a traversal reads of the tree.
//!
//! ```text
//! table   slices that count their reads, or do not
//! steps   the reads of all rays together, for benchmarks
//! costs   the reads of each pixel's rays, for pictures of costs
//! ```

pub mod costs;
pub mod steps;
pub mod table;
