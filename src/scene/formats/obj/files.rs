//! Files that OBJ and MTL files name.

use std::path::{Path, PathBuf};

use super::{
    maps::{MapKind, MapOptions},
    statement::{split_keyword, statements, without_comment},
    udim::files_of_tiles,
};
use crate::scene::{
    files::{
        outside::{Access, NamedFile, Reach},
        read::read_lossy,
        store,
    },
    model::error::Checked,
};

/// Returns the files that the `mtllib` statements of an OBJ file's text name, and the images that these name. Names
/// that are refused are left out.
pub fn named_files(obj: &Path, text: &str, access: Access) -> Vec<PathBuf> {
    let reach = access.beside(obj);
    let mut files = Vec::new();
    for (_, statement) in statements(text) {
        if let ("mtllib", rest) = split_keyword(&statement) {
            files.extend(library_files(reach, rest).into_iter().flatten().map(|file| file.path));
        }
    }
    if !files.iter().any(|path| store::is_file(path)) {
        files.extend(own_library(reach, obj));
    }
    let images: Vec<PathBuf> = files.iter().flat_map(|mtl| named_images(reach, mtl)).collect();
    files.into_iter().chain(images).collect()
}

/// Returns the images that an MTL file names.
fn named_images(reach: Reach, mtl: &Path) -> Vec<PathBuf> {
    let text = read_lossy(mtl).unwrap_or_default();
    let folder = mtl.parent().unwrap_or(Path::new(""));
    let files = |statement: &str| match split_keyword(statement) {
        (keyword, rest) if matches!(MapKind::of(keyword), MapKind::Shown(_)) => {
            let Ok(MapOptions { name, .. }) = MapOptions::new(rest) else { return Vec::new() };
            let tiles = files_of_tiles(reach, folder, &name);
            match tiles.is_empty() {
                true => find_file(reach, folder, &name).into_iter().map(|file| file.path).collect(),
                false => tiles.into_iter().map(|(_, file)| file.path).collect(),
            }
        }
        _ => Vec::new(),
    };
    statements(&text).flat_map(|(_, statement)| files(&statement)).collect()
}

/// Returns the files that a `mtllib` line names. The rest of the line is one name with spaces, if [`find_file`] finds
/// such a file; otherwise it is a list of names.
pub fn library_files(reach: Reach, rest: &str) -> Vec<Checked<NamedFile>> {
    let find = |name: &str| find_file(reach, reach.root, name.trim_matches('"'));
    let whole = find(rest);
    let has_spaces = |file: &NamedFile| file.path.file_name().is_some_and(|name| name.to_string_lossy().contains(' '));
    if exists(&whole) && whole.as_ref().is_ok_and(has_spaces) {
        return vec![whole];
    }
    without_comment(rest).split_whitespace().map(find).collect()
}

/// Returns the MTL file of the OBJ file's own name, which counts where no library is found that the OBJ file names.
pub fn own_library(reach: Reach, obj: &Path) -> Option<PathBuf> {
    let name = obj.with_extension("mtl").file_name()?.to_str()?.to_owned();
    reach.find(reach.root, &name).ok().map(|file| file.path).filter(|path| store::is_file(path))
}

/// Returns the file that a name in an OBJ or MTL file stands for. Writers often state absolute names of their own
/// machine: where a name leaves the folder of the OBJ file, the file is taken whose name in `folder` has the most last
/// parts in common with it. A comment may follow the name.
pub fn find_file(reach: Reach, folder: &Path, name: &str) -> Checked<NamedFile> {
    let whole = reach.find(folder, name);
    if exists(&whole) {
        return whole;
    }
    let name = without_comment(name).trim_end_matches('"');
    let named = reach.find(folder, name);
    if exists(&named) || reach.within().find(folder, name).is_ok() {
        return named;
    }
    let ends = name.match_indices(['/', '\\']).map(|(at, _)| &name[at + 1..]).filter(|end| !end.is_empty());
    ends.map(|end| reach.within().find(folder, end)).find(exists).unwrap_or(named)
}

fn exists(file: &Checked<NamedFile>) -> bool {
    file.as_ref().is_ok_and(|file| store::is_file(&file.path))
}
