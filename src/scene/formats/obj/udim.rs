//! Images in tiles (UDIM): one map has several images, each for a square of texture coordinates. The tile of the square
//! that begins at (u, v) has the number 1001 + u + 10 v. The name of the map has `<UDIM>` in place of the number, or
//! the number 1001 beside files of other numbers.
//!
//! A material with such a map gets a copy for each tile, which shows the image of that tile. Each face gets the copy
//! for its own tile.

use std::{
    collections::{BTreeSet, HashMap},
    path::Path,
};

use super::files::find_file;
use crate::scene::{
    files::SourceFile,
    model::{Mesh, error::Checked},
};

/// Number of the first tile.
const FIRST: u32 = 1001;
/// Tiles in a row.
const PER_ROW: u32 = 10;
/// Numbers of all tiles.
const ALL: std::ops::Range<u32> = FIRST..FIRST + PER_ROW * PER_ROW;
/// What stands for the number in a name, in capitals.
pub const TOKEN: &str = "<UDIM>";

/// Returns the texture coordinates at which a tile begins.
pub fn corner(tile: u32) -> (f32, f32) {
    (((tile - FIRST) % PER_ROW) as f32, ((tile - FIRST) / PER_ROW) as f32)
}

/// Returns the name of a map before and after the number of a tile, if it has one.
fn around_number(name: &str) -> Option<(&str, &str)> {
    if let Some(at) = name.to_ascii_uppercase().find(TOKEN) {
        return Some((&name[..at], &name[at + TOKEN.len()..]));
    }
    let (before, after) = name.rsplit_once("1001")?;
    (before.ends_with(['.', '_']) && after.starts_with('.')).then_some((before, after))
}

/// Returns the files of a map: those of its tiles whose images are there, with the numbers of the tiles, or else the
/// file of its name.
pub fn files_of_map(obj: &SourceFile, folder: &Path, name: &str) -> Checked<Vec<(Option<u32>, SourceFile)>> {
    let tiles = files_of_tiles(obj, folder, name);
    match tiles.is_empty() {
        true => Ok(vec![(None, find_file(obj, folder, name)?)]),
        false => Ok(tiles.into_iter().map(|(tile, file)| (Some(tile), file)).collect()),
    }
}

/// Returns the tiles of a map whose images are there, with their files. A map of one image has none.
fn files_of_tiles(obj: &SourceFile, folder: &Path, name: &str) -> Vec<(u32, SourceFile)> {
    let Some((before, after)) = around_number(name) else { return Vec::new() };
    let file = |tile: u32| {
        let file = find_file(obj, folder, &format!("{before}{tile}{after}")).ok()?;
        file.is_file().then_some((tile, file))
    };
    let found: Vec<_> = ALL.filter_map(file).collect();
    let is_one_image = !name.to_ascii_uppercase().contains(TOKEN) && found.len() < 2;
    if is_one_image { Vec::new() } else { found }
}

/// The indices of materials for tiles, by the index of the material without such maps and the number of the tile.
#[derive(Debug, Default)]
pub struct UdimMaterials {
    by_tile: HashMap<(u32, u32), u32>,
    /// Materials that have tiles.
    bases: BTreeSet<u32>,
}

impl UdimMaterials {
    /// Adds the material of a tile.
    pub fn add(&mut self, base: usize, tile: u32, material: usize) {
        self.bases.insert(base as u32);
        self.by_tile.insert((base as u32, tile), material as u32);
    }

    /// Gives each face the material of its tile. Warns of faces whose tiles have no images. `path` is the OBJ file.
    pub fn assign(&self, path: &Path, mesh: &mut Mesh) {
        if self.bases.is_empty() {
            return;
        }
        if mesh.uvs[0].is_empty() {
            return warn_of_missing(path, mesh.slots.iter().filter(|slot| self.bases.contains(slot)).count());
        }
        let mut n_without = 0;
        for (slot, uvs) in mesh.slots.iter_mut().zip(&mesh.uvs[0]).filter(|(slot, _)| self.bases.contains(slot)) {
            // The v of a mesh grows downwards.
            let middle = (uvs[0] + uvs[1] + uvs[2]) / 3.0;
            let (column, row) = (middle.x.floor(), (1.0 - middle.y).floor());
            let is_in = (0.0..PER_ROW as f32).contains(&column) && (0.0..PER_ROW as f32).contains(&row);
            let tile = is_in.then(|| FIRST + column as u32 + PER_ROW * row as u32);
            match tile.and_then(|tile| self.by_tile.get(&(*slot, tile))) {
                Some(material) => *slot = *material,
                None => n_without += 1,
            }
        }
        warn_of_missing(path, n_without);
    }
}

/// Tells the user of triangles that have no image, if there are any.
fn warn_of_missing(path: &Path, n_without: usize) {
    if n_without > 0 {
        tracing::warn!(
            "{}: {n_without} triangles are in tiles (UDIM) whose images are missing: they are shown without",
            path.display()
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_have_the_numbers_of_tiles() {
        assert_eq!(around_number("a.<UDIM>.png"), Some(("a.", ".png")));
        assert_eq!(around_number("maps/a_<udim>_b.png"), Some(("maps/a_", "_b.png")));
        assert_eq!(around_number("1001_a.1001.exr"), Some(("1001_a.", ".exr")));
        assert_eq!(
            (around_number("a1001.png"), around_number("a.10010.png"), around_number("é.png")),
            (None, None, None)
        );
    }

    #[test]
    fn tiles_begin_at_whole_coordinates() {
        assert_eq!([1001, 1002, 1010, 1011, 1100].map(corner), [(0., 0.), (1., 0.), (9., 0.), (0., 1.), (9., 9.)]);
    }
}
