//! Searches: an acceleration structure with an algorithm that leads rays through it. Option words, help and `bench
//! traversal` follow from this list. search_modules.rs names the SPIR-V modules; `bench driver` has a selection of its
//! own.

use std::{fmt, str::FromStr};

use super::{AccelKind, kdtree::Traversal};
use crate::util::UnknownWord;

// `SEARCH_MODULES`, which build.rs compiles kernels for.
include!("search_modules.rs");

/// A search through an acceleration structure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Search {
    /// A traversal of the kd-tree.
    KdTree(Traversal),
    /// Single rays through the wide hierarchy, which the CPU makes from the kd-tree. Devices have none.
    Wide,
    /// The search through a uniform grid.
    Grid,
    /// The search through a grid of two levels.
    Grid2,
}

impl Search {
    const WIDE: &str = "wide";
    const WIDE_DESCRIPTION: &str = "single rays through a hierarchy with sixteen children a node; only with --cpu";

    /// Returns the search through a structure. `traversal`: the algorithm for a kd-tree.
    pub fn of(accel: AccelKind, traversal: Traversal) -> Self {
        match accel {
            AccelKind::KdTree => Self::KdTree(traversal),
            AccelKind::Grid => Self::Grid,
            AccelKind::Grid2 => Self::Grid2,
        }
    }

    /// Returns all searches of devices, or of the CPU, except brute force, which is for small meshes only.
    pub fn all(on_cpu: bool) -> Vec<Self> {
        let traversals = Traversal::ALL.iter().filter(|&&traversal| traversal != Traversal::Brute);
        let wide = on_cpu.then_some(Self::Wide);
        traversals.map(|&traversal| Self::KdTree(traversal)).chain(wide).chain([Self::Grid, Self::Grid2]).collect()
    }

    /// Returns the words of all searches, separated by commas.
    pub fn words() -> String {
        format!("{}, {}, {}, {}", Traversal::words(), Self::WIDE, AccelKind::Grid, AccelKind::Grid2)
    }

    /// Returns a list of all words, one per line, each with a description of its search.
    pub fn descriptions() -> String {
        let accels = AccelKind::descriptions();
        let grids = accels.lines().filter(|line| !line.starts_with(&format!("- {}:", AccelKind::KdTree)));
        let wide = format!("- {}: {}", Self::WIDE, Self::WIDE_DESCRIPTION);
        [Traversal::descriptions().as_str(), &wide].into_iter().chain(grids).collect::<Vec<_>>().join("\n")
    }

    /// Returns the kind of structure that is built for the search.
    pub fn accel(self) -> AccelKind {
        match self {
            Self::KdTree(_) | Self::Wide => AccelKind::KdTree,
            Self::Grid => AccelKind::Grid,
            Self::Grid2 => AccelKind::Grid2,
        }
    }

    /// Returns the traversal of the kd-tree whose steps count for the search. For a grid it is a value without effect.
    pub fn traversal(self) -> Traversal {
        match self {
            Self::KdTree(traversal) => traversal,
            Self::Wide => Traversal::OF_CPU,
            Self::Grid | Self::Grid2 => Traversal::OF_GPUS,
        }
    }

    /// Returns the word for the search in names of SPIR-V modules, or none if no kernel has the search.
    pub(crate) fn module(self) -> Option<&'static str> {
        let name = match self {
            Self::KdTree(traversal) => traversal.to_string().replace('-', "_"),
            // Both grids are searched by one kernel.
            Self::Grid | Self::Grid2 => AccelKind::Grid.to_string(),
            Self::Wide => return None,
        };
        SEARCH_MODULES.into_iter().find(|module| *module == name)
    }
}

impl fmt::Display for Search {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::KdTree(traversal) => traversal.fmt(f),
            Self::Wide => f.write_str(Self::WIDE),
            Self::Grid | Self::Grid2 => self.accel().fmt(f),
        }
    }
}

impl FromStr for Search {
    type Err = UnknownWord;

    fn from_str(word: &str) -> Result<Self, UnknownWord> {
        if let Ok(traversal) = word.parse() {
            return Ok(Self::KdTree(traversal));
        }
        match word.parse() {
            Ok(AccelKind::Grid) => Ok(Self::Grid),
            Ok(AccelKind::Grid2) => Ok(Self::Grid2),
            _ if word == Self::WIDE => Ok(Self::Wide),
            _ => Err(UnknownWord::Unknown { word: word.to_owned(), expected: Self::words() }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_word_names_its_search() {
        for search in Search::all(true) {
            assert_eq!(search.to_string().parse::<Search>().unwrap(), search);
            assert!(Search::words().contains(&search.to_string()));
            assert!(Search::descriptions().contains(&format!("- {search}: ")));
        }
        let error = "kdtree".parse::<Search>().unwrap_err().to_string();
        assert!(
            error.starts_with("`kdtree` is not one of mask, ") && error.ends_with(", wide, grid, grid2"),
            "{error}"
        );
    }

    #[test]
    fn every_search_of_devices_has_a_module_and_every_module_a_search() {
        let searches = Search::all(false).into_iter().chain([Search::KdTree(Traversal::Brute)]);
        let modules: Vec<_> = searches.map(|search| search.module().expect("a module")).collect();
        assert!(SEARCH_MODULES.iter().all(|module| modules.contains(module)));
        assert_eq!(Search::Wide.module(), None);
    }
}
