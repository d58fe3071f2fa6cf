//! Variants, which benchmarks compare: each is an acceleration structure with a search through it.

use std::{fmt, str::FromStr};

use crate::{
    accel::{AccelKind, kdtree::Traversal},
    util::UnknownWord,
};

/// A search through an acceleration structure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variant {
    /// A traversal of the kd-tree.
    KdTree(Traversal),
    /// The search through a uniform grid.
    Grid,
    /// The search through a grid of two levels.
    Grid2,
}

impl Variant {
    /// Returns all variants except brute force, which is for small meshes only.
    pub fn all() -> Vec<Self> {
        let traversals = Traversal::ALL.iter().filter(|&&traversal| traversal != Traversal::Brute);
        traversals.map(|&traversal| Self::KdTree(traversal)).chain([Self::Grid, Self::Grid2]).collect()
    }

    /// Returns the words of all variants, separated by commas.
    pub fn words() -> String {
        format!("{}, {}, {}", Traversal::words(), AccelKind::Grid, AccelKind::Grid2)
    }

    /// Returns a list of all words, one per line, each with a description of its variant.
    pub fn descriptions() -> String {
        let accels = AccelKind::descriptions();
        let grids = accels.lines().filter(|line| !line.starts_with(&format!("- {}:", AccelKind::KdTree)));
        [Traversal::descriptions().as_str()].into_iter().chain(grids).collect::<Vec<_>>().join("\n")
    }

    /// Returns the kind of structure that is searched.
    pub fn accel(self) -> AccelKind {
        match self {
            Self::KdTree(_) => AccelKind::KdTree,
            Self::Grid => AccelKind::Grid,
            Self::Grid2 => AccelKind::Grid2,
        }
    }

    /// Returns the traversal of the kd-tree. For a grid it is a value without effect.
    pub fn traversal(self) -> Traversal {
        match self {
            Self::KdTree(traversal) => traversal,
            Self::Grid | Self::Grid2 => Traversal::OF_GPUS,
        }
    }
}

impl fmt::Display for Variant {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::KdTree(traversal) => traversal.fmt(f),
            Self::Grid | Self::Grid2 => self.accel().fmt(f),
        }
    }
}

impl FromStr for Variant {
    type Err = UnknownWord;

    fn from_str(word: &str) -> Result<Self, UnknownWord> {
        if let Ok(traversal) = word.parse() {
            return Ok(Self::KdTree(traversal));
        }
        match word.parse() {
            Ok(AccelKind::Grid) => Ok(Self::Grid),
            Ok(AccelKind::Grid2) => Ok(Self::Grid2),
            _ => Err(UnknownWord::Unknown { word: word.to_owned(), expected: Self::words() }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_word_names_its_variant() {
        for variant in Variant::all() {
            assert_eq!(variant.to_string().parse::<Variant>().unwrap(), variant);
            assert!(Variant::words().contains(&variant.to_string()));
        }
        let error = "kdtree".parse::<Variant>().unwrap_err().to_string();
        assert!(error.starts_with("`kdtree` is not one of mask, ") && error.ends_with(", grid, grid2"), "{error}");
    }
}
