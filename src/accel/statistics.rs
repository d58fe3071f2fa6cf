//! Statistics of acceleration structures.

use std::fmt::{self, Display};

use serde::Serialize;

use super::{AccelKind, grid, kdtree};

/// Statistics of an acceleration structure. As JSON it is a member `tree` or `grid`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum Statistics {
    /// Statistics of a kd-tree.
    #[serde(rename = "tree")]
    KdTree(kdtree::Statistics),
    /// Statistics of a grid.
    #[serde(rename = "grid")]
    Grid(grid::Statistics),
}

impl Statistics {
    /// The kind of the structure.
    pub fn kind(&self) -> AccelKind {
        match self {
            Self::KdTree(_) => AccelKind::KdTree,
            Self::Grid(grid) => AccelKind::of_grid_levels(grid.n_levels),
        }
    }

    /// The plural name of the structure's elements: `nodes` or `cells`.
    pub fn elements(&self) -> &'static str {
        match self {
            Self::KdTree(_) => "nodes",
            Self::Grid(_) => "cells",
        }
    }

    /// The number of nodes or cells.
    pub fn n_elements(&self) -> u64 {
        match self {
            Self::KdTree(tree) => tree.n_nodes,
            Self::Grid(grid) => grid.n_cells,
        }
    }

    /// The number of references: entries of triangles in all leaves or cells.
    pub fn n_references(&self) -> u64 {
        match self {
            Self::KdTree(tree) => tree.n_references,
            Self::Grid(grid) => grid.n_references,
        }
    }

    /// The size of the structure's arrays as the host stores them, bytes.
    pub fn bytes(&self) -> u64 {
        match self {
            Self::KdTree(tree) => tree.bytes,
            Self::Grid(grid) => grid.bytes,
        }
    }

    /// Returns the names and values of a table's rows: everything but the memory.
    pub fn rows(&self) -> Vec<(&'static str, String)> {
        match self {
            Self::KdTree(tree) => vec![
                ("nodes", tree.n_nodes.to_string()),
                ("leaves", tree.n_leaves.to_string()),
                ("empty leaves", number(tree.n_empty_leaves)),
                ("slabs", number(tree.n_slabs)),
                ("depth", tree.depth.to_string()),
                ("references", tree.n_references.to_string()),
                ("references a triangle", format!("{:.2}", tree.references_per_triangle)),
                ("SAH cost", tree.sah_cost.map_or_else(unknown, |cost| format!("{cost:.2}"))),
            ],
            Self::Grid(grid) => vec![
                ("resolution", resolution(grid)),
                ("cells", grid.n_cells.to_string()),
                ("empty cells", grid.n_empty_cells.to_string()),
                ("references", grid.n_references.to_string()),
                ("references a triangle", format!("{:.2}", grid.references_per_triangle)),
                ("times coarsened", grid.n_coarser.to_string()),
            ],
        }
    }
}

fn unknown() -> String {
    "-".to_owned()
}

fn number(n: Option<u64>) -> String {
    n.map_or_else(unknown, |n| n.to_string())
}

/// Formats the number of cells of the upper level along each axis.
fn resolution(grid: &grid::Statistics) -> String {
    let [x, y, z] = grid.resolution;
    format!("{x} x {y} x {z}")
}

/// Formats one line, which begins with the structure's name.
impl Display for Statistics {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}: ", self.kind().name())?;
        match self {
            Self::KdTree(tree) => {
                let kdtree::Statistics { n_nodes, depth, references_per_triangle, .. } = tree;
                write!(f, "{n_nodes} nodes, depth {depth}, {references_per_triangle:.2} references a triangle")
            }
            Self::Grid(grid) => {
                let empty = 100.0 * grid.n_empty_cells as f64 / grid.n_cells.max(1) as f64;
                let (resolution, references) = (resolution(grid), grid.references_per_triangle);
                let upper = if grid.n_levels == 1 { "" } else { " on the upper level" };
                write!(
                    f,
                    "{resolution} cells{upper}, {} in all, {empty:.0} % of them empty, \
                     {references:.2} references a triangle",
                    grid.n_cells
                )?;
                match grid.n_coarser {
                    0 => Ok(()),
                    n => write!(f, "; made coarser {n} times to keep to the limit of memory"),
                }
            }
        }
    }
}
